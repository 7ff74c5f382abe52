"""The error that pictures tell: of synthetic samples, and of renders against their truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

import drpt
from drpt.convergence import INDEPENDENT
from drpt.error import DARK, Estimate, relative_mse, squared_differences
from drpt.error import estimate as estimated
from drpt.film import Film
from drpt.light_pixels import light_pixels
from tests.scenes import LAMP_AND_BALL, seen_by

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.oracle.arrays import Floats

    AnyFloats = NDArray[np.float32] | NDArray[np.float64]

SIDE = 128
# Of 49152 values, whose errors are averages of 25 neighbours' in each channel.
VARIANCE = 0.03
# Such an average has 25 · 3 degrees of freedom, so that its intervals cover almost 95 %.
COVERED = 0.945, 0.955
# Half of an interval that covers 95 % of a normal distribution, in standard errors.
NORMAL_95 = 1.96


def independent_noise(samples: int, seed: int = 0) -> Floats:
    """Numbers (samples, side, side, 3) of mean 0 and variance 1."""
    return np.random.default_rng(seed).normal(size=(samples, SIDE, SIDE, 3))


def complementary_noise(samples: int, ratio: float, seed: int = 0) -> Floats:
    """Noise of which each aligned run of 2ᵏ samples has a mean of variance ρ⁻ᵏ.

    From the whole down, halves deviate from their run's mean by ±d, of variance
    v(half) − v(run), so that they complement each other.
    """
    rng = np.random.default_rng(seed)
    levels = samples.bit_length() - 1
    means: Floats = rng.normal(size=(1, SIDE, SIDE, 3)) * ratio ** (-levels / 2)
    for level in range(levels - 1, -1, -1):
        spread = np.sqrt(ratio**-level - ratio ** -(level + 1))
        deviations = rng.normal(size=means.shape) * spread
        means = np.stack([means + deviations, means - deviations], axis=1)
        means = means.reshape(-1, SIDE, SIDE, 3)
    return means


def estimate(samples: Floats, *, independent: bool) -> tuple[Floats, Floats]:
    """Image of samples (n, side, side, 3) and its standard error, as a render has them."""
    film = Film(SIDE**2)
    for number, sample in enumerate(samples):
        film.add(range(SIDE**2), sample.reshape(1, -1, 3), range(number, number + 1), 1)
    blocks, shape = film.leading_blocks, (SIDE, SIDE, 3)
    differences = squared_differences(blocks, film.size).reshape(-1, *shape)
    growth = len(samples) / (len(blocks) * film.size) if len(blocks) else 1.0
    image = film.mean.reshape(shape)
    return image, estimated(differences, image, growth, independent=independent)[0]


def covered(image: AnyFloats, truth: Floats | float, errors: AnyFloats) -> float:
    """Share of values whose intervals of 95 % hold the truth, but for float32's rounding."""
    return float((np.abs(image - truth) <= NORMAL_95 * errors + 1e-6 * np.abs(truth)).mean())


class TestIndependentNoise:
    @pytest.mark.parametrize("count", [4, 5, 6, 7, 16, 21, 27, 64])
    def test_the_error_is_that_of_the_mean(self, count: int) -> None:
        image, errors = estimate(3 + independent_noise(count), independent=True)
        assert np.mean(errors**2) == pytest.approx(1 / count, rel=VARIANCE)
        assert COVERED[0] <= covered(image, 3, errors) <= COVERED[1]

    @pytest.mark.parametrize("count", [2, 3])
    def test_two_runs_tell_as_much_as_they_can(self, count: int) -> None:
        _, errors = estimate(3 + independent_noise(count), independent=True)
        assert np.mean(errors**2) == pytest.approx(1 / count, rel=VARIANCE)

    @pytest.mark.parametrize("count", [16, 27])
    def test_a_sequence_finds_that_it_is_independent(self, count: int) -> None:
        _, errors = estimate(3 + independent_noise(count), independent=False)
        assert np.mean(errors**2) == pytest.approx(1 / count, rel=2 * VARIANCE)

    def test_relative_mse_is_the_true_one(self) -> None:
        image, errors = estimate(3 + independent_noise(64), independent=True)
        true = np.mean((image - 3) ** 2 / (9 + DARK))
        assert relative_mse(errors**2, image) == pytest.approx(true, rel=VARIANCE)

    def test_errors_follow_the_noise_from_place_to_place(self) -> None:
        noise = independent_noise(64)
        noise[:, :, SIDE // 2 :] *= 5
        _, errors = estimate(3 + noise, independent=True)
        quiet, loud = errors[:, : SIDE // 2 - 5], errors[:, SIDE // 2 + 5 :]
        assert np.mean(quiet**2) == pytest.approx(1 / 64, rel=VARIANCE)
        assert np.mean(loud**2) == pytest.approx(25 / 64, rel=VARIANCE)


class TestComplementaryNoise:
    @pytest.mark.parametrize("ratio", [2.0, 2.8, 6.0])
    def test_the_noise_falls_as_it_should(self, ratio: float) -> None:
        noise = complementary_noise(16, ratio)
        for size in (1, 4, 16):
            runs = noise.reshape(16 // size, size, SIDE, SIDE, 3).mean(axis=1)
            assert runs.var() == pytest.approx(ratio ** -np.log2(size), rel=VARIANCE)

    @pytest.mark.parametrize("ratio", [2.0, 2.8, 6.0])
    @pytest.mark.parametrize("count", [16, 64])
    def test_the_error_is_that_of_the_mean(self, count: int, ratio: float) -> None:
        image, errors = estimate(3 + complementary_noise(count, ratio), independent=False)
        assert np.mean(errors**2) == pytest.approx(ratio ** -np.log2(count), rel=2 * VARIANCE)
        assert COVERED[0] - 0.01 <= covered(image, 3, errors) <= COVERED[1] + 0.01

    @pytest.mark.parametrize("count", [18, 20, 24, 28, 30])
    def test_samples_beyond_the_runs_count(self, count: int) -> None:
        """The first of a sequence of 32; 30 of them are as good as the model of `_fall`."""
        samples = 3 + complementary_noise(32, 2.8)[:count]
        image, errors = estimate(samples, independent=False)
        true = np.mean((image - 3) ** 2)
        assert np.mean(errors**2) == pytest.approx(true, rel=0.1)

    def test_who_takes_them_as_independent_tells_too_large_an_error(self) -> None:
        image, errors = estimate(3 + complementary_noise(64, 2.8), independent=True)
        assert np.mean(errors**2) > 1.5 * np.mean((image - 3) ** 2)


@pytest.mark.parametrize("independent", [True, False])
class TestWhatIsNotNoise:
    def test_no_noise_is_no_error(self, independent: bool) -> None:
        image, errors = estimate(np.full((16, SIDE, SIDE, 3), 0.5), independent=independent)
        assert not errors.any()
        assert relative_mse(errors**2, image) == 0

    def test_a_black_picture_has_no_error(self, independent: bool) -> None:
        _, errors = estimate(np.zeros((16, SIDE, SIDE, 3)), independent=independent)
        assert not errors.any()

    def test_one_sample_tells_nothing(self, independent: bool) -> None:
        image, errors = estimate(independent_noise(1), independent=independent)
        assert np.isnan(errors).all()
        assert np.isnan(relative_mse(errors**2, image))

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
    def test_a_sample_that_is_not_finite_spoils_its_window_alone(
        self, independent: bool, value: float
    ) -> None:
        samples = 3 + independent_noise(16)
        _, clean = estimate(samples, independent=independent)
        samples[5, 60, 70] = value
        _, errors = estimate(samples, independent=independent)
        assert not np.isfinite(errors[60, 70]).any()
        far = np.ones((SIDE, SIDE), bool)
        far[54:67, 64:77] = False  # windows of three passes
        assert np.isfinite(errors[far]).all()
        assert errors[far] == pytest.approx(clean[far], rel=1e-9 if independent else 1e-2)


@pytest.mark.parametrize("radiance", [1e-12, 1e-6, 1e6, 1e12])
def test_errors_grow_with_the_radiance(radiance: float) -> None:
    samples = 3 + independent_noise(16)
    _, plain = estimate(samples, independent=True)
    _, scaled = estimate(radiance * samples, independent=True)
    # Weights are flat in the dark, and inverse squares in the light.
    assert np.sqrt(np.mean(scaled**2)) / radiance == pytest.approx(
        np.sqrt(np.mean(plain**2)), rel=VARIANCE
    )


class TestEstimate:
    def of(self, squares: Floats) -> Estimate:
        """Estimate for a grey picture with such squared differences, of independent samples."""
        levels = np.stack([squares, squares]).astype(np.float32)
        return Estimate(levels, np.ones_like(squares), 1.0, independent=True)

    def of_pixel(self, squares: Floats, image: Floats) -> Estimate:
        """Likewise, where halves of halves differ as those of independent samples do."""
        levels = np.stack([squares, 2 * squares]).astype(np.float32)
        return Estimate(levels, image, 1.0, independent=True)

    def test_many_pixels_are_certain(self) -> None:
        found = self.of(0.01 * np.random.default_rng(0).chisquare(3, (SIDE, SIDE, 3)))
        assert found.bound == found.relative_mse

    def test_a_pixel_that_holds_half_of_the_error_is_not(self) -> None:
        squares = np.ones((16, 16, 3))
        squares[3, 4] = 16**2
        found = self.of(squares)
        assert found.bound > 1.2 * found.relative_mse

    def test_a_dark_pixel_beside_a_light_may_hold_more_of_the_error_than_it_seems_to(self) -> None:
        """Rare samples alone are bright in it, as are its neighbours; without them it is black."""
        squares, image = np.full((SIDE, SIDE, 3), 1e-4), np.ones((SIDE, SIDE, 3))
        image[2:5, 3:6] = 10
        squares[3, 4], image[3, 4] = 0.3**2, 0.3
        found = self.of_pixel(squares, image)
        own = 0.3**2 / DARK / SIDE**2
        assert found.relative_mse < 0.3 * own
        assert 2 * found.bound > own

    def test_a_few_pixels_need_not_converge_as_fast_as_the_picture(self) -> None:
        """All differences say that noise falls sixfold."""
        squares = np.full((SIDE, SIDE, 3), 1e-4)
        squares[3, 4] = 1e-4 * SIDE**2
        image = np.full_like(squares, 2.0)
        levels = np.stack([squares, 6 * squares]).astype(np.float32)
        found = Estimate(levels, image, 1.0, independent=False)
        independent = Estimate(levels, image, 1.0, independent=True)
        assert independent.relative_mse > 3 * found.relative_mse
        assert 2 * found.bound > independent.relative_mse

    def test_the_bound_of_a_part_is_that_of_a_picture_without_noise_elsewhere(self) -> None:
        rng = np.random.default_rng(1)
        squares = 0.01 * rng.chisquare(3, (SIDE, SIDE, 3))
        chosen = np.zeros((SIDE, SIDE), np.bool_)
        chosen[:3, :2] = True
        whole, part = self.of(squares), self.of(np.where(chosen[..., None], squares, 0))
        assert whole.bound_in(chosen) < whole.bound
        assert whole.bound_in(chosen) == pytest.approx(part.bound, rel=0.01)
        assert whole.bound_in(chosen & False) == 0

    def test_what_is_measured_is_certain(self) -> None:
        squares = 0.01 * np.random.default_rng(0).chisquare(3, (SIDE, SIDE, 3))
        plain = self.of(squares)
        measured = np.zeros_like(squares)
        measured[3, 4] = 5 * SIDE**2
        found = replace(plain, measured=measured)
        assert found.relative_mse == pytest.approx(plain.relative_mse + 5)
        assert found.bound == found.relative_mse

    def test_a_bright_pixel_among_dark_ones_counts_relative_to_itself(self) -> None:
        """Differences for a pixel of value 10 and variance 1 whose neighbours are black."""
        squares = np.zeros((SIDE, SIDE, 3))
        squares[3, 4] = 1
        image = np.zeros_like(squares)
        image[3, 4] = 10
        found = self.of_pixel(squares, image)
        assert found.relative_mse == pytest.approx(1 / (8**2 + DARK) / SIDE**2, rel=1e-6)

    def test_a_firefly_does_not_hide_itself(self) -> None:
        """A single sample is as large as its standard error."""
        squares = np.zeros((SIDE, SIDE, 3))
        squares[3, 4] = 1000**2
        image = np.sqrt(squares)
        found = self.of_pixel(squares, image)
        assert found.relative_mse == pytest.approx(1000**2 / DARK / SIDE**2, rel=1e-6)


class TestRelativeMse:
    def test_it_is_relative_to_what_there_is(self) -> None:
        image = np.full((8, 8, 3), 2.0)
        assert relative_mse(np.full((8, 8, 3), 0.04), image) == pytest.approx(0.04 / 4.01)

    def test_dark_pixels_do_not_decide(self) -> None:
        image = np.zeros((8, 8, 3))
        assert relative_mse(np.full((8, 8, 3), 1e-6), image) == pytest.approx(1e-4)

    def test_a_firefly_does_not_hide_itself(self) -> None:
        image, squares = np.ones((16, 16, 3)), np.zeros((16, 16, 3))
        image[8, 8], squares[6:11, 6:11] = 1000, 1000**2 / 25
        assert relative_mse(squares, image) > 100 * relative_mse(squares, np.full_like(image, 1e3))


def differences_of(result: drpt.Result) -> NDArray[np.float32]:
    found = result._differences
    assert found is not None
    return found


def test_renders_keep_what_the_error_needs() -> None:
    scene = LAMP_AND_BALL
    assert len(differences_of(drpt.render(scene, 1))) == 0
    assert len(differences_of(drpt.render(scene, 2))) == 1
    assert len(differences_of(drpt.render(scene, 64))) == 2
    assert np.isnan(drpt.render(scene, 1).error)
    off = drpt.render(scene, 64, error=False)
    assert np.isnan(off.standard_error).all()
    assert np.isnan(off.error)
    on = drpt.render(scene, 64)
    assert on.standard_error.shape == on.image.shape
    assert on.standard_error.dtype == np.float32
    assert np.array_equal(on.image, off.image)
    assert on.rays == off.rays


BESIDE_SEEDS = 24
CALIBRATED = 0.7, 1.4


def test_standard_errors_beside_a_light_are_not_those_of_its_edge() -> None:
    """Around the lamp of the glossy box, within two pixels, noise has a magnitude as at its edge.

    The mean squared standard error over the variance across seeds is 1.02 ± 0.08 with 64 seeds; it
    was 1.81 when variances were averaged over the edge of the lamp and what is beside it.
    """
    scene = drpt.load_scene("cornell-box-glossy").resized(height=32)
    lights = light_pixels(scene)
    beside = binary_dilation(lights, np.ones((5, 5))) & ~lights
    results = [
        drpt.render(scene, 16, 2, sampler="independent", seed=s) for s in range(BESIDE_SEEDS)
    ]
    variance = np.var([result.image[beside] for result in results], axis=0, ddof=1).mean()
    told = np.mean([np.square(result.standard_error[beside]) for result in results])
    assert CALIBRATED[0] < told / variance < CALIBRATED[1]


# Scenes of ten thousand pixels and more, as they are rendered by default or in a course.
HONEST: dict[str, tuple[int, str]] = {
    "cornell-box": (2, "explicit"),
    "cornell-box-glossy": (3, "mis"),
    "veach": (3, "mis"),
    "spheres": (3, "mis"),
    "many-lights": (3, "mis"),
}
SAMPLERS = "sobol", "independent"
TOO_LOW = pytest.mark.xfail(
    strict=True,
    reason="pixels beside bright lights count too little: the estimate is 0.6 to 0.8 of the truth",
)
CASES = [
    pytest.param(*case, marks=TOO_LOW if case == ("veach", "sobol") else ())
    for case in product(HONEST, SAMPLERS)
]
SIZE = 192, 128
SEEDS = range(5, 10)  # so that no single firefly decides
TRUTH_SPP = 2048  # its own error, as it tells it, is taken off
INSIDE = 0.92, 0.98
TRUE = 0.15


@cache
def truth_of(name: str) -> drpt.Result:
    scene = seen_by(drpt.load_scene(name), *SIZE)
    return drpt.render(scene, TRUTH_SPP, HONEST[name][0], seed=99)


def true_error(result: drpt.Result, truth: drpt.Result) -> float:
    """RelMSE of a picture, less that of the truth."""
    image, exact = (r.image.astype(np.float64) for r in (result, truth))
    squares = (image - exact) ** 2 - truth.standard_error.astype(np.float64) ** 2
    return float(np.mean(squares / (exact**2 + DARK)))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "sampler"), CASES)
def test_the_error_of_renders_is_honest(name: str, sampler: str) -> None:
    truth, (bounces, mode) = truth_of(name), HONEST[name]
    exact = truth.image.astype(np.float64)
    settings: Any = {"spp": 64, "bounces": bounces, "mode": mode, "sampler": sampler}
    found = [drpt.render(truth.scene, seed=seed, **settings) for seed in SEEDS]
    inside = [
        covered(r.image, exact, np.hypot(r.standard_error, truth.standard_error)) for r in found
    ]
    assert INSIDE[0] <= np.mean(inside) <= INSIDE[1]
    told = sum(result.error for result in found)
    assert told == pytest.approx(sum(true_error(r, truth) for r in found), rel=TRUE)


@pytest.mark.slow
def test_the_gate_sees_sobol_points_that_are_taken_as_independent() -> None:
    """They have half of the error in the Cornell box."""
    scene = seen_by(drpt.load_scene("cornell-box"), *SIZE)
    result = drpt.render(scene, 256, 2, "explicit", seed=5)
    image = result.image.astype(np.float64)
    wrong, _ = estimated(differences_of(result), image, 1.0, independent=True)
    assert relative_mse(wrong**2, image) > (1 + TRUE) * true_error(result, truth_of("cornell-box"))
    assert INDEPENDENT == 2
