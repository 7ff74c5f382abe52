"""The geometry of a scene on the device: what rays are intersected with."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

from drpt.kernel.vec import gather_row

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    import numpy as np
    from drjit.auto import Array4f, Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.camera import Ray
    from drpt.kernel.facets import Facet
    from drpt.kernel.meet import Ball
    from drpt.kernel.mesh import TriangleMesh
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.solids import Solid

    Visit: TypeAlias = Callable[[UInt32, Bool, Float, Float, UInt32], tuple[Float, UInt32]]

AFAR = 2.0**16
"""Distance, in radii, from which a sphere counts as far away.

There a distance is rounded by 1/256 of the radius.
"""
NEAR = 16
"""Largest distance of a ray's origin, in radii, for which a sphere is treated as large.

The power of the origin is rounded by 2⁻²⁴ of its squared distance.
"""


class ManySpheres(Protocol):
    """Spheres in a hierarchy; for ``afar`` see `Ball`."""

    afar: bool

    def walk(
        self,
        ray: Ray,
        active: Bool,
        end: Float,
        found: UInt32,
        visit: Visit,
        but: UInt32 | None = None,
    ) -> tuple[Float, UInt32]:
        """Visit the spheres that may be met before an ``end``, which the visits may bring nearer.

        ``visit(number, met, t, end, found)`` gets a sphere's number, whether and where the ray
        meets it, and what an earlier visit has returned; the walk is over where the end is before
        the origin. The sphere with the number ``but`` is not visited.
        """
        ...


class SurfaceRow(NamedTuple):
    """Shape of a primitive, (normal, offset) or (centre, radius), and the row of its material.

    The row is for `Materials` to interpret; that of a light is black.
    """

    shape: Array4f
    material: Array4f


@dataclass
class SceneGeometry:
    """Primitives as rays see them; the numbers of primitives are those of `Primitives`.

    Attributes
    ----------
    first_smooth, first_sphere, first_light, first_light_triangle
        Numbers at which the kinds of primitives start.
    sphere_count
        Number of spheres, those that emit included.
    solids
        Convex bodies of the facets that reflect.
    loose_facets
        Of the other facets: number, constants, and whether it can cast a shadow.
    mesh
        The triangles that reflect, where they are too many for facets.
    reach
        Largest coordinate of each facet that shares an edge, and of each triangle of a mesh;
        0 for other facets, None without such.
    light_facets, light_mesh
        The triangles that emit, as facets where they are few, else as a mesh.
    balls
        Of the spheres that are met one by one: number, and what is the same for all lanes.
    many_spheres
        The others.
    surfaces
        Rows of 8 by primitive, see `SurfaceRow`.
    smooth
        18 by smooth triangle: its corners, then the normals there.
    afar
        Whether rays may start far away from spheres, see `AFAR`.
    """

    types: ModuleType
    first_smooth: int
    first_sphere: int
    first_light: int
    first_light_triangle: int
    sphere_count: int
    solids: tuple[Solid, ...]
    loose_facets: tuple[tuple[int, Facet, bool], ...]
    mesh: TriangleMesh | None
    reach: Float | None
    light_facets: tuple[Facet, ...]
    light_mesh: TriangleMesh | None
    balls: tuple[tuple[int, Ball], ...]
    many_spheres: ManySpheres | None
    surfaces: Float
    smooth: Float
    afar: bool = False

    def seen_from(self, eye: NDArray[np.float64], primitives: Primitives) -> SceneGeometry:
        """The same geometry, prepared for rays that start at its primitives or at an eye (3,)."""
        if not len(primitives.spheres):
            return self
        extent, radii = primitives.extent(eye), primitives.spheres[:, 3]
        afar = bool(extent > AFAR * radii.min())
        many = copy(self.many_spheres)
        if many is not None:
            many.afar = afar

        def seen(number: int, ball: Ball) -> tuple[int, Ball]:
            near = extent <= NEAR * radii[number - self.first_sphere]
            return number, replace(ball, power=ball.power if near else None, afar=afar)

        balls = tuple(seen(number, ball) for number, ball in self.balls)
        return replace(self, balls=balls, many_spheres=many, afar=afar)

    def row(self, primitive: UInt32, active: Any = True) -> SurfaceRow:
        """The row of a primitive; zeros for lanes that are not active."""
        numbers = gather_row(self.surfaces, primitive, 8, active)
        return SurfaceRow(self.types.Array4f(*numbers[:4]), self.types.Array4f(*numbers[4:]))
