"""Surfaces that overlap in one plane: finding them, and cutting the earlier shape (host).

`resolving` applies the rule that decides which surface is seen. `coplanar` finds pairs of triangles
by `nearby` (candidates) and `triangle_pairs` (the exact test). `darkness` drops pairs that no
picture shows. `cutting` cuts meshes by `clipping` convex polygons.
"""

from drpt.kernel.overlaps.resolving import Overlap, Resolved, resolve_overlaps, warning_of

__all__ = ["Overlap", "Resolved", "resolve_overlaps", "warning_of"]
