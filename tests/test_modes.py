"""Modes, samplers, scales and pass plans: whatever must not change a picture."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from math import log2
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.scene import builtin_names
from tests.measuring import (
    Measured,
    assert_agree,
    measure,
    measure_to,
    with_picture,
    with_radiance,
)

if TYPE_CHECKING:
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

MODES = tuple(drpt.Mode)
PATHS = 2**24
# The bias of a picture's reflected light, relative to its mean, that is seen with so many paths in
# the order of MODES. Paths find a small light by chance only, a sharp plate hardly by a uniform
# direction, and in `veach` a sharp plate's light is not found by sampling lights: there the modes
# are compared as far as it goes, and the closed forms decide. Uniform directions into the sharpest
# lobes of `veach` meet a light once in millions, which no affordable number of paths measures: that
# mode is compared on the same plates, duller.
DETECTABLE: dict[str, tuple[float | None, ...]] = {
    "cornell-box": (0.03, 0.015, 0.018, 0.002, 0.002, 0.002),
    "cornell-box-glossy": (0.1, 0.015, 0.03, 0.01, 0.004, 0.004),
    "cornell-box-medium-light": (0.07, 0.03, 0.012, 0.002, 0.002, 0.002),
    "cornell-box-small-light": (0.2, 0.1, 0.01, 0.002, 0.002, 0.002),
    "furnace": (0.008, 0.003, 0.006, 0.001, 0.001, 0.001),
    "many-lights": (0.08, 0.02, 0.2, 0.05, 0.01, 0.01),
    "spheres": (0.5, 0.03, 0.07, 0.05, 0.015, 0.015),
    "veach": (None, 0.015, 0.6, 0.6, 0.01, 0.01),
}
DULL_VEACH = (0.4, 0.02, 0.05, 0.03, 0.015, 0.015)
MARGIN = 1.2  # of what is detected, since the noise itself is estimated
# For changes of a scene that leave its picture as it is, in mode mis.
UNCHANGED = 0.01

# Of `cornell-box` with 2 bounces, measured with Mitsuba's path integrator, and how far off the
# estimate may be.
CORNELL_MEAN = (0.89779, 0.90146, 0.82165)
CORNELL_TOLERANCE = 5e-4


def assert_modes_agree(scene: drpt.Scene, paths: int, detectable: tuple[float | None, ...]) -> None:
    small = with_picture(scene, 48, 32)
    measured = [
        (measure(small, paths, 2, mode, reflected=True), np.sqrt(PATHS / paths) * bias)
        for mode, bias in zip(MODES, detectable, strict=True)
        if bias is not None
    ]
    for (a, bias_a), (b, bias_b) in combinations(measured, 2):
        assert_agree(a, b, MARGIN * np.hypot(bias_a, bias_b))


@pytest.mark.slow
@pytest.mark.parametrize("name", DETECTABLE)
def test_modes_agree(name: str) -> None:
    assert_modes_agree(drpt.load_scene(name), PATHS, DETECTABLE[name])


@pytest.mark.slow
def test_modes_agree_on_duller_plates() -> None:
    assert_modes_agree(duller(drpt.load_scene("veach"), 100), PATHS, DULL_VEACH)


def duller(scene: drpt.Scene, factor: float) -> drpt.Scene:
    """The same scene of flat meshes and lights, its exponents divided."""

    def dull(shape: Shape) -> Shape:
        if isinstance(shape, drpt.Mesh) and isinstance(shape.material, drpt.Phong):
            material = drpt.Phong(shape.material.albedo, shape.material.exponent / factor)
            return replace(shape, material=material)
        return shape

    return replace(scene, shapes=tuple(map(dull, scene.shapes)))


@pytest.mark.parametrize("name", ["cornell-box", "furnace"])
def test_modes_agree_as_far_as_few_paths_tell(name: str) -> None:
    assert_modes_agree(drpt.load_scene(name), PATHS // 8, DETECTABLE[name])


def test_every_builtin_scene_is_compared() -> None:
    assert sorted(DETECTABLE) == sorted(builtin_names())


def test_the_comparison_sees_a_bias() -> None:
    scene = with_picture(drpt.load_scene("cornell-box"), 48, 32)
    truth = measure_to(0.004, scene, 2, "mis", reflected=True)
    biased = measure_to(0.004, with_radiance(scene, 1.01), 2, "explicit", reflected=True)
    with pytest.raises(AssertionError, match="means differ"):
        assert_agree(biased, truth, 0.01)


def test_light_that_is_seen_directly_is_the_same_in_every_mode() -> None:
    scene = with_picture(drpt.load_scene("many-lights"), 48, 32)
    pictures = [drpt.render(scene, 16, 0, mode).image for mode in MODES]
    assert pictures[0].any()
    assert all(np.array_equal(picture, pictures[0]) for picture in pictures)


def test_cornell_box_has_the_mean_that_mitsuba_gives() -> None:
    scene = drpt.load_scene("cornell-box")
    a, b = (
        drpt.render(scene, 256, 2, "explicit", seed=seed).image.mean((0, 1), np.float64)
        for seed in (1, 2)
    )
    assert np.abs(a - b).max() < CORNELL_TOLERANCE / 2  # what is left of noise
    assert (a + b) / 2 == pytest.approx(CORNELL_MEAN, rel=CORNELL_TOLERANCE)


def small_scene(shapes: list[Shape] | None = None) -> drpt.Scene:
    """A bit of everything: both materials and kinds of lights, smooth and flat triangles."""
    camera = drpt.Camera((0.2, -4, 1.5), (0, 0, 0.6), (0, 0, 1), 45, 48, 32)
    return drpt.Scene(camera=camera, shapes=shapes or [*reflecting(), *lights()])


def reflecting() -> list[Shape]:
    floor = [[-3, -5, 0], [3, -5, 0], [3, 3, 0], [-3, 3, 0]]
    roof = [[-1.3, 0, 0.1], [-0.3, -0.5, 0.2], [-0.5, 0.6, 1.2]]
    normals = [[-0.1, -0.6, 0.5], [0.2, -0.6, 0.5], [0, -0.8, 0.5]]
    return [
        drpt.Mesh(floor, [[0, 1, 2], [0, 2, 3]], material=drpt.Diffuse((0.7, 0.6, 0.5))),
        drpt.Mesh(roof, [[0, 1, 2]], normals, material=drpt.Diffuse(0.8)),
        drpt.Sphere((0.7, 0, 0.5), 0.5, material=drpt.Phong((0.8, 0.7, 0.9), 30)),
    ]


def lights(split: int = 0) -> list[Shape]:
    """A lamp and a panel that faces down, cut into 2 · 4^split triangles."""
    corners = np.array([[0, 0, 2], [0, 1, 2], [1.2, 1, 2], [1.2, 0, 2.0]])
    triangles = corners[[[0, 1, 2], [0, 2, 3]]]
    for _ in range(split):
        triangles = quartered(triangles)
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return [
        drpt.Sphere((-0.8, -1, 1.2), 0.25, radiance=(4, 6, 8)),
        drpt.Mesh(triangles.reshape(-1, 3), faces, radiance=(9, 7, 5)),
    ]


def quartered(triangles: Floats) -> Floats:
    a, b, c = triangles.swapaxes(0, 1)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


@pytest.fixture(scope="module")
def reference() -> Measured:
    """Reflected light of the small scene; detects 0.7 %, as do those compared with it."""
    return measure_to(UNCHANGED * 0.7, small_scene(), 2, "mis", reflected=True)


def assert_unchanged(scene: drpt.Scene, reference: Measured, mode: str = "mis") -> None:
    found = measure_to(UNCHANGED * 0.7, scene, 2, mode, reflected=True, seed=5)
    assert_agree(found, reference, UNCHANGED * 1.1)


@pytest.mark.slow
@pytest.mark.parametrize("split", [1, 3])  # 8 triangles, and more than the kernel unrolls
def test_splitting_a_light_changes_nothing(split: int, reference: Measured) -> None:
    assert_unchanged(small_scene([*reflecting(), *lights(split)]), reference)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["implicit", "explicit"])
def test_other_modes_give_the_same_of_the_small_scene(mode: str, reference: Measured) -> None:
    assert_unchanged(small_scene(), reference, mode)


def test_splitting_triangles_changes_nothing(reference: Measured) -> None:
    floor, *others = reflecting()
    assert isinstance(floor, drpt.Mesh)
    pieces = quartered(quartered(floor.vertices[floor.faces])).reshape(-1, 3)
    faces = np.arange(len(pieces)).reshape(-1, 3)
    split = drpt.Mesh(pieces, faces, material=floor.material)
    assert_unchanged(small_scene([split, *others, *lights()]), reference)


def test_black_and_unlit_shapes_out_of_sight_change_nothing(reference: Measured) -> None:
    below: list[Shape] = [
        drpt.Sphere((0, 0, -2), 0.5, radiance=0),
        drpt.Sphere((1, 0, -2), 0.3, radiance=5),  # chosen, and always blocked
        drpt.Mesh([[0, 1, -1], [1, 0, -1], [0, 0, -1]], [[0, 1, 2]], material=drpt.Phong(1, 9)),
    ]
    assert_unchanged(small_scene([*reflecting(), *lights(), *below]), reference)


TURN = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
TURN *= np.linalg.det(TURN)  # a rotation, no mirror image


def room() -> list[Shape]:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 2) for z in (-1.0, 1)])
    quads = [[0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6], [1, 3, 7, 5], [0, 2, 6, 4]]
    faces = [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]
    return [drpt.Mesh(corners, faces, material=drpt.Diffuse(0.6))]


def panels(radiance: float = 5) -> list[Shape]:
    below = np.array([[-0.3, 0, -0.3], [-0.3, 0, 0.3], [0.3, 0, 0.3], [0.3, 0, -0.3]])
    above = below[::-1] + np.array([0, 2, 0])
    quad = [[0, 1, 2], [0, 2, 3]]
    return [drpt.Mesh(corners, quad, radiance=radiance) for corners in (below, above)]


def crumbs() -> drpt.Mesh:
    """So many small triangles in a corner that all of a scene goes into a mesh."""
    corners = np.random.default_rng(0).normal(0.7, 0.02, (300, 3))
    return drpt.Mesh(corners, np.arange(300).reshape(-1, 3), material=drpt.Diffuse(0.6))


def spheres_in_a_corner() -> list[Shape]:
    """So many spheres that the kernel loops over them, and one of them in a lamp's place."""
    place = np.random.default_rng(1).uniform([-0.9, 0.1, -0.9], [-0.7, 0.3, -0.7], (70, 3))
    lamp = drpt.Sphere((0.4, 0.5, 0.3), 0.2, radiance=3)
    dull = drpt.Diffuse(0.5)
    return [*(drpt.Sphere(p, 0.02, dull) for p in place), replace_surface(lamp, dull), lamp]


def replace_surface(sphere: drpt.Sphere, material: drpt.Diffuse) -> drpt.Sphere:
    return drpt.Sphere(sphere.center, sphere.radius, material)


def many_panels() -> list[Shape]:
    """The panels in more triangles than the kernel unrolls."""
    return [split_mesh(panel, 3) for panel in panels() if isinstance(panel, drpt.Mesh)]


def split_mesh(mesh: drpt.Mesh, times: int) -> drpt.Mesh:
    triangles = mesh.vertices[mesh.faces]
    for _ in range(times):
        triangles = quartered(triangles)
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return drpt.Mesh(triangles.reshape(-1, 3), faces, radiance=mesh.radiance)


def two_sided_lamp() -> list[Shape]:
    corners = np.array([[-0.3, 0.8, 0.2], [0.3, 0.8, 0.2], [0.3, 1.2, 0.4], [-0.3, 1.2, 0.4]])
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    return [drpt.Mesh(corners, faces, radiance=4) for faces in (quad, quad[:, ::-1])]


def overlapping_panels() -> list[Shape]:
    small = panels()
    corners = np.array([[-0.5, 2, -0.1], [0.5, 2, -0.1], [0.5, 2, 0.2], [-0.5, 2, 0.2]])
    return [*small, drpt.Mesh(corners, [[0, 1, 2], [0, 2, 3]], radiance=3)]


def cut_panels() -> list[Shape]:
    """The panels, of which later patches cover half of one and a hole in the other."""
    half = np.array([[-0.3, 2, -0.3], [0.3, 2, -0.3], [0.3, 2, 0.0], [-0.4, 2, 0.0]])
    hole = np.array([[-0.1, 0, -0.1], [-0.1, 0, 0.2], [0.2, 0, 0.1], [0.1, 0, -0.2]])
    quad = [[0, 1, 2], [0, 2, 3]]
    patches = (drpt.Mesh(corners, quad, material=drpt.Diffuse(0.1)) for corners in (half, hole))
    return [*panels(), *patches]


COINCIDENCES: dict[str, list[Shape]] = {
    "panels flush with facets": panels(),
    "panels flush with a mesh": [*panels(), crumbs()],
    "many panels flush with facets": many_panels(),
    "many panels flush with a mesh": [*many_panels(), crumbs()],
    "lamp of two sides": two_sided_lamp(),
    "lamp of two sides, turned": two_sided_lamp()[::-1],
    "panels that overlap": overlapping_panels(),
    "panels that overlap, turned": overlapping_panels()[::-1],
    "panels that are cut": cut_panels(),
    "panels that are cut, in a mesh": [*cut_panels(), crumbs()],
    "a lamp in a sphere's place, among many": spheres_in_a_corner(),
}


def tilted(shapes: list[Shape]) -> list[Shape]:
    """Turned off the axes and far from the origin, where nothing rounds to the same."""

    def place(points: object) -> Floats:
        return np.asarray(np.asarray(points) @ TURN.T + [30, 7, -11])

    return [
        replace(s, center=tuple(place(s.center)))
        if isinstance(s, drpt.Sphere)
        else replace(s, vertices=place(s.vertices))
        for s in shapes
    ]


@pytest.mark.filterwarnings("ignore:surfaces overlap in one place")
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if i else ()) for i, n in enumerate(COINCIDENCES)],
)
def test_modes_agree_on_lights_that_coincide_with_something(name: str) -> None:
    eye, target = TURN @ [0, 1, -0.9] + [30, 7, -11], TURN @ [0, 1, 0] + [30, 7, -11]
    camera = drpt.Camera(eye, target, TURN @ [0, 1, 0], 60, 32, 32)
    scene = drpt.Scene(camera, tilted([*room(), *COINCIDENCES[name]]))
    truth = measure_to(UNCHANGED * 0.7, scene, 2, "mis")
    for mode in ("implicit", "explicit"):
        assert_agree(measure_to(UNCHANGED * 0.7, scene, 2, mode, seed=5), truth, UNCHANGED * 1.1)


@pytest.mark.parametrize("lamp", [two_sided_lamp(), two_sided_lamp()[::-1]])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_lamp_of_two_sides_shines_on_both(lamp: list[Shape], side: int) -> None:
    camera = drpt.Camera((0, 1, 0.3 + 3 * side), (0, 1, 0.3), (0, 1, 0), 2, 8, 8)
    assert (drpt.render(drpt.Scene(camera, lamp), 1, 0).image == 4).all()


@pytest.mark.parametrize("mode", MODES)
def test_coincident_lights_are_one_of_their_sum(mode: str) -> None:
    lamp, whole = (drpt.Sphere((0, 1.5, 0.2), 0.2, radiance=r) for r in (5, 10))
    camera = drpt.Camera((0, 1, -0.9), (0, 1, 0), (0, 1, 0), 60, 32, 32)
    halves = drpt.Scene(camera, [*room(), *panels(2), lamp, *panels(3), lamp])
    once = drpt.Scene(camera, [*room(), *panels(5), whole])
    pictures = [drpt.render(scene, 16, 2, mode).image for scene in (halves, once)]
    assert pictures[0] == pytest.approx(pictures[1], rel=1e-5)


@pytest.mark.parametrize("size", [1, 10, 100])
def test_large_triangles_do_not_shade_themselves_in_a_mesh(size: float) -> None:
    """A tilted square through the origin, seen from above, with and without a mesh below it."""
    normal = np.array([0.3, 0.9, 0.31]) / np.linalg.norm([0.3, 0.9, 0.31])
    along = np.cross(normal, [1, 0, 0]) / np.linalg.norm(np.cross(normal, [1, 0, 0]))
    across = np.cross(along, normal)
    corners = [size * (a * along + b * across) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    square = drpt.Mesh(corners, [[0, 1, 2], [0, 2, 3]], material=drpt.Diffuse(0.6))
    lamp = drpt.Sphere(3 * normal + across, 0.5, radiance=5)
    camera = drpt.Camera(normal + 0.3 * along, (0, 0, 0), along, 40, 32, 32)
    below = replace(crumbs(), vertices=crumbs().vertices - 2 * size * normal)
    pictures = [
        drpt.render(drpt.Scene(camera, [square, lamp, *extra]), 16, 1, "explicit").image
        for extra in ((), (below,))
    ]
    assert pictures[0].all()
    assert pictures[1] == pytest.approx(pictures[0], rel=1e-3)


def transformed(turn: Floats, scale: float = 1.0, shift: Floats | None = None) -> drpt.Scene:
    """The small scene, its camera too, turned, scaled and shifted."""
    scene = small_scene()
    camera = scene.camera
    shift = np.zeros(3) if shift is None else shift

    def place(points: object) -> Floats:
        return np.asarray(scale * (np.asarray(points) @ turn.T) + shift)

    shapes: list[Shape] = []
    for shape in scene.shapes:
        if isinstance(shape, drpt.Sphere):
            radius = scale * shape.radius
            shapes.append(drpt.Sphere(place(shape.center), radius, shape.material, shape.radiance))
        else:
            normals = None if shape.normals is None else shape.normals @ turn.T
            vertices = place(shape.vertices)
            shapes.append(drpt.Mesh(vertices, shape.faces, normals, shape.material, shape.radiance))
    eye, target, up = place(camera.eye), place(camera.target), turn @ camera.up
    moved = drpt.Camera(eye, target, up, camera.fov, camera.width, camera.height)
    return drpt.Scene(camera=moved, shapes=shapes)


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(transformed(TURN), id="turned", marks=pytest.mark.slow),
        pytest.param(transformed(np.eye(3), shift=np.array([1e5, -3e4, 777])), id="shifted"),
        pytest.param(transformed(TURN, 3.3e-4, np.array([1.0, 2, 3])), id="tiny and shifted"),
    ],
)
def test_place_and_orientation_do_not_matter(scene: drpt.Scene, reference: Measured) -> None:
    assert_unchanged(scene, reference)


SLOW_BUT_FOR_MIS = [
    mode if mode == "mis" else pytest.param(mode, marks=pytest.mark.slow) for mode in MODES
]


@pytest.mark.parametrize("mode", SLOW_BUT_FOR_MIS)
def test_powers_of_two_change_no_bit(mode: str) -> None:
    picture = drpt.render(small_scene(), 16, 3, mode).image
    for power in (-10, 10):
        scaled = transformed(np.eye(3), 2.0**power)
        assert np.array_equal(drpt.render(scaled, 16, 3, mode).image, picture)


@pytest.mark.parametrize("mode", SLOW_BUT_FOR_MIS)
def test_twice_the_radiance_is_twice_the_picture_to_the_bit(mode: str) -> None:
    picture = drpt.render(small_scene(), 16, 3, mode).image
    brighter = drpt.render(with_radiance(small_scene(), 2), 16, 3, mode).image
    assert picture.any()
    assert np.array_equal(brighter, 2 * picture)


@pytest.mark.parametrize("radiance", [1e-30, 1e29])
def test_extreme_radiances_lose_nothing(radiance: float) -> None:
    power = 2.0 ** round(log2(radiance))
    scene = with_radiance(small_scene(), power)
    found = drpt.render(scene, 16, 2, "explicit")
    plain = drpt.render(small_scene(), 16, 2, "explicit").image
    assert found.non_finite == 0
    # What would be subnormal counts as 0: a ten-millionth of the picture at the lowest radiance.
    assert found.image / power == pytest.approx(plain, rel=1e-5, abs=1e-7 * float(plain.mean()))


def test_samplers_agree(reference: Measured) -> None:
    sobol = measure(small_scene(), 2**21, 2, "mis", reflected=True, sampler="sobol")
    assert_agree(sobol, reference, UNCHANGED)


def test_pass_plans_agree(monkeypatch: pytest.MonkeyPatch, reference: Measured) -> None:
    monkeypatch.setattr("drpt.plan.LAUNCH_PATHS", 2**17)
    monkeypatch.setattr("drpt.plan.LAUNCH_PIXELS", 1000)
    monkeypatch.setattr("drpt.plan.LAUNCH_LANES", 2**13)
    assert_agree(measure(small_scene(), 2**21, 2, "mis", reflected=True), reference, 4 * UNCHANGED)


def test_jitter_moves_samples_off_the_pixels_centres() -> None:
    scene = small_scene()
    soft = drpt.render(scene, 64, 0)
    hard = drpt.render(scene, 1, 0, jitter=False)
    colours = {tuple(c) for c in hard.image.reshape(-1, 3).tolist()}
    assert len(colours) <= 3  # black and the two lights
    assert len({tuple(c) for c in soft.image.reshape(-1, 3).tolist()}) > 10
    many = drpt.render(scene, 7, 0, jitter=False, seed=3)
    assert np.array_equal(many.image, hard.image)
