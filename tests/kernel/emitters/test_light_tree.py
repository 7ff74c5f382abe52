"""The choice of a light: its probabilities against definitions in float64, and how often."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drpt.kernel.emitters import Receiver
from drpt.kernel.emitters.light_tree import (
    EVEN,
    FEW,
    WIDTH,
    LightTree,
    geometric_importance,
    nodes_of,
)
from drpt.kernel.sphere_tree import arrange
from tests.conftest import TYPES, to_device, to_host, unit_square
from tests.oracle.arrays import Floats, sample_uniform_sphere
from tests.oracle.closed_forms import sphere_light_irradiance
from tests.oracle.statistics import chi2_of_counts

if TYPE_CHECKING:
    from tests.oracle.arrays import Ints

SAMPLES = 1_000_000
SIGNIFICANCE = 1e-4  # of each statistical gate; seeds are fixed, so it fails always or never
ROUNDED = 2e-6  # relative, of a probability: some roundings on each of at most 7 levels
HEIGHT = 1e-6  # of a height above the horizon, whose terms cancel; relative to the scene
GRID = 2.0**-24  # of random numbers
COUNTS = [2, 3, FEW, FEW + 1, 40, 300]  # lights; 64 leaves are full, the other trees have gaps


@dataclass
class Lamps:
    """Balls of unequal power, on the device and in float64."""

    balls: Floats
    power: Floats
    tree: LightTree

    @classmethod
    def of(cls, balls: Floats, power: Floats) -> Lamps:
        balls = balls.astype(np.float32).astype(np.float64)
        upload = lambda rows: TYPES.Float32(rows.astype(np.float32).ravel())  # noqa: E731
        return cls(balls, power, LightTree(balls, power, TYPES, upload))

    @classmethod
    def random(cls, count: int, scale: float = 1) -> Lamps:
        rng = np.random.default_rng(count)
        radii = 10 ** rng.uniform(-3, -0.5, count)
        centers = rng.uniform(-1, 1, (count, 3)) * (3, 1, 2)
        power = 10 ** rng.uniform(-2, 2, count)
        return cls.of(scale * np.column_stack([centers, radii]), power)

    def pmf(self, at: Receiver, light: Ints) -> Floats:
        """Return the probabilities of lights (n,) at receivers (n)."""
        number = TYPES.UInt32(light.astype(np.uint32))
        return to_host(self.tree.pmf(at, TYPES.Bool(True), number))

    def all_pmf(self, point: Any, normal: Any) -> Floats:
        """Return the probabilities of all lights (n,) at one receiver."""
        at = Receiver(to_device([point]), to_device([normal]))
        return self.pmf(at, np.arange(len(self.power)))

    def choose(self, at: Receiver, u: Any) -> tuple[Ints, Floats]:
        """Return the lights that numbers lead to, and their probabilities."""
        choice = self.tree.choose(at, TYPES.Bool(True), u)
        return np.array(choice.light), to_host(choice.pmf)

    def defined_pmf(self, point: Floats, normal: Floats) -> Floats:
        """Return the probabilities of all lights (n,), from their definition in float64."""
        count = len(self.power)
        width = count if count <= FEW else WIDTH
        leaves = width
        while leaves < count:
            leaves *= width
        rows = np.full((leaves, 5), np.nan)
        rows[:count] = np.column_stack([self.balls, self.power])
        order = np.arange(count) if count <= FEW else arrange(rows[:, :3])
        pmf = np.ones(1)
        while len(pmf) < leaves:
            nodes = nodes_of(rows[order], width * len(pmf))
            shares = importance(nodes, point, normal).reshape(-1, width)
            even = nodes[:, 5].reshape(-1, width)
            total = shares.sum(axis=1, keepdims=True)
            even = even / np.maximum(even.sum(axis=1, keepdims=True), 1)
            chosen = np.where(total > 0, shares / np.where(total > 0, total, 1), even)
            pmf = (pmf[:, None] * ((1 - EVEN) * chosen + EVEN * even)).ravel()
        return pmf[np.argsort(order)[:count]]


def importance(nodes: Floats, point: Floats, normal: Floats) -> Floats:
    """Return the importance of nodes (n, 5+): power · height / distance³."""
    to_center = nodes[:, :3] - point
    height = to_center @ normal
    height = np.maximum(np.maximum(height, (height + nodes[:, 3]) / 2), 0)
    distance = np.maximum(np.linalg.norm(to_center, axis=1), nodes[:, 3])
    return np.asarray(nodes[:, 4] * height / distance**3)


def receivers(count: int) -> tuple[Floats, Floats]:
    """Return points in and around the lamps, and normals there, (n, 3) each."""
    rng = np.random.default_rng(99)
    points, normals = rng.uniform(-4, 4, (count, 3)), sample_uniform_sphere(rng, count)
    return points.astype(np.float32).astype(float), normals.astype(np.float32).astype(float)


@pytest.mark.parametrize("count", COUNTS)
def test_probabilities_are_those_of_the_definition(count: int) -> None:
    lamps = Lamps.random(count)
    for point, normal in zip(*receivers(20), strict=True):
        pmf = lamps.all_pmf(point, normal)
        assert pmf.sum() == pytest.approx(1, abs=ROUNDED)
        np.testing.assert_allclose(pmf, lamps.defined_pmf(point, normal), rtol=1e-4)


@pytest.mark.parametrize("count", COUNTS)
def test_lights_are_chosen_as_often_as_their_probabilities_say(count: int) -> None:
    lamps, u = Lamps.random(count), unit_square(SAMPLES).x
    for point, normal in zip(*receivers(3), strict=True):
        at = Receiver(to_device([point]), to_device([normal]))
        light, _ = lamps.choose(at, u)
        counts = np.bincount(light, minlength=count).astype(np.float64)
        expected = lamps.all_pmf(point, normal)
        assert chi2_of_counts(counts, SAMPLES * expected).p_value > SIGNIFICANCE
        biased = expected * np.where(np.arange(count) % 2, 1, 1.05)
        biased *= SAMPLES / biased.sum()
        assert chi2_of_counts(counts, biased).p_value < SIGNIFICANCE


@pytest.mark.slow
@pytest.mark.parametrize("count", [FEW, 300])
def test_every_number_leads_where_it_should(count: int) -> None:
    """All 2²⁴ of them: an interval gets as many as its length, up to those at its ends."""
    lamps = Lamps.random(count)
    (point,), (normal,) = receivers(1)
    at = Receiver(to_device([point]), to_device([normal]))
    u = TYPES.Float32(np.arange(2**24, dtype=np.float32) * np.float32(GRID))
    light, _ = lamps.choose(at, u)
    counts = np.bincount(light, minlength=count)
    pmf = lamps.all_pmf(point, normal)
    assert (np.abs(counts * GRID - pmf) <= 4 * GRID + ROUNDED * pmf).all()


@pytest.mark.parametrize("count", COUNTS)
def test_a_hit_light_has_the_probability_of_the_sample(count: int) -> None:
    lamps = Lamps.random(count)
    points, normals = receivers(10_000)
    at = Receiver(to_device(points), to_device(normals))
    light, chosen = lamps.choose(at, unit_square(10_000).x)
    np.testing.assert_allclose(lamps.pmf(at, light), chosen, rtol=ROUNDED)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
def test_scale_changes_nothing(count: int, scale: float) -> None:
    plain, scaled = Lamps.random(count), Lamps.random(count, scale)
    points, normals = receivers(1000)
    u = unit_square(1000).x
    for a, b in zip(
        plain.choose(Receiver(to_device(points), to_device(normals)), u),
        scaled.choose(Receiver(to_device(scale * points), to_device(normals)), u),
        strict=True,
    ):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("count", COUNTS)
def test_numbers_at_the_ends_lead_to_lights(count: int) -> None:
    lamps = Lamps.random(count)
    points, normals = receivers(10_000)
    at = Receiver(to_device(points), to_device(normals))
    for end in (0, 1 - GRID):
        light, pmf = lamps.choose(at, TYPES.Float32(end))
        assert light.max() < count
        assert (pmf > 0).all()


@pytest.mark.parametrize("count", COUNTS)
def test_no_light_is_out_of_the_question(count: int) -> None:
    """Not even below the horizon, or beside one that is brighter by far and may be occluded."""
    lamps = Lamps.random(count)
    lamps = Lamps.of(lamps.balls, np.where(np.arange(count) == 1, 1e30, 1e-30))
    levels = 1 if count <= FEW else int(np.ceil(np.log(count) / np.log(WIDTH)))
    for point, normal in zip(*receivers(20), strict=True):
        assert lamps.all_pmf(point, normal).min() >= 0.99 * EVEN**levels / count


def test_where_all_lights_are_below_the_horizon_they_are_chosen_alike() -> None:
    lamps = Lamps.random(40)
    pmf = lamps.all_pmf((0, 0, 9), (0, 0, 1))
    np.testing.assert_allclose(pmf, 1 / 40, rtol=ROUNDED)


def test_importance_of_a_sphere_light_above_the_horizon_is_its_irradiance() -> None:
    at = Receiver(to_device([(0, 0, 0)]), to_device([(0, 0, 1)]))
    for distance, omega, ratio in [(2, 0.3, 0.5), (1, 1.2, 0.1), (5, 0, 0.9), (1e3, 1.5, 1e-3)]:
        center = distance * np.array([np.sin(omega), 0, np.cos(omega)])
        radius = ratio * distance
        ball = TYPES.Array4f(*map(float, center), radius)
        expected = sphere_light_irradiance(1, np.arcsin(ratio), omega) / (np.pi * radius**2)
        assert to_host(geometric_importance(at, ball)) == pytest.approx(expected, rel=ROUNDED * 5)


def test_importance_is_positive_where_any_part_is_above_the_horizon() -> None:
    points, normals = receivers(10_000)
    rng = np.random.default_rng(3)
    radii = 10 ** rng.uniform(-3, 1, len(points))
    below = rng.uniform(-1, 2, len(points)) * radii
    at = Receiver(to_device(points), to_device(normals))
    centers = points - below[:, None] * normals
    ball = TYPES.Array4f(*map(to_device, centers.T), to_device(radii))
    value = to_host(geometric_importance(at, ball))
    assert (value[below < radii - 4 * HEIGHT] > 0).all()
    assert (value[below > radii + 4 * HEIGHT] == 0).all()


def test_nodes_hold_what_is_below_them() -> None:
    lamps = Lamps.random(13)
    rows = np.full((16, 5), np.nan)
    rows[:13] = np.column_stack([lamps.balls, lamps.power])
    nodes = nodes_of(rows, 4)
    np.testing.assert_array_equal(nodes[:, 5], [4, 4, 4, 1])
    for node, group in zip(nodes, rows.reshape(4, 4, 5), strict=True):
        lights = group[~np.isnan(group[:, 0])]
        assert node[4] == pytest.approx(lights[:, 4].sum())
        away = np.linalg.norm(lights[:, :3] - node[:3], axis=1) + lights[:, 3]
        assert away.max() == pytest.approx(node[3])
