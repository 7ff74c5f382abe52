"""Suppresses the output of libraries that print messages."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from io import StringIO
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_STREAMS = (1, 2)
_LOCK = Lock()


@contextmanager
def nothing_printed() -> Iterator[None]:
    """Discard all output of this process to stdout and stderr meanwhile.

    OpenEXR prints through C, C++ and Python. Output of other threads is lost, too, so wrap short
    calls only.
    """
    with _LOCK:
        kept = [(stream, os.dup(stream)) for stream in _STREAMS if _is_open(stream)]
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            _flush()
            for number, _ in kept:
                os.dup2(nowhere, number)
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
                yield
        finally:
            _flush()
            os.close(nowhere)
            for number, copy in kept:
                os.dup2(copy, number)
                os.close(copy)


def _flush() -> None:
    """Flush the buffers of Python and of C."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and not stream.closed:
            stream.flush()
    with suppress(OSError, TypeError):  # Windows does not name its C library so
        ctypes.CDLL(None).fflush(None)


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True
