"""A picture, and what it took."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.distribution import versions
from drpt.error import Estimate
from drpt.immutable import Immutable, immutable
from drpt.light_pixels import light_pixels
from drpt.notebook import figure
from drpt.output import write
from drpt.scene.saving import to_toml

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import NDArray

    from drpt.kernel.estimator import Mode
    from drpt.scene import Scene

STANDARD_ERROR = "standard_error"
"""Name of its layer in an EXR."""
SAMPLES = "samples"
"""Likewise."""
_NOT_METADATA = {"image", "scene", "layers", "first_non_finite", "warning"}


@dataclass(frozen=True, eq=False)
class Result(Immutable):
    """A picture, its settings and its cost; its arrays cannot be changed.

    Attributes
    ----------
    image
        Linear radiance, W/(m² sr) or relative, float32 (height, width, 3), row 0 at the top.
    scene, spp, bounces, mode, sampler, seed, jitter
        What was rendered, and how; ``spp`` are the samples that each pixel has got.
    partial
        Whether the render was interrupted before it had all samples that it was to take.
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
    layers
        More float32 images, (height, width, 3) or (height, width), by the names of their layers in
        an EXR: ``samples`` that each pixel has got; on request ``albedo``, ``normal`` and
        ``depth``, see :func:`drpt.kernel.first_hit.first_hits`.
    denoised
        Whether the image was denoised, which made it biased and took its standard error.
    """

    image: NDArray[np.float32]
    scene: Scene
    spp: int
    bounces: int
    mode: Mode
    sampler: str
    seed: int
    jitter: bool
    partial: bool
    seconds: float
    rays: int
    non_finite: int
    first_non_finite: tuple[int, int, int] | None = None
    warning: str | None = None
    layers: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    denoised: bool = False
    _differences: NDArray[np.float32] | None = None
    _growth: float = 1.0
    _measured: Estimate | None = None

    @property
    def paths(self) -> int:
        """Paths traced: width × height × spp."""
        return int(self.image.size // 3 * self.spp)

    @cached_property
    def standard_error(self) -> NDArray[np.float32]:
        """Standard error of every value of the image, float32 (height, width, 3).

        Not a number with a single sample, where the error was turned off, and in pictures that
        an exception left amid a pass. See :mod:`drpt.error`.
        """
        errors = self._estimate.standard_errors(light_pixels(self.scene))
        return immutable(errors.astype(np.float32))

    @cached_property
    def error(self) -> float:
        """Estimated relMSE of the image, mean (x − truth)² / (truth² + 0.01).

        Where a ``target_error`` was set, the part that is due to directly visible lights may have
        been measured by additional camera rays; see :mod:`drpt.missed`.
        """
        return self.error_estimate.relative_mse

    @cached_property
    def error_bound(self) -> float:
        """Half of a relMSE that the image is unlikely to exceed; ``target_error`` compares it.

        It equals ``error`` if the error is measured, or spread over many pixels.
        """
        return self.error_estimate.bound

    @property
    def relative_squares(self) -> NDArray[np.float64]:
        """Estimated squared error of each value, relative to it; ``error`` is their mean."""
        return self.error_estimate.relative_squares

    @property
    def error_uncertain(self) -> bool:
        """Whether the true relMSE may exceed twice ``error``, as a few pixels have most of it."""
        return bool(self.error_bound > self.error)

    @property
    def error_estimate(self) -> Estimate:
        """The best estimate of the error."""
        return self._measured or self._estimate

    @cached_property
    def _estimate(self) -> Estimate:
        """That from the samples of the image alone."""
        differences = self.image[None][:0] if self._differences is None else self._differences
        image = self.image.astype(np.float64)
        return Estimate(differences, image, self._growth, self.sampler == "independent")

    def denoise(self) -> Result:
        """Denoise the image by Open Image Denoise, guided by albedo and normal if it has them.

        The result is biased, and says so: its ``denoised`` is true, its error is not a number. See
        :func:`drpt.denoise.denoise`. Raises `ImportError` without the extra ``denoise``.
        """
        from drpt.denoise import denoise

        image = denoise(self.image, self.layers.get("albedo"), self.layers.get("normal"))
        return replace(self, image=image, denoised=True, _differences=None, _measured=None)

    @property
    def metadata(self) -> dict[str, str | int | float]:
        """Settings, figures, versions and the scene, as they are written beside a picture."""
        names = [field.name for field in fields(self) if not field.name.startswith("_")]
        settings = {name: getattr(self, name) for name in names if name not in _NOT_METADATA}
        if self.first_non_finite is not None:
            settings["first_non_finite"] = "{} {} {}".format(*self.first_non_finite)
        if np.isfinite(self.error):
            settings["error"] = self.error
        if self.error_uncertain:
            settings["error_uncertain"] = True
        found = versions("drjit", "numpy")
        return {**settings, "mode": str(self.mode), **found, "scene": to_toml(self.scene)}

    def save(
        self, path: str | PathLike[str], *, exposure: float = 0.0, curve: str = "srgb"
    ) -> None:
        """Write the picture; the suffix chooses .exr (float32), .png (sRGB, 8 bit) or .npy.

        An EXR has the layer ``standard_error``, too, if that is known, and all of ``layers``.
        ``exposure`` brightens a PNG by so many stops, ``curve`` is ``"srgb"`` or ``"filmic"``.
        Raises `ValueError` for another suffix and `OSError` where the file cannot be written; a
        file that was there before stays whole.
        """
        known = self._differences is not None and len(self._differences) > 0
        layers = {**({STANDARD_ERROR: self.standard_error} if known else {}), **self.layers}
        write(path, self.image, self.metadata, exposure=exposure, curve=curve, layers=layers)

    def __str__(self) -> str:
        height, width, _ = self.image.shape
        facts = [
            f"{width}x{height}",
            f"{self.spp} spp",
            f"{self.bounces} bounce{'' if self.bounces == 1 else 's'}",
            self.mode,
            self.sampler,
            f"seed {self.seed}",
            f"{self.seconds:.2f} s",
            f"relMSE {self.error:.2g}" if np.isfinite(self.error) else "relMSE unknown",
        ]
        marks = {
            "error uncertain": self.error_uncertain,
            "partial": self.partial,
            "denoised (biased)": self.denoised,
        }
        return ", ".join([*facts, *(mark for mark, holds in marks.items() if holds)])

    def __repr__(self) -> str:
        return f"<Result {self}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the picture, and what it is."""
        lines = (self.scene.description, str(self), self.warning)
        return figure(self.image, *filter(None, lines))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.image, dtype=dtype, copy=copy)
