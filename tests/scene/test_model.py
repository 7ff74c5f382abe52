import math
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drpt.scene import (
    Camera,
    Diffuse,
    Mesh,
    Phong,
    Scene,
    SceneError,
    Sphere,
    material_from_brdf_params,
)

GREY = Diffuse(0.5)
TRIANGLE = np.eye(3)
FACES = [[0, 1, 2]]
CAMERA: dict[str, Any] = {
    "eye": (0, 0, 5),
    "target": (0, 0, 0),
    "up": (0, 1, 0),
    "fov": 40,
    "width": 4,
    "height": 3,
}
NOT_NUMBERS = ["1", True, None, math.nan, math.inf, -math.inf, 1j, [], {}, 10**400]
UNIT = 1e-15  # length of a normal: some roundings of float64


def camera(**changes: object) -> Camera:
    return Camera(**CAMERA | changes)


def refusal(field: str, make: Any, *args: object, **kwargs: object) -> str:
    """Return the one line that a `SceneError` about `field` says."""
    with pytest.raises(SceneError) as caught:
        make(*args, **kwargs)
    assert caught.value.field == field
    text = str(caught.value)
    assert text.startswith(field)
    assert "\n" not in text
    assert len(text) < 250
    return text


def test_scalars_stand_for_grey() -> None:
    assert Diffuse(0.25).albedo == (0.25, 0.25, 0.25)
    assert Phong(albedo=1, exponent=7) == Phong((1, 1, 1), 7.0)
    assert Sphere((0, 0, 0), 1, radiance=19.5).radiance == (19.5, 19.5, 19.5)


@pytest.mark.parametrize("kind", [tuple, list, np.array, np.float32])
def test_points_and_colours_are_tuples_of_floats(kind: Any) -> None:
    center: Any = kind([1, 2, 3])
    radius: Any = np.float32(2)
    sphere = Sphere(center=center, radius=radius, material=Diffuse(kind([0, 1, 1])))
    assert sphere == Sphere((1.0, 2.0, 3.0), 2.0, Diffuse((0.0, 1.0, 1.0)))
    assert all(type(x) is float for x in (*sphere.center, sphere.radius))


def test_arrays_without_dimensions_are_numbers() -> None:
    assert Diffuse(np.array(0.5)) == GREY
    assert Sphere((0, 0, 0), np.array(2), GREY).radius == 2.0  # type: ignore[arg-type]


def test_any_real_number_is_a_number() -> None:
    assert Sphere((0, 0, 0), Fraction(1, 4), GREY).radius == 0.25  # type: ignore[arg-type]


def test_models_are_immutable_and_hashable() -> None:
    scene = Scene(camera(), [Sphere((0, 0, 0), 1, GREY), Mesh(TRIANGLE, FACES, material=GREY)])
    with pytest.raises(FrozenInstanceError):
        scene.camera.fov = 3  # type: ignore[misc]
    assert isinstance(scene.shapes, tuple)
    assert hash(scene) == hash(pickle.loads(pickle.dumps(scene)))
    assert scene == pickle.loads(pickle.dumps(scene))


def test_replace_checks_again() -> None:
    assert replace(camera(), width=800).width == 800
    assert camera(width=np.int64(800)) == camera(width=800)
    refusal("width", replace, camera(), width=0)


class TestResized:
    @pytest.mark.parametrize(
        ("sides", "size"),
        [
            ({}, (160, 90)),
            ({"width": 16}, (16, 9)),
            ({"width": 100}, (100, 56)),
            ({"width": 1}, (1, 1)),
            ({"height": 180}, (320, 180)),
            ({"width": 7, "height": 5}, (7, 5)),
        ],
    )
    def test_one_side_alone_keeps_the_aspect_ratio(
        self, sides: dict[str, int], size: tuple[int, int]
    ) -> None:
        scene = Scene(camera(width=160, height=90), [Sphere((0, 0, 0), 1, radiance=1)])
        assert scene.resized(**sides) == replace(
            scene, camera=camera(width=size[0], height=size[1])
        )

    @pytest.mark.parametrize(
        ("sides", "field"),
        [({"width": 0}, "width"), ({"height": 2.5}, "height"), ({"width": 65536}, "height")],
    )
    def test_sides_that_no_camera_has_are_refused(self, sides: dict[str, Any], field: str) -> None:
        scene = Scene(camera(width=2, height=3), [Sphere((0, 0, 0), 1, radiance=1)])
        refusal(field, scene.resized, **sides)


def test_mesh_arrays_are_read_only_copies() -> None:
    vertices = np.asfortranarray(np.eye(3))
    mesh = Mesh(vertices, np.array(FACES, np.uint64), normals=2 * vertices, radiance=1)
    vertices[:] = 7
    for array in (mesh.vertices, mesh.faces, mesh.normals):
        assert array is not None
        assert array.flags.c_contiguous
        assert not array.flags.writeable
        assert array.tolist() in (np.eye(3).tolist(), FACES)


@given(st.lists(st.tuples(*3 * [st.floats(-1e9, 1e9)]), min_size=3, max_size=3))
def test_normals_have_unit_length_and_stay_as_they_are(normals: list[Any]) -> None:
    if not np.abs(normals).max(axis=1).all():
        refusal_of_zero = pytest.raises(SceneError, match="longer than 0")
        with refusal_of_zero:
            Mesh(TRIANGLE, FACES, normals, GREY)
        return
    mesh = Mesh(TRIANGLE, FACES, normals, GREY)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=0, atol=UNIT)  # type: ignore[arg-type]
    assert Mesh(TRIANGLE, FACES, mesh.normals, GREY) == mesh


@pytest.mark.parametrize(
    "other",
    [
        Mesh(TRIANGLE + 1e-9, FACES, material=GREY),
        Mesh(TRIANGLE, [[0, 2, 1]], material=GREY),
        Mesh(TRIANGLE, FACES * 2, material=GREY),
        Mesh(TRIANGLE, FACES, TRIANGLE, GREY),
        Mesh(TRIANGLE, FACES, material=Diffuse(0.4)),
        Mesh(TRIANGLE, FACES, radiance=0.5),
        Sphere((0, 0, 0), 1, GREY),
    ],
)
def test_unequal_shapes(other: object) -> None:
    mesh = Mesh(TRIANGLE, FACES, material=GREY)
    assert mesh == Mesh(TRIANGLE.copy(), FACES, material=Diffuse(0.5))
    assert mesh != other


def test_repr_of_a_mesh_is_short() -> None:
    mesh = Mesh(TRIANGLE, FACES, TRIANGLE, radiance=2)
    assert repr(mesh) == "Mesh(3 vertices, 1 faces, with normals, radiance=(2.0, 2.0, 2.0))"


def test_areas_and_triangles_without_area() -> None:
    mesh = Mesh([(0, 0, 0), (2, 0, 0), (0, 3, 0)], [[0, 1, 2], [0, 1, 1]], radiance=1)
    assert mesh.areas().tolist() == [3, 0]


def test_lights() -> None:
    assert Sphere((0, 0, 0), 1, radiance=(0, 1e-30, 0)).is_light
    assert not Sphere((0, 0, 0), 1, radiance=0).is_light
    assert not Mesh(TRIANGLE, [[0, 0, 0]], radiance=0).is_light
    assert not Sphere((0, 0, 0), 1, GREY).is_light


def test_material_from_brdf_params() -> None:
    assert material_from_brdf_params((0.1, 0.2, 0.3, 1)) == Diffuse((0.1, 0.2, 0.3))
    assert material_from_brdf_params(np.array([0.1, 0.2, 0.3, 50])) == Phong((0.1, 0.2, 0.3), 50)
    for bad in [(1, 1, 1), 5, "1111", np.array(1.0)]:
        refusal("brdf_params", material_from_brdf_params, bad)
    refusal("exponent", material_from_brdf_params, (1, 1, 1, -1))
    refusal("exponent", material_from_brdf_params, np.ones((4, 2)))
    refusal("albedo", material_from_brdf_params, (1, 1, 2, 1))


@pytest.mark.parametrize("value", [-1, 0, 1e-10, 1e10, np.float64(-2), *NOT_NUMBERS])
def test_bad_radius(value: object) -> None:
    refusal("radius", Sphere, (0, 0, 0), value, GREY)


def test_a_refusal_names_value_and_allowed_range() -> None:
    text = refusal("radius", Sphere, (0, 0, 0), -1, GREY)
    assert text == "radius: -1 is not allowed; it must be a number > 0 (from 1e-9 to 1e9)"
    assert "this int is" in refusal("radius", Sphere, (0, 0, 0), 10**5000, GREY)
    assert "-2.0 is" in refusal("radius", Sphere, (0, 0, 0), np.float64(-2), GREY)


@pytest.mark.parametrize(
    "value",
    [
        *(-0.01, 1.01, (0, 0), (0, 0, 2), (0, 0, "1"), "abc", np.array(2), np.array(True)),
        *({0.1, 0.2, 0.3}, {0: 0, 1: 0, 0.5: 0}, iter((0, 0, 0)), np.zeros((3, 3)), b"\0\0\0"),
        *NOT_NUMBERS,
    ],
)
@pytest.mark.parametrize("make", [Diffuse, lambda albedo: Phong(albedo, 2)])
def test_bad_albedo(make: Any, value: object) -> None:
    refusal("albedo", make, value)


@pytest.mark.parametrize("value", [-1e-9, 1e9, *NOT_NUMBERS])
def test_bad_exponent(value: object) -> None:
    refusal("exponent", Phong, 0.5, value)


@pytest.mark.parametrize(
    "value", [-1, 1e31, 1e-31, (1, 1, -1), *(x for x in NOT_NUMBERS if x is not None)]
)
def test_bad_radiance(value: object) -> None:
    refusal("radiance", Sphere, (0, 0, 0), 1, radiance=value)
    refusal("radiance", Mesh, TRIANGLE, FACES, radiance=value)


@pytest.mark.parametrize(
    "value",
    [(0, 0), (0, 0, 2e9), (0, 0, math.nan), (0, 0, False), 3, "abc", np.array(5.0), {1, 2, 3}],
)
@pytest.mark.parametrize("field", ["eye", "target", "up"])
def test_bad_points(field: str, value: object) -> None:
    refusal(field, camera, **{field: value})
    refusal("center", Sphere, value, 1, GREY)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("target", (0, 0, 5)),
        ("target", (0, 0, 5 + 1e-12)),
        ("up", (0, 0, 0)),
        ("up", (0, 0, -3)),
        ("up", (0, 1e-8, 1)),
        *(("fov", x) for x in (0, 180, -20, 1e9, *NOT_NUMBERS)),
        *(("width", x) for x in (0, -1, 65537, 2.0, *NOT_NUMBERS)),
        *(("height", x) for x in (0, -1, 65537, np.float64(2), *NOT_NUMBERS)),
    ],
)
def test_bad_camera(field: str, value: object) -> None:
    refusal(field, camera, **{field: value})


def test_a_shape_has_one_of_material_and_radiance() -> None:
    assert "neither" in refusal("", Sphere, (0, 0, 0), 1)
    assert "both" in refusal("", Mesh, TRIANGLE, FACES, None, GREY, 0)
    refusal("material", Sphere, (0, 0, 0), 1, 0.5)


@pytest.mark.parametrize(
    ("field", "vertices"),
    [
        ("vertices", []),
        ("vertices", np.zeros((0, 3))),
        ("vertices", [1, 2, 3]),
        ("vertices", [[1, 2], [3, 4]]),
        ("vertices", [[1, 2, 3], [4, 5]]),
        ("vertices", [["a", "b", "c"]]),
        ("vertices", TRIANGLE > 0),
        ("vertices", [[0.5, True, 1]]),
        ("vertices", TRIANGLE * 1j),
        ("vertices", None),
        ("vertices", 3),
        ("vertices[1]", [[0, 0, 0], [0, math.nan, 0], [1, 1, 1]]),
        ("vertices[2]", [[0, 0, 0], [0, 0, 0], [1, -math.inf, 1]]),
        ("vertices[0]", TRIANGLE * 2e9),
    ],
)
def test_bad_vertices(field: str, vertices: object) -> None:
    refusal(field, Mesh, vertices, FACES, material=GREY)


@pytest.mark.parametrize(
    ("field", "faces"),
    [
        ("faces", []),
        ("faces", [0, 1, 2]),
        ("faces", [[0, 1, 2, 2]]),
        ("faces", [[0.0, 1.0, 2.0]]),
        ("faces", [[True, False, True]]),
        ("faces", [[0, 1, None]]),
        ("faces", [[True, 0, 2]]),
        ("faces", [[np.True_, 0, 2]]),
        ("faces", [[0, 1, 2], [0, 1]]),
        ("faces[0]", [[0, 1, 3]]),
        ("faces[1]", [[0, 1, 2], [0, -1, 2]]),
        ("faces[0]", np.array([[0, 1, 2**63]], np.uint64)),
    ],
)
def test_bad_faces(field: str, faces: object) -> None:
    refusal(field, Mesh, TRIANGLE, faces, material=GREY)


@pytest.mark.parametrize(
    ("field", "normals"),
    [
        ("normals", TRIANGLE[:2]),
        ("normals", "up"),
        ("normals[2]", [[1, 0, 0], [0, 1, 0], [0, 0, 0]]),
        ("normals[0]", [[math.nan, 0, 0], [0, 1, 0], [0, 0, 0]]),
    ],
)
def test_bad_normals(field: str, normals: object) -> None:
    refusal(field, Mesh, TRIANGLE, FACES, normals, GREY)


def test_a_light_needs_an_area() -> None:
    refusal("faces", Mesh, TRIANGLE, [[0, 1, 1], [2, 2, 2]], radiance=1)


@pytest.mark.parametrize("value", [None, 3, "a picture"])
def test_bad_scene_parts(value: object) -> None:
    shapes = [Sphere((0, 0, 0), 1, GREY)]
    refusal("camera", Scene, value, shapes)
    refusal("shapes[1]", Scene, camera(), [*shapes, value])


def test_bad_scene() -> None:
    refusal("shapes", Scene, camera(), [])
    refusal("shapes", Scene, camera(), None)
    refusal("shapes", Scene, camera(), 5)
    refusal("description", Scene, camera(), [Sphere((0, 0, 0), 1, GREY)], 3)


def test_an_error_gathers_where_it_is() -> None:
    error = SceneError("wrong\nagain", "radius").within("shapes[3]").in_file("x.toml")
    assert str(error) == "x.toml: shapes[3].radius: wrong again"
    assert str(SceneError("wrong").within("shapes[3]")) == "shapes[3]: wrong"
    assert isinstance(error, ValueError)


def test_scenes_need_neither_drjit_nor_mitsuba() -> None:
    code = """
import sys, drpt.scene
drpt.scene.load_scene("veach")
heavy = {"drjit", "mitsuba", "trimesh", "tomli_w", "scipy"} & set(sys.modules)
sys.exit(f"imported {heavy}" if heavy else 0)
"""
    subprocess.run([sys.executable, "-c", code], check=True)
