"""The materials of a scene on the device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drpt.kernel.bsdfs.base import SurfacePoint
from drpt.kernel.bsdfs.bsdf import Bsdf

if TYPE_CHECKING:
    from drjit.auto import Array3f

    from drpt.kernel.bsdfs.base import Lobe
    from drpt.kernel.intersect import Hit


@dataclass
class Materials:
    """The kinds of materials in a scene.

    The row of each primitive's material, (albedo, code), lies beside that of its geometry, so that
    a hit takes a single gather.
    """

    lobes: tuple[Lobe, ...]

    def bsdf(self, hit: Hit, to_viewer: Array3f, *, interpolated_normals: bool) -> Bsdf:
        """The BSDF at a hit, towards a viewer; black where there is no hit, and on lights."""
        row = hit.material
        point = SurfacePoint(row.w, hit.shading_normal, to_viewer)
        normal = hit.normal if interpolated_normals else None
        return Bsdf(self.lobes, row.xyz, row.w, point, normal)
