"""What each thing that kernels leave out would cost: operations and time with it and without.

Each scene is rendered with the kernel that it gets, and with one that also has what it could do
without; both in turn. Seconds are those of the kernel alone. Prints a Markdown table.

    python -m benchmarks.skips
"""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from operator import itemgetter
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.bench.report import table
from benchmarks.bench.scenes import ball_pit, resized
from drpt import Mesh, Phong, Result, Scene, load_scene, render
from drpt.kernel import backend
from drpt.kernel.estimator import Features, Mode
from drpt.scene.materials import MATERIALS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager
    from types import ModuleType

    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.integrators.path import Tracer, Vertex
    from drpt.kernel.primitives import Primitives
    from drpt.scene import Shape

SIDE = 256
"""Pixels, of the height."""
SPP = 64
RUNS = 7
MANY = 100
"""Spheres, more than are met one by one."""


class Skip(NamedTuple):
    """Something that the kernel for a scene and settings leaves out, and how to have it back."""

    what: str
    scene: Callable[[], Scene]
    bounces: int
    mode: Mode
    undo: Callable[[], list[AbstractContextManager[Any]]]


class Run(NamedTuple):
    """A render, its kernel's hash and count of operations, and the seconds that this ran."""

    result: Result
    kernel: str
    operations: int
    seconds: float


def main() -> None:
    """Measure all and print the table."""
    rows = [_row(skip, *compare(skip)) for skip in SKIPS]
    print(table({name: itemgetter(name) for name in rows[0]}, rows))


def _row(skip: Skip, plain: list[Run], full: list[Run]) -> dict[str, object]:
    seconds, full_seconds = (median(run.seconds for run in runs) for runs in (plain, full))
    return {
        "left out": skip.what,
        "scene": skip.scene.__name__,
        "bounces, mode": f"{skip.bounces}, {skip.mode}",
        "operations": plain[0].operations,
        "with it": full[0].operations,
        "ms": 1000 * seconds,
        "ms with it": 1000 * full_seconds,
        "ratio": full_seconds / seconds,
    }


def compare(skip: Skip) -> tuple[list[Run], list[Run]]:
    """Warm runs as kernels are, and with the skip undone, in turn."""
    work = partial(render, resized(skip.scene(), SIDE), SPP, skip.bounces, skip.mode)
    plain, full = [], []
    for _ in range(1 + RUNS):
        plain.append(run(work))
        with undone(skip):
            full.append(run(work))
    return plain[1:], full[1:]


def run(work: Callable[[], Result]) -> Run:
    """Render, and look up the kernel."""
    backend.load()
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        result = work()
        kernels = dr.kernel_history((dr.KernelType.JIT,))
    kernel = max(kernels, key=lambda kernel: int(kernel["operation_count"]))
    times = [k["execution_time"] for k in kernels if k["hash"] == kernel["hash"]]
    return Run(result, kernel["hash"], kernel["operation_count"], sum(times) / 1000)


@contextmanager
def undone(skip: Skip) -> Iterator[None]:
    """Kernels have what they could do without."""
    backend.load()
    from drpt.kernel.launch import forget

    with ExitStack() as stack:
        stack.callback(forget)
        for change in skip.undo():
            stack.enter_context(change)
        forget()
        yield


def features(**flags: bool) -> Callable[[], list[AbstractContextManager[Any]]]:
    """Features as told, whatever the scene needs."""
    of = Features.of

    def told(primitives: Primitives, bounces: int, mode: Mode, **known: bool) -> Features:
        return replace(of(primitives, bounces, mode, **known), **flags)

    return lambda: [
        patch.object(Features, "of", told),
        patch("drpt.kernel.launch.upload", _upload_something),
    ]


def all_materials() -> list[AbstractContextManager[Any]]:
    """All kinds of materials, whatever the scene has."""
    return [patch("drpt.kernel.primitives.Primitives.kinds", MATERIALS)]


def choosing(*, both_kinds: bool = False) -> Callable[[], list[AbstractContextManager[Any]]]:
    """A choice between the light and itself, perhaps with code for lights of both kinds."""

    def upload_two(primitives: Primitives, types: ModuleType) -> DeviceScene:
        scene = _upload_something(primitives, types)
        tree = _same_light_twice(primitives, types)
        kinds: tuple[Any, ...] = scene.emitters.kinds
        if both_kinds:
            kinds = _both_kinds(kinds[0], types)
        kinds = tuple(replace(kind, count=2 * kind.count) for kind in kinds)
        return replace(scene, emitters=replace(scene.emitters, kinds=kinds, tree=tree))

    return lambda: [patch("drpt.kernel.launch.upload", upload_two)]


def _both_kinds(kind: Any, types: ModuleType) -> tuple[Any, ...]:
    """A single light, and the kind that it does not have, without any light."""
    from drpt.kernel.emitters import SphereLights, TriangleLights

    if isinstance(kind, TriangleLights):
        return SphereLights(kind.rows, 0), kind
    corners = types.Float32(np.ones(9, np.float32))
    return kind, TriangleLights(kind.rows, kind.count, 0, corners)


def _same_light_twice(primitives: Primitives, types: ModuleType) -> Any:
    import drjit as dr

    from drpt.kernel.emitters.light_tree import Choice, LightTree

    class SameLight(LightTree):
        def choose(self, *arguments: Any) -> Choice:
            found = super().choose(*arguments)
            nothing = dr.opaque(types.UInt32, 0)
            return Choice(found.light & nothing, dr.select(found.pmf > 1, found.pmf, 1))

    balls = np.repeat(primitives.light_balls(), 2, axis=0)
    upload = lambda values: types.Float32(values.astype(np.float32).ravel())  # noqa: E731
    return SameLight(balls, np.ones(2), types, upload)


def _upload_something(primitives: Primitives, types: ModuleType) -> DeviceScene:
    """No table is empty, so that there is something to gather from."""
    from drpt.kernel.device_scene import upload

    scene = upload(primitives, types)
    if len(scene.geometry.smooth):
        return scene
    smooth = types.Float32(np.ones(18, np.float32))
    return replace(scene, geometry=replace(scene.geometry, smooth=smooth))


def _light_code() -> list[AbstractContextManager[Any]]:
    """Of the first vertex only the device knows that light does not leave it."""
    from drpt.kernel.integrators.path import Tracer

    def first_vertex(self: Tracer, ray: Any, sampler: Any, known: Any = None) -> Vertex:
        return self.arrive(self.start(ray), sampler, _opaque(self.scene.types.UInt32, 0), known)

    return [*features(direct_light=True)(), patch.object(Tracer, "first_vertex", first_vertex)]


def _last_ray() -> list[AbstractContextManager[Any]]:
    """A ray after the last bounce, whose hit only the device knows to give nothing."""
    from drpt.kernel.camera import Ray
    from drpt.kernel.integrators.path import Tracer
    from drpt.kernel.intersect import light_hit

    def follow(self: Tracer, first: Vertex, sampler: Any) -> tuple[Any, Any]:
        import drjit as dr

        path = self.leave(first, sampler, 0)
        for depth in range(1, self.bounces):
            path = self.step(path, sampler, depth)
        ray = Ray(path.origin, path.direction)
        hit = light_hit(self.scene.geometry, self.features, ray, path.active)
        nothing = dr.select(hit.valid, _opaque(self.scene.types.Float32, 0), 0)
        return path.radiance + nothing, path.rays

    vertices = property(lambda self: self.bounces + 1)
    return [
        patch.object(Tracer, "follow", follow),
        patch.object(Tracer, "vertices", vertices),
    ]


def _weights() -> list[AbstractContextManager[Any]]:
    """Weights of two techniques, of which only the device knows that one never finds light."""
    from drpt.kernel.bsdfs import Bsdf
    from drpt.kernel.integrators.path import Tracer

    pdf, emission = Bsdf.pdf, Tracer._emission

    def no_pdf(self: Bsdf, to_light: Any) -> Any:
        return pdf(self, to_light) * _opaque(type(to_light.x), 0)

    def weighted(self: Tracer, path: Any, hit: Any, depth: Any) -> Any:
        found = emission(self, path, hit, depth)
        return found * _opaque(type(found.x), 0) if depth.may_be_later else found

    return [
        *features(mis=True)(),
        patch.object(Bsdf, "pdf", no_pdf),
        patch.object(Tracer, "_emission", weighted),
    ]


def _opaque(kind: Any, value: int) -> Any:
    """A number that is an input of the kernel, so that no compiler can make use of it."""
    import drjit as dr

    return dr.opaque(kind, value)


def all_block() -> list[AbstractContextManager[Any]]:
    """Shadow rays look for every facet, in bodies and elsewhere."""
    from drpt.kernel import solids

    make = solids.make_solids

    def make_shading(*args: Any) -> tuple[solids.Solid, ...]:
        return tuple(solid._replace(shading=solid.spans) for solid in make(*args))

    return [
        patch("drpt.kernel.primitives.make_solids", make_shading),
        patch("drpt.kernel.primitives.bounds", lambda *_: False),
    ]


def _facets() -> list[AbstractContextManager[Any]]:
    """Facets one by one, in a room that is still known as one."""
    return [
        patch("drpt.kernel.primitives.make_solids", lambda *_: ()),
        patch("drpt.kernel.primitives.Primitives.interior", True),
    ]


def _triangles() -> list[AbstractContextManager[Any]]:
    """Triangles as they come, which form no bodies."""
    return [*_facets(), patch("drpt.kernel.primitives.merge_coplanar", list)]


def _one_by_one() -> list[AbstractContextManager[Any]]:
    return [patch("drpt.kernel.spheres.SPHERE_LIMIT", 2 * MANY)]


def _shadow_rays() -> list[AbstractContextManager[Any]]:
    """A shadow ray from every vertex, wherever it leads and from lanes that are done."""
    from drpt.kernel.intersect import occluded

    def trace(scene: Any, ray: Any, distance: Any, light: Any, _: Any) -> Any:
        return occluded(scene, ray, distance, light, scene.types.Bool(True))

    return [patch("drpt.kernel.integrators.path.occluded", trace)]


def _normals_of_lights() -> list[AbstractContextManager[Any]]:
    """Points on spheres are moved onto them and get a normal, although all spheres emit."""
    return [patch("drpt.kernel.intersect._some_spheres_reflect", lambda *_: True)]


def cornell_box() -> Scene:
    """Return the built-in scene."""
    return load_scene("cornell-box")


def phong_box() -> Scene:
    """Return the same, all surfaces Phong."""
    scene = cornell_box()
    return Scene(scene.camera, map(_glossy, scene.shapes))


def panel_box() -> Scene:
    """Return the same, its light a triangle."""
    scene = cornell_box()
    panel = Mesh([(200, 450, 150), (350, 450, 150), (278, 450, 250)], [(0, 1, 2)], radiance=20)
    return Scene(scene.camera, [*(s for s in scene.shapes if not s.is_light), panel])


def spheres() -> Scene:
    """Return the built-in scene."""
    return load_scene("spheres")


def many_spheres() -> Scene:
    """Return spheres in an open box."""
    return ball_pit(MANY)


def _glossy(shape: Shape) -> Shape:
    if shape.material is None:
        return shape
    return replace(shape, material=Phong(shape.material.albedo, 20))


_MIS, _EXPLICIT = Mode.MIS, Mode.EXPLICIT
SKIPS = (
    Skip("Phong code", cornell_box, 2, _EXPLICIT, all_materials),
    Skip("diffuse code", phong_box, 2, _MIS, all_materials),
    Skip("interpolated normals", cornell_box, 2, _EXPLICIT, features(interpolated_normals=True)),
    Skip("points on spheres", panel_box, 2, _EXPLICIT, features(spheres=True)),
    Skip("points on reflecting spheres", cornell_box, 2, _EXPLICIT, _normals_of_lights),
    Skip("points on facets", spheres, 2, _EXPLICIT, features(triangles=True)),
    Skip("choice of a light", cornell_box, 2, _EXPLICIT, choosing()),
    Skip(
        "choice, and samples of triangle lights",
        cornell_box,
        2,
        _EXPLICIT,
        choosing(both_kinds=True),
    ),
    Skip(
        "choice, and samples of sphere lights",
        panel_box,
        2,
        _EXPLICIT,
        choosing(both_kinds=True),
    ),
    Skip("light code at bounces 0", cornell_box, 0, _EXPLICIT, _light_code),
    Skip("last ray", cornell_box, 2, _EXPLICIT, _last_ray),
    Skip("MIS weights and last ray", cornell_box, 2, _EXPLICIT, _weights),
    Skip("shadows of the walls", cornell_box, 2, _EXPLICIT, all_block),
    Skip("bodies as facets", cornell_box, 2, _EXPLICIT, _facets),
    Skip("facets as triangles", cornell_box, 2, _EXPLICIT, _triangles),
    Skip("spheres one by one", many_spheres, 2, _EXPLICIT, _one_by_one),
    Skip("shadow rays below the horizon", many_spheres, 2, _EXPLICIT, _shadow_rays),
    Skip("lanes that wait", spheres, 8, _EXPLICIT, features(regeneration=False)),
    Skip(
        "camera rays of covered pixels", cornell_box, 2, _EXPLICIT, features(covered_pixels=False)
    ),
    Skip("a camera ray for each path", cornell_box, 2, _EXPLICIT, features(shared_rays=False)),
)
"""The last two are skipped at the price of more operations, which fewer rays are worth."""


if __name__ == "__main__":
    main()
