import itertools
from math import comb
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from drpt import Camera, Diffuse, Rendering, Scene, Sphere
from drpt.kernel.sampler import SAMPLERS, hash4, owen_scramble, pascal_product, unit_float
from tests.conftest import TYPES, to_host
from tests.oracle.arrays import Floats
from tests.oracle.statistics import chi2_of_counts, sidak

SIGNIFICANCE = 1e-4  # of each statistical gate; inputs are fixed, so it fails always or never
BIAS = 0.03  # share of samples moved to one half of a range, which the chi² tests detect
POINTS = 2**18  # a correlation of random pairs is below 5 / √POINTS = 1 %
CORRELATION = 5 / POINTS**0.5
STRATIFIED = 2**10  # the longest runs of samples that are looked at
DECISIONS = (0, 1, 2, 7, 100)
BITS = 32


def words(values: npt.ArrayLike) -> Any:
    return TYPES.UInt32(np.asarray(values, np.uint32))


def random_words(count: int, seed: int = 0) -> npt.NDArray[np.uint32]:
    return np.random.default_rng(seed).integers(0, 2**32, count, np.uint32)


def draw(
    name: str, pixel: npt.ArrayLike, index: npt.ArrayLike, decision: int, seed: int = 0
) -> Floats:
    """Return the points (n, 2) of a sampler."""
    pixels, indices = (words(np.atleast_1d(values)) for values in (pixel, index))
    sampler = SAMPLERS[name](pixels, indices, words([seed]))
    return to_host(sampler.next_2d(words([decision])))


def draw_1d(name: str, pixel: int, index: npt.ArrayLike, decision: int, seed: int = 0) -> Floats:
    """Return the numbers (n,) of a sampler."""
    sampler = SAMPLERS[name](words([pixel]), words(index), words([seed]))
    return to_host(sampler.next_1d(words([decision])))


def joint_p_value(*columns: Floats, cells: int = 16) -> float:
    """Return the p-value of a chi² test of numbers (n,) that are uniform and independent."""
    shape = (cells,) * len(columns)
    cell = np.ravel_multi_index([(cells * c).astype(int) for c in columns], shape)
    counts = np.bincount(cell, minlength=cells ** len(columns)).astype(np.float64)
    return chi2_of_counts(counts, np.full(counts.size, counts.mean())).p_value


def count_distinct(columns: list[npt.NDArray[Any]]) -> int:
    """Return how many different rows some columns (n,) make."""
    rows = np.stack(columns)[:, np.lexsort(columns)]
    return 1 + int(np.any(rows[:, 1:] != rows[:, :-1], axis=0).sum())


def push(x: Floats) -> Floats:
    """Return numbers of [0, 1) with a share of `BIAS` of them moved into the upper half."""
    moved = np.random.default_rng(9).random(len(x)) < BIAS
    return np.where(moved, 0.5 + x / 2, x)


def counting(counted: int) -> list[Any]:
    """Return four inputs of the hash of which one counts up."""
    return [words(np.arange(POINTS) if k == counted else [k]) for k in range(4)]


class TestHash:
    @pytest.mark.parametrize("counted", range(4))
    def test_is_injective(self, counted: int) -> None:
        inputs = [words(random_words(POINTS, k)) for k in range(4)]
        for given in (inputs, counting(counted)):
            assert count_distinct([np.array(word) for word in hash4(*given)]) == POINTS

    @pytest.mark.parametrize("counted", range(4))
    def test_top_bits_are_uniform_where_one_input_counts_up(self, counted: int) -> None:
        for output in hash4(*counting(counted)):
            assert joint_p_value(to_host(unit_float(output)), cells=256) > sidak(SIGNIFICANCE, 16)

    @pytest.mark.parametrize("counted", range(4))
    def test_outputs_are_independent_where_one_input_counts_up(self, counted: int) -> None:
        outputs = [to_host(unit_float(word)) for word in hash4(*counting(counted))]
        for a, b in itertools.combinations(outputs, 2):
            assert joint_p_value(a, b) > sidak(SIGNIFICANCE, 24)

    def test_the_gates_detect_bits_that_are_not_uniform(self) -> None:
        a, b = (push(to_host(unit_float(word))) for word in hash4(*counting(0))[:2])
        assert joint_p_value(a, cells=256) < sidak(SIGNIFICANCE, 16)
        assert joint_p_value(a, b) < sidak(SIGNIFICANCE, 24)


class TestUnitFloat:
    def test_never_reaches_one(self) -> None:
        values = to_host(unit_float(words([0, 255, 256, 2**31, 2**32 - 1])))
        np.testing.assert_array_equal(values, [0, 0, 2.0**-24, 0.5, 1 - 2.0**-24])


class TestOwenScrambling:
    """Bits stand in reversed order: the lowest one halves the interval."""

    @pytest.mark.parametrize("bit", range(BITS))
    def test_is_a_nested_permutation(self, bit: int) -> None:
        """A bit flips with itself and depends on no higher one: so all prefixes are permuted."""
        x, seed = random_words(4096, 1), words(random_words(4096, 2))
        scrambled = np.array(owen_scramble(words(x), seed))
        flipped = np.array(owen_scramble(words(x ^ np.uint32(1 << bit)), seed))
        changed = scrambled ^ flipped
        np.testing.assert_array_equal(changed & ((1 << bit) - 1), 0)
        np.testing.assert_array_equal(changed >> bit & 1, 1)

    def test_no_two_of_a_long_run_coincide(self) -> None:
        run = np.arange(POINTS) << 7
        assert len(np.unique(np.array(owen_scramble(words(run), words([0x1234ABCD]))))) == POINTS


class TestPascalProduct:
    matrix = np.array([[comb(j, i) % 2 for j in range(BITS)] for i in range(BITS)])

    def test_is_the_product_with_the_matrix(self) -> None:
        vectors = np.concatenate([1 << np.arange(BITS), random_words(10_000)]).astype(np.uint32)
        bits = vectors[:, None] >> np.arange(BITS) & 1
        expected = (bits @ self.matrix.T % 2) @ (1 << np.arange(BITS))
        np.testing.assert_array_equal(np.array(pascal_product(words(vectors))), expected)

    def test_is_its_own_inverse(self) -> None:
        x = words(random_words(10_000))
        np.testing.assert_array_equal(np.array(pascal_product(pascal_product(x))), np.array(x))


class TestSobol:
    @pytest.mark.parametrize("decision", DECISIONS)
    @pytest.mark.parametrize("pixel", [0, 1, 2**24 + 3])
    def test_every_elementary_interval_holds_one_point_of_each_run(
        self, pixel: int, decision: int
    ) -> None:
        points = draw("sobol", pixel, np.arange(4 * STRATIFIED), decision)
        for log_count in range(STRATIFIED.bit_length()):
            for log_columns in range(log_count + 1):
                grid = np.array([2**log_columns, 2 ** (log_count - log_columns)])
                assert_one_point_each(points, grid)

    @pytest.mark.parametrize("decision", DECISIONS)
    @pytest.mark.parametrize("pixel", [0, 1, 2**24 + 3])
    def test_every_interval_holds_one_number_of_each_run(self, pixel: int, decision: int) -> None:
        numbers = draw_1d("sobol", pixel, np.arange(4 * STRATIFIED), decision)
        for log_count in range(STRATIFIED.bit_length()):
            assert_one_point_each(numbers[:, None], np.array([2**log_count]))

    def test_last_samples_of_an_epoch_are_stratified(self) -> None:
        points = draw("sobol", 5, 2**32 - STRATIFIED + np.arange(STRATIFIED), 3)
        assert_one_point_each(points, np.array([32, 32]))

    def test_the_gate_detects_one_point_in_the_wrong_place(self) -> None:
        points = draw("sobol", 0, np.arange(STRATIFIED), 0)
        points[17] = (points[17] + 0.5) % 1
        with pytest.raises(AssertionError):
            assert_one_point_each(points, np.array([32, 32]))


def assert_one_point_each(points: Floats, grid: Floats) -> None:
    """Assert that each cell of a grid holds one point of each run of as many points as cells."""
    cells = int(grid.prod())
    cell = np.ravel_multi_index(tuple((points * grid).astype(int).T), tuple(grid))
    runs = np.sort(cell.reshape(-1, cells), axis=1)
    np.testing.assert_array_equal(runs, np.broadcast_to(np.arange(cells), runs.shape))


@pytest.mark.parametrize("name", SAMPLERS)
class TestIndependence:
    """What is random in a sampler is independent in all of its coordinates."""

    def test_points_of_a_sample_over_the_pixels_are_uniform(self, name: str) -> None:
        pixels = np.arange(POINTS)
        for index, decision in ((0, 0), (1, 0), (0, 1), (1000, 5)):
            x, y = draw(name, pixels, index, decision).T
            assert joint_p_value(x, y) > sidak(SIGNIFICANCE, 4)
            assert joint_p_value(push(x), y) < sidak(SIGNIFICANCE, 4)

    def test_decisions_are_uncorrelated(self, name: str) -> None:
        decisions = [draw(name, 3, np.arange(POINTS), d) for d in range(8)]
        assert_uncorrelated(np.concatenate(decisions, axis=1))

    def test_decisions_are_independent_over_the_pixels(self, name: str) -> None:
        decisions = [draw(name, np.arange(POINTS), 0, d) for d in range(8)]
        assert_uncorrelated(np.concatenate(decisions, axis=1))
        for a, b in itertools.combinations(decisions, 2):
            assert joint_p_value(a[:, 0], b[:, 0]) > sidak(SIGNIFICANCE, 2 * 28)
            assert joint_p_value(a[:, 0], b[:, 1]) > sidak(SIGNIFICANCE, 2 * 28)

    def test_pixels_are_uncorrelated(self, name: str) -> None:
        pixels = [draw(name, p, np.arange(POINTS), 1) for p in (0, 1, 2, 256, 257, 2**20)]
        assert_uncorrelated(np.concatenate(pixels, axis=1))

    def test_neighbouring_pixels_are_independent(self, name: str) -> None:
        points = draw(name, np.arange(POINTS + 1), 0, 0)
        for a, b in itertools.product(range(2), range(2)):
            assert joint_p_value(points[1:, a], points[:-1, b]) > sidak(SIGNIFICANCE, 4)

    def test_seeds_are_uncorrelated(self, name: str) -> None:
        seeds = 0, 1, 2, *random_words(3).tolist()
        points = [draw(name, 0, np.arange(POINTS), 0, seed) for seed in seeds]
        assert_uncorrelated(np.concatenate(points, axis=1))

    def test_a_number_and_a_point_of_one_vertex_are_uncorrelated(self, name: str) -> None:
        indices = np.arange(POINTS)
        columns = draw_1d(name, 3, indices, 1)[:, None], draw(name, 3, indices, 2)
        assert_uncorrelated(np.concatenate(columns, axis=1))

    def test_the_gate_detects_a_small_correlation(self, name: str) -> None:
        points = draw(name, 0, np.arange(POINTS), 0)
        mixed = points[:, 0] + 2 * CORRELATION * points[:, 1]
        with pytest.raises(AssertionError):
            assert_uncorrelated(np.stack([points[:, 1], mixed], axis=1))

    def test_no_stream_occurs_twice(self, name: str) -> None:
        pixel, decision, seed = (a.ravel() for a in np.indices((2**12, 8, 4)))
        streams = np.concatenate(
            [self._points(name, pixel, index, decision, seed) for index in range(4)], axis=1
        )
        assert count_distinct(list(streams.T)) == len(pixel)

    def test_no_point_of_a_stream_occurs_twice(self, name: str) -> None:
        points = draw(name, 3, np.arange(POINTS), 2)
        assert count_distinct(list(points.T)) == POINTS

    @staticmethod
    def _points(name: str, pixel: Any, index: int, decision: Any, seed: Any) -> Floats:
        sampler = SAMPLERS[name](words(pixel), words([index]), words(seed))
        return to_host(sampler.next_2d(words(decision)))

    def test_numbers_depend_on_their_coordinates_alone(self, name: str) -> None:
        points = draw(name, 3, np.arange(100), 2)
        np.testing.assert_array_equal(draw(name, 3, np.arange(50, 100), 2), points[50:])

    def test_samples_beyond_32_bits_differ(self, name: str) -> None:
        shapes = [
            Sphere((0, 0, 0), 1, material=Diffuse(0.5)),
            Sphere((0, 3, 2), 0.5, radiance=5),
        ]
        camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), fov=40, width=4, height=4)
        launcher = Rendering(Scene(camera, shapes), bounces=1, sampler=name).launcher
        images = [
            launcher.launch(range(16), range(start, start + 64), 64, 0).radiance
            for start in (0, 2**32, 2**33, 2**34)
        ]
        lit = images[0] > 0
        assert lit.any()
        for a, b in itertools.combinations(images, 2):
            assert (a != b)[lit].mean() > 0.5


def assert_uncorrelated(columns: Floats) -> None:
    """Assert that the columns of (n, k) numbers have no correlation above `CORRELATION`."""
    correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert np.abs(correlation).max() < CORRELATION
