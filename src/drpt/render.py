"""Rendering: the only place where scene, kernel, film and output meet."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass, fields
from importlib.metadata import version
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.film import Film
from drpt.kernel import backend
from drpt.kernel.estimator import Features, Mode
from drpt.output import write
from drpt.scene import Scene
from drpt.scene.saving import to_toml

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike

    from numpy.typing import NDArray

    from drpt.kernel.launch import Launcher, Sums

__all__ = [
    "SAMPLERS",
    "Explanation",
    "Mode",
    "Rendering",
    "Result",
    "explain",
    "plan_passes",
    "render",
]

SAMPLERS = ("sobol", "independent")
MAX_SPP = 2**48
MAX_BOUNCES = 2**16
LAUNCH_PATHS = 2**24
"""Paths of a launch: long enough to be worth it, short enough to be interrupted."""
LAUNCH_PIXELS = 2**20
"""Pixels of a launch at the most, which bounds its memory to some 100 MB."""
SHARING_SPP = 64
"""With so many samples per pixel, edges are smooth even if a few share a camera ray."""
LAUNCH_LANES = 2**18
"""Lanes of a launch at the least: small pictures use several for each pixel."""


def plan_passes(pixels: int, spp: int) -> Iterator[range]:
    """Passes of a render, as ranges of samples; they depend on the resolution and spp alone.

    All but the last take the same power of two of samples, so none of them crosses a multiple
    of 2³², where a sampler's index begins anew.
    """
    launch_pixels = min(pixels, LAUNCH_PIXELS)
    count = 2 ** ((LAUNCH_PATHS // launch_pixels).bit_length() - 1)
    for start in range(0, spp, count):
        yield range(start, min(start + count, spp))


@dataclass(frozen=True, eq=False)
class Result:
    """A picture, and what it took.

    Attributes
    ----------
    image
        Linear radiance, W/(m² sr) or relative, float32 (height, width, 3), row 0 at the top.
    scene, spp, bounces, mode, sampler, seed, jitter
        What was rendered, and how; ``spp`` are the samples that each pixel has got.
    seconds
        Time that the passes took, compilation included.
    rays
        Rays traced, to vertices and to lights.
    non_finite
        Samples that were infinite or not a number; they are in the image, too.
    first_non_finite
        Column, row and number of one of them, if there are any; :meth:`Rendering.sample` traces
        it again.
    warning
        What is wrong with the picture, and how to see it again; None if nothing is.
    """

    image: NDArray[np.float32]
    scene: Scene
    spp: int
    bounces: int
    mode: Mode
    sampler: str
    seed: int
    jitter: bool
    seconds: float
    rays: int
    non_finite: int
    first_non_finite: tuple[int, int, int] | None = None
    warning: str | None = None

    @property
    def paths(self) -> int:
        """Paths traced: width × height × spp."""
        return int(self.image.size // 3 * self.spp)

    @property
    def metadata(self) -> dict[str, str | int | float]:
        """Settings, figures, versions and the scene, as they are written beside a picture."""
        settings = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name not in ("image", "scene", "first_non_finite", "warning")
        }
        if self.first_non_finite is not None:
            settings["first_non_finite"] = "{} {} {}".format(*self.first_non_finite)
        versions = {name: version(name) for name in ("drpt", "drjit", "numpy")}
        return {**settings, "mode": str(self.mode), **versions, "scene": to_toml(self.scene)}

    def save(self, path: str | PathLike[str], *, exposure: float = 0.0) -> None:
        """Write the picture; the suffix chooses .exr (float32), .png (sRGB, 8 bit) or .npy.

        ``exposure`` brightens a PNG by so many stops. Raises `ValueError` for another suffix and
        `OSError` where the file cannot be written; a file that was there before stays whole.
        """
        write(path, self.image, self.metadata, exposure=exposure)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.image, dtype=dtype, copy=copy)


class Rendering:
    """A render that runs pass by pass.

    Parameters are those of :func:`render`, which is all that most callers need.
    """

    def __init__(
        self,
        scene: Scene,
        spp: int = 64,
        bounces: int = 3,
        mode: str = Mode.MIS,
        *,
        sampler: str = "sobol",
        seed: int = 0,
        jitter: bool = True,
    ) -> None:
        self.scene = _check_scene(scene)
        self.spp = _check_whole("spp", spp, 1, MAX_SPP)
        self.bounces = _check_whole("bounces", bounces, 0, MAX_BOUNCES)
        self.mode = _check_mode(mode)
        self.sampler = _check_choice("sampler", sampler, SAMPLERS)
        self.seed = _check_whole("seed", seed, 0, None)
        self.jitter = _check_switch("jitter", jitter)
        self._film = Film(scene.camera.width * scene.camera.height)
        self._done = 0  # samples of each pixel, in whole passes
        self._pixels = 0  # that have got those of the pass amid which an interrupt came
        self._rays = 0
        self._non_finite = 0
        self._first_non_finite: tuple[int, int, int] | None = None
        self._seconds = 0.0

    def passes(self) -> Iterator[int]:
        """Run the passes that have not run yet; yields after each the samples per pixel so far."""
        start = perf_counter()
        with backend.interrupts_put_off():
            launcher = self.launcher()
        pixels = len(self._film.mean)
        for samples in plan_passes(pixels, self.spp):
            if samples.start < self._done:
                continue
            for part in _parts(pixels):
                if part.start < self._pixels:
                    continue
                rays = -(-len(samples) // launcher.paths_per_ray)
                replicates = min(rays, max(1, LAUNCH_LANES // len(part)))
                with backend.interrupts_put_off():
                    sums = launcher.launch(part, samples, replicates, self.seed)
                self._film.add(part, sums.radiance, len(samples))
                self._rays += sums.rays
                self._non_finite += sums.non_finite
                if sums.non_finite and self._first_non_finite is None:
                    bad = ~np.isfinite(sums.radiance).all(axis=1)
                    pixel = part.start + int(bad.argmax())
                    self._first_non_finite = self._find_non_finite(launcher, pixel, samples)
                self._pixels = part.stop
            self._done, self._pixels = samples.stop, 0
            self._seconds += perf_counter() - start
            yield self._done
            start = perf_counter()

    def _find_non_finite(
        self, launcher: Launcher, pixel: int, samples: range
    ) -> tuple[int, int, int]:
        """Column, row and number of the first sample of a pixel that is not finite."""
        row, column = divmod(pixel, self.scene.camera.width)
        first, stop = samples.start, samples.stop
        while stop - first > 1:
            middle = (first + stop) // 2
            with backend.interrupts_put_off():
                sums = self._trace(launcher, pixel, range(first, middle))
            first, stop = (first, middle) if sums.non_finite else (middle, stop)
        return column, row, first

    def _trace(self, launcher: Launcher, pixel: int, samples: range) -> Sums:
        """Samples of a single pixel."""
        lanes = min(len(samples), LAUNCH_LANES)
        return launcher.launch(range(pixel, pixel + 1), samples, lanes, self.seed)

    def sample(self, column: int, row: int, number: int) -> NDArray[np.float64]:
        """Radiance (3,) of one sample of a pixel, the same that the passes trace.

        ``row`` counts from the top, ``number`` from 0; raises `ValueError` for one out of range.
        """
        camera = self.scene.camera
        column = _check_whole("column", column, 0, camera.width - 1)
        row = _check_whole("row", row, 0, camera.height - 1)
        number = _check_whole("number", number, 0, self.spp - 1)
        pixel = row * camera.width + column
        with backend.interrupts_put_off():
            sums = self._trace(self.launcher(), pixel, range(number, number + 1))
        return np.asarray(sums.radiance[0])

    def launcher(self) -> Launcher:
        """Put the scene on the device."""
        types = backend.load()  # before Dr.Jit is imported, which the kernels do
        from drpt.kernel.launch import make_launcher

        return make_launcher(
            types,
            self.scene,
            self.bounces,
            self.mode,
            self.sampler,
            jitter=self.jitter,
            share_rays=self.sampler == "sobol" and self.spp >= SHARING_SPP,
        )

    def result(self) -> Result:
        """The picture of the passes that have run.

        After an interrupt amid a pass, some pixels hold its samples already.
        """
        camera = self.scene.camera
        return Result(
            image=self._film.mean.astype(np.float32).reshape(camera.height, camera.width, 3),
            scene=self.scene,
            spp=self._done,
            bounces=self.bounces,
            mode=self.mode,
            sampler=self.sampler,
            seed=self.seed,
            jitter=self.jitter,
            seconds=self._seconds,
            rays=self._rays,
            non_finite=self._non_finite,
            first_non_finite=self._first_non_finite,
            warning=self._warning(),
        )

    def _warning(self) -> str | None:
        if self._first_non_finite is None:
            return None
        column, row, sample = self._first_non_finite
        return (
            f"{self._non_finite} samples were not finite, one of them in pixel ({column}, {row}): "
            f"Rendering(scene, {self.spp}, {self.bounces}, {str(self.mode)!r}, "
            f"sampler={self.sampler!r}, seed={self.seed}, jitter={self.jitter})"
            f".sample({column}, {row}, {sample}) traces it again"
        )


def render(
    scene: Scene,
    spp: int = 64,
    bounces: int = 3,
    mode: str = Mode.MIS,
    *,
    sampler: str = "sobol",
    seed: int = 0,
    jitter: bool = True,
) -> Result:
    """Render a scene.

    Parameters
    ----------
    scene
        What to render.
    spp
        Samples per pixel, from 1 to 2⁴⁸; each is a path of its own. From 64 on, with Sobol' points,
        in rooms that a single sphere lights, four of them share their camera ray and its first
        vertex: :func:`explain` says whether.
    bounces
        How often light bounces at most, from 0 to 65536: 0 shows the lights alone, 1 adds what
        they light, 2 one indirect bounce, …. Light of longer paths is missing from the picture.
    mode
        A `Mode` or its name; all of them converge to the same picture.
    sampler
        ``"sobol"`` (Owen-scrambled Sobol' points) or ``"independent"``.
    seed
        Whole number ≥ 0; another one gives other noise.
    jitter
        Whether samples are spread over their pixel; else all go through its centre.

    Returns
    -------
    Result
        The same call gives the same bits, whatever the number of threads. Samples that are not
        finite stay in it, and give a `RuntimeWarning` that says where.

    Raises
    ------
    ValueError
        A setting is not allowed; the message names it and says what is.
    drpt.kernel.backend.BackendError
        Neither a usable libLLVM nor CUDA was found.
    """
    rendering = Rendering(scene, spp, bounces, mode, sampler=sampler, seed=seed, jitter=jitter)
    for _ in rendering.passes():
        pass
    result = rendering.result()
    if result.warning:
        warnings.warn(result.warning, RuntimeWarning, stacklevel=2)
    return result


@dataclass(frozen=True)
class Explanation:
    """What the kernel of a render contains.

    Attributes
    ----------
    features
        Name of each feature, and whether the kernel has code for it.
    operations
        Dr.Jit's count of operations, with the default sampler.
    """

    features: dict[str, bool]
    operations: int

    def __str__(self) -> str:
        width = max(map(len, self.features))
        lines = [f"{name:{width}}  {'yes' if on else 'no'}" for name, on in self.features.items()]
        return "\n".join([*lines, f"{'operations':{width}}  {self.operations}"])


def explain(scene: Scene, bounces: int = 3, mode: str = Mode.MIS) -> Explanation:
    """Say what the kernel for a scene and settings contains, and what it leaves out.

    Raises `ValueError` like :func:`render`.
    """
    launcher = Rendering(scene, bounces=bounces, mode=mode).launcher()
    features = {f.name: getattr(launcher.tracer.features, f.name) for f in fields(Features)}
    return Explanation(features, launcher.operations())


def _parts(pixels: int) -> list[range]:
    starts = range(0, pixels, LAUNCH_PIXELS)
    return [range(start, min(start + LAUNCH_PIXELS, pixels)) for start in starts]


def _check_scene(scene: object) -> Scene:
    if not isinstance(scene, Scene):
        raise _refuse("scene", scene, "a drpt.Scene, as drpt.load_scene returns it")
    return scene


def _check_whole(name: str, value: object, low: int, high: int | None) -> int:
    limits = f">= {low}" if high is None else f"from {low} to {high}"
    allowed = f"a whole number {limits}"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise _refuse(name, value, allowed)
    if value < low or (high is not None and value > high):
        raise _refuse(name, value, allowed)
    return int(value)


def _check_mode(mode: object) -> Mode:
    if isinstance(mode, str):
        with suppress(ValueError):
            return Mode(mode)
    raise _refuse("mode", mode, f"one of {', '.join(Mode)}")


def _check_choice(name: str, value: object, choices: tuple[str, ...]) -> str:
    if not isinstance(value, str) or value not in choices:
        raise _refuse(name, value, f"one of {', '.join(choices)}")
    return value


def _check_switch(name: str, value: object) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise _refuse(name, value, "True or False")
    return bool(value)


def _refuse(name: str, value: object, allowed: str) -> ValueError:
    return ValueError(f"{name}: {value!r} is not allowed; it must be {allowed}")
