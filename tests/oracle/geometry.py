"""Ray intersection with spheres and triangles in float64, vectorised over rays."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction

import numpy as np

from drpt.scene import Mesh, Sphere
from tests.oracle.arrays import Bools, Floats, Ints, basis, dot, normalize

PAIRS_AT_ONCE = 2**18  # ray-triangle pairs held in memory together: a few MiB an array


@dataclass(frozen=True)
class Hits:
    """Where n rays meet a surface first.

    A ray that meets nothing has t = inf, shape = primitive = -1 and NaN elsewhere. Normals are
    unit and as the surface has them: outward on a sphere, on the counter-clockwise side of a
    triangle; `shading_normal` is interpolated where the mesh has normals, else geometric.
    """

    t: Floats
    shape: Ints
    primitive: Ints
    position: Floats
    geometric_normal: Floats
    shading_normal: Floats

    def __getitem__(self, rays: Bools | Ints) -> "Hits":
        """Return the hits of the chosen rays."""
        return Hits(*(getattr(self, field.name)[rays] for field in fields(self)))


def closest_hit(
    shapes: Sequence[Sphere | Mesh], origins: Floats, directions: Floats, t_min: float = 0.0
) -> Hits:
    """Return the first hits with t > t_min of rays (n, 3) with unit directions (n, 3)."""
    n = len(origins)
    nothing, nowhere = np.full(n, -1), np.full((n, 3), np.nan)
    best = Hits(np.full(n, np.inf), nothing, nothing, nowhere, nowhere, nowhere)
    for index, shape in enumerate(shapes):
        if isinstance(shape, Sphere):
            hits = _hit_sphere(shape, index, origins, directions, t_min)
        else:
            hits = _hit_mesh(shape, index, origins, directions, t_min)
        best = _nearer(best, hits)
    return best


def any_hit(
    shapes: Sequence[Sphere | Mesh],
    origins: Floats,
    directions: Floats,
    t_min: float,
    t_max: Floats,
) -> Bools:
    """Return (n,) whether each ray meets a surface with t_min < t < t_max."""
    return closest_hit(shapes, origins, directions, t_min).t < t_max


def sphere_is_hit_exactly(
    origin: Sequence[float], direction: Sequence[float], center: Sequence[float], radius: float
) -> bool:
    """Return whether one ray, of any length of direction, meets a sphere: in exact arithmetic.

    It does if it starts inside, or approaches and |f|² - r² <= (f·d)² / |d|² with f = o - c;
    a tangent ray meets the sphere.
    """
    f = [Fraction(o) - Fraction(c) for o, c in zip(origin, center, strict=True)]
    d = [Fraction(x) for x in direction]
    f_d = sum(x * y for x, y in zip(f, d, strict=True))
    outside = sum(x * x for x in f) - Fraction(radius) ** 2
    return outside < 0 or (f_d < 0 and f_d**2 >= outside * sum(x * x for x in d))


def _hit_sphere(
    sphere: Sphere, index: int, origins: Floats, directions: Floats, t_min: float
) -> Hits:
    """Return the hits of one sphere; the roots are Haines et al.'s (2019), free of cancellation."""
    center = np.asarray(sphere.center, np.float64)
    f = origins - center
    b = -dot(f, directions)
    closest_point = f + b[:, None] * directions
    discriminant = sphere.radius**2 - dot(closest_point, closest_point)
    q = b + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), b)
    f_length = np.linalg.norm(f, axis=1)
    c = (f_length - sphere.radius) * (f_length + sphere.radius)
    roots = np.sort(np.stack([q, np.divide(c, q, out=q.copy(), where=q != 0)]), axis=0)
    roots = np.where((discriminant >= 0) & (roots > t_min), roots, np.inf)
    t = roots.min(axis=0)
    normal = normalize(f + _nan_where_missed(t) * directions)
    position = center + sphere.radius * normal
    shape, primitive = (np.where(t < np.inf, i, -1) for i in (index, 0))
    return Hits(t, shape, primitive, position, normal, normal)


def _hit_mesh(mesh: Mesh, index: int, origins: Floats, directions: Floats, t_min: float) -> Hits:
    vertices = np.asarray(mesh.vertices, np.float64)
    faces = np.asarray(mesh.faces, np.int64)
    t, face, weights = _hit_triangles(vertices, faces, origins, directions, t_min)
    corners = vertices[faces[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = normalize(normal + 0 * _nan_where_missed(t))
    shading_normal = normal
    if mesh.normals is not None:
        corner_normals = np.asarray(mesh.normals, np.float64)[faces[face]]
        shading_normal = normalize(np.einsum("nk,nkc->nc", weights, corner_normals))
    position = np.einsum("nk,nkc->nc", weights, corners)
    shape, primitive = (np.where(t < np.inf, i, -1) for i in (index, face))
    return Hits(t, shape, primitive, position, normal, shading_normal)


def _hit_triangles(
    vertices: Floats, faces: Ints, origins: Floats, directions: Floats, t_min: float
) -> tuple[Floats, Ints, Floats]:
    """Return t (n,), face (n,) and barycentric weights (n, 3; NaN where missed) of first hits."""
    chunks = range(0, max(1, len(origins)), max(1, PAIRS_AT_ONCE // len(faces)))
    parts = [
        _hit_triangles_at_once(vertices, faces, origins[rays], directions[rays], t_min)
        for rays in (slice(start, start + chunks.step) for start in chunks)
    ]
    t, face, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
    return t, face, weights


def _hit_triangles_at_once(
    vertices: Floats, faces: Ints, origins: Floats, directions: Floats, t_min: float
) -> tuple[Floats, Ints, Floats]:
    """Look down each ray: it is the origin of a plane, and meets a triangle that contains it.

    The three edge functions are twice the areas that the origin makes with the edges; two
    triangles get exactly opposite values for a shared edge, so that no ray slips through it.
    """
    seen = np.einsum("rvc,rkc->krv", vertices - origins[:, None], basis(directions))
    x, y, z = (seen[k][:, faces] for k in range(3))
    following, last = [1, 2, 0], [2, 0, 1]
    areas = x[..., following] * y[..., last] - x[..., last] * y[..., following]
    inside = np.all(areas >= 0, axis=-1) | np.all(areas <= 0, axis=-1)
    total = areas.sum(axis=-1)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    inside &= (total != 0) & np.any(np.cross(b - a, c - a) != 0, axis=1)
    weights = areas / np.where(inside, total, np.nan)[..., None]
    t = np.nan_to_num(dot(weights, z), nan=np.inf)
    t = np.where(t > t_min, t, np.inf)
    face = t.argmin(axis=1)
    rays = np.arange(len(origins))
    return t[rays, face], face, weights[rays, face]


def _nan_where_missed(t: Floats) -> Floats:
    return np.where(t < np.inf, t, np.nan)[:, None]


def _nearer(a: Hits, b: Hits) -> Hits:
    keep = a.t <= b.t
    merged = []
    for field in fields(Hits):
        x, y = getattr(a, field.name), getattr(b, field.name)
        merged.append(np.where(keep if x.ndim == 1 else keep[:, None], x, y))
    return Hits(*merged)
