"""The film: sums of the samples of each pixel, in float64, and of blocks of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCKS = 8
"""Into so many blocks the samples of a pixel are parted at the most."""


class Film:
    """Sums of the samples of each pixel.

    Beside the sum of all, there are those of blocks of samples that follow each other, from whose
    differences the error can be told: all of one size, a power of two. When the last is full,
    neighbours are joined, so that from then on half of `BLOCKS` or more are full. Every pixel sees
    the same passes in the same order; a pass may arrive in parts, each of some pixels.

    Attributes
    ----------
    samples
        How many samples each pixel has got in complete passes.
    size
        Samples of a block.
    ahead
        How many pixels have got their part of the running pass.
    """

    def __init__(self, pixels: int, *, blocks: bool = True) -> None:
        self.samples = 0
        self.size = 1
        self.ahead = 0
        self._count = 0  # samples that the pixels ahead have more
        self._total = np.zeros((pixels, 3))
        self._blocks = np.zeros((BLOCKS if blocks else 0, pixels, 3), np.float32)

    def add(self, pixels: range, sums: NDArray[np.float64], samples: range, run: int) -> None:
        """Add samples of each pixel in a range, as sums (runs, len(pixels), 3) of ``run`` each.

        Passes start where the last one has ended, and at multiples of ``run``, a power of two.
        """
        part = slice(pixels.start, pixels.stop)
        if self.samples:
            self._total[part] += sums.sum(axis=0)
        else:
            np.sum(sums, axis=0, out=self._total[part])
        size = self._size_for(samples.stop, run)
        if len(self._blocks):
            starts = np.arange(samples.start, samples.stop, run)
            self._add_to_blocks(self._blocks[:, part], sums, starts, size)
        self.ahead, self._count = pixels.stop, len(samples)
        if pixels.stop == len(self._total):
            self.samples, self.size, self.ahead = samples.stop, size, 0

    def _add_to_blocks(
        self,
        blocks: NDArray[np.float32],
        sums: NDArray[np.float64],
        starts: NDArray[np.int64],
        size: int,
    ) -> None:
        doublings = (size // self.size).bit_length() - 1
        for _ in range(doublings if self.samples else 0):
            blocks[: BLOCKS // 2] = blocks[0::2] + blocks[1::2]
            blocks[BLOCKS // 2 :] = 0
        block = starts // size
        if len(block) > 1 + block[-1] - block[0]:  # several runs of a block
            sums = np.add.reduceat(sums, np.flatnonzero(np.diff(block, prepend=-1)), axis=0)
        theirs = blocks[block[0] : block[-1] + 1]
        # Memory that is new takes longest, and twice as long if it is read before.
        if self.samples:
            np.add(theirs, sums, out=theirs, casting="same_kind")
        else:
            np.copyto(theirs, sums, casting="same_kind")

    def _size_for(self, samples: int, run: int) -> int:
        size = max(self.size, run)
        while samples >= BLOCKS * size:
            size *= 2
        return size

    @property
    def mean(self) -> NDArray[np.float64]:
        """Means of all samples (pixels, 3); black where there are none."""
        mean: NDArray[np.float64] = self._total / max(self.samples, 1)
        if self.ahead:
            mean[: self.ahead] = self._total[: self.ahead] / (self.samples + self._count)
        return mean

    @property
    def leading_blocks(self) -> NDArray[np.float32]:
        """Sums (4, 2 or 0, pixels, 3) of the first full blocks, of ``size`` samples each.

        There are none amid a pass, nor without blocks.
        """
        full = 0 if self.ahead else min(self.samples // self.size, len(self._blocks))
        return self._blocks[: 4 if full >= 4 else 2 if full >= 2 else 0]

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """Arrays with which, ``samples`` and ``size`` :meth:`restore` makes an equal film."""
        used = -(-self.samples // self.size)
        return {"total": self._total, "blocks": self._blocks[:used]}

    def restore(
        self, total: NDArray[np.float64], blocks: NDArray[np.float32], samples: int, size: int
    ) -> None:
        """Become the film of which these are the state."""
        self._total[:] = total
        self._blocks[: len(blocks)] = blocks
        self.samples, self.size = samples, size
