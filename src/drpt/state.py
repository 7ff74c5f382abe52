"""The state of a render that a checkpoint stores, and its validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.film import BLOCKS
from drpt.settings import MAX_SPP, check_number, check_whole, refuse

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from drpt.settings import Settings

LONGEST = 1e12
"""Largest duration of a render, in seconds: 30 000 years."""
MOST_RAYS = 2**80
"""Largest number of rays: those of 2^48 samples in each of 2^32 pixels."""


@dataclass(frozen=True, eq=False)
class State:
    """The state of a render after some passes.

    Attributes
    ----------
    spp, block
        Samples of each pixel, and samples of a block.
    total, blocks
        Sums of all samples, float64 (pixels, 3), and of blocks, float32 (used, pixels, 3).
    rays, non_finite, first_non_finite, seconds
        As in :class:`drpt.result.Result`.
    last_look
        As in :class:`drpt.stopping.Stopping`.
    """

    spp: int
    block: int
    rays: int
    non_finite: int
    first_non_finite: tuple[int, int, int] | None
    seconds: float
    last_look: tuple[int, float] | None
    total: NDArray[np.float64]
    blocks: NDArray[np.float32]

    @classmethod
    def checked(
        cls, facts: Mapping[str, Any], arrays: Mapping[str, Any], settings: Settings, *, error: bool
    ) -> State:
        """Return the state that facts and arrays describe.

        Raises `ValueError`, which names the field, the value and what is allowed, if no render with
        these settings can be in that state. A render has blocks if ``error`` is true.
        """
        spp = check_whole("spp", _get(facts, "spp"), 1, settings.spp)
        block = check_whole("block", _get(facts, "block"), 1, MAX_SPP)
        if block & (block - 1) or spp >= BLOCKS * block:
            raise refuse("block", block, f"a power of two, at most {BLOCKS} of which hold {spp}")
        non_finite = check_whole("non_finite", _get(facts, "non_finite"), 0, spp * settings.pixels)
        total = _array(arrays, "total", (settings.pixels, 3), np.float64)
        used = -(-spp // block) if error else 0
        blocks = _array(arrays, "blocks", (used, settings.pixels, 3), np.float32)
        _check_sums(total, blocks, non_finite)
        return cls(
            spp,
            block,
            check_whole("rays", _get(facts, "rays"), 0, MOST_RAYS),
            non_finite,
            _checked_place(_get(facts, "first_non_finite"), settings, spp, non_finite),
            check_number("seconds", _get(facts, "seconds"), 0, LONGEST),
            _checked_look(_get(facts, "last_look"), spp),
            total,
            blocks,
        )

    @property
    def facts(self) -> dict[str, int | float | list[int] | list[float] | None]:
        """All attributes but the arrays, as :meth:`checked` takes them."""
        first, look = self.first_non_finite, self.last_look
        return {
            "spp": self.spp,
            "block": self.block,
            "rays": self.rays,
            "non_finite": self.non_finite,
            "first_non_finite": None if first is None else list(first),
            "seconds": self.seconds,
            "last_look": None if look is None else list(look),
        }

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays, as :meth:`checked` takes them."""
        return {"total": self.total, "blocks": self.blocks}


def _get(table: Mapping[str, Any], name: str) -> Any:
    if name not in table:
        raise ValueError(f"{name} is missing")
    return table[name]


def _array(
    arrays: Mapping[str, Any], name: str, shape: tuple[int, ...], dtype: type[np.generic]
) -> NDArray[Any]:
    array: NDArray[Any] = _get(arrays, name)
    if array.shape != shape or array.dtype != dtype:
        allowed = f"one of {np.dtype(dtype)} {shape}"
        raise ValueError(f"{name} is an array of {array.dtype} {array.shape}; it must be {allowed}")
    return array


def _check_sums(total: NDArray[np.float64], blocks: NDArray[np.float32], non_finite: int) -> None:
    """Raise `ValueError` unless sums are >= 0 and finite.

    Each sample that was not finite explains one pixel at most.
    """
    bad = ~np.isfinite(total).all(axis=1)
    count = int(bad.sum())
    if count > non_finite or (non_finite and not count):
        raise ValueError(
            f"{count} pixels of total are not finite, and {non_finite} samples are said to be so"
        )
    for name, sums in (("total", total[~bad]), ("blocks", blocks[:, ~bad])):
        if not (sums >= 0).all():
            raise ValueError(f"{name} has sums of radiance that are negative or no number")


def _checked_place(
    value: Any, settings: Settings, spp: int, non_finite: int
) -> tuple[int, int, int] | None:
    """Return column, row and number of the first sample that was not finite, or None."""
    if value is None and not non_finite:
        return None
    camera = settings.scene.camera
    if not isinstance(value, list) or len(value) != 3 or not non_finite:
        allowed = "column, row and number of a sample" if non_finite else "null"
        raise refuse("first_non_finite", value, allowed)
    ends = camera.width, camera.height, spp
    column, row, number = (
        check_whole("first_non_finite", item, 0, end - 1)
        for item, end in zip(value, ends, strict=True)
    )
    return column, row, number


def _checked_look(value: Any, spp: int) -> tuple[int, float] | None:
    """Return the samples of the last error estimate, and its value, or None."""
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise refuse("last_look", value, "null, or samples and an error")
    samples = check_whole("last_look", value[0], 1, spp)
    if isinstance(value[1], float) and np.isnan(value[1]):
        return samples, value[1]
    return samples, check_number("last_look", value[1], 0, np.inf)
