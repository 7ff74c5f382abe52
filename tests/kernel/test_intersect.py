"""Closest hits and shadows against the float64 oracle; seams, needles, far scenes, self-hits."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.camera import Ray
from drpt.kernel.estimator import Mode
from drpt.kernel.intersect import closest_hit, occluded
from drpt.kernel.launch import make_launcher
from drpt.kernel.primitives import FACET_LIMIT, make_primitives
from drpt.kernel.spheres import CROWDED_LIMIT
from tests.conftest import TYPES, to_host
from tests.oracle import geometry
from tests.oracle.arrays import dot, normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drpt.scene import Shape
    from tests.oracle.arrays import Bools, Floats, Ints

# All scenes here are some units wide. Errors of positions are relative to that, across the surface:
# along the ray they grow with 1 / cos of the angle of incidence. 16 ulps of float32.
POSITION = 2e-6
# Off the surface a hit point is by 2^-20 of its largest coordinate (and radius), apart from that.
OFFSET = 2.0**-19
# Normals of spheres and smooth triangles: the error of a position over the size of the shape.
NORMAL = 2e-5
# A ray is compared unless moving it by this much, ten times its error, makes it meet another face.
DOUBT = 2e-5
# How close to a sphere's silhouette, in radii, a ray may be misclassified: 16 ulps of float32.
SILHOUETTE = 2e-6
# Share of the rays aimed at a seam that may meet the next surface instead. A ray that is aimed
# elsewhere passes a seam within a float32 ulp about once in 1e6 times.
SLIPS = 1e-4

CAMERA = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8)
RAYS = 2**12


class Found(NamedTuple):
    """A `Hit` on the host, in the coordinates of the shapes; `shape` is -1 on lights."""

    valid: Bools
    distance: Floats
    shape: Ints
    point: Floats
    normal: Floats
    shading_normal: Floats
    front: Bools

    def of(self, rays: Bools) -> Found:
        columns: list[Any] = [column[rays] for column in self]
        return Found(*columns)


class World:
    """Shapes on the device; each that reflects is known by an albedo of its own."""

    def __init__(self, *shapes: Shape) -> None:
        self.shapes = shapes
        scene = drpt.Scene(camera=CAMERA, shapes=shapes)
        launcher = make_launcher(TYPES, scene, 1, Mode.MIS, "independent", jitter=False)
        self.scene, self.features = launcher.tracer.scene.geometry, launcher.tracer.features
        self.primitives = make_primitives(scene.shapes)

    def closest(self, origins: Floats, directions: Floats) -> Found:
        ray = self._ray(origins, directions)
        hit = closest_hit(self.scene, self.features, ray, self.scene.types.Bool(True))
        dr.eval(hit)
        albedos = [shape.material.albedo[0] if shape.material else -1 for shape in self.shapes]
        reflectance = self.primitives.reflectance[:, 0]
        own = np.array([albedos.index(albedo) for albedo in reflectance], np.int64)
        of_primitive = np.append(own, np.full(len(self.primitives.radiance), -1))
        n = len(origins)
        return Found(
            np.broadcast_to(np.array(hit.valid), n),
            np.broadcast_to(to_host(hit.distance), n),
            of_primitive[np.broadcast_to(np.array(hit.primitive), n)],
            to_host(hit.point) + self.primitives.origin,
            to_host(hit.normal),
            to_host(hit.shading_normal),
            np.broadcast_to(np.array(hit.front), n),
        )

    def occluded(self, origins: Floats, ends: Floats, light: int) -> Bools:
        way = ends - origins
        distance = np.linalg.norm(way, axis=1)
        types = self.scene.types
        blocked = occluded(
            self.scene,
            self._ray(origins, way / distance[:, None]),
            types.Float32(distance.astype(np.float32)),
            types.UInt32(light),
            types.Bool(True),
        )
        return np.broadcast_to(np.array(blocked), len(origins))

    def rounded(self, points: Floats) -> Floats:
        """Points as float32 tells them, relative to the world's origin."""
        near = (points - self.primitives.origin).astype(np.float32)
        return np.asarray(near + self.primitives.origin)

    def _ray(self, origins: Floats, directions: Floats) -> Ray:
        return Ray(self._vectors(origins - self.primitives.origin), self._vectors(directions))

    def _vectors(self, values: Floats) -> Any:
        types = self.scene.types
        columns = np.ascontiguousarray(values.astype(np.float32).T)
        return types.Array3f(*(types.Float32(column) for column in columns))


def dull(index: int) -> drpt.Diffuse:
    return drpt.Diffuse((index + 1) / 2048)


def spheres(rng: np.random.Generator, count: int) -> Iterator[Shape]:
    for index in range(count):
        yield drpt.Sphere(rng.uniform(-2, 2, 3), rng.uniform(0.1, 1), material=dull(index))
    yield drpt.Sphere(rng.uniform(-2, 2, 3), 0.5, radiance=1)


def triangles(rng: np.random.Generator, count: int, *, smooth: bool = False) -> Iterator[Shape]:
    for index in range(count):
        corners = rng.uniform(-2, 2, 3) + rng.uniform(-1, 1, (3, 3))
        normals = None
        if smooth:
            upright = normalize(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
            normals = upright + rng.uniform(-0.3, 0.3, (3, 3))
        yield drpt.Mesh(corners, [[0, 1, 2]], normals, material=dull(1000 + index))
    yield drpt.Mesh(rng.uniform(-2, 2, (3, 3)), [[0, 1, 2]], radiance=1)


def nested(rng: np.random.Generator) -> Iterator[Shape]:
    center = rng.uniform(-1, 1, 3)
    for index, radius in enumerate((2.0, 1.9, 1.0, 0.4)):
        yield drpt.Sphere(center, radius, material=dull(index))
    yield drpt.Sphere(center + 0.1, 0.1, radiance=1)


SCENES: dict[str, Callable[[np.random.Generator], list[Shape]]] = {
    "one sphere": lambda rng: [*spheres(rng, 1)],
    "spheres": lambda rng: [*spheres(rng, 8)],
    "nested spheres": lambda rng: [*nested(rng)],
    "many spheres": lambda rng: [*spheres(rng, CROWDED_LIMIT + 1)],
    "triangles": lambda rng: [*triangles(rng, 12)],
    "smooth triangles": lambda rng: [*triangles(rng, 8, smooth=True)],
    "many triangles": lambda rng: [*triangles(rng, FACET_LIMIT + 1)],
    "many smooth triangles": lambda rng: [*triangles(rng, FACET_LIMIT + 1, smooth=True)],
    "mixed": lambda rng: [*triangles(rng, 6), *spheres(rng, 5), *box(rng)],
    "many of all": lambda rng: [
        *triangles(rng, FACET_LIMIT + 1, smooth=True),
        *spheres(rng, CROWDED_LIMIT + 1),
    ],
}


SLOW = ("one sphere", "many smooth triangles", "many of all")
QUICK_AND_SLOW = [
    pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in SCENES
]


def box(rng: np.random.Generator) -> Iterator[Shape]:
    """A closed box of twelve triangles, somewhere and turned."""
    axes, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    corners = rng.uniform(-1, 1, 3) + (np.array([*product((-1, 1), repeat=3)]) * 0.7) @ axes
    yield drpt.Mesh(corners, BOX_FACES, material=dull(2000))


BOX_FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip


def random_rays(rng: np.random.Generator, world: World, count: int) -> tuple[Floats, Floats]:
    """Rays towards points near shapes, from far, near and inside, as float32 tells them."""
    centers = np.array([middle(shape) for shape in world.shapes])
    targets = centers[rng.integers(0, len(centers), count)] + rng.uniform(-0.7, 0.7, (count, 3))
    origins = world.rounded(centers.mean(axis=0) + rng.uniform(-3, 3, (count, 3)))
    directions = normalize(targets - origins).astype(np.float32).astype(np.float64)
    return origins, directions


def middle(shape: Shape) -> Floats:
    if isinstance(shape, drpt.Sphere):
        return np.array(shape.center)
    return np.asarray(shape.vertices.mean(axis=0))


def sure_hits(
    shapes: tuple[Shape, ...], origins: Floats, directions: Floats
) -> tuple[geometry.Hits, Bools]:
    """The oracle's hits, and for which rays they stay on their face if the ray is moved a bit."""
    directions = normalize(directions)
    truth = geometry.closest_hit(shapes, origins, directions)
    sure = np.ones(len(origins), bool)
    rng = np.random.default_rng(0)
    for _ in range(2):
        moved = origins + DOUBT * sample_uniform_sphere(rng, len(origins))
        hits = geometry.closest_hit(shapes, moved, directions)
        sure &= (hits.shape == truth.shape) & (hits.primitive == truth.primitive)
        near = np.isclose(hits.t, truth.t, rtol=0.1, atol=0.1)
        sure &= near | np.isinf(truth.t)
    return truth, sure


def assert_agree(world: World, origins: Floats, directions: Floats) -> None:
    found = world.closest(origins, directions)
    truth, sure = sure_hits(world.shapes, origins, directions)
    assert sure.mean() > 0.95
    assert np.array_equal(found.valid[sure], np.isfinite(truth.t[sure]))
    hit = sure & found.valid
    assert hit.mean() > 0.1
    lights = [i for i, shape in enumerate(world.shapes) if shape.is_light]
    assert np.array_equal(
        found.shape[hit], np.where(np.isin(truth.shape, lights), -1, truth.shape)[hit]
    )
    found, truth = found.of(hit), truth[hit]
    cosine = np.abs(dot(truth.geometric_normal, directions[hit]))
    facing = np.where(dot(truth.geometric_normal, directions[hit]) < 0, 1.0, -1.0)[:, None]
    assert np.abs((found.distance - truth.t) * cosine).max() < 4 * POSITION
    assert distance(found.normal, facing * truth.geometric_normal, cosine).max() < NORMAL
    shading = truth.shading_normal
    shading *= np.sign(dot(shading, facing * truth.geometric_normal))[:, None]
    assert distance(found.shading_normal, shading, cosine).max() < 2 * NORMAL
    assert (dot(found.shading_normal, found.normal) > 0).all()
    reach = np.abs(found.point - world.primitives.origin).max() + 2
    assert distance(found.point, truth.position, cosine).max() < OFFSET * reach + 4 * POSITION
    assert np.array_equal(found.front[cosine > NORMAL], facing[cosine > NORMAL, 0] > 0)


def distance(a: Floats, b: Floats, cosine: Floats) -> Floats:
    return np.asarray(np.linalg.norm(a - b, axis=1) * cosine)


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_closest_hits_agree_with_the_oracle(name: str) -> None:
    rng = np.random.default_rng(len(name))
    world = World(*SCENES[name](rng))
    assert_agree(world, *random_rays(rng, world, RAYS))


@pytest.mark.parametrize("name", ["mixed", pytest.param("many of all", marks=pytest.mark.slow)])
def test_a_scene_far_from_its_origin_agrees_with_the_oracle(name: str) -> None:
    rng = np.random.default_rng(7)
    shapes = [moved(shape, (1e5, -3e4, 77.7)) for shape in SCENES[name](rng)]
    world = World(*shapes)
    assert_agree(world, *random_rays(rng, world, RAYS))


def moved(shape: Shape, by: tuple[float, float, float]) -> Shape:
    if isinstance(shape, drpt.Sphere):
        center = np.add(shape.center, by)
        return drpt.Sphere(center, shape.radius, shape.material, shape.radiance)
    vertices = shape.vertices + by
    return drpt.Mesh(vertices, shape.faces, shape.normals, shape.material, shape.radiance)


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_shadows_agree_with_the_oracle(name: str) -> None:
    rng = np.random.default_rng(100 + len(name))
    world = World(*SCENES[name](rng))
    found = world.closest(*random_rays(rng, world, RAYS))
    dull_hit = found.valid & (found.shape >= 0)
    points, normals = found.point[dull_hit], found.normal[dull_hit]
    lights = [shape for shape in world.shapes if shape.is_light]
    lights.sort(key=lambda shape: isinstance(shape, drpt.Mesh))  # as the kernel numbers them
    for number, light in enumerate(lights):
        ends = on_surface(rng, light, points)
        above = dot(ends - points, normals) > 0  # nothing else reflects
        start, end = points[above], ends[above]
        others = [shape for shape in world.shapes if shape is not light]
        truth = blocked(others, start, end)
        sure = np.ones(len(start), bool)
        for _ in range(4):
            nudge = DOUBT * sample_uniform_sphere(rng, len(start))
            sure &= blocked(others, start, end + nudge) == truth
        answer = world.occluded(start, end, number)
        assert sure.mean() > 0.95
        assert np.array_equal(answer[sure], truth[sure])


def blocked(shapes: list[Shape], start: Floats, end: Floats) -> Bools:
    length = np.linalg.norm(end - start, axis=1)
    return geometry.any_hit(shapes, start, (end - start) / length[:, None], 0, length - DOUBT)


def on_surface(rng: np.random.Generator, light: Shape, seen_from: Floats) -> Floats:
    """A point of the light for each point, on the side of a sphere that is turned to it."""
    n = len(seen_from)
    if isinstance(light, drpt.Sphere):
        normal = sample_uniform_sphere(rng, n)
        side = np.where(dot(normal, seen_from - light.center) < 0, -1, 1)
        return np.asarray(light.center + light.radius * side[:, None] * normal)
    return np.asarray(rng.dirichlet([1, 1, 1], n) @ light.vertices)


def test_the_gate_sees_a_shape_of_slightly_other_size() -> None:
    rng = np.random.default_rng(3)
    shapes = SCENES["mixed"](rng)
    world = World(*shapes)
    rays = random_rays(rng, world, RAYS)
    assert_agree(world, *rays)
    ball = next(i for i, s in enumerate(shapes) if isinstance(s, drpt.Sphere))
    sphere = shapes[ball]
    assert isinstance(sphere, drpt.Sphere)
    swollen = drpt.Sphere(sphere.center, sphere.radius + 1e-4, sphere.material)
    world.shapes = (*shapes[:ball], swollen, *shapes[ball + 1 :])
    with pytest.raises(AssertionError):
        assert_agree(world, *rays)


@pytest.mark.parametrize("far", [1.5, 1e2, 1e4])
def test_a_sphere_far_away_keeps_its_outline(far: float) -> None:
    rng = np.random.default_rng(0)
    world = World(drpt.Sphere((0, 0, 0), 1, material=dull(0)), light_far_away(far))
    n = 500_000
    origins = (far * sample_uniform_sphere(rng, n)).astype(np.float32).astype(np.float64)
    sine = (1 + rng.normal(0, 1e-4, (n, 1))) / far  # of the angle between ray and centre
    aside = normalize(np.cross(sample_uniform_sphere(rng, n), origins))
    directions = sine * aside - np.sqrt(1 - sine**2) * normalize(origins)
    directions = directions.astype(np.float32).astype(np.float64)
    found = world.closest(origins, directions)
    impact = np.linalg.norm(np.cross(origins, normalize(directions)), axis=1)
    clear = np.abs(impact - 1) > SILHOUETTE
    assert 0.9 < clear.mean() < 1
    assert np.array_equal(found.valid[clear] & (found.shape[clear] == 0), impact[clear] < 1)


def light_far_away(far: float) -> Shape:
    """A light that keeps a scene's origin at 0, out of the way of rays from `far` to it."""
    return drpt.Sphere((0, 0, -4 * far), far, radiance=1)


def test_axis_parallel_directions_with_any_sign_of_zero() -> None:
    rng = np.random.default_rng(5)
    shapes = [*SCENES["mixed"](rng)]
    shapes += [drpt.Mesh([[-3, -3, -3], [3, -3, -3], [0, 3, -3]], [[0, 1, 2]], material=dull(7))]
    shapes += [drpt.Sphere((0, 0, 0), 3, material=dull(8))]
    world = World(*shapes)
    origins = world.rounded(rng.uniform(-2, 2, (512, 3)))
    for axis, sign in product(range(3), (-1.0, 1.0)):
        answers = []
        for first, second in product((0.0, -0.0), repeat=2):
            direction = np.roll([sign, first, second], axis)
            answers.append(world.closest(origins, np.tile(direction, (512, 1))))
        assert all(np.array_equal(a.distance, answers[0].distance) for a in answers)
        truth, sure = sure_hits(world.shapes, origins, np.tile(direction, (512, 1)))
        valid = answers[0].valid
        assert np.array_equal(valid[sure], np.isfinite(truth.t)[sure])
        assert answers[0].distance[sure & valid] == pytest.approx(truth.t[sure & valid], rel=1e-4)


def icosphere(levels: int, center: Floats, radius: float) -> drpt.Mesh:
    golden = (1 + 5**0.5) / 2
    signs = [*product((-1, 1), (-golden, golden))]
    vertices = np.array([np.roll([0, a, b], k) for k in range(3) for a, b in signs])
    vertices = normalize(vertices)
    edge = min(np.linalg.norm(vertices[1:] - vertices[0], axis=1)) * 1.001
    near = np.linalg.norm(vertices[:, None] - vertices, axis=-1) < edge
    faces = [
        (a, b, c)
        for a, b, c in product(range(12), repeat=3)
        if a < b < c and near[a, b] and near[b, c] and near[a, c]
    ]
    corners = vertices[np.array(faces)]
    for _ in range(levels):
        a, b, c = corners.swapaxes(0, 1)
        ab, bc, ca = normalize(a + b), normalize(b + c), normalize(c + a)
        parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    outward = dot(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                  corners.sum(axis=1))  # fmt: skip
    corners[outward < 0] = corners[outward < 0, ::-1]
    unique, index = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    return drpt.Mesh(center + radius * unique, index.reshape(-1, 3), material=dull(0))


def inner_light(center: Floats, radius: float) -> Shape:
    return drpt.Sphere(center, 0.01 * radius, radiance=1)


CLOSED = {
    "icosahedron": (0, 1.0, (0.0, 0.0, 0.0)),
    "icosahedron aside": (0, 0.01, (0.37, 0.11, -0.2)),
    "icosahedron far away": (0, 3.0, (1e5, 1e5, -7e4)),
    "large icosahedron": (0, 1e4, (7.0, 0.0, 0.0)),
    "icosphere": (2, 1.0, (0.1, 0.2, 0.3)),
    "icosphere far away": (2, 1.0, (1e5, 0.0, 3.0)),
}


@pytest.mark.parametrize("as_body", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", CLOSED)
def test_no_ray_leaves_a_closed_mesh_through_its_seams(
    name: str, as_body: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not as_body:
        monkeypatch.setattr("drpt.kernel.primitives.make_solids", lambda *_: ())
    levels, radius, center = CLOSED[name]
    rng = np.random.default_rng(1)
    mesh = icosphere(levels, np.array(center), radius)
    world = World(mesh, inner_light(np.array(center), radius))
    n = 250_000
    corners = mesh.vertices[mesh.faces[rng.integers(0, len(mesh.faces), n)]]
    share = rng.choice([0, 0.5, 1, np.nan], (n, 1))  # corners, middles and points of edges
    share = np.where(np.isnan(share), rng.random((n, 1)), share)
    targets = corners[:, 0] + share * (corners[:, 1] - corners[:, 0])
    inside = center + 0.5 * radius * sample_uniform_sphere(rng, n) * rng.random((n, 1))
    leaks = (~world.closest(inside, normalize(targets - inside)).valid).sum()
    assert leaks == 0
    outside = center + 3 * radius * normalize(targets - center + radius * rng.normal(size=(n, 3)))
    way = targets - outside
    faces_it = dot(way, targets - center) < -0.7 * radius * np.linalg.norm(way, axis=1)
    outside, way = outside[faces_it], way[faces_it]
    found = world.closest(outside, normalize(way))
    assert len(way) > n / 20
    length = np.linalg.norm(way, axis=1)
    slips = (np.abs(found.distance / length - 1) > 1e-3).sum()  # to the inside of the back
    assert slips <= SLIPS * len(way)


def test_the_seam_gate_sees_a_mesh_with_a_hole() -> None:
    mesh = icosphere(0, np.zeros(3), 1)
    open_mesh = drpt.Mesh(mesh.vertices, mesh.faces[1:], material=dull(0))
    world = World(open_mesh, inner_light(np.zeros(3), 1))
    rng = np.random.default_rng(1)
    assert not world.closest(np.full((1000, 3), 0.1), sample_uniform_sphere(rng, 1000)).valid.all()


def test_coplanar_rays_and_duplicate_triangles_give_finite_answers() -> None:
    triangle = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])
    world = World(
        drpt.Mesh([*triangle, *triangle], [[0, 1, 2], [3, 4, 5]], material=dull(0)),
        drpt.Sphere((0, 0, 3), 0.1, radiance=1),
    )
    angles = np.linspace(0, 6, 100)
    along = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    flat = world.closest(-3 * along, along)
    assert not np.isnan(flat.distance).any()
    assert np.isfinite(flat.point[flat.valid]).all()
    straight = world.closest(np.array([[0.0, 0, 1]]), np.array([[0.0, 0, -1]]))
    assert straight.distance.tolist() == [1]
    assert straight.point[0] == pytest.approx([0, 0, 0], abs=1e-5)


@pytest.mark.parametrize("name", ["one needle", "many triangles"])
def test_a_needle_is_hit_on_its_axis_and_missed_beside_it(name: str) -> None:
    rng = np.random.default_rng(2)
    width = 1e-5
    needle = drpt.Mesh(
        [[0.0, -width, 0], [1.0, 0, 0], [0.0, width, 0]], [[0, 1, 2]], material=dull(0)
    )
    away = (0.0, 0.0, -9.0)
    others = [*triangles(rng, FACET_LIMIT + 1)] if name != "one needle" else [*spheres(rng, 1)]
    world = World(needle, *(moved(shape, away) for shape in others))
    n = 4096
    x = rng.uniform(0.05, 0.4, n)
    origins = np.stack([x, 0 * x, 0 * x + 1], axis=1)
    down = np.tile([0.0, 0, -1], (n, 1))
    assert (world.closest(origins, down).shape == 0).all()
    beside = origins + np.array([0, 1.5 * width, 0])
    assert not ((world.closest(beside, down).shape == 0) & world.closest(beside, down).valid).any()


def grazing(rng: np.random.Generator, normal: Floats) -> Floats:
    """Directions (n, 3) above a surface by 1e-7 to 1e-2 radians."""
    along = normalize(np.cross(normal, sample_uniform_sphere(rng, len(normal))))
    height = 10 ** rng.uniform(-7, -2, (len(normal), 1))
    return normalize(along + height * normal)


SIZES = [1e-3, 1.0, 1e3]
DISTANCES = [0.0, 30.0, 1e3]  # in sizes


def beside(size: float, far: float) -> tuple[Floats, Shape]:
    """A place so far from the origin, and a light that keeps the origin there."""
    center = far * size * np.array([0.6, -0.64, 0.48])
    return center, drpt.Sphere(-1.1 * center - 4 * size, 0.1 * size, radiance=1)


@pytest.mark.parametrize(("size", "far"), [*product(SIZES, DISTANCES)])
def test_spheres_do_not_hit_themselves(size: float, far: float) -> None:
    rng = np.random.default_rng(0)
    n = 50_000
    center, light = beside(size, far)
    world = World(drpt.Sphere(center, size, material=dull(0)), light)
    origins = center + size * sample_uniform_sphere(rng, n) * rng.uniform(1.1, 3, (n, 1))
    towards = center + 0.999 * size * sample_uniform_sphere(rng, n)
    found = world.closest(origins, normalize(towards - origins))
    start = found.valid & (found.shape == 0)
    assert start.mean() > 0.9
    point, normal = found.point[start], found.normal[start]
    again = world.closest(point, grazing(rng, normal))
    assert not (again.valid & (again.shape == 0)).any()
    inside = world.closest(center + 0 * origins, sample_uniform_sphere(rng, n))
    direction = grazing(rng, inside.normal)
    chord = 2 * size * dot(direction, inside.normal)
    across = world.closest(inside.point, direction)
    assert across.valid.all()
    assert (across.distance > 0.5 * chord).all()


@pytest.mark.parametrize(("size", "far"), [*product(SIZES, DISTANCES)])
def test_facets_do_not_hit_themselves(size: float, far: float) -> None:
    rng = np.random.default_rng(0)
    n = 100_000
    center, light = beside(size, far)
    axes, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    flat = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) @ axes * size
    world = World(drpt.Mesh(center + flat, [[0, 1, 2], [0, 2, 3]], material=dull(0)), light)
    targets = center + rng.uniform(-0.99, 0.99, (n, 2)) @ axes[:2] * size
    origins = targets + 2 * size * sample_uniform_sphere(rng, n)
    found = world.closest(origins, normalize(targets - origins))
    start = found.valid & (found.shape == 0)
    assert start.mean() > 0.9
    again = world.closest(found.point[start], grazing(rng, found.normal[start]))
    assert not (again.valid & (again.shape == 0)).any()


@pytest.mark.parametrize("size", SIZES)
def test_convex_meshes_do_not_hit_themselves(size: float) -> None:
    rng = np.random.default_rng(0)
    n = 100_000
    center, light = beside(size, 30.0)
    world = World(icosphere(2, center, size), light)
    assert len(world.primitives.triangles)
    origins = center + 2 * size * sample_uniform_sphere(rng, n)
    towards = center + 0.9 * size * sample_uniform_sphere(rng, n)
    found = world.closest(origins, normalize(towards - origins))
    start = found.valid & (found.shape == 0)
    again = world.closest(found.point[start], grazing(rng, found.normal[start]))
    assert not (again.valid & (again.shape == 0)).any()


def test_the_self_hit_gate_sees_points_below_the_surface() -> None:
    rng = np.random.default_rng(0)
    center, light = beside(1.0, 1.0)
    world = World(drpt.Sphere(center, 1.0, material=dull(0)), light)
    normal = sample_uniform_sphere(rng, 1000)
    again = world.closest(center + (1 - 1e-6) * normal, grazing(rng, normal))
    assert (again.valid & (again.shape == 0)).any()


@pytest.mark.parametrize("radius", [1e2, 1e4, 1e6])
def test_a_large_sphere_is_as_exact_as_what_stands_on_it(radius: float) -> None:
    """Its hits lie just above it, by an error of what is near, and see nothing of it again."""
    rng = np.random.default_rng(0)
    n = 50_000
    ground = drpt.Sphere((0, 0, -radius), radius, material=dull(0))
    world = World(ground, drpt.Sphere((0, 0, 1), 1, radiance=1))
    targets = rng.uniform(-5, 5, (n, 3)) * [1, 1, 0]
    origins = targets + 4 * np.abs(sample_uniform_sphere(rng, n)) + [0, 0, 0.1]
    found = world.closest(origins, normalize(targets - origins))
    start = found.valid & (found.shape == 0)
    assert start.mean() > 0.8
    point, normal = found.point[start], found.normal[start]
    height = (dot(point, point) / radius + 2 * point[:, 2]) / 2
    assert (height > 0).all()
    assert height.max() < 10 * OFFSET
    again = world.closest(point, grazing(rng, normal))
    assert not (again.valid & (again.shape == 0)).any()


def test_only_a_sphere_near_the_origin_is_large() -> None:
    def balls(*shapes: Shape) -> list[bool]:
        return [ball.power is not None for _, ball in World(*shapes).scene.balls]

    light = drpt.Sphere((0, 0, 1), 1, radiance=1)
    assert balls(drpt.Sphere((0, 0, -1e5), 1e5, material=dull(0)), light)[0]
    assert not balls(drpt.Sphere((0, 0, -5), 1, material=dull(0)), light)[0]
