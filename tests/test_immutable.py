"""Arrays of scenes and results: nobody can write to them, whatever made them."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt.comparison import compare
from drpt.crosscheck.compare import compare as crosscheck
from drpt.crosscheck.estimate import Estimate
from drpt.immutable import Immutable, immutable
from drpt.kernel.launch import forget
from tests.scenes import LAMP, scene_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

FLOOR = drpt.Mesh(
    [(-3, -1, -3), (-3, -1, 3), (3, -1, 3), (3, -1, -3)],
    [(0, 1, 2), (0, 2, 3)],
    [(0, 1, 0)] * 4,
    material=drpt.Diffuse(0.5),
)
SCENE = scene_of(FLOOR, LAMP)


def _through_buffers(value: Any) -> Any:
    """Unpickle from memory that can be written to."""
    buffers: list[pickle.PickleBuffer] = []
    text = pickle.dumps(value, 5, buffer_callback=buffers.append)
    return pickle.loads(text, buffers=[bytearray(buffer.raw()) for buffer in buffers])


def _through(protocol: int, value: Any) -> Any:
    return pickle.loads(pickle.dumps(value, protocol))


WAYS: dict[str, Callable[[Any], Any]] = {
    **{f"pickle {protocol}": partial(_through, protocol) for protocol in range(6)},
    "buffers": _through_buffers,
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


def arrays(value: Any) -> Iterator[NDArray[Any]]:
    """All arrays that attributes, items and keys lead to."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, Mapping):
        yield from (array for item in value.values() for array in arrays(item))
    elif isinstance(value, tuple | list):
        yield from (array for item in value for array in arrays(item))
    elif hasattr(value, "__dataclass_fields__"):
        yield from (array for item in fields(value) for array in arrays(getattr(value, item.name)))


def assert_immutable(value: Any) -> None:
    found = list(arrays(value))
    assert found
    for array in found:
        assert not array.flags.writeable
        for view in (array, array[...], array.reshape(-1)):
            with pytest.raises(ValueError, match="WRITEABLE"):
                view.flags.writeable = True
        base = array.base
        while isinstance(base, np.ndarray):
            assert not base.flags.writeable
            base = base.base
        assert isinstance(base, bytes)


def results() -> dict[str, Any]:
    rendering = drpt.Rendering(SCENE, 16)
    result = drpt.render(SCENE, 16, layers=True)
    estimate = Estimate(np.ones((4, 4, 3)), np.full((4, 4, 3), 1e-4), 8, 64)
    verdict = crosscheck(estimate, replace(estimate, mean=np.full((4, 4, 3), 1.01)))
    return {
        "mesh": FLOOR,
        "scene": SCENE,
        "result": result,
        "first hits": rendering.first_hits(),
        "vertices": rendering.vertices(6, 6, 4),
        "no vertices": drpt.Rendering(scene_of(FLOOR)).vertices(6, 6, 4),
        "comparison": compare(result.image, 2 * result.image),
        "estimate": estimate,
        "verdict": verdict,
    }


def test_arrays_of_models_and_results_stay_immutable() -> None:
    for name, value in results().items():
        assert_immutable(value)
        if name == "first hits":  # a dictionary of arrays, whose copies are the caller's
            continue
        for way in WAYS.values():
            again = way(value)
            assert type(again) is type(value)
            assert_immutable(again)
            for one, other in zip(arrays(value), arrays(again), strict=True):
                assert one.dtype == other.dtype
                np.testing.assert_array_equal(one, other)


def test_standard_errors_are_immutable() -> None:
    result = drpt.render(SCENE, 16)
    assert_immutable([result.standard_error])
    assert_immutable([copy.deepcopy(result).standard_error])
    assert_immutable([replace(result, _differences=None).standard_error])
    assert pickle.loads(pickle.dumps(result)).error == result.error


def test_replaced_arrays_are_immutable() -> None:
    result = replace(drpt.render(SCENE, 4), image=np.ones((8, 12, 3), np.float32))
    assert_immutable(result)
    assert_immutable(replace(FLOOR, vertices=np.array(FLOOR.vertices)))


def test_a_mesh_copies_what_can_be_written_to() -> None:
    vertices = np.array(FLOOR.vertices)
    view = vertices.view()
    view.flags.writeable = False
    mesh = drpt.Mesh(view, FLOOR.faces, material=drpt.Diffuse(0.5))
    vertices *= 0.3
    np.testing.assert_array_equal(mesh.vertices, FLOOR.vertices)


def test_a_mesh_copies_what_was_unpickled() -> None:
    vertices = pickle.loads(pickle.dumps(np.array(FLOOR.vertices), 2))
    view = vertices[:]
    view.flags.writeable = False  # NumPy has put both into the same bytes
    mesh = drpt.Mesh(view, FLOOR.faces, material=drpt.Diffuse(0.5))
    vertices *= 0.3
    np.testing.assert_array_equal(mesh.vertices, FLOOR.vertices)


def test_a_scene_never_gets_the_picture_of_another() -> None:
    scene = pickle.loads(pickle.dumps(SCENE))
    before = drpt.render(scene, 4).image
    mesh = scene.shapes[0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[:] *= 0.3
    small = drpt.Mesh(0.3 * mesh.vertices, mesh.faces, material=drpt.Diffuse(0.5))
    after = drpt.render(scene_of(small, LAMP), 4).image
    assert (before != after).any()
    np.testing.assert_array_equal(drpt.render(SCENE, 4).image, before)


@pytest.mark.parametrize("shrunk_before", [False, True])
def test_replacing_the_content_of_an_array_object_gives_no_picture_of_another_scene(
    *, shrunk_before: bool
) -> None:
    """NumPy lets anyone call ``__setstate__`` on an array, which gives it other memory."""
    scene = pickle.loads(pickle.dumps(SCENE))
    small = drpt.Mesh(0.3 * FLOOR.vertices, FLOOR.faces, FLOOR.normals, drpt.Diffuse(0.5))
    expected = drpt.render(scene_of(small, LAMP), 4).image
    forget()
    before = drpt.render(scene, 4).image
    vertices = scene.shapes[0].vertices
    vertices.__setstate__((0.3 * vertices).__reduce__()[2])
    if shrunk_before:
        np.testing.assert_array_equal(drpt.render(scene, 4).image, expected)
    np.testing.assert_array_equal(drpt.render(scene_of(small, LAMP), 4).image, expected)
    np.testing.assert_array_equal(drpt.render(SCENE, 4).image, before)


def test_the_layers_of_a_result_cannot_be_exchanged() -> None:
    layers = drpt.render(SCENE, 4, layers=True).layers
    with pytest.raises(TypeError, match="does not support item assignment"):
        layers["albedo"] = layers["normal"]  # type: ignore[index]


def test_what_is_prepared_is_read_only() -> None:
    primitives = drpt.Rendering(SCENE).launcher.primitives
    with pytest.raises(ValueError, match="read-only"):
        primitives.light_corners[:] = 0
    with pytest.raises(ValueError, match="read-only"):
        primitives.spheres[:] *= 2


@dataclass(frozen=True)
class Sample(Immutable):
    image: NDArray[np.float32]
    layers: dict[str, NDArray[np.float32]]
    name: str


def test_values_are_kept() -> None:
    image, layer = np.arange(6, dtype=np.float32).reshape(2, 3), np.zeros((0, 3), np.float32)
    sample = Sample(image, {"layer": layer}, "sample")
    np.testing.assert_array_equal(sample.image, image)
    assert (sample.layers["layer"].shape, sample.name) == ((0, 3), "sample")


def test_what_is_immutable_is_not_copied() -> None:
    array = immutable(np.ones((4, 3)))
    assert immutable(array) is array
    assert immutable(array[1:]).base is not None
    assert np.shares_memory(immutable(array[::2]), array)
