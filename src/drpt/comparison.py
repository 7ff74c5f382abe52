"""How much a picture differs from another one, in numbers and as a picture.

Whether it differs by more than noise is another question, which :mod:`drpt.crosscheck` answers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.colours import colour_end, signed_colours
from drpt.crosscheck.flip import has_flip, mean_flip
from drpt.distribution import install_command
from drpt.error import DARK
from drpt.immutable import Immutable
from drpt.machine import require_memory
from drpt.output import write

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]
    Metadata = Mapping[str, str | int | float]

DOUBLE = 8
"""Bytes of a float64."""
COPIES = 10
"""Number of float64 copies of a picture in memory while two are compared."""
SETTINGS = ("scene", "mode", "spp", "bounces", "sampler", "seed", "jitter")
"""What makes a difference, of the metadata of a picture."""


@dataclass(frozen=True, eq=False)
class Comparison(Immutable):
    """A picture held against a reference.

    Attributes
    ----------
    error
        Signed relative difference (x − x̂) / √(x̂² + 0.01), shape (height, width, 3).
    rmse
        Root of the mean of (x − x̂)², in units of radiance.
    mean_difference
        Relative difference of the means, (3,), one value for each channel: 0 where both are
        black, infinite where the reference alone is.
    flip
        Mean FLIP of both as a PNG shows them, from 0 to 1; None without the package
        ``flip-evaluator``.
    non_finite
        Pixels that are infinite or not a number, in the picture and in the reference.
    """

    error: Floats
    rmse: float
    mean_difference: Floats
    flip: float | None
    non_finite: tuple[int, int]

    @property
    def rel_mse(self) -> float:
        """Mean of (x − x̂)² / (x̂² + 0.01)."""
        return float((self.error**2).mean())

    @property
    def error_end(self) -> float:
        """Size of the error, averaged over the channels, from which its colours are full."""
        return colour_end(self.error.mean(axis=2))

    def save_error(self, path: str | PathLike[str]) -> None:
        """Write the error: in colours as ``.png``, as it is as ``.exr`` or ``.npy``.

        The colours are of its average over the channels: red where the picture is too bright, blue
        where it is too dark, magenta where it is not a number. Raises like
        :func:`drpt.output.write`.
        """
        shown = self.error
        if Path(path).suffix.lower() == ".png":
            shown = signed_colours(self.error.mean(axis=2), self.error_end)
        write(path, shown.astype(np.float32), {})

    def __str__(self) -> str:
        means = zip("RGB", self.mean_difference, strict=True)
        rows = {
            "relMSE": f"{self.rel_mse:.3g}",
            "RMSE": f"{self.rmse:.3g}",
            "FLIP": self._flip_row(),
            "means": ", ".join(f"{channel} {100 * value:+.3g} %" for channel, value in means),
        }
        if any(self.non_finite):
            rows["not finite"] = "{} and {} pixels".format(*self.non_finite)
        return "\n".join(f"  {name:10}  {value}" for name, value in rows.items())

    def _flip_row(self) -> str:
        if self.flip is None:
            return f"not computed ({install_command('flip')} adds it)"
        return f"{self.flip:.4f}"


def compare(image: ArrayLike, reference: ArrayLike) -> Comparison:
    """Compare two pictures with linear radiance, such as results, of shape (height, width, 3).

    Values that are not finite make the numbers so, too. Raises `ValueError` where the shapes are
    not the same or not those of pictures, or where the memory is too small.
    """
    x, y = _picture("image", image), _picture("reference", reference)
    if x.shape != y.shape:
        sizes = [f"{picture.shape[1]}x{picture.shape[0]}" for picture in (x, y)]
        raise ValueError(f"reference: its size is {sizes[1]}, and the image's is {sizes[0]}")
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = x - y
        return Comparison(
            error=difference / np.sqrt(y**2 + DARK),
            rmse=float(np.sqrt((difference**2).mean())),
            mean_difference=_relative(difference.mean(axis=(0, 1)), y.mean(axis=(0, 1))),
            flip=mean_flip(x, y) if has_flip() else None,
            non_finite=(_non_finite(x), _non_finite(y)),
        )


def _relative(difference: Floats, mean: Floats) -> Floats:
    """Differences of means, relative to them; none is none even of nothing."""
    return np.where(difference == 0, 0.0, difference / mean)


def _picture(name: str, values: ArrayLike) -> Floats:
    picture = np.asarray(values)
    if picture.ndim != 3 or picture.shape[2] != 3 or not picture.size:
        raise ValueError(f"{name}: its shape is {picture.shape}; it must be (height, width, 3)")
    size = f"a comparison of {picture.shape[1]}x{picture.shape[0]} pixels"
    require_memory(COPIES * picture.size * DOUBLE, size)
    return picture.astype(np.float64)


def _non_finite(picture: Floats) -> int:
    return int((~np.isfinite(picture)).any(axis=2).sum())


def differing_settings(image: Metadata, reference: Metadata) -> str:
    """Say in one line in which `SETTINGS` picture A and reference B differ, by their metadata."""
    unknown = [name for name, settings in (("A", image), ("B", reference)) if not settings]
    if unknown:
        return f"unknown of {' and '.join(unknown)}"
    pairs = {name: (image.get(name, "?"), reference.get(name, "?")) for name in SETTINGS}
    different = {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
    scene = ["another scene"] if different.pop("scene", None) else []
    named = [f"{name} {ours} / {theirs}" for name, (ours, theirs) in different.items()]
    return ", ".join([*scene, *named]) or "the same"
