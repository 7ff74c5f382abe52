"""Many triangles: Embree, or OptiX on CUDA, which Mitsuba offers to the same kernel."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import drjit as dr

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    import numpy as np
    from drjit.auto import Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.camera import Ray


class TriangleMesh:
    """Triangles in a bounding volume hierarchy.

    Parameters
    ----------
    triangles
        Corners (n, 3, 3).
    types
        The backend; Mitsuba wants its differentiable types, ``drjit.llvm.ad`` or ``.cuda.ad``.
    """

    def __init__(self, triangles: NDArray[np.float64], types: ModuleType) -> None:
        count = len(triangles)
        with _mitsuba(types) as mi:
            mesh = mi.Mesh("triangles", 3 * count, count)
            buffers = mi.traverse(mesh)
            buffers["vertex_positions"] = types.Float32(triangles.ravel())
            buffers["faces"] = dr.arange(types.UInt32, 3 * count)
            buffers.update()
            scene = {"type": "scene", "mesh": mesh, "embree_use_robust_intersections": True}
            self._scene = mi.load_dict(scene)
            self._ray = mi.Ray3f

    def closest(self, ray: Ray, active: Bool) -> tuple[UInt32, Bool, Float]:
        """Number of the first triangle that a ray meets, whether there is one, and how far."""
        hit = self._scene.ray_intersect_preliminary(
            self._ray(ray.origin, ray.direction), active=active
        )
        return hit.prim_index, hit.is_valid(), hit.t

    def blocks(self, ray: Ray, distance: Float, active: Bool) -> Bool:
        """Whether any triangle stands on the first ``distance`` of a ray."""
        segment = self._ray(ray.origin, ray.direction)
        segment.maxt = distance
        return self._scene.ray_test(segment, active=active)


@contextmanager
def _mitsuba(types: ModuleType) -> Iterator[Any]:
    """Mitsuba in the variant of these types; the caller's own variant is set again after."""
    import mitsuba as mi

    previous = mi.variant()
    mi.set_variant("cuda_ad_rgb" if "cuda" in types.__name__ else "llvm_ad_rgb")
    try:
        yield mi
    finally:
        if previous is not None:
            mi.set_variant(previous)
