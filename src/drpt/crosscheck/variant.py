"""Mitsuba, with the LLVM library that drpt chose and drpt's plugins."""

from __future__ import annotations

from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

from drpt.crosscheck.bsdfs.phong_plugin import register_phong
from drpt.kernel import backend

if TYPE_CHECKING:
    from collections.abc import Iterator

VARIANT = "llvm_ad_rgb"
"""The variant of Mitsuba where none is set."""


def load_mitsuba() -> Any:
    """Return Mitsuba's module in the variant that is set, or in `VARIANT`, which is set then.

    Raises
    ------
    ValueError
        The variant that is set does not compute in RGB.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    mi = _import_mitsuba()
    variant = mi.variant() or VARIANT
    if not variant.endswith("_rgb"):
        raise ValueError(f"Mitsuba's variant: {variant!r} is not allowed; it must end in '_rgb'")
    with backend.interrupts_put_off():
        mi.set_variant(variant)
        _register(variant)
    return mi


@contextmanager
def scoped_variant() -> Iterator[Any]:
    """Mitsuba in `VARIANT`; the one that was set before is set again afterwards."""
    mi = _import_mitsuba()
    previous = mi.variant()
    with backend.interrupts_put_off():
        mi.set_variant(VARIANT)
    try:
        yield load_mitsuba()
    finally:
        if previous is not None:
            mi.set_variant(previous)


def _import_mitsuba() -> Any:
    backend.load("llvm")  # first, or Mitsuba chooses another library
    with backend.interrupts_put_off():
        import mitsuba as mi

    return mi


@cache
def _register(_variant: str) -> None:
    """Register the plugins once in the variant that is set."""
    register_phong()
