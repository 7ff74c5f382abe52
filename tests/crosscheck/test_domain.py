from typing import Any

import numpy as np
import pytest

from drpt import Camera, Diffuse, Mesh, Scene, Sphere, load_scene
from drpt.crosscheck.convert import to_mitsuba
from drpt.crosscheck.domain import (
    MAX_SINE,
    MIN_SINE,
    SERIES_SINE,
    UNIT,
    VANISHING_SINE,
    Caveat,
    caveats,
    emulated_error,
    light_error,
    ray_offset,
    tolerance,
)
from drpt.scene import Shape, builtin_names
from tests.oracle.arrays import Floats

COUNT = 1_000_000
TIGHT = 0.99  # share of the bound that random lights reach where the cancellation dominates
PICTURE = 1e-5  # relative: rounding and noise of a picture, 1e-6, and of sums in Mitsuba's film

CAMERA = Camera((1, 1, 0), (0, 0, 0), (0, 1, 0), 1e-3, 16, 16)
FLOOR = Mesh(
    [(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], [(0, 1, 2), (0, 2, 3)], None, Diffuse(1)
)
LAMP = Sphere((0, 2, 0), 0.5, radiance=1)


def lights(count: int, low: float, high: float) -> tuple[Any, Any]:
    """Radii and distances of float32, half of the distances powers of two."""
    rng = np.random.default_rng(7)
    distance = 2.0 ** np.where(
        np.arange(count) % 2, rng.integers(-20, 20, count), rng.uniform(-20, 20, count)
    )
    sine = np.exp(rng.uniform(np.log(low), np.log(high), count))
    return (sine * distance).astype(np.float32), distance.astype(np.float32)


def sines(radius: Any, distance: Any) -> Floats:
    return np.asarray(np.asarray(radius, np.float64) / distance)


@pytest.mark.parametrize(
    ("low", "high", "reached"),
    [
        (VANISHING_SINE, 0.01, TIGHT),
        (0.01, SERIES_SINE, 0.5),  # here the bound also covers lights that are seen in part
        (SERIES_SINE, 0.1, 0.9),
        (0.1, MAX_SINE, 0.0),
    ],
)
def test_no_rounding_exceeds_the_bound(low: float, high: float, reached: float) -> None:
    radius, distance = lights(COUNT // 4, low * 1.0001, high * 0.9999)
    share = np.abs(emulated_error(radius, distance)) / light_error(sines(radius, distance))
    assert reached < share.max() <= 1


def test_powers_of_two_are_within_the_bound() -> None:
    radius = 2.0 ** np.arange(-12, 0)
    error = np.abs(emulated_error(radius, np.ones(12)))
    assert (error <= light_error(radius)).all()


def test_the_bound_falls() -> None:
    bound = light_error(np.geomspace(VANISHING_SINE * 1.0001, MAX_SINE, 10_000))
    assert (np.diff(bound) < 0).all()
    assert light_error(MIN_SINE) == pytest.approx(1e-4, rel=0.05)
    assert light_error(VANISHING_SINE) == np.inf


def test_lights_vanish_only_where_the_bound_is_infinite() -> None:
    radius, distance = lights(10_000, 0.999 * VANISHING_SINE, 1.001 * VANISHING_SINE)
    vanished = emulated_error(radius, distance) == -1
    bound = light_error(sines(radius, distance))
    assert vanished.any()
    assert np.isinf(bound[vanished]).all()
    assert (emulated_error(1e-5, 1.0) == -1).all()


def sphere(mi: Any, radius: float) -> Any:
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
    return mi.load_dict({"type": "sphere", "radius": radius, "emitter": emitter})


@pytest.mark.parametrize("radius", [0.37, 1.0, 25.1])
def test_mitsuba_computes_what_is_emulated(mi: Any, radius: float) -> None:
    rng = np.random.default_rng(3)
    distance = (radius / np.exp(rng.uniform(np.log(1e-4), np.log(MAX_SINE), COUNT // 10))).astype(
        np.float32
    )
    pdf = density(mi, sphere(mi, radius), distance[:, None] * np.array([0, 0, 1], np.float32))
    np.testing.assert_array_equal(light(pdf, radius, distance), emulated_error(radius, distance))


def test_mitsuba_keeps_the_bound_from_all_sides(mi: Any) -> None:
    rng = np.random.default_rng(4)
    direction = rng.normal(size=(COUNT // 10, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    low = 1.0001 * VANISHING_SINE
    sine = np.exp(rng.uniform(np.log(low), np.log(0.9999 * MAX_SINE), (COUNT // 10, 1)))
    points = (direction / sine).astype(np.float32)
    distance = np.linalg.norm(points.astype(np.float64), axis=1)
    bound = light_error(1 / distance)
    shape = sphere(mi, 1)
    for sampled in (True, False):
        error = light(density(mi, shape, points, sampled=sampled), 1, distance)
        assert (np.abs(error) <= bound).all()


def density(mi: Any, shape: Any, points: Any, *, sampled: bool = False) -> Any:
    """Mitsuba's density of directions from points (n, 3) to a light."""
    import drjit as dr

    interaction = dr.zeros(mi.Interaction3f, len(points))
    interaction.p = mi.Point3f(points.T)
    sample = shape.sample_direction(interaction, mi.Point2f(0.3, 0.6))
    return (sample.pdf if sampled else shape.pdf_direction(interaction, sample)).numpy()


def light(pdf: Any, radius: float, distance: Any) -> Floats:
    """Relative error of 1 / density of the light of this radius in all directions."""
    s = sines(np.float32(radius), distance)
    cap = s**2 / (1 + np.sqrt((1 - s) * (1 + s)))
    return np.asarray(1 / (2 * np.pi * cap * pdf) - 1)


@pytest.mark.parametrize("radius", [4e-4, 0.002, 0.01])
def test_a_picture_is_off_by_what_is_emulated(mi: Any, radius: float) -> None:
    scene = Scene(CAMERA, [FLOOR, Sphere((0, 1, 0), radius, radiance=1)])
    picture = mi.render(to_mitsuba(scene, 1), spp=64).numpy().mean(dtype=np.float64)
    error = picture / radius**2 - 1
    assert error == pytest.approx(float(emulated_error(radius, 1.0)), abs=PICTURE)
    assert abs(error) > 10 * PICTURE
    assert abs(error) <= tolerance(scene)


PLAUSIBLE = {
    "cornell-box": 1.5e-5,
    "cornell-box-glossy": 1.5e-5,
    "cornell-box-medium-light": 4.6e-5,
    "cornell-box-small-light": 5.5e-4,
    "furnace": 4.5e-6,
    "many-lights": 3.4e-3,
    "spheres": 2.0e-3,
    "veach": 3.8e-3,
}


def test_every_builtin_scene_has_a_tolerance() -> None:
    assert {name: tolerance(load_scene(name)) for name in builtin_names()} == pytest.approx(
        PLAUSIBLE, rel=0.03
    )


@pytest.mark.parametrize("name", builtin_names())
def test_caveats_are_of_lights_below_the_domain(name: str) -> None:
    scene = load_scene(name)
    found = caveats(scene)
    assert bool(found) == (tolerance(scene) > light_error(MIN_SINE))
    assert all(c.sine < MIN_SINE and scene.shapes[c.shape].is_light for c in found)
    assert all(c.error <= tolerance(scene) for c in found)


def test_a_caveat_is_a_sentence() -> None:
    (caveat,) = caveats(load_scene("cornell-box-small-light"))
    assert str(caveat) == (
        "shapes[0]: a sphere light of radius 10 shines as far as 651.1, at radius / distance 0.015:"
        " Mitsuba's picture may be off by 0.055 % where it alone lights it"
    )
    black = str(Caveat(2, 1e-5, 1, np.inf))
    assert black.endswith("radius / distance 1e-05: in Mitsuba's picture it may be black there")


@pytest.mark.parametrize(
    "shapes",
    [
        [FLOOR],
        [LAMP],
        [LAMP, Sphere((900, 0, 0), 1, radiance=1)],
        [LAMP, Sphere((900, 0, 0), 1, radiance=0)],
        [FLOOR, Mesh(FLOOR.vertices, FLOOR.faces, radiance=1)],
    ],
)
def test_without_light_of_spheres_on_surfaces_nothing_is_off(shapes: list[Shape]) -> None:
    scene = Scene(CAMERA, shapes)
    assert tolerance(scene) == 0
    assert caveats(scene) == []


def test_the_farthest_surface_counts() -> None:
    corner = np.sqrt(1 + 4 + 1)
    assert tolerance(Scene(CAMERA, [FLOOR, LAMP])) == light_error(0.5 / corner)
    tiny = Scene(CAMERA, [FLOOR, LAMP, Sphere((0, 2, 0), 1e-5, radiance=1)])
    assert tolerance(tiny) == np.inf
    assert [(c.shape, c.error) for c in caveats(tiny)] == [(2, np.inf)]


def test_a_surface_within_the_light_is_no_error() -> None:
    dot = Mesh([LAMP.center] * 3, [(0, 1, 2)], material=Diffuse(1))
    assert tolerance(Scene(CAMERA, [LAMP, dot])) < light_error(0.5)


@pytest.mark.parametrize("between", [3.0, 30.0, 1.5, 0.0])
def test_the_reach_on_a_sphere_is_that_of_its_lit_points(between: float) -> None:
    ball, lamp = Sphere((0, 0, 0), 2, Diffuse(1)), Sphere((between, 0, 0), 0.25, radiance=1)
    theta = np.linspace(0, np.pi, 100_001)
    towards = between - 2 * np.cos(theta)
    distance = np.hypot(towards, 2 * np.sin(theta))
    outside = towards * np.cos(theta) - 2 * np.sin(theta) ** 2 > -lamp.radius
    lit = distance if between < ball.radius else distance[outside]
    scene = Scene(CAMERA, [ball, lamp])
    assert tolerance(scene) == pytest.approx(float(light_error(0.25 / lit.max())), rel=1e-4)


@pytest.mark.parametrize("point", [(0.0, 0, 0), (1e-6, 0, 2e-6), (3.0, -400, 7), (1e4, 1e4, 1e4)])
def test_mitsubas_rays_start_off_their_surface(mi: Any, point: tuple[float, ...]) -> None:
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.p, si.n = mi.Point3f(*point), mi.Normal3f(0, 0, 1)
    start = np.array(si.spawn_ray(mi.Vector3f(0, 0, 1)).o).ravel()[2]
    expected = 1500 * UNIT * (1 + np.abs(point).max())
    assert start - point[2] == pytest.approx(expected, rel=0.02)  # float32 at 1e4


@pytest.mark.parametrize(
    ("scale", "shift", "known"), [(1, 0, True), (1e-3, 0, False), (1, 99, False)]
)
def test_rays_must_not_start_far_off_their_surfaces(
    scale: float, shift: float, known: bool
) -> None:
    floor = Mesh(scale * FLOOR.vertices + [shift, 0, 0], FLOOR.faces, None, Diffuse(1))
    lamp = Sphere((shift, 2 * scale, 0), 0.5 * scale, radiance=1)
    scene = Scene(CAMERA, [floor, lamp])
    reach = scale * 2.5 + shift
    assert ray_offset(scene) == pytest.approx(1500 * UNIT * (1 + reach) / (2.5 * scale), rel=0.02)
    assert np.isfinite(tolerance(scene)) == known
