"""Whether two images have the same expectation.

Two tests answer, each wrong with a probability of `SIGNIFICANCE` at the most where nothing is:

- of the image's mean, the sharper one: what is wrong everywhere adds up in it;
- of every block of 1×1, 2×2, 4×4, … pixels, which finds what is wrong in one place, or too high
  here and too low there.

Both are Welch's t-test with the smaller of both images' degrees of freedom, which is conservative,
and Šidák's correction (1967) for the number of values compared. A t-test wants means that are
nearly normal, so a block takes part once it is resolved: as in a χ² test, what is too uncertain
by itself is judged together with its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drpt.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from drpt.crosscheck.estimate import Estimate

    Floats = NDArray[np.float64]

SIGNIFICANCE = 1e-3
"""Probability that a test fails although nothing is wrong."""
RESOLVED = 0.05
"""Standard error, relative to its mean, up to which a block takes part."""
ROUNDING = 1e-6
"""Relative difference that is no difference: some float32 roundings."""
POWER = 0.95
"""Probability with which a difference that is called detectable is detected."""


class Value(NamedTuple):
    """A mean and its variance."""

    mean: Floats
    variance: Floats


@dataclass(frozen=True, eq=False)
class ImageTest(Immutable):
    """The test of the images' means; arrays are (3,), one value for each channel.

    Attributes
    ----------
    pixels
        How many pixels were counted.
    resolved
        Whether the errors of both are known: the reference tells its own, and there are samples
        enough to tell those of the image.
    mean, reference
        Their mean in both images.
    standard_error
        Of their difference.
    p_value
        Probability of such a difference, or a larger one, in one of the channels by chance; not a
        number if the error of the reference is unknown.
    detectable
        Smallest difference that would have been detected, with the probability `POWER`.
    """

    pixels: int
    resolved: bool
    mean: Floats
    reference: Floats
    standard_error: Floats
    p_value: float
    detectable: Floats

    @property
    def difference(self) -> Floats:
        """Signed difference of the means, (3,)."""
        return self.mean - self.reference

    @property
    def passed(self) -> bool:
        """Whether the difference can be chance; it is not known if it is not resolved."""
        return not self.resolved or self.p_value >= SIGNIFICANCE


class Block(NamedTuple):
    """A square of pixels, its first column and row, and the channel that was compared."""

    column: int
    row: int
    side: int
    channel: int
    mean: float
    reference: float
    standard_error: float  # of the difference

    @property
    def errors(self) -> float:
        """The difference in standard errors."""
        difference = self.mean - self.reference
        if self.standard_error == 0:
            return float(np.copysign(np.inf, difference))
        return difference / self.standard_error

    def __str__(self) -> str:
        size = f"pixel ({self.column}, {self.row})"
        if self.side > 1:
            size = f"{self.side}x{self.side} pixels from ({self.column}, {self.row})"
        return f"{size}, {'RGB'[self.channel]}: {self.mean:.6g} against {self.reference:.6g}"


@dataclass(frozen=True, eq=False)
class BlockTest(Immutable):
    """The test of all blocks.

    Attributes
    ----------
    comparisons
        How many values were compared.
    worst
        The block with the least p-value; None where no block took part.
    p_value
        Probability of such a block, or a worse one, by chance.
    p_map
        The least p-value of the blocks that hold a pixel, (height, width); 1 where none did.
    passing
        Share of the pixels in no block that fails.
    side, detectable
        The side of the smallest blocks of which half took part, and the median of what would have
        been detected in one of them, relative to the reference; NaN where there are none.
    """

    comparisons: int
    worst: Block | None
    p_value: float
    p_map: Floats
    passing: float
    side: int
    detectable: float

    @property
    def passed(self) -> bool:
        """Whether all differences can be chance."""
        return self.p_value >= SIGNIFICANCE


@dataclass(frozen=True, eq=False)
class Comparison:
    """An image, its reference, and the verdicts of both tests."""

    image: Estimate
    reference: Estimate
    of_image: ImageTest
    of_blocks: BlockTest

    @property
    def passed(self) -> bool:
        """Whether all differences can be chance."""
        return self.of_image.passed and self.of_blocks.passed


def compare(
    image: Estimate,
    reference: Estimate,
    *,
    edges: NDArray[np.bool_] | None = None,
    tolerance: float = 0.0,
    min_samples: int = 0,
) -> Comparison:
    """Test whether an image has the expectation of its reference.

    Parameters
    ----------
    image
        What is tested.
    reference
        What it should be. Where its variance is not a number, nothing is compared.
    edges
        Pixels (height, width) to leave out of the images' means, because their noise drowns the
        rest, unless that is black; by default none. Every pixel counts in the blocks.
    tolerance
        Relative error of the reference that is known, and not held against the image.
    min_samples
        How many samples a mean must have to be judged: of fewer, too few are of the rarest kind
        that matters, and it seems more certain than it is.

    Raises
    ------
    ValueError
        The images differ in size, or the image has less than two passes.
    """
    if image.mean.shape != reference.mean.shape:
        sizes = [f"{e.mean.shape[1]}x{e.mean.shape[0]}" for e in (image, reference)]
        raise ValueError(f"reference: its size is {sizes[1]}, and the image's is {sizes[0]}")
    kept = np.ones(image.mean.shape[:2], np.bool_)
    if edges is not None and reference.mean[~edges].any():
        kept = ~edges
    test = _Welch(image, reference, tolerance, min_samples)
    of_image, of_blocks = _test_image(test, kept), _test_blocks(test, kept)
    return Comparison(image, reference, of_image, of_blocks)


def sidak(significance: float, comparisons: int) -> float:
    """Return the significance of each of n independent comparisons, 1 − (1 − α)^(1/n)."""
    return float(-np.expm1(np.log1p(-significance) / comparisons))


def of_any(p_value: float, comparisons: int) -> float:
    """Return the probability of such a p-value among n independent ones: the inverse of `sidak`."""
    return float(-np.expm1(comparisons * np.log1p(-min(p_value, 1 - 1e-16))))


class _Welch:
    """Welch's t-test of two images, block by block."""

    def __init__(
        self, image: Estimate, reference: Estimate, tolerance: float, min_samples: int
    ) -> None:
        self.pair = image, reference
        self.tolerance = tolerance + ROUNDING
        self.min_samples = min_samples
        passes = [estimate.passes for estimate in self.pair if estimate.passes]
        if image.passes < 2 or min(passes) < 2:
            raise ValueError("image: its errors are unknown; it must have two passes at least")
        self.degrees_of_freedom = min(passes) - 1

    def has_samples(self, pixels: int) -> bool:
        """Whether so many pixels of the image have samples enough to be judged."""
        return pixels * self.pair[0].spp >= self.min_samples

    def p_value(self, image: Value, reference: Value) -> Floats:
        """Two-sided p-values of values that should be equal; 0 where one is not finite."""
        from scipy import stats

        difference = np.abs(image.mean - reference.mean) - self.allowed(reference)
        error = _standard_error(image, reference)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = np.where(difference <= 0, 0, difference / error)
        p_value = 2 * stats.t.sf(t, self.degrees_of_freedom)
        return np.where(np.isfinite(image.mean + reference.mean), p_value, 0.0)

    def detectable(self, image: Value, reference: Value, comparisons: int) -> Floats:
        """Differences that n comparisons detect with the probability `POWER`."""
        from scipy import stats

        each = sidak(SIGNIFICANCE, comparisons)
        t = stats.t.isf([each / 2, 1 - POWER], self.degrees_of_freedom)
        seen = _standard_error(image, reference) * t.sum()
        return np.asarray(seen + self.allowed(reference))

    def allowed(self, reference: Value) -> Floats | float:
        """Differences that are the reference's own."""
        known = np.isfinite(self.tolerance)
        return self.tolerance * np.abs(reference.mean) if known else np.inf


def _test_image(test: _Welch, kept: NDArray[np.bool_]) -> ImageTest:
    image, reference = (_mean(Value(e.mean[kept], e.variance[kept])) for e in test.pair)
    channels = len(image.mean)
    p_value = of_any(float(test.p_value(image, reference).min()), channels)
    detectable = test.detectable(image, reference, channels)
    error = _standard_error(image, reference)
    pixels = int(kept.sum())
    known = ~np.isnan(reference.variance) & test.has_samples(pixels)
    resolved = bool((known | ~np.isfinite(image.mean)).any())
    return ImageTest(pixels, resolved, image.mean, reference.mean, error, p_value, detectable)


def _mean(image: Value) -> Value:
    """The mean of pixels (n, 3)."""
    return Value(image.mean.mean(axis=0), image.variance.sum(axis=0) / len(image.mean) ** 2)


def _test_blocks(test: _Welch, kept: NDArray[np.bool_]) -> BlockTest:
    height, width, _ = test.pair[0].mean.shape
    p_map = np.ones((height, width))
    levels = []
    pixels = _cautious(*test.pair, kept)
    for side in _sides(height, width):
        image, reference = (_blocks(values, side) for values in pixels)
        black = (reference.mean == 0) & ~np.isnan(reference.variance)
        resolved = _resolved(image) & (_resolved(reference) | black)
        resolved &= test.has_samples(side**2) | ~np.isfinite(image.mean)
        p_value = np.where(resolved, test.p_value(image, reference), 1.0)
        levels.append(_Level(side, image, reference, resolved, p_value))
        np.minimum(p_map, _spread(p_value.min(axis=2), side, p_map.shape), out=p_map)
    comparisons = sum(int(level.resolved.sum()) for level in levels)
    if not comparisons:
        return BlockTest(0, None, 1.0, p_map, 1.0, 0, np.nan)
    worst = min(levels, key=lambda level: level.p_value.min()).worst()
    p_least = of_any(float(p_map.min()), comparisons)
    passing = float((p_map >= sidak(SIGNIFICANCE, comparisons)).mean())
    side, detectable = _finest(test, levels, comparisons)
    return BlockTest(comparisons, worst, p_least, p_map, passing, side, detectable)


class _Level(NamedTuple):
    """All blocks of one size; arrays are (rows, columns, 3)."""

    side: int
    image: Value
    reference: Value
    resolved: NDArray[np.bool_]
    p_value: Floats

    def worst(self) -> Block:
        """The block with the least p-value."""
        at = np.unravel_index(self.p_value.argmin(), self.p_value.shape)
        row, column, channel = (int(i) for i in at)
        values = self.image.mean, self.reference.mean, _standard_error(self.image, self.reference)
        place = column * self.side, row * self.side, self.side, channel
        return Block(*place, *(float(value[at]) for value in values))


def _finest(test: _Welch, levels: list[_Level], comparisons: int) -> tuple[int, float]:
    """The smallest side of which half of the blocks took part, and what is detectable there."""
    for level in levels:
        lit = level.reference.mean > 0
        taken = level.resolved & lit
        if 2 * taken.sum() >= lit.sum() > 0:
            detectable = test.detectable(level.image, level.reference, comparisons)
            return level.side, float(np.median(detectable[taken] / level.reference.mean[taken]))
    return 0, np.nan


def _sides(height: int, width: int) -> Iterator[int]:
    """1, 2, 4, …, as long as there are several blocks."""
    side = 1
    while side < max(height, width):
        yield side
        side *= 2


def _cautious(image: Estimate, reference: Estimate, kept: NDArray[np.bool_]) -> tuple[Value, Value]:
    """The pixels of both, with variances that allow for rare events that have not happened.

    A pixel that such an event has missed, a light at its edge or a firefly, seems to be certain.
    So its variance is at least the mean of those around it, and that of the image is at least
    what the image has more than the reference on average: the noise of its fireflies.
    """
    shares = reference.spp / image.spp * reference.variance[kept].mean(axis=0)
    floor = np.maximum(image.variance[kept].mean(axis=0) - shares, 0)
    ours = Value(image.mean, np.maximum(_smooth(image.variance), floor))
    return ours, Value(reference.mean, _smooth(reference.variance))


def _smooth(variance: Floats) -> Floats:
    """At least the mean of the 3 × 3 pixels around."""
    from scipy.ndimage import uniform_filter

    around = uniform_filter(variance, size=(3, 3, 1), mode="nearest")
    return np.asarray(np.maximum(variance, around))


def _blocks(pixels: Value, side: int) -> Value:
    """Means of blocks of side × side pixels; the last ones may be smaller."""
    count = _block_sums(np.ones_like(pixels.mean), side)
    return Value(
        _block_sums(pixels.mean, side) / count, _block_sums(pixels.variance, side) / count**2
    )


def _block_sums(values: Floats, side: int) -> Floats:
    height, width, _ = values.shape
    rows = np.add.reduceat(values, np.arange(0, height, side), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, width, side), axis=1))


def _spread(blocks: Floats, side: int, shape: tuple[int, ...]) -> Floats:
    """Give each pixel the value of its block."""
    height, width = shape
    return blocks.repeat(side, axis=0).repeat(side, axis=1)[:height, :width]


def _resolved(value: Value) -> NDArray[np.bool_]:
    """Where a mean is certain enough to be nearly normal, or not finite, which is never right."""
    certain = (value.mean > 0) & (np.sqrt(value.variance) <= RESOLVED * value.mean)
    return certain | ~np.isfinite(value.mean)


def _standard_error(a: Value, b: Value) -> Floats:
    return np.asarray(np.sqrt(a.variance + b.variance))
