"""Single paths, vertex by vertex: where they went, and which of the light each vertex found.

The tracer is that of the renders; here it stops at every vertex and says what it has there.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import drjit as dr
import numpy as np

from drpt.immutable import Immutable
from drpt.kernel.arithmetic import same_bits

if TYPE_CHECKING:
    from drjit.auto import Array3f, Bool, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.integrators.path import Tracer, Vertex
    from drpt.kernel.integrators.state import Path
    from drpt.kernel.launch import Launcher
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.sampler import Sampler

NONE = -1
"""Stands for the number of a shape where there is none."""


@dataclass(frozen=True, eq=False)
class Vertices(Immutable):
    """The vertices of some paths: arrays (depths, paths) and (depths, paths, 3).

    Attributes
    ----------
    reached
        Whether a ray was sent to the vertex; all else says nothing where none was.
    throughput
        What share of the radiance from there arrives in the picture.
    direction
        Unit vector along which the ray came.
    shape
        Number in the scene of the shape that the ray met, `NONE` for the background.
    point
        Where that is, in world space.
    contribution
        Radiance that the vertex adds to that of its path, W/(m² sr): emission of a light, direct
        light of a surface.
    light_shape
        Number of the shape to which a shadow ray was sent, or `NONE`; it arrived if there is a
        contribution.
    light_point
        The point of it, in world space.
    """

    reached: NDArray[np.bool_]
    throughput: NDArray[np.float64]
    direction: NDArray[np.float64]
    shape: NDArray[np.intp]
    point: NDArray[np.float64]
    contribution: NDArray[np.float64]
    light_shape: NDArray[np.intp]
    light_point: NDArray[np.float64]


@same_bits()
def record(launcher: Launcher, pixel: int, samples: range, seed: int) -> Vertices:
    """Trace samples of a pixel as a render traces them, and keep their vertices."""
    tracer, recorder = launcher.tracer, _Recorder(launcher.tracer, launcher.primitives)
    path, sampler, own = launcher.single_paths(pixel, samples, seed)
    path = path._replace(
        active=dr.full(tracer.scene.types.Bool, True, len(samples)),
        beta=dr.full(tracer.scene.types.Array3f, 1, len(samples)),
    )
    dr.make_opaque(*path)
    found = []
    for depth in range(tracer.vertices):
        number = dr.opaque(tracer.scene.types.UInt32, depth)  # one kernel for every depth
        vertices, path = recorder.step(path, sampler, own, number)
        found.append(vertices)
        sampler = own
    if not found:
        return _none(len(samples))
    names = [field.name for field in fields(Vertices)]
    return Vertices(**{name: np.stack([getattr(one, name) for one in found]) for name in names})


@dataclass
class _Recorder:
    """Follows paths over one vertex after the other."""

    tracer: Tracer
    primitives: Primitives

    def step(
        self, path: Path, sampler: Sampler, own: Sampler, depth: UInt32
    ) -> tuple[Vertices, Path]:
        """Return what is at the next vertex, and the paths on from there."""
        tracer, types = self.tracer, self.tracer.scene.types
        fresh = path._replace(radiance=types.Array3f(0), rays=types.UInt32(0))
        vertex = tracer.arrive(fresh, sampler, depth)
        onward = tracer.leave(vertex, own, depth)
        hit, (light, light_point, traced) = vertex.hit, self._light(vertex)
        dr.eval(vertex.found, hit.primitive, hit.point, *vertex.path, *onward)
        dr.eval(light, light_point, traced)
        vertices = Vertices(
            reached=np.array(path.active),
            throughput=_rows(vertex.path.beta),
            direction=_rows(path.direction),
            shape=self._shapes(hit.primitive, vertex.found),
            point=self.primitives.origin + _rows(hit.point),
            contribution=_rows(vertex.path.radiance),
            light_shape=self._shapes(light, traced),
            light_point=self.primitives.origin + _rows(light_point),
        )
        return vertices, onward

    def _light(self, vertex: Vertex) -> tuple[UInt32, Array3f, Bool]:
        """The primitive and the point that a shadow ray leads to, and whether there is one."""
        hit, direct = vertex.hit, vertex.direct
        if direct is None:
            return hit.primitive, hit.point, hit.valid & False
        point = dr.fma(direct.sample.direction, direct.sample.distance, hit.point)
        return direct.light + self.tracer.scene.geometry.first_light, point, direct.traced

    def _shapes(self, primitive: UInt32, valid: Bool) -> NDArray[np.intp]:
        kept = np.array(valid)
        return np.where(kept, self.primitives.shape[np.where(kept, np.array(primitive), 0)], NONE)


def _none(paths: int) -> Vertices:
    """No vertices at all, of a scene without light."""
    flags, numbers, vectors = (
        np.empty((0, paths), bool),
        np.empty((0, paths), np.intp),
        np.empty((0, paths, 3)),
    )
    return Vertices(flags, vectors, vectors, numbers, vectors, vectors, numbers, vectors)


def _rows(vectors: Array3f) -> NDArray[np.float64]:
    return np.array(vectors, np.float64).T
