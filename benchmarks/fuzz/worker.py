"""The process that calls a target, so that a crash ends nothing else."""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
import traceback
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, NamedTuple

from benchmarks.fuzz.branches import Tracer

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.connection import Connection

    from benchmarks.fuzz.branches import Branch
    from benchmarks.fuzz.target import Target

SECONDS = 2.0
"""Processor time that an input may take; most of them take milliseconds."""
MEMORY = 2**30
"""Bytes of address space that an input may take beyond what the process has when it starts."""


class Outcome(NamedTuple):
    """The outcome of one input.

    Attributes
    ----------
    number
        Which input it was.
    accepted, past_parser
        Whether the file was read, and whether the parser of its format let it through.
    fault
        What is wrong with the outcome; empty if nothing is.
    taken
        Branches that no input before has taken.
    """

    number: int
    accepted: bool
    past_parser: bool
    fault: str
    seconds: float
    taken: set[Branch]


class TooSlow(BaseException):
    """An input takes more than `SECONDS`; no handler of the code under test may catch this."""


def load(name: str) -> Target:
    """Return the target that a module of this package defines as ``TARGET``."""
    target: Target = import_module(f"benchmarks.fuzz.{name}").TARGET
    return target


def work(pipe: Connection, name: str, seed: int, start: int) -> None:
    """Call a target with one input after another, and send an `Outcome` for each."""
    target = load(name)
    os.fsync = lambda fd: None  # which takes most of the time and finds nothing
    tracer = Tracer(target.modules, target.past_parser)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGPROF, _interrupt)
    with tempfile.TemporaryDirectory() as folder, _stderr_in(Path(folder, "stderr")) as said:
        path = Path(folder, f"input{target.suffix}")
        try_once(target, path, target.input(seed, start), tracer)  # imports what it needs
        _limit_memory()
        pipe.send(len(tracer.branches))
        sent: set[Branch] = set()
        index = start
        while True:
            content = target.input(seed, index)
            begin = process_time()
            accepted, fault = try_once(target, path, content, tracer)
            seconds = process_time() - begin
            if said.stat().st_size and not fault:
                fault = f"it writes to stderr: {said.read_text(errors='replace')!r}"
            os.truncate(said, 0)
            new = tracer.taken - sent
            pipe.send(Outcome(index, accepted, tracer.entered, fault, seconds, new))
            sent |= new
            index += 1


def try_once(target: Target, path: Path, content: bytes, tracer: Tracer) -> tuple[bool, str]:
    """Call a target with an input; return whether it was accepted, and its fault if any."""
    path.write_bytes(content)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        with tracer.watching():
            target.call(path)
    except target.allowed as error:
        return False, _fault_of_message(str(error), path)
    except TooSlow:
        return False, f"it takes more than {SECONDS:g} s"
    except BaseException:
        return False, traceback.format_exc(limit=-8)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return True, ""


def _fault_of_message(message: str, path: Path) -> str:
    if not message.isprintable():
        return f"its message is no line of printable characters: {message!r}"
    if path.name not in message:
        return f"its message does not name the file: {message}"
    if "Unable to allocate" in message:
        return f"it allocates memory before it looks at sizes: {message}"
    if len(message) > 1000:
        return f"its message has {len(message)} characters: {message[:200]}"
    return ""


def _interrupt(*_: object) -> None:
    raise TooSlow


def _limit_memory() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    used = pages * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, hard))


@contextmanager
def _stderr_in(path: Path) -> Iterator[Path]:
    """Collect in a file what is written to stderr, by C++ too."""
    sys.stderr.flush()
    kept = os.dup(2)
    with open(path, "ab") as stream:
        os.dup2(stream.fileno(), 2)
    try:
        yield path
    finally:
        os.dup2(kept, 2)
        os.close(kept)
