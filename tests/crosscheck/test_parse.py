from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drpt import Diffuse, Mesh, Phong, Scene, SceneError, Sphere, load_scene, render
from drpt.crosscheck.convert import to_mitsuba_dict
from drpt.crosscheck.parse import from_mitsuba
from drpt.kernel.camera import make_camera
from drpt.scene import builtin_names
from tests.conftest import TYPES, to_host
from tests.oracle.statistics import assert_means_agree, smallest_detectable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt import Camera
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

SCENES = Path(__file__).parent / "mitsuba_scenes"
REFUSED = SCENES / "refused"
ONE_SIDED = "version-2"  # its surfaces, of which no path sees the back

PASSES = 16
SPP = 64  # per pass
BOUNCES = 3
TILE = 4  # pixels, per axis: tiles are compared, to see where a picture differs
SIGNIFICANCE = 1e-4  # of each comparison; seeds are fixed, so it fails always or never
SENSITIVITY = {"cornell-box": 0.05, "spheres": 0.05, "meshes": 0.015, "version-2": 0.015}
# Relative difference of the image means that the comparison must detect
ROUNDING = 1e-6  # relative: matrices, vertices and objects' colours are float32 in Mitsuba

GREY = {"type": "twosided", "bsdf": {"type": "diffuse"}}
LIGHT = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
SENSOR = {"type": "perspective"}


def scene_dict(**items: Any) -> dict[str, Any]:
    return {"type": "scene", "sensor": SENSOR, **items}


def only_shape(**items: Any) -> Shape:
    (shape,) = from_mitsuba(scene_dict(shape=items)).shapes
    return shape


def tiles(image: NDArray[Any]) -> Floats:
    """Return the image mean and the means of square tiles, (n, 3)."""
    image = image.astype(np.float64)
    height, width, _ = image.shape
    squares = image.reshape(height // TILE, TILE, width // TILE, TILE, 3).mean(axis=(1, 3))
    return np.concatenate([image.mean(axis=(0, 1))[None], squares.reshape(-1, 3)])


def mean_and_error(images: list[NDArray[np.float32]]) -> tuple[Floats, Floats]:
    values = np.array([tiles(image) for image in images])
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(PASSES)


@pytest.mark.parametrize(
    "name",
    [
        "meshes",
        "spheres",
        pytest.param("cornell-box", marks=pytest.mark.slow),
        pytest.param("version-2", marks=pytest.mark.slow),
    ],
)
def test_pictures_are_mitsubas_own(mi: Any, name: str) -> None:
    path = SCENES / f"{name}.xml"
    theirs = mi.load_file(str(path))
    with pytest.warns(UserWarning, match="behind") if name == ONE_SIDED else nullcontext():
        scene = from_mitsuba(path)
    integrator = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1, "rr_depth": BOUNCES + 2})
    ours, ours_error = mean_and_error(
        [
            render(scene, SPP, BOUNCES, sampler="independent", seed=seed).image
            for seed in range(PASSES)
        ]
    )
    mean, error = mean_and_error(
        [
            mi.render(theirs, integrator=integrator, spp=SPP, seed=mi.UInt32(seed)).numpy()
            for seed in range(PASSES, 2 * PASSES)
        ]
    )
    assert_means_agree(ours, ours_error, mean, error, SIGNIFICANCE)
    least = smallest_detectable(np.hypot(ours_error[0], error[0]), SIGNIFICANCE, 3) / mean[0]
    assert least.max() < SENSITIVITY[name], f"a difference of {least.max():.2%} could hide"


@pytest.mark.parametrize("name", builtin_names())
def test_what_drpt_gives_comes_back(name: str) -> None:
    scene = load_scene(name)
    assert_same(from_mitsuba(to_mitsuba_dict(scene)), scene)


def assert_same(first: Scene, second: Scene) -> None:
    """Assert that two scenes are equal, apart from roundings of float32."""
    assert_same_camera(first.camera, second.camera)
    assert len(first.shapes) == len(second.shapes)
    for one, other in zip(first.shapes, second.shapes, strict=True):
        assert type(one.material) is type(other.material)
        for ours, theirs in zip(numbers(one), numbers(other), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=ROUNDING, atol=ROUNDING)


def assert_same_camera(first: Camera, second: Camera) -> None:
    assert (first.fov, first.width, first.height) == (second.fov, second.width, second.height)
    one, other = (make_camera(camera, np.zeros(3), TYPES) for camera in (first, second))
    for name in ("eye", "corner", "right", "down"):
        ours, theirs = to_host(getattr(one, name)), to_host(getattr(other, name))
        np.testing.assert_allclose(ours, theirs, rtol=ROUNDING, atol=ROUNDING)


def numbers(shape: Shape) -> list[Any]:
    """Return all numbers of a shape; a light's normals play no part, and Mitsuba gets none."""
    surface = [shape.radiance or 0.0]
    if shape.material is not None:
        surface = [shape.material.albedo, getattr(shape.material, "exponent", 0.0)]
    if isinstance(shape, Sphere):
        return [shape.center, shape.radius, *surface]
    bent = shape.normals is not None and not shape.is_light
    return [shape.vertices, shape.faces, shape.normals if bent else 0.0, *surface]


REFUSALS = {
    "bright-albedo": ':9: <bsdf type="diffuse">.reflectance: [0.5, 1.5, 0.5] is not allowed;',
    "constant-emitter": ':9: <emitter type="constant" id="sky">: drpt has nothing like it',
    "crop": ':8: <film type="hdrfilm">: its crop_width is 32;',
    "cylinder": ':8: <shape type="cylinder" id="tube">: drpt has nothing like it',
    "ellipsoid": ':8: <shape type="sphere" id="egg">: its to_world makes it an ellipsoid',
    "flattened": ':8: <shape type="rectangle">: its to_world flattens it',
    "hex-colour": ":10: could not parse RGB value",
    "instance": ':8: <shape type="shapegroup" id="group">: drpt has nothing like it',
    "inward-light": ':8: <shape type="sphere" id="dome">: it emits inward',
    "medium": ':9: <medium type="homogeneous">: drpt has nothing like it',
    "mirrored-camera": ':4: <sensor type="perspective">: its to_world mirrors the picture',
    "missing-mesh": ':8: <shape type="ply">: [PLYMesh] Error while loading PLY file',
    "missing-reference": ':8: unresolved reference to "nowhere"',
    "no-sensor": ':1: <scene type="scene">: it has no sensor',
    "orthographic": ':4: <sensor type="orthographic">: drpt has no such camera;',
    "point-emitter": ':9: <emitter type="point">: drpt has nothing like it',
    "roughconductor": ':9: <bsdf type="roughconductor" id="gold">: drpt has no such surface',
    "texture": ':10: <texture type="checkerboard" id="tiles">: drpt\'s reflectance is one colour',
    "textured-emitter": ':9: <emitter type="directionalarea">: drpt has no such light;',
    "two-surfaces": ':9: <bsdf type="twosided">: it holds 2 surfaces;',
    "unknown-property": ":8: <shape type=\"sphere\">: drpt has nothing for its property 'radus'",
}


def test_every_refused_scene_is_tested() -> None:
    assert {path.stem for path in REFUSED.glob("*.xml")} == {*REFUSALS, "no-xml"}


@pytest.mark.parametrize("name", REFUSALS)
def test_what_is_refused_is_named(name: str) -> None:
    path = REFUSED / f"{name}.xml"
    with pytest.raises(SceneError) as error:
        from_mitsuba(path)
    assert str(error.value).startswith(f"{path}{REFUSALS[name]}")


def test_a_file_that_is_no_xml_or_missing_is_refused() -> None:
    with pytest.raises(SceneError, match=r"no-xml.xml\" failed: Start-end tags mismatch \(line 3"):
        from_mitsuba(REFUSED / "no-xml.xml")
    with pytest.raises(SceneError, match=r"nowhere\.xml"):
        from_mitsuba("nowhere.xml")
    with pytest.raises(SceneError, match="3 is not allowed; it must be the path of an XML file"):
        from_mitsuba(3)  # type: ignore[arg-type]


def test_places_in_dicts_are_named(mi: Any) -> None:
    glass = {"type": "sphere", "surface": {"type": "dielectric"}}
    with pytest.raises(SceneError, match=r'^ball.surface: <bsdf type="dielectric">: drpt has no'):
        from_mitsuba(scene_dict(ball=glass))
    given = {"type": "sphere", "surface": mi.load_dict({"type": "diffuse"})}
    with pytest.raises(SceneError, match=r"^ball: .*'surface' is an object of Mitsuba's"):
        from_mitsuba(scene_dict(ball=given))
    with pytest.raises(SceneError, match=r"'ball' is an object of Mitsuba's"):
        from_mitsuba(scene_dict(ball=mi.load_dict({"type": "sphere"})))
    metal = mi.load_dict({"type": "cube", "surface": {"type": "roughconductor"}})
    with pytest.raises(SceneError, match=r"^box: bsdf: drpt has no such surface"):
        from_mitsuba(scene_dict(box=metal))


def test_shapes_with_one_side_are_named_in_a_warning() -> None:
    plain = {"type": "rectangle", "surface": {"type": "diffuse"}}
    with pytest.warns(UserWarning, match=r"^wall: <.*>, ball: <.*>: it is black from behind"):
        from_mitsuba(
            scene_dict(wall=plain, box={"type": "cube", "b": GREY}, ball={"type": "sphere"})
        )


def test_lights_that_reflect_are_named_in_a_warning() -> None:
    with pytest.warns(UserWarning, match=r"^lamp: <.*>: it emits and reflects in Mitsuba"):
        scene = from_mitsuba(scene_dict(lamp={"type": "sphere", "emitter": LIGHT, "bsdf": GREY}))
    assert scene.shapes == (Sphere((0, 0, 0), 1, radiance=1),)


def test_lights_with_bent_normals_are_named_in_a_warning() -> None:
    sail = {"type": "obj", "filename": str(SCENES / "meshes" / "sail.obj"), "emitter": LIGHT}
    with pytest.warns(UserWarning, match=r"^lamp: <.*>: it emits by its normals in Mitsuba"):
        from_mitsuba(scene_dict(lamp=sail))


def test_surfaces_that_reflect_nothing_are_black() -> None:
    black = {"type": "diffuse", "reflectance": 0.0}
    dark = {**LIGHT, "radiance": 0.0}
    assert only_shape(type="sphere", bsdf=black).radiance == (0, 0, 0)
    assert only_shape(type="sphere", emitter=dark).radiance == (0, 0, 0)
    assert only_shape(type="sphere", emitter=dark, bsdf=GREY).material == Diffuse(0.5)


@pytest.mark.parametrize("value", [0.25, [0.1, 0.2, 0.3]])
def test_rgb_is_linear(value: Any) -> None:
    lobe = {"type": "drpt_phong", "reflectance": {"type": "rgb", "value": value}, "exponent": 7}
    shape = only_shape(type="sphere", bsdf={"type": "twosided", "lobe": lobe})
    assert shape.material == Phong(value, 7)


@pytest.mark.parametrize("value", [0.25, [(400, 0.2), (700, 0.3)]])
def test_spectra_are_what_mitsuba_makes_of_them(mi: Any, value: Any) -> None:
    spectrum = {"type": "spectrum", "value": value}
    lobe = {"type": "diffuse", "reflectance": spectrum}
    emitter = {"type": "area", "radiance": spectrum}
    expected = np.array(mi.traverse(mi.load_dict(lobe))["reflectance.value"]).ravel()
    painted = only_shape(type="sphere", bsdf={"type": "twosided", "lobe": lobe})
    assert isinstance(painted.material, Diffuse)
    np.testing.assert_allclose(painted.material.albedo, np.broadcast_to(expected, 3))
    expected = np.array(mi.traverse(mi.load_dict(emitter))["radiance.value"]).ravel()
    radiance = np.array(only_shape(type="sphere", emitter=emitter).radiance)
    np.testing.assert_allclose(radiance, expected)


@pytest.mark.parametrize("axis", ["x", "y", "diagonal", "smaller", "larger", None])
@pytest.mark.parametrize(("width", "height"), [(30, 20), (20, 30)])
def test_fields_of_view_are_mitsubas(mi: Any, axis: str | None, width: int, height: int) -> None:
    lens = {"focal_length": "40mm"} if axis is None else {"fov": 40.0, "fov_axis": axis}
    film = {"type": "hdrfilm", "width": width, "height": height}
    sensor = {"type": "perspective", "film": film, **lens}
    camera = from_mitsuba(scene_dict(sensor=sensor, ball={"type": "sphere", "b": GREY})).camera
    wide = np.radians(mi.traverse(mi.load_dict(sensor))["x_fov"])
    expected = np.degrees(2 * np.arctan(np.tan(np.array(wide) / 2) * height / width))
    np.testing.assert_allclose(camera.fov, expected, rtol=ROUNDING)


def test_cameras_without_film_or_transform_are_mitsubas_own() -> None:
    camera = from_mitsuba(scene_dict(ball={"type": "sphere", "b": GREY})).camera
    assert (camera.width, camera.height) == (768, 576)
    assert (camera.eye, camera.target, camera.up) == ((0, 0, 0), (0, 0, 1), (0, 1, 0))


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (0.5, 1, -2), (-1, -2, -1)])
@pytest.mark.parametrize("kind", ["rectangle", "disk", "cube", "sail", "flat sail", "roof"])
def test_fronts_are_mitsubas(mi: Any, kind: str, scale: tuple[float, ...], flip: bool) -> None:
    """Of what a ray from +z meets."""
    files = {"sail": "sail.obj", "flat sail": "sail.obj", "roof": "roof.ply"}
    given: dict[str, Any] = {"type": kind}
    if kind in files:
        given = {"type": files[kind][-3:], "filename": str(SCENES / "meshes" / files[kind])}
        given["face_normals"] = kind != "sail"
    turned = mi.ScalarTransform4f().rotate([1, 0, 0], 90 if kind == "roof" else 0)
    to_world = turned @ mi.ScalarTransform4f().scale(scale)
    given.update(to_world=to_world, flip_normals=flip, bsdf=GREY)
    shape = only_shape(**given)
    assert isinstance(shape, Mesh)
    theirs = mi.load_dict({"type": "scene", "shape": given})
    hit = theirs.ray_intersect(mi.Ray3f([0.1, 0.05, 9], [0, 0, -1]))
    front = np.array(hit.sh_frame.n).ravel()
    a, b, c = shape.vertices[shape.faces].swapaxes(0, 1)
    nearest = a[:, 2] > 0 if kind == "cube" else np.full(len(a), True)
    facing = np.cross(b - a, c - a)[nearest, 2]
    assert front[2] != 0
    assert np.all(facing * front[2] >= 0)
    assert np.any(facing * front[2] > 0)


def test_disks_have_the_area_of_mitsubas(mi: Any) -> None:
    to_world = mi.ScalarTransform4f().scale([2, 3, 1])
    disk = only_shape(type="disk", to_world=to_world, bsdf=GREY)
    assert isinstance(disk, Mesh)
    np.testing.assert_allclose(disk.areas().sum(), 6 * np.pi, rtol=ROUNDING)


def test_normals_are_those_of_the_file() -> None:
    file = str(SCENES / "meshes" / "sail.obj")
    sail, flat = (
        only_shape(type="obj", filename=file, face_normals=face_normals, bsdf=GREY)
        for face_normals in (False, True)
    )
    assert isinstance(sail, Mesh)
    assert isinstance(flat, Mesh)
    assert sail.normals is not None
    expected = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    np.testing.assert_allclose(sail.normals[:, :2], expected, atol=ROUNDING)
    assert flat.normals is None


def test_the_file_resolver_of_mitsuba_stays_as_it_was(mi: Any) -> None:
    before = list(map(str, mi.file_resolver()))
    from_mitsuba(SCENES / "meshes.xml")
    assert list(map(str, mi.file_resolver())) == before


def test_the_variant_that_is_set_counts(mi: Any) -> None:
    before = mi.variant()
    try:
        mi.set_variant("scalar_rgb")
        scene = load_scene("cornell-box-glossy")
        assert_same(from_mitsuba(to_mitsuba_dict(scene)), scene)
        assert mi.variant() == "scalar_rgb"
    finally:
        mi.set_variant(before)


@pytest.mark.parametrize(
    ("sensor", "says"),
    [
        ({"film": {"type": "hdrfilm", "width": 0}}, "its size is 0x576; it must have pixels"),
        ({"film": {"type": "hdrfilm", "width": 2.5}}, "its width is 2.5; it must be a whole"),
        ({"fov": "wide"}, "its fov is 'wide'; it must be a number"),
        ({"fov": 200.0}, "its fov is 200; it must be > 0 and < 180 degrees"),
        ({"focal_length": "5cm"}, "its focal_length is '5cm'; it must be millimetres"),
        ({"focal_length": 50.0}, "its focal_length is 50.0; it must be a text"),
        ({"focal_length": "-5mm"}, "its focal_length is '-5mm'"),
        ({"focal_length": "50mm", "fov": 40.0}, "it has both a fov and a focal_length"),
        ({"a": {"type": "hdrfilm"}, "b": {"type": "hdrfilm"}}, "it has 2 elements <film>"),
    ],
)
def test_wrong_sensors_are_refused(sensor: dict[str, Any], says: str) -> None:
    wrong = {"type": "perspective", **sensor}
    with pytest.raises(SceneError, match=says):
        from_mitsuba(scene_dict(sensor=wrong, ball={"type": "sphere", "b": GREY}))


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        ({"type": "sphere", "radius": "big"}, "its radius is 'big'; it must be a number"),
        ({"type": "disk", "flip_normals": "no"}, "its flip_normals is 'no'; it must be true or"),
        ({"type": "sphere", "other": GREY}, "it has 2 elements <bsdf>; it must have one"),
    ],
)
def test_wrong_shapes_are_refused(shape: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        from_mitsuba(scene_dict(wrong={"b": GREY, **shape}))


def test_a_center_that_is_no_point_is_refused() -> None:
    ball = {"type": "sphere", "center": 1.0}
    with pytest.raises(SceneError, match=r"^ball: .*its center is 1.0; it must be a point"):
        from_mitsuba(scene_dict(ball=ball))


def test_a_mesh_without_triangles_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    mesh = {"type": "obj", "filename": str(tmp_path / "a.obj"), "face_normals": True}
    with pytest.raises(SceneError, match="it has no faces"):
        from_mitsuba(scene_dict(a=mesh))
