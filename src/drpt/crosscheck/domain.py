"""Where Mitsuba is exact enough to compare with: its error for small, far sphere lights.

Mitsuba 3.9.1 samples a sphere light of radius r, seen from distance d, in the cone of half-angle σ,
sin σ = s = r/d, that it fills, and divides by the density 1/(2π (1 − cos σ)). It computes
1 − cos σ as ``1 - sqrt(1 - s²)`` in float32 (``Sphere::sample_direction`` and ``pdf_direction``
in ``sphere.cpp``, ``square_to_uniform_cone_pdf`` in ``warp.h``). With u = 2⁻²⁴:

- 1 − s² and its root lie in [1/2, 1) for small lights, where neighbouring numbers are u apart, so
  each is rounded by up to u/2. Rounding 1 − s² shifts the root by up to u/(4 cos σ), rounding the
  root by u/2; the last subtraction is exact. Together that is 3u/4 of 1 − cos σ ≈ s²/2, an error
  of up to 3u/2s². What comes out is a whole multiple of u, and 0 for s² ≤ u/2.
- s² itself is off by up to 16u: 5u from |c − p|², 8u from its reciprocal root squared (4u each;
  it is approximate on some processors), 3u from products. Of 1 − cos σ that is up to
  8u (1 + cos σ) / cos σ, 65u at s = 0.99. With three roundings of the density's own, and what
  the first item lacks where cos σ is not 1, `ROUNDING` covers it.
- For s² < 0.00068523 directions are not uniform in the cone: from a random number ξ it takes
  sin²θ = s² ξ in place of cos θ = 1 − (1 − cos σ) ξ. The density is then 2 cos θ / (1 + cos σ)
  times what it claims, within s²/4 of 1, which cancels only where the whole light is seen.

The path integrator adds light and BRDF samples, each weighted by w_light + w_brdf = 1 (power
heuristic). An error e of 1/density multiplies the light samples alone: the picture's error is e
times the mean of w_light, e (1 − O(s⁴)) on diffuse surfaces, and never more than the bound of e;
not either where ``pdf_direction``, which gives w_brdf, rounds to the next multiple of u. Every path
takes its light from one light, at one vertex, so no number of bounces adds to it.

Two more of Mitsuba's approximations are not of the density and not counted here. Rays start
δ = 1500u (1 + max|p|) off the surface (``offset_p`` in ``interaction.h``): BRDF samples see a light
as from δ nearer, on diffuse surfaces an error of about 2 δ s⁴ / d. Shadow rays end 15000u = 9e-4 of
their length before the light, and miss what occludes it there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drpt.scene import Sphere
from drpt.scene.bounds import bounds

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from drpt.scene import Scene, Shape

MIN_SINE = 0.03
"""Smallest radius / distance at which Mitsuba is compared with unreservedly: its error is 1e-4."""
MAX_SINE = 0.99
"""Largest radius / distance that `light_error` covers: 1 % of the radius from the light."""

MAX_OFFSET = 1e-3
"""Largest offset of Mitsuba's rays, relative to the scene's size, at which it is compared with."""

UNIT = 2.0**-24
"""Largest relative rounding error of float32."""
ROUNDING = 70 * UNIT
"""Largest relative error up to `MAX_SINE` where nothing cancels."""
SERIES_SINE = 0.00068523**0.5
"""Sine of 1.5°, below which Mitsuba samples directions by a series."""
VANISHING_SINE = (UNIT / 2 * (1 + 16 * UNIT)) ** 0.5
"""The largest sine at which a light can vanish."""


def light_error(sine: ArrayLike) -> NDArray[np.float64]:
    """Return a bound of Mitsuba's relative error of the light that arrives from a sphere light.

    With u = 2⁻²⁴, |error| ≤ 3u/2s² + 70u, and 1.7e-4 more for s below sin 1.5°; it falls with s.
    Derived in this module from Mitsuba's source, for what the whole light gives: where only a
    part of it is seen, the seen part's outline may besides be displaced by as much of its area.

    Parameters
    ----------
    sine
        s = radius / distance from the receiver to the light's centre, > 0 and up to `MAX_SINE`.

    Returns
    -------
    Bound, of the shape of ``sine``; infinite where the light may vanish altogether.
    """
    s = np.asarray(sine, np.float64)
    series = np.where(s < SERIES_SINE, SERIES_SINE**2 / 4, 0.0)
    error = 1.5 * UNIT / s**2 + ROUNDING + series
    return np.where(s > VANISHING_SINE, error, np.inf)


def emulated_error(radius: ArrayLike, distance: ArrayLike) -> NDArray[np.float64]:
    """Return the relative error of the light that Mitsuba's density gives, in its own rounding.

    The operations of ``Sphere::pdf_direction`` in IEEE float32, for radii and distances of
    float32; -1 where the light vanishes.
    """
    r, d = np.asarray(radius, np.float32), np.asarray(distance, np.float32)
    one = np.float32(1)
    s = r * (one / np.sqrt(d * d))
    cap = one - np.sqrt(one - s * s)
    with np.errstate(divide="ignore"):
        pdf = np.float32(1 / (2 * np.pi)) / cap
    true_s = r.astype(np.float64) / d
    true_cap = true_s**2 / (1 + np.sqrt((1 - true_s) * (1 + true_s)))
    return np.asarray(1 / (2 * np.pi * true_cap * pdf) - 1)


@dataclass(frozen=True)
class Caveat:
    """A sphere light whose picture in Mitsuba is not to be trusted without reservation.

    Attributes
    ----------
    shape
        Index of the light in the scene's shapes.
    radius, distance
        Of the light, and from its centre to the farthest point that it may light.
    error
        Bound of Mitsuba's relative error there; infinite where the light may vanish.
    """

    shape: int
    radius: float
    distance: float
    error: float

    @property
    def sine(self) -> float:
        """Radius / distance."""
        return self.radius / self.distance

    def __str__(self) -> str:
        light = (
            f"shapes[{self.shape}]: a sphere light of radius {self.radius:g} shines as far as "
            f"{self.distance:.4g}, at radius / distance {self.sine:.2g}"
        )
        if np.isinf(self.error):
            return f"{light}: in Mitsuba's picture it may be black there"
        percent = f"{100 * self.error:.2g} %"
        return f"{light}: Mitsuba's picture may be off by {percent} where it alone lights it"


def caveats(scene: Scene) -> list[Caveat]:
    """Return the sphere lights that reach beyond radius / distance = `MIN_SINE`, in order."""
    return [caveat for caveat in _sphere_lights(scene) if caveat.sine < MIN_SINE]


def tolerance(scene: Scene) -> float:
    """Return a bound of the relative error that its sphere lights cause in Mitsuba's picture.

    See `light_error`; 0 without sphere lights, or with nothing for them to light, and infinite
    beyond `MAX_OFFSET`. It holds for each pixel, for every number of bounces, and for surfaces that
    keep 1 % of a light's radius away from it.
    """
    if ray_offset(scene) > MAX_OFFSET:
        return np.inf
    return max((caveat.error for caveat in _sphere_lights(scene)), default=0.0)


def ray_offset(scene: Scene) -> float:
    """Return how far off a surface Mitsuba's rays start at the most, relative to the scene's size.

    They start 1500 u (1 + max|p|) off a point p (``RayEpsilon`` in ``math.h``, ``offset_p`` in
    ``interaction.h``). The size is the longest side of the box around all shapes. Infinite where
    all shapes are in one point.
    """
    low, high = bounds(scene.shapes)
    reach = max(np.abs(low).max(), np.abs(high).max())
    size = float((high - low).max())
    return 1500 * UNIT * float(1 + reach) / size if size else np.inf


def _sphere_lights(scene: Scene) -> list[Caveat]:
    """Return the sphere lights with their farthest receivers; lights reflect nothing."""
    reflecting = [shape for shape in scene.shapes if shape.material is not None]
    found = []
    for index, light in enumerate(scene.shapes):
        if isinstance(light, Sphere) and light.is_light and reflecting:
            distance = max([light.radius, *(_reach(light, shape) for shape in reflecting)])
            error = float(light_error(light.radius / distance))
            found.append(Caveat(index, light.radius, distance, error))
    return found


def _reach(light: Sphere, shape: Shape) -> float:
    """Return the distance from a light's centre to the farthest point of a shape that it may light.

    With the light (radius r, centre c) outside a sphere (radius R, centre o), a point o + R n sees
    none of it unless n·(c − o) > R − r; there |c − o − R n|² < |c − o|² − R² + 2 R r.
    """
    center = np.array(light.center)
    if not isinstance(shape, Sphere):
        return float(np.linalg.norm(shape.vertices - center, axis=1).max())
    between = float(np.linalg.norm(shape.center - center))
    if between < shape.radius + light.radius:
        return between + shape.radius
    tangent = (between - shape.radius) * (between + shape.radius)
    return float(np.sqrt(tangent + 2 * shape.radius * light.radius))
