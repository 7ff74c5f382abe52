"""Stress cases: float32 at the edges of its range, each against a closed form or the oracle."""

from benchmarks.stress import afar, brdf, integrator, intersection, lights

AREAS = {
    "intersection": intersection.CASES,
    "afar": afar.CASES,
    "lights": lights.CASES,
    "brdf": brdf.CASES,
    "integrator": integrator.CASES,
}
"""All cases by area."""
