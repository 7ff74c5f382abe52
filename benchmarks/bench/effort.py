"""How much is measured: a full run, some twenty minutes on two cores, or a quick one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """Limits of a run.

    Attributes
    ----------
    runs
        Warm renders of each point, of which the median counts.
    point_seconds
        A render that is expected to take longer is left out.
    slow_point_seconds
        The same for those modes that never are the best.
    reference_spp
        Samples per pixel of a reference; a multiple of 64.
    throughput_spp
        Of throughput.
    scaling_seconds
        A point of a scaling curve that is expected to take longer, with loading, is left out.
    quick
        Whether only the first configuration is measured, and every axis cut short.
    """

    runs: int
    point_seconds: float
    slow_point_seconds: float
    reference_spp: int
    throughput_spp: int
    scaling_seconds: float
    quick: bool


FULL = Effort(
    runs=3,
    point_seconds=8,
    slow_point_seconds=0.3,
    reference_spp=2**14,
    throughput_spp=256,
    scaling_seconds=10,
    quick=False,
)
QUICK = Effort(
    runs=3,
    point_seconds=0.5,
    slow_point_seconds=0.1,
    reference_spp=2**10,
    throughput_spp=16,
    scaling_seconds=1,
    quick=True,
)
