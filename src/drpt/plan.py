"""The plan of a render: which samples its passes take, which pixels its launches."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

LAUNCH_PATHS = 2**24
"""Paths of a pass for so many pixels as `PASS_PIXELS`: long enough to be worth it."""
LEAST_PASS = 4
"""Samples of a pass at the least: so many may share a camera ray."""
PASS_PIXELS = 2**20
"""Larger pictures take longer passes."""
LAUNCH_PIXELS = 2**18
"""Pixels of a launch at the most, which bounds its memory to some 100 MB."""
LAUNCH_LANES = 2**18
"""Lanes of a launch at the least: small pictures use several for each pixel."""
LANES_PER_PIXEL = 4
"""Lanes of a pixel at the least: runs of samples, whose differences tell the error."""
FIRST_PASS = 16
"""Samples of the first pass of a render that may stop early."""


def plan_passes(
    pixels: int,
    spp: int,
    done: int = 0,
    *,
    growing: bool = False,
    paths: int | None = None,
) -> Iterator[range]:
    """Passes of a render, as ranges of samples; they depend on the resolution and spp alone.

    All but the last take the same power of two of samples, so none of them crosses a multiple
    of 2³², where a sampler's index begins anew. Those of a render that may stop early are
    ``growing`` up to there. A plan can be taken up where any pass was ``done``, and with fewer
    ``paths`` a pass where what has come is to be seen soon.
    """
    share = max(LEAST_PASS, (paths or LAUNCH_PATHS) // min(pixels, PASS_PIXELS))
    longest = 1 << (share.bit_length() - 1)
    while done < spp:
        count = min(longest, FIRST_PASS) if growing and not done else longest
        if done % longest:
            count = done & -done
        yield range(done, min(done + count, spp))
        done += count


def parts(pixels: int) -> list[range]:
    """Pixels of the launches of a pass."""
    starts = range(0, pixels, LAUNCH_PIXELS)
    return [range(start, min(start + LAUNCH_PIXELS, pixels)) for start in starts]


def run_length(pixels: int, samples: range, paths_per_ray: int) -> int:
    """Samples of a pixel that one lane takes in a pass: a power of two."""
    lanes = max(LANES_PER_PIXEL, LAUNCH_LANES // min(pixels, LAUNCH_PIXELS))
    share = max(1, len(samples) // lanes)
    return max(paths_per_ray, 1 << (share.bit_length() - 1))
