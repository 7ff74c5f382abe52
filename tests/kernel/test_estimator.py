"""Names of modes, what they do, and what of a scene a kernel needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt.kernel.estimator import Features, Mode, feature_facts, layout_facts
from drpt.kernel.launch import prepare
from drpt.kernel.primitives import FACET_LIMIT, make_primitives
from drpt.kernel.sphere_grid import SphereGrid
from drpt.kernel.sphere_tree import SphereTree
from drpt.kernel.spheres import CROWDED_LIMIT
from tests.conftest import TYPES

if TYPE_CHECKING:
    from drpt.kernel.estimator import Fact
    from drpt.scene import Shape

CAMERA = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8)
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
DIFFUSE, PHONG = drpt.Diffuse(0.5), drpt.Phong(0.5, 9)
BALL = drpt.Sphere((0, 0, 3), 1, material=DIFFUSE)
TRIANGLE = drpt.Mesh(CORNERS, [[0, 1, 2]], material=DIFFUSE)
SMOOTH = drpt.Mesh(np.add(CORNERS, (0, 0, 4)), [[0, 1, 2]], [[0, 0, 1]] * 3, material=PHONG)
CUBE = [[x, y, z] for x in (-9, 9) for y in (-9, 9) for z in (-9, 9)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
HALVES = [half for a, b, c, d in QUADS for half in ((a, b, c), (a, c, d))]
ROOM = drpt.Mesh(CUBE, HALVES, material=DIFFUSE)
LAMP = drpt.Sphere((0, 0, 7), 1, radiance=1)
PANEL = drpt.Mesh(np.add(CORNERS, (0, 0, 5)), [[0, 1, 2]], radiance=1)

HOUSE = ROOM, TRIANGLE, LAMP
MANY = FACET_LIMIT + 1
LAYERS = np.concatenate([np.add(CORNERS, (0, 0, z)) for z in range(MANY)])
STRIPES = drpt.Mesh(LAYERS, np.arange(3 * MANY).reshape(-1, 3), material=DIFFUSE)
PANELS = drpt.Mesh(LAYERS, STRIPES.faces, radiance=1)
BALLS = [drpt.Sphere((3 * x, 0, 0), 1, material=DIFFUSE) for x in range(CROWDED_LIMIT + 1)]
PIT = *BALLS, drpt.Sphere((0, 0, 20), 9, radiance=1)
HEAPS = [drpt.Sphere((1e4 * (x % 2) + x / 9, 0, 0), 1, DIFFUSE) for x in range(CROWDED_LIMIT + 1)]
FEW = "2 spheres, few enough to be met one by one"
TOO_MANY = "too many to be met one by one"
IMPLICIT, EXPLICIT = {"mode": "implicit"}, {"mode": "explicit"}
GUIDED: dict[str, Any] = {"mode": "guided"}
ONE_SPHERE = "light samples of one sphere have all of its light on diffuse surfaces"
NO_FACETS = "there are no facets, which alone have patches"
NOTHING_FILLS = "there are no facets, which alone fill pixels"
TOO_MUCH = "too much may stand before the facets"
AT_ONCE = "lanes follow camera rays and others at once"
NOT_LESS = "the noise is not expected to become less"
BOTH = "mode guided finds lights in two ways"
ONE_BOUNCE = "1 bounce: nothing comes after the direct light"

COURSE_NAMES = {
    "IMPLICIT_UNIFORM_SAMPLING": "implicit-uniform",
    "IMPLICIT_BRDF_SAMPLING": "implicit",
    "EXPLICIT_UNIFORM_SAMPLING": "explicit-uniform",
    "EXPLICIT_LIGHT_BRDF_SAMPLING": "explicit",
}


def features(*shapes: Shape, bounces: int = 2, mode: str = "mis") -> set[str]:
    """Names of the features that the kernel of a scene has."""
    primitives = make_primitives(drpt.Scene(camera=CAMERA, shapes=shapes).shapes)
    found = feature_facts(primitives, bounces, Mode(mode))
    return {name for name, fact in found.items() if fact.holds}


def facts(
    *shapes: Shape, bounces: int = 2, mode: str = "mis", worthwhile: bool = True
) -> dict[str, Fact]:
    """All that is told of the kernel of a scene."""
    primitives = make_primitives(drpt.Scene(camera=CAMERA, shapes=shapes).shapes)
    what = primitives, bounces, Mode(mode)
    told = feature_facts, layout_facts
    features, layout = (facts_of(*what, worthwhile=worthwhile) for facts_of in told)
    return features | layout


def test_there_are_six_modes() -> None:
    names = ["implicit-uniform", "implicit", "explicit-uniform", "explicit", "mis", "guided"]
    assert [str(mode) for mode in Mode] == names
    assert drpt.Mode is Mode
    assert all(Mode(name) == name for name in names)


@pytest.mark.parametrize(("course", "name"), COURSE_NAMES.items())
def test_the_names_of_the_course_are_the_same_modes(course: str, name: str) -> None:
    assert Mode(course) is Mode(name)
    assert getattr(Mode, course) is Mode(name)
    assert Mode[course] is Mode(name)


@pytest.mark.parametrize("name", ["", "EXPLICIT ", "brdf", "samples_brdf", "value", 3, None])
def test_other_names_are_refused(name: object) -> None:
    with pytest.raises(ValueError, match="is not a valid Mode"):
        Mode(name)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mode", "samples_brdf", "samples_lights", "samples_cones"),
    [
        ("implicit-uniform", False, False, False),
        ("implicit", True, False, False),
        ("explicit-uniform", False, True, False),
        ("explicit", True, True, True),
        ("mis", True, True, True),
        ("guided", True, True, True),
    ],
)
def test_what_modes_do(
    mode: str, samples_brdf: bool, samples_lights: bool, samples_cones: bool
) -> None:
    found = Mode(mode)
    assert found.samples_brdf is samples_brdf
    assert found.samples_lights is samples_lights
    assert found.samples_cones is samples_cones


def test_a_scene_of_everything_has_all_features() -> None:
    primitives = make_primitives((BALL, LAMP))
    names = feature_facts(primitives, 2, Mode.MIS).keys()
    everything = names - {"shared_rays", "regeneration"}
    mirror = drpt.Sphere((0, 3, 3), 1, material=drpt.Mirror(0.5))
    assert features(BALL, TRIANGLE, SMOOTH, mirror, LAMP, PANEL, mode="guided") == everything


def test_spheres_alone() -> None:
    found = features(BALL, LAMP)
    assert found == {
        "spheres",
        "diffuse",
        "emission",
        "direct_light",
        "sphere_light_samples",
        "mis",
    }


@pytest.mark.parametrize(
    ("mode", "bounces", "shapes", "expected"),
    [
        ("mis", 2, [ROOM, LAMP], True),
        ("explicit", 5, [ROOM, LAMP], True),
        ("explicit-uniform", 2, [ROOM, LAMP], False),  # noise of points on the light
        ("implicit", 2, [ROOM, LAMP], False),
        ("mis", 1, [ROOM, LAMP], False),  # all the noise is of the first vertex
        ("mis", 2, [ROOM, LAMP, PANEL], False),  # noise of the choice
        ("mis", 2, [ROOM, PANEL], False),
        ("mis", 2, [LAMP], False),  # outdoors
        ("mis", 2, [ROOM, drpt.Sphere((0, 0, 99), 1, radiance=1)], False),
    ],
)
def test_rays_are_shared_where_direct_light_has_little_noise(
    mode: str, bounces: int, shapes: list[Shape], expected: bool
) -> None:
    found = features(BALL, *shapes, bounces=bounces, mode=mode)
    assert ("shared_rays" in found) is expected


def test_triangles_alone() -> None:
    found = features(TRIANGLE, PANEL)
    assert found == {
        "triangles",
        "covered_pixels",
        "diffuse",
        "emission",
        "direct_light",
        "triangle_light_samples",
        "mis",
    }


def test_each_feature_needs_its_cause() -> None:
    assert "phong" not in features(BALL, LAMP)
    assert "diffuse" not in features(SMOOTH, LAMP)
    assert "interpolated_normals" in features(SMOOTH, LAMP)
    assert "interpolated_normals" not in features(SMOOTH, LAMP, bounces=0)
    assert "light_choice" in features(BALL, LAMP, PANEL)
    assert "light_choice" not in features(BALL, LAMP, PANEL, mode="implicit")


@pytest.mark.parametrize("mode", Mode)
def test_without_light_nothing_is_left(mode: str) -> None:
    assert features(BALL, TRIANGLE, SMOOTH, mode=mode) == set()
    assert features(BALL, drpt.Sphere((0, 0, 7), 1, radiance=0), mode=mode) == set()


@pytest.mark.parametrize("mode", Mode)
def test_without_bounces_or_surfaces_only_emission_is_left(mode: str) -> None:
    emission = {"spheres", "triangles", "emission"}
    covered = features(BALL, TRIANGLE, LAMP, bounces=0, mode=mode)
    assert covered == emission | {"covered_pixels"}
    assert features(LAMP, PANEL, mode=mode) == emission


@pytest.mark.parametrize("mode", ["implicit", "implicit-uniform"])
def test_implicit_modes_sample_no_light(mode: str) -> None:
    assert not features(BALL, LAMP, mode=mode) & {"direct_light", "sphere_light_samples", "mis"}


def test_mis_weighs_and_so_does_guided_without_a_guide() -> None:
    def weighing(*shapes: Shape) -> list[Mode]:
        return [mode for mode in Mode if "mis" in features(*shapes, mode=mode)]

    assert weighing(*HOUSE) == [Mode.MIS]
    assert weighing(BALL, LAMP) == [Mode.MIS, Mode.GUIDED]


def test_every_feature_is_told() -> None:
    assert facts(BALL).keys() > set(Features.__dataclass_fields__)


@pytest.mark.parametrize(
    ("name", "told", "shapes", "settings"),
    [
        ("spheres", (True, "2 spheres"), [BALL, LAMP], {}),
        ("triangles", (False, "there is no polygon"), [BALL, LAMP], {}),
        ("triangles", (True, "7 polygons"), [ROOM, TRIANGLE, LAMP], {}),
        ("interpolated_normals", (True, "1 smooth triangle"), [SMOOTH, LAMP], {}),
        ("phong", (False, "there is no Phong surface"), [BALL, LAMP], {}),
        ("phong", (False, "there is no light"), [SMOOTH], {}),
        ("diffuse", (False, "light does not bounce"), [BALL, LAMP], {"bounces": 0}),
        ("diffuse", (False, "nothing reflects"), [LAMP], {}),
        ("emission", (True, "2 lights"), [LAMP, PANEL], {}),
        ("direct_light", (False, "mode implicit samples no light"), [BALL, LAMP], IMPLICIT),
        ("light_choice", (False, "there is one light"), [BALL, LAMP], {}),
        ("light_choice", (True, "one of 2 lights at every vertex"), [BALL, LAMP, PANEL], {}),
        ("mis", (False, "mode explicit counts no light that it runs into"), [BALL, LAMP], EXPLICIT),
        ("mis", (False, ONE_SPHERE), [*HOUSE], GUIDED),
        ("mis", (True, BOTH), [TRIANGLE, LAMP], GUIDED),
        ("mis", (True, BOTH), [BALL, LAMP], GUIDED),
        ("mis", (True, BOTH), [*HOUSE], GUIDED | {"bounces": 1}),
        ("mis", (True, BOTH), [*HOUSE], GUIDED | {"worthwhile": False}),
        ("mis", (True, BOTH), [TRIANGLE, LAMP, PANEL], GUIDED),
        ("mis", (True, BOTH), [TRIANGLE, SMOOTH, LAMP], GUIDED),
        ("guiding", (True, "mode guided goes where patches reflect much light"), [*HOUSE], GUIDED),
        ("guiding", (False, "mode mis follows the BRDF"), [*HOUSE], {}),
        ("guiding", (False, NO_FACETS), [BALL, LAMP], GUIDED),
        ("guiding", (False, NO_FACETS), [STRIPES, LAMP], GUIDED),
        ("guiding", (False, "no facet is diffuse"), [BALL, SMOOTH, LAMP], GUIDED),
        ("guiding", (False, ONE_BOUNCE), [*HOUSE], GUIDED | {"bounces": 1}),
        ("guiding", (False, NOT_LESS), [*HOUSE], GUIDED | {"worthwhile": False}),
        ("covered_pixels", (True, "what fills a pixel need not be looked for"), [*HOUSE], {}),
        ("covered_pixels", (False, NOTHING_FILLS), [BALL, LAMP], {}),
        ("covered_pixels", (False, TOO_MUCH), [ROOM, *BALLS, LAMP], {}),
        ("covered_pixels", (False, TOO_MUCH), [ROOM, PANELS, LAMP], {}),
        ("covered_pixels", (False, AT_ONCE), [TRIANGLE, LAMP], {"bounces": 3}),
        ("regeneration", (False, "the scene is a room"), [ROOM, LAMP], {"bounces": 3}),
        ("regeneration", (False, "2 bounces, less than 3"), [BALL, LAMP], {}),
        ("regeneration", (True, "an open scene, up to 3 bounces"), [BALL, LAMP], {"bounces": 3}),
        ("shared_rays", (False, "there are 2 lights"), [ROOM, LAMP, PANEL], {}),
        ("shared_rays", (False, "the light is a triangle"), [ROOM, PANEL], {}),
        ("shared_rays", (False, "the scene is open"), [BALL, LAMP], {}),
        ("merged_triangles", (True, "6 of 7 facets are of several triangles"), [*HOUSE], {}),
        ("solids", (True, "1 convex body of 6 facets"), [*HOUSE], {}),
        ("solids", (False, "no facets are a convex body"), [TRIANGLE, LAMP], {}),
        ("mesh", (False, "7 facets, not more than 64, or 24 that emit"), [*HOUSE], {}),
        ("mesh", (True, "65 triangles, more than 64, or 24 that emit"), [STRIPES, LAMP], {}),
        ("mesh", (True, "65 triangles, more than 64, or 24 that emit"), [BALL, PANELS], {}),
        ("sphere_grid", (False, FEW), [BALL, LAMP], {}),
        ("sphere_grid", (True, f"66 spheres, {TOO_MANY}"), [*BALLS, LAMP], {}),
        ("sphere_grid", (True, f"66 spheres, 1 of which stands out, {TOO_MANY}"), [*PIT], {}),
        ("sphere_grid", (False, "they are crowded"), [*HEAPS, LAMP], {}),
        ("sphere_tree", (False, FEW), [BALL, LAMP], {}),
        ("sphere_tree", (False, "they are not crowded"), [*BALLS, LAMP], {}),
        ("sphere_tree", (True, f"66 spheres, {TOO_MANY}, and crowded"), [*HEAPS, LAMP], {}),
        ("facet_shadows", (True, "1 of 7 facets can stand before a light"), [*HOUSE], {}),
        ("facet_shadows", (False, "0 of 6 facets can stand before a light"), [ROOM, LAMP], {}),
        ("facet_shadows", (False, "mode implicit samples no light"), [*HOUSE], IMPLICIT),
        ("last_ray", (True, "mode mis counts the light that it runs into"), [BALL, LAMP], {}),
        (
            "last_ray",
            (False, "mode explicit counts no light that it runs into"),
            [BALL, LAMP],
            EXPLICIT,
        ),
    ],
)
def test_reasons(
    name: str, told: tuple[bool, str], shapes: list[Shape], settings: dict[str, Any]
) -> None:
    assert facts(*shapes, **settings)[name] == told


@pytest.mark.parametrize(
    "shapes",
    [
        [*HOUSE],
        [STRIPES, LAMP],
        [*BALLS, LAMP],
        [*HEAPS, LAMP],
        [*PIT],
        [BALL, PANELS],
        [ROOM, LAMP],
    ],
)
def test_what_is_told_is_on_the_device(shapes: list[Shape]) -> None:
    told = {name: fact.holds for name, fact in facts(*shapes).items()}
    scene = prepare(tuple(shapes), TYPES)[1].geometry
    assert told["mesh"] is (scene.mesh is not None or scene.light_mesh is not None)
    assert told["sphere_grid"] is isinstance(scene.many_spheres, SphereGrid)
    assert told["sphere_tree"] is isinstance(scene.many_spheres, SphereTree)
    assert told["solids"] is (len(scene.solids) > 0)
    loose = any(blocks for _, _, blocks in scene.loose_facets)
    assert told["facet_shadows"] is (loose or any(solid.shading for solid in scene.solids))
