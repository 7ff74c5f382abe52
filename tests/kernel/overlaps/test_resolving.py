"""Shapes that overlap in one plane: which are cut, what is left of them, what a warning says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.kernel.overlaps import Overlap, cutting, resolve_overlaps, warning_of
from drpt.kernel.parts import make_parts
from drpt.kernel.primitives import Primitives, make_primitives
from drpt.scene.builtin import builtin_names

if TYPE_CHECKING:
    from drpt.scene import Shape

SEAM = 1e-4  # of areas: pieces reach 2e-7 under what covers them, along borders

GREY, WHITE = drpt.Diffuse(0.5), drpt.Diffuse(0.9)
QUAD = [(0, 1, 2), (0, 2, 3)]
LAMP = drpt.Sphere((0, 2, 0), 0.3, radiance=10)
"""A light above the sheets, clear of the boxes on them."""


def sheet(half: float, height: float = 0, *, down: bool = False, **surface: object) -> drpt.Mesh:
    corners = [(-half, height, -half), (-half, height, half), (half, height, half)]
    corners.append((half, height, -half))
    faces = [face[::-1] for face in QUAD] if down else QUAD
    return drpt.Mesh(corners, faces, **(surface or {"material": GREY}))  # type: ignore[arg-type]


def closed_box(low: tuple[float, ...], high: tuple[float, ...]) -> drpt.Mesh:
    x, y, z = zip(low, high, strict=True)
    corners = [(i, j, k) for i in x for j in y for k in z]
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]
    return drpt.Mesh(corners, faces, material=GREY)


def prepare(*shapes: Shape) -> Primitives:
    return make_primitives(shapes)


def areas(found: Primitives) -> dict[int, float]:
    """Area of all triangles and polygons of each shape that reflects."""
    outlines = [facet.corners for facet in found.facets] or [*found.triangles]
    total = dict.fromkeys(found.shape.tolist(), 0.0)
    for outline, number in zip(outlines, found.shape.tolist(), strict=False):
        spokes = outline[1:] - outline[0]
        total[number] += float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)) / 2)
    return total


def crumbs() -> drpt.Mesh:
    """Enough distant triangles that all triangles go into a mesh."""
    corners = np.random.default_rng(0).normal(0, 0.1, (300, 3))
    corners[:, 1] += 9
    return drpt.Mesh(corners, np.arange(300).reshape(-1, 3), material=GREY)


@pytest.mark.parametrize("extra", [(), (crumbs(),)], ids=["polygons", "Embree"])
def test_the_earlier_shape_is_cut(extra: tuple[Shape, ...]) -> None:
    found = prepare(sheet(3), sheet(2, material=WHITE), LAMP, *extra)
    assert found.overlaps == (Overlap(0, 1),)
    assert areas(found)[0] == pytest.approx(36 - 16, rel=SEAM)
    assert areas(found)[1] == 16


@pytest.mark.parametrize("extra", [(), (crumbs(),)], ids=["polygons", "Embree"])
def test_an_earlier_shape_that_is_covered_is_gone(extra: tuple[Shape, ...]) -> None:
    found = prepare(sheet(2, material=WHITE), sheet(3), LAMP, *extra)
    assert found.overlaps == (Overlap(0, 1),)
    assert 0 not in found.shape
    assert areas(found)[1] == 36


def test_copies_of_triangles_are_gone_without_a_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cutting, "uncovered")
    corners = np.random.default_rng(1).normal(size=(2400, 3))
    faces = np.arange(2400).reshape(-1, 3)
    first, copy = (drpt.Mesh(corners, faces, material=material) for material in (GREY, WHITE))
    found = resolve_overlaps(make_parts((first, copy), np.zeros(3)))
    assert found.overlaps == (Overlap(0, 1),)
    assert [len(part.primitives) for part in found.parts] == [0, 800]


def test_a_shape_that_is_gone_covers_nothing_that_its_own_cover_does_not() -> None:
    black = drpt.Diffuse(0)
    small = drpt.Mesh([(-1, 0, 0), (-1, 0, 0.5), (-0.7, 0, 0.5)], [(0, 1, 2)], material=WHITE)
    larger = sheet(1.5, material=black)
    found = prepare(sheet(2), small, larger, LAMP)
    assert found.overlaps == (Overlap(0, 1), Overlap(0, 2), Overlap(1, 2))
    assert found.shape.tolist() == [0, 0, 0, 0, 2, 3]
    assert areas(found)[0] == pytest.approx(16 - 9, rel=SEAM)
    assert areas(found)[2] == 9


def test_pieces_of_a_polygon_are_few() -> None:
    assert len(prepare(sheet(3), sheet(2, material=WHITE), LAMP).facets) == 5
    assert len(prepare(sheet(3), sheet(3, material=WHITE), LAMP).facets) == 1


@pytest.mark.parametrize("rounded", [False, True])
@pytest.mark.parametrize("scale", [1e-3, 1, 1e4])
def test_a_plane_that_is_turned_and_rounded_is_one(scale: float, rounded: bool) -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        turn, move = np.linalg.qr(rng.standard_normal((3, 3)))[0], rng.uniform(-3, 3, 3)

        def placed(mesh: drpt.Mesh, turn: object = turn, move: object = move) -> drpt.Mesh:
            points = scale * (mesh.vertices @ np.asarray(turn).T + np.asarray(move))
            points = points.astype(np.float32) if rounded else points
            return drpt.Mesh(points, mesh.faces, material=mesh.material)

        found = prepare(placed(sheet(3)), placed(sheet(2, material=WHITE)), LAMP)
        assert found.overlaps == (Overlap(0, 1),)
        assert areas(found)[0] == pytest.approx(20 * scale**2, rel=SEAM)


@pytest.mark.parametrize(
    "shapes",
    [
        [sheet(3), sheet(2, 1e-3, material=WHITE)],
        [sheet(500, 500), sheet(2, 500 + 1e-3, material=WHITE)],
        [sheet(3), drpt.Mesh(np.add(sheet(1).vertices, (4, 0, 0)), QUAD, material=WHITE)],
        [sheet(3), sheet(3)],
        [sheet(3), drpt.Mesh([(-1, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], material=WHITE)],
        [
            sheet(3),
            drpt.Mesh([(-1, -1e-4, -1), (1, 1e-4, -1), (0, 0, 1)], [(0, 1, 2)], material=WHITE),
        ],
    ],
    ids=["above", "above, far from the origin", "beside", "alike", "upright", "tilted"],
)
def test_what_does_not_overlap_is_left_alone(shapes: list[Shape]) -> None:
    found = prepare(*shapes, LAMP)
    assert found.overlaps == ()
    assert not found.is_cut


@pytest.mark.parametrize("name", builtin_names())
def test_built_in_scenes_have_no_overlaps(name: str) -> None:
    found = make_primitives(drpt.load_scene(name).shapes)
    assert found.overlaps == ()
    assert not found.is_cut


def test_interpolated_normals_stay_where_they_are() -> None:
    normals = np.array([[-1, 2, 0], [0, 2, 1], [1, 2, 0], [0, 2, -1.0]])
    given = sheet(3)
    smooth = drpt.Mesh(given.vertices, given.faces, normals, WHITE)
    found = prepare(smooth, sheet(1), LAMP)
    unit = smooth.normals
    assert unit is not None
    corners, mixed = found.smooth_corners.reshape(-1, 3), found.smooth_normals.reshape(-1, 3)
    x, z = corners[:, 0], corners[:, 2]
    upper = z >= x  # on this side of the diagonal is the triangle (0, 1, 2)
    a, b, c = np.where(upper[:, None, None], unit[[0, 1, 2]], unit[[0, 2, 3]]).swapaxes(0, 1)
    u, v = np.where(upper, [(z - x) / 6, (x + 3) / 6], [(z + 3) / 6, (x - z) / 6])
    expected = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    assert len(corners) > 12
    assert mixed == pytest.approx(expected, abs=1e-5)


class TestLights:
    def test_a_light_is_cut_with_its_area(self) -> None:
        lamp = sheet(2, radiance=3)
        found = prepare(lamp, sheet(1))
        assert found.overlaps == (Overlap(0, 1),)
        assert found.light_areas().sum() == pytest.approx(12, rel=SEAM)
        assert (found.planes[found.first_light - len(found.planes) :, 1] == 1).all()

    def test_a_light_that_is_covered_is_none(self) -> None:
        found = prepare(sheet(1, radiance=3), sheet(2))
        assert found.overlaps == (Overlap(0, 1),)
        assert len(found.radiance) == 0

    def test_a_light_on_an_earlier_surface_cuts_nothing(self) -> None:
        found = prepare(sheet(3), sheet(1, radiance=3))
        assert found.overlaps == ()
        assert len(found.facets) == 1

    def test_of_lights_that_face_the_same_way_the_earlier_is_cut(self) -> None:
        found = prepare(sheet(2, radiance=3), sheet(1, radiance=5))
        assert found.overlaps == (Overlap(0, 1),)
        assert found.light_areas().sum() == pytest.approx(16, rel=SEAM)

    def test_lights_that_face_opposite_ways_are_both_whole(self) -> None:
        found = prepare(sheet(2, radiance=3), sheet(1, down=True, radiance=5))
        assert found.overlaps == ()
        assert found.light_areas().sum() == 20

    def test_a_light_that_overlaps_itself_is_cut(self) -> None:
        small, large = sheet(1), sheet(2)
        points = np.concatenate([large.vertices, small.vertices])
        lamp = drpt.Mesh(points, [*large.faces, *(small.faces + 4)], radiance=3)
        found = prepare(lamp)
        assert found.overlaps == (Overlap(0, 0),)
        assert found.light_areas().sum() == pytest.approx(16, rel=SEAM)


class TestSpheres:
    SAME = (0.1, 0.2, 0.3), 0.5

    @pytest.mark.parametrize("nudge", [0, 1e-9])
    @pytest.mark.parametrize("first", [{"material": GREY}, {"radiance": 2}])
    @pytest.mark.parametrize("second", [{"material": WHITE}, {"radiance": 3}])
    def test_the_later_one_is_left(
        self, first: dict[str, object], second: dict[str, object], nudge: float
    ) -> None:
        center, radius = self.SAME
        spheres = [
            drpt.Sphere(center, radius, **first),  # type: ignore[arg-type]
            drpt.Sphere(center, radius + nudge, **second),  # type: ignore[arg-type]
        ]
        found = prepare(LAMP, *spheres)
        if "radiance" in first and "radiance" in second and not nudge:
            assert found.overlaps == ()
            assert found.radiance.tolist() == [[10] * 3, [5] * 3]
        else:
            assert found.overlaps == (Overlap(1, 2),)
            assert sorted(found.shape.tolist()) == [0, 2]

    def test_concentric_and_touching_ones_are_left_alone(self) -> None:
        center, radius = self.SAME
        shapes = [drpt.Sphere(center, radius * k, drpt.Diffuse(0.2 * k)) for k in (1, 1.001, 2)]
        assert prepare(LAMP, *shapes).overlaps == ()


class TestDarkness:
    """A closed box on the floor: beneath it nothing is lit, so nothing is cut and nobody warned."""

    BOX = closed_box((-0.3, 0, -0.3), (0.3, 0.5, 0.3))

    @pytest.mark.parametrize("order", [1, -1])
    @pytest.mark.parametrize("inverted", [False, True])
    def test_a_box_on_the_floor_costs_nothing(self, order: int, inverted: bool) -> None:
        box = drpt.Mesh(
            self.BOX.vertices, self.BOX.faces[:, :: -1 if inverted else 1], material=WHITE
        )
        found = prepare(*[sheet(3), box][::order], LAMP)
        assert found.overlaps == ()
        assert len(found.facets) == 7
        assert len(found.solids) == 1

    def test_a_box_on_a_box_costs_nothing(self) -> None:
        below = closed_box((-1, -0.4, -1), (1, 0, 1))
        above = drpt.Mesh(self.BOX.vertices, self.BOX.faces, material=WHITE)
        assert prepare(sheet(3, -2), below, above, LAMP).overlaps == ()

    def test_what_is_seen_from_below_is_the_later_one(self) -> None:
        box = drpt.Mesh(self.BOX.vertices, self.BOX.faces, material=WHITE)
        under = drpt.Sphere((0, -2, 0), 0.5, GREY)
        assert prepare(sheet(3), box, under, LAMP).overlaps == (Overlap(0, 1),)
        assert prepare(box, sheet(3), under, LAMP).overlaps == (Overlap(0, 1),)

    def test_a_lit_room_is_not_dark(self) -> None:
        room = closed_box((-2, 0, -2), (2, 3, 2))
        rug = sheet(1, material=WHITE)
        assert prepare(room, rug, LAMP).overlaps == (Overlap(0, 1),)
        assert prepare(rug, room, LAMP).overlaps == (Overlap(0, 1),)

    def test_an_open_box_is_not_dark(self) -> None:
        without_top = drpt.Mesh(self.BOX.vertices, self.BOX.faces[:-2], material=WHITE)
        assert prepare(sheet(3), without_top, LAMP).overlaps == (Overlap(0, 1),)


def test_a_warning_names_some_of_the_shapes() -> None:
    overlaps = tuple(Overlap(1, later) for later in (1, 2, 3, 4, 5))
    assert warning_of(overlaps[1:2]) == (
        "surfaces overlap in one place, where the later one is seen: shapes[1] and shapes[2]"
    )
    assert warning_of(overlaps).endswith(
        ": shapes[1] and itself, shapes[1] and shapes[2], shapes[1] and shapes[3], and 2 more"
    )


def test_a_render_warns_of_the_shapes() -> None:
    camera = drpt.Camera((0, 1.5, 0.01), (0, 0, 0), (0, 0, 1), 60, 8, 8)
    scene = drpt.Scene(camera, [sheet(3), LAMP, sheet(2, material=WHITE)])
    for _ in range(2):
        with pytest.warns(RuntimeWarning, match=r"shapes\[0\] and shapes\[2\]$"):
            drpt.render(scene, 1)
