"""Rendering: the only place where scene, kernel, film and output meet."""

from __future__ import annotations

import warnings
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.black import black_because
from drpt.checkpoint import Checkpoint, CheckpointError
from drpt.distribution import versions
from drpt.error import Estimate, squared_differences
from drpt.files import check_file
from drpt.film import Film
from drpt.immutable import immutable
from drpt.kernel import backend
from drpt.kernel.estimator import SHARING_SPP, Mode, feature_facts, layout_facts
from drpt.light_pixels import light_pixels
from drpt.machine import require_memory
from drpt.missed import Emission, measured, rays_for, runs
from drpt.plan import parts, plan_passes, run_length
from drpt.progress import with_bar
from drpt.result import SAMPLES, Result
from drpt.scene.saving import to_toml
from drpt.settings import SAMPLERS, Settings, check_positive, check_switch, check_whole, refuse
from drpt.state import State
from drpt.stopping import Stopping

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Mapping

    from numpy.typing import NDArray

    from drpt.kernel.launch import Launcher, Sums
    from drpt.kernel.recording import Vertices
    from drpt.scene import Scene

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

PACKAGES = ("drjit", "mitsuba", "numpy")
"""Packages, beside drpt, whose versions determine the bits of a picture."""
OTHER_SEED = 2**32
"""Offset to the seed of independent samples."""
PIXEL_BYTES = 72
"""Bytes of a pixel: its sum, the mean of a result, and its image, in float64 and float32."""
ERROR_BYTES = PIXEL_BYTES + 8 * 12
"""Bytes of a pixel with the sums of eight blocks, for the error."""
FIRST_HIT_SPP = 64
"""Samples after which layers of first hits are as smooth as edges in 8 bits."""


class Rendering:
    """A render that runs pass by pass.

    Parameters are those of :func:`render`, which is all that most callers need.

    Attributes
    ----------
    settings
        What is rendered, and how.
    """

    def __init__(  # noqa: PLR0913 -- a setting each
        self,
        scene: Scene,
        spp: int = 64,
        bounces: int = 3,
        mode: str = Mode.MIS,
        *,
        sampler: str = "sobol",
        seed: int = 0,
        jitter: bool = True,
        error: bool = True,
        target_error: float | None = None,
        time_limit: float | None = None,
        checkpoint: str | PathLike[str] | None = None,
        checkpoint_interval: float = 30.0,
    ) -> None:
        self.settings = Settings(scene, spp, bounces, mode, sampler, seed, jitter)
        self._stopping = Stopping(target_error, time_limit)
        self._has_error = check_switch("error", error)
        if target_error is not None and not error:
            raise refuse("error", error, "True where there is a target_error")
        width, height = scene.camera.width, scene.camera.height
        needed = self.settings.pixels * (ERROR_BYTES if error else PIXEL_BYTES)
        require_memory(needed, f"width, height: a picture of {width}x{height}")
        self._film = Film(self.settings.pixels, blocks=error)
        self._rays = 0
        self._non_finite = 0
        self._first_non_finite: tuple[int, int, int] | None = None
        self._seconds = 0.0
        self._enough = False
        self._measured: tuple[int, Estimate] | None = None  # after how many samples
        interval = check_positive("checkpoint_interval", checkpoint_interval)
        self._checkpoint = None if checkpoint is None else self._resume(checkpoint, interval)

    @property
    def spp(self) -> int:
        """Samples that each pixel has got so far."""
        return self._film.samples

    def expected_spp(self, seconds: float, error: float) -> float:
        """Samples per pixel that there will be, given the seconds of one and the error by now."""
        return min(self.settings.spp, self._stopping.expected_spp(self.spp, seconds, error))

    def passes(self, paths: int | None = None) -> Generator[int]:
        """Run the passes that have not run yet; yields after each the samples per pixel so far.

        Where the iterator ends, whether it is exhausted or closed, the checkpoint is saved. Fewer
        ``paths`` make shorter passes, which take longer together; another iterator may have others.
        """
        if self._checkpoint:
            self._checkpoint.lock()
        try:
            yield from self._passes(paths)
        finally:
            self._save()
            if self._checkpoint:
                self._checkpoint.unlock()

    def _passes(self, paths: int | None) -> Generator[int]:
        self._stopping.start()
        start = perf_counter()
        settings = self.settings
        with backend.interrupts_put_off():
            launcher = self.launcher
        growing = self._stopping.may_come
        plan = plan_passes(settings.pixels, settings.spp, self.spp, growing=growing, paths=paths)
        self._enough = self.spp > 0 and self._stopping.has_come(self.spp, self._stopping_error)
        for samples in plan:
            if self._enough:
                break
            self._run(launcher, samples)
            self._enough = self._stopping.has_come(self.spp, self._stopping_error)
            if self._stopping.has_target and self.spp == settings.spp:
                self._measure_light()
            self._seconds += perf_counter() - start
            if self._checkpoint and self._checkpoint.is_due():
                self._save()
            yield self.spp
            start = perf_counter()

    def _stopping_error(self) -> float:
        """Error for the stopping rule; light is measured once the rest may be small enough."""
        rest = self.result().error_estimate.bound_in(~self._light_pixels)
        return self._measure_light().bound if self._stopping.is_enough(rest) else rest

    def _measure_light(self) -> Estimate:
        """Have the error of directly visible light measured, once after so many samples."""
        if self._measured is None or self._measured[0] != self.spp:
            self._measured = self.spp, self._measure(self.result().error_estimate)
        return self._measured[1]

    @cached_property
    def _light_pixels(self) -> NDArray[np.bool_]:
        """Whether each pixel (height, width) may show a light."""
        return light_pixels(self.settings.scene)

    def _measure(self, estimate: Estimate) -> Estimate:
        """Estimate the error anew, in which that of directly visible light is measured."""
        blocks, size = self._film.leading_blocks, self._film.size
        if not len(blocks):  # a single sample has no error
            return estimate
        return measured(estimate, blocks, size, self._emission(len(blocks), size))

    def _emission(self, count: int, size: int) -> Emission:
        """Directly visible light, also in the first ``count`` runs of ``size`` samples."""
        seed, lights = self.settings.seed, self._lights
        pixels = np.flatnonzero(self._light_pixels)
        rays = rays_for(len(pixels), self.settings.pixels, self.spp)
        shared = self.launcher.paths_per_ray // lights.paths_per_ray
        own, of_block = -(-self.spp // shared), size // shared
        shapes = self.settings.scene.shapes
        radiance = [np.asarray(shape.radiance) for shape in shapes if shape.is_light]
        blocks, found, seen = [], [], []
        for part in runs(pixels):
            with backend.interrupts_put_off():
                run = min(run_length(len(part), range(own), lights.paths_per_ray), of_block)
                sums = lights.launch(part, range(own), run, seed).radiance
                found.append(sums.sum(axis=0) / own)
                whole = sums[: count * of_block // run] * shared
                blocks.append(whole.reshape(count, -1, len(part), 3).sum(axis=1))
                run = run_length(len(part), range(rays), lights.paths_per_ray)
                sums = lights.launch(part, range(rays), run, seed + OTHER_SEED).radiance
                seen.append(sums.sum(axis=0) / rays)
        return Emission(
            pixels,
            np.concatenate([np.zeros((count, 0, 3)), *blocks], axis=1),
            np.concatenate([np.zeros((0, 3)), *found]),
            np.concatenate([np.zeros((0, 3)), *seen]),
            rays / self.spp,
            np.max([np.zeros(3), *radiance], axis=0),
        )

    def _run(self, launcher: Launcher, samples: range) -> None:
        """Run a pass, or what is left of it."""
        pixels = self.settings.pixels
        run = run_length(pixels, samples, launcher.paths_per_ray)
        for part in parts(pixels):
            if part.start < self._film.ahead:
                continue
            with backend.interrupts_put_off():
                sums = launcher.launch(part, samples, run, self.settings.seed)
                self._film.add(part, sums.radiance, samples, run)
                self._rays += sums.rays
                self._non_finite += sums.non_finite
                if sums.non_finite and self._first_non_finite is None:
                    bad = ~np.isfinite(sums.radiance.sum(axis=0)).all(axis=1)
                    pixel = part.start + int(bad.argmax())
                    self._first_non_finite = self._find_non_finite(launcher, pixel, samples)

    def _find_non_finite(
        self, launcher: Launcher, pixel: int, samples: range
    ) -> tuple[int, int, int]:
        """Column, row and number of the first sample of a pixel that is not finite."""
        row, column = divmod(pixel, self.settings.scene.camera.width)
        first, stop = samples.start, samples.stop
        while stop - first > 1:
            middle = (first + stop) // 2
            sums = self._trace(launcher, pixel, range(first, middle))
            first, stop = (first, middle) if sums.non_finite else (middle, stop)
        return column, row, first

    def _trace(self, launcher: Launcher, pixel: int, samples: range) -> Sums:
        """Samples of a single pixel."""
        run = run_length(1, samples, launcher.paths_per_ray)
        return launcher.launch(range(pixel, pixel + 1), samples, run, self.settings.seed)

    def sample(self, column: int, row: int, number: int) -> NDArray[np.float64]:
        """Radiance (3,) of one sample of a pixel, the same that the passes trace.

        ``row`` counts from the top, ``number`` from 0; raises `ValueError` for one out of range.
        """
        pixel = self._pixel(column, row)
        number = check_whole("number", number, 0, self.settings.spp - 1)
        with backend.interrupts_put_off():
            sums = self._trace(self.launcher, pixel, range(number, number + 1))
        return np.asarray(sums.radiance[0, 0])

    def vertices(self, column: int, row: int, count: int, first: int = 0) -> Vertices:
        """Vertices of the paths of ``count`` samples of a pixel, the same that the passes trace.

        What they contribute adds up to the radiance of :meth:`sample`; see
        :class:`drpt.kernel.recording.Vertices`. Raises `ValueError` for what is out of range.
        """
        pixel, spp = self._pixel(column, row), self.settings.spp
        first = check_whole("first", first, 0, spp - 1)
        count = check_whole("count", count, 1, spp - first)
        with backend.interrupts_put_off():
            launcher = self.launcher
            from drpt.kernel.recording import record

            return record(launcher, pixel, range(first, first + count), self.settings.seed)

    def _pixel(self, column: int, row: int) -> int:
        camera = self.settings.scene.camera
        column = check_whole("column", column, 0, camera.width - 1)
        row = check_whole("row", row, 0, camera.height - 1)
        return row * camera.width + column

    @cached_property
    def launcher(self) -> Launcher:
        """The scene on the device, and what it is rendered by."""
        return self._new_launcher(self.settings.bounces)

    @cached_property
    def _lights(self) -> Launcher:
        """Likewise for light that is seen directly."""
        with backend.interrupts_put_off():
            return self._new_launcher(0)

    def _new_launcher(self, bounces: int) -> Launcher:
        types = backend.load()  # before Dr.Jit is imported, which the kernels do
        from drpt.kernel.launch import make_launcher
        from drpt.kernel.overlaps import warning_of

        settings = self.settings
        launcher = make_launcher(
            types,
            settings.scene,
            bounces,
            Mode(settings.mode),
            settings.sampler,
            jitter=settings.jitter,
            share_rays=settings.sampler == "sobol" and settings.spp >= SHARING_SPP,
        )
        if overlaps := launcher.primitives.overlaps:
            warnings.warn(warning_of(overlaps), RuntimeWarning, stacklevel=2)
        return launcher

    def result(self) -> Result:
        """The picture of the passes that have run.

        After an interrupt amid a pass, some pixels hold its samples already.
        """
        film, camera = self._film, self.settings.scene.camera
        shape = camera.height, camera.width, 3
        blocks = film.leading_blocks
        settings: dict[str, Any] = {**vars(self.settings), "spp": self.spp}
        looked, measured = self._measured or (0, None)
        return Result(
            image=film.mean.astype(np.float32).reshape(shape),
            **settings,
            partial=self.spp < self.settings.spp and not self._enough,
            seconds=self._seconds,
            rays=self._rays,
            non_finite=self._non_finite,
            first_non_finite=self._first_non_finite,
            warning=self._warning(),
            layers={SAMPLES: np.broadcast_to(immutable(np.array(self.spp, np.float32)), shape[:2])},
            _differences=squared_differences(blocks, film.size).reshape(-1, *shape),
            _growth=film.samples / (len(blocks) * film.size) if len(blocks) else 1.0,
            _measured=measured if looked == self.spp else None,
        )

    def first_hits(self) -> dict[str, NDArray[np.float32]]:
        """Layers ``albedo``, ``normal`` and ``depth`` of what the camera sees first.

        See :func:`drpt.kernel.first_hit.first_hits`.
        """
        types = backend.load()
        from drpt.kernel.first_hit import first_hits

        settings = self.settings
        return first_hits(
            types,
            settings.scene,
            min(settings.spp, FIRST_HIT_SPP),
            sampler=settings.sampler,
            seed=settings.seed,
            jitter=settings.jitter,
        )

    def final_result(self) -> Result:
        """The picture of the passes that have run; if it is black, its ``warning`` says why."""
        result = self.result()
        if result.spp == 0 or result.image.any():
            return result
        return replace(result, warning=f"the picture is black: {self._why_black()}")

    def _why_black(self) -> str:
        settings = self.settings
        types = backend.load()
        from drpt.kernel.first_hit import first_seen

        if settings.bounces and not Mode(settings.mode).samples_lights:
            aimed = Rendering(settings.scene, 1, settings.bounces, Mode.EXPLICIT, error=False)
            if any(aimed.result().image.any() for _ in aimed.passes()):
                return (
                    f"mode {settings.mode} finds lights by chance only, and no path has found one; "
                    f"take more spp, or mode {Mode.MIS}"
                )
        seen = first_seen(types, settings.scene)
        return black_because(settings.scene, settings.bounces, seen)

    def _warning(self) -> str | None:
        if self._first_non_finite is None:
            return None
        column, row, sample = self._first_non_finite
        settings = self.settings
        return (
            f"{self._non_finite} samples were not finite, one of them in pixel ({column}, {row}): "
            f"Rendering(scene, {settings.spp}, {settings.bounces}, {str(settings.mode)!r}, "
            f"sampler={settings.sampler!r}, seed={settings.seed}, jitter={settings.jitter})"
            f".sample({column}, {row}, {sample}) traces it again"
        )

    def _resume(self, path: str | PathLike[str], interval: float) -> Checkpoint:
        """Take up what a checkpoint holds, if there is one."""
        if not isinstance(path, str | PathLike):
            raise refuse("checkpoint", path, "the path of a file")
        path = Path(path)
        check_file(path)
        checkpoint = Checkpoint(path, self._identity(), interval)
        checkpoint.lock()
        try:
            if saved := checkpoint.load():
                self._restore(checkpoint.path, *saved)
        except BaseException:
            checkpoint.unlock()
            raise
        return checkpoint

    def _restore(self, path: Path, facts: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
        """Restore the state in a checkpoint; raises `CheckpointError` if it is impossible."""
        try:
            state = State.checked(facts, arrays, self.settings, error=self._has_error)
        except ValueError as error:
            raise CheckpointError(f"{path}: no render can be in its state: {error}") from error
        self._film.restore(state.total, state.blocks, state.spp, state.block)
        self._rays, self._non_finite = state.rays, state.non_finite
        self._first_non_finite = state.first_non_finite
        self._seconds = state.seconds
        self._stopping.last_look = state.last_look

    def _identity(self) -> dict[str, str | int | bool | None]:
        """Everything that determines the bits of the picture; CPU and threads do not."""
        machine = backend.describe()
        settings = {**vars(self.settings), "seed": str(self.settings.seed)}
        return {
            **settings,
            "mode": str(self.settings.mode),
            "scene": to_toml(self.settings.scene),
            "error": self._has_error,
            **{f"version of {name}": found for name, found in versions(*PACKAGES).items()},
            "version of LLVM": machine.llvm_version,
            "backend": machine.name,
            "prepared scene": self._digest(),
        }

    def _digest(self) -> str:
        """Digest of the prepared scene, to compare it with that of another machine."""
        from drpt.kernel.digest import digest

        with backend.interrupts_put_off():
            return digest(self.launcher)

    def _save(self) -> None:
        """Save the passes that have run, if that is wanted; a render goes on where that fails."""
        film = self._film
        if self._checkpoint is None or film.ahead or not film.samples:
            return
        state = State(
            spp=film.samples,
            block=film.size,
            rays=self._rays,
            non_finite=self._non_finite,
            first_non_finite=self._first_non_finite,
            seconds=self._seconds,
            last_look=self._stopping.last_look,
            **film.state,
        )
        try:
            self._checkpoint.save(state.facts, state.arrays)
        except OSError as error:
            warnings.warn(f"no checkpoint: {error}", RuntimeWarning, stacklevel=2)


def render(  # noqa: PLR0913 -- a setting each
    scene: Scene,
    spp: int = 64,
    bounces: int = 3,
    mode: str = Mode.MIS,
    *,
    sampler: str = "sobol",
    seed: int = 0,
    jitter: bool = True,
    error: bool = True,
    target_error: float | None = None,
    time_limit: float | None = None,
    checkpoint: str | PathLike[str] | None = None,
    checkpoint_interval: float = 30.0,
    layers: bool = False,
    on_pass: Callable[[Result], object] | None = None,
    progress: bool = False,
) -> Result:
    """Render a scene.

    Parameters
    ----------
    scene
        What to render.
    spp
        Samples per pixel, from 1 to 2⁴⁸; each is a path of its own. From 64 on, with Sobol' points,
        in rooms that a single sphere lights, four of them share their camera ray and its first
        vertex: :func:`explain` says whether. With a target or a limit, the most that it may take.
    bounces
        How often light bounces at most, from 0 to 65536: 0 shows the lights alone, 1 adds what
        they light, 2 one indirect bounce, …. Light of longer paths is missing from the picture.
    mode
        A `Mode` or its name: ``"implicit-uniform"``, ``"implicit"``, ``"explicit-uniform"``,
        ``"explicit"``, ``"mis"`` or ``"guided"``; all of them converge to the same picture.
    sampler
        ``"sobol"`` (Owen-scrambled Sobol' points) or ``"independent"``.
    seed
        Whole number ≥ 0; another one gives other noise.
    jitter
        Whether samples are spread over their pixel; else all go through its centre.
    error
        Whether to keep what ``result.standard_error`` and ``result.error`` are estimated from: up
        to 120 bytes a pixel, and no sample.
    target_error
        Stop as soon as the estimated relMSE of the picture is no larger, from 64 samples on.
    time_limit
        Stop after this number of seconds, compilation included; the running pass ends.
    checkpoint
        A file to keep the state in; the same call takes it up again, and gives the same bits as
        one that was never interrupted.
    checkpoint_interval
        Seconds between two states; there is another one in the end.
    layers
        Whether ``result.layers`` has albedo, normal and depth of what the camera sees first, which
        EXRs hold and :meth:`Result.denoise` is guided by.
    on_pass
        Called after each pass with the `Result` so far.
    progress
        Whether to draw a bar, on a terminal or in a notebook.

    Returns
    -------
    Result
        The same call gives the same bits, if no time limit stops it, with any number of threads and
        on every x86-64 CPU with FMA. Scenes with more triangles than are unrolled, which Embree
        intersects, were measured on one CPU only. A `RuntimeWarning` says where samples are not
        finite (they stay in the picture), why a picture is black, and which shapes overlap in one
        plane.

    Raises
    ------
    ValueError
        A setting is not allowed; the message names it and says what is.
    drpt.checkpoint.CheckpointError
        A `ValueError`: the checkpoint is damaged, or of another render; the message says how.
    OSError
        The checkpoint cannot be read, or its folder not be written to.
    drpt.kernel.backend.BackendError
        Neither a usable libLLVM nor CUDA was found.
    """
    rendering = Rendering(
        scene,
        spp,
        bounces,
        mode,
        sampler=sampler,
        seed=seed,
        jitter=jitter,
        error=error,
        target_error=target_error,
        time_limit=time_limit,
        checkpoint=checkpoint,
        checkpoint_interval=checkpoint_interval,
    )
    check_switch("layers", layers)
    if on_pass is not None and not callable(on_pass):
        raise refuse("on_pass", on_pass, "a function that takes a Result")
    bar = check_switch("progress", progress)
    with closing(rendering.passes()) as passes:
        for _ in with_bar(rendering, passes) if bar else passes:
            if on_pass is not None:
                on_pass(rendering.result())
    result = rendering.final_result()
    if layers:
        result = replace(result, layers={**result.layers, **rendering.first_hits()})
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
    reasons
        Name of each feature, and why it is there or not.
    operations
        Dr.Jit's count of operations, with the default sampler.
    """

    features: dict[str, bool]
    reasons: dict[str, str]
    operations: int

    def __str__(self) -> str:
        width = max(map(len, self.features))
        lines = [
            f"{name:{width}}  {'yes' if on else 'no':3}  {self.reasons[name]}"
            for name, on in self.features.items()
        ]
        return "\n".join([*lines, f"{'operations':{width}}  {self.operations}"])


def explain(scene: Scene, bounces: int = 3, mode: str = Mode.MIS) -> Explanation:
    """Say what the kernel for a scene and settings contains, what it leaves out, and why.

    Raises `ValueError` like :func:`render`.
    """
    rendering = Rendering(scene, bounces=bounces, mode=mode)
    with backend.interrupts_put_off():
        launcher = rendering.launcher
        operations = launcher.operations()
    what = launcher.primitives, bounces, Mode(rendering.settings.mode)
    worthwhile = launcher.tracer.features.guiding
    facts = {
        **feature_facts(*what, worthwhile=worthwhile),
        **layout_facts(*what, worthwhile=worthwhile),
    }
    return Explanation(
        features={name: fact.holds for name, fact in facts.items()},
        reasons={name: fact.reason for name, fact in facts.items()},
        operations=operations,
    )
