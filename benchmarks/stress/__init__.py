"""Stress cases: float32 at the edges of its range, each against a closed form or the oracle."""

from benchmarks.stress import brdf, integrator, intersection, lights

AREAS = {
    "intersection": intersection.CASES,
    "lights": lights.CASES,
    "brdf": brdf.CASES,
    "integrator": integrator.CASES,
}
"""All cases by area."""
