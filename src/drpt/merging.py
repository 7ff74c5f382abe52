"""Renders of one scene with different seeds, put together to one with all of their samples.

With the samples n of a pixel in each of them, its value x and standard error s there,

    x = Σ nᵢ xᵢ / Σ nᵢ,    s = √(Σ (nᵢ sᵢ)²) / Σ nᵢ,

as other seeds are independent. The relMSE is computed from these standard errors, which are
smoothed, and corrected by the ratio of the relMSE that the pictures state to that of their standard
errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from drpt.error import relative_mse
from drpt.machine import require_memory
from drpt.messages import one_line
from drpt.output import read
from drpt.output.metadata import MOST
from drpt.result import SAMPLES, STANDARD_ERROR

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Layers = dict[str, NDArray[np.float32]]
    Metadata = dict[str, str | int | float]
    Path = str | PathLike[str]

SAME = ("scene", "bounces", "jitter")
"""What decides about the expectation of a picture, of its metadata."""
SUMMED = ("spp", "seconds", "rays", "non_finite")
"""What adds up, of its metadata."""
NEEDED = (*SAME, "spp", "seed")

DOUBLE = 8
"""Bytes of a float64."""
COPIES = 10
"""Number of float64 copies of the picture in memory while it is added to others."""
LAYER_COPIES = 3
"""Likewise of each layer, that of the picture included."""

_COMMA = ", "


def merge(paths: Sequence[Path]) -> tuple[Layers, Metadata]:
    """Merge renders, or what was merged of others: mode, sampler and spp may differ.

    Parameters
    ----------
    paths
        Pictures with metadata, at least one, of the same scene, camera, size, bounces and jitter,
        and of different seeds.

    Returns
    -------
    layers
        ``"RGB"`` and ``"standard_error"`` are those above, the latter if all pictures have it,
        ``"samples"`` are sums, and others means, as the picture is, of all pictures that have them.
    metadata
        ``spp``, ``seconds``, ``rays`` and ``non_finite`` are sums, ``error`` is the estimated
        relMSE; of all else, such as ``seed``, different values are listed.

    Raises
    ------
    OSError
        A file is missing or unreadable.
    ValueError
        One is no render with its metadata, does not fit to those before it, or needs more memory
        than there is.
    """
    first, *others = paths
    with np.errstate(invalid="ignore"):  # pictures may hold infinite values
        sums = _read(first)
        for path in others:
            sums = sums.plus(_read(path))
        return sums.divided()


def seeds(metadata: Metadata) -> list[str]:
    """All seeds whose samples are in a picture."""
    return str(metadata["seed"]).split(_COMMA)


class _Weighted(NamedTuple):
    """A layer (height, width, …) times weights (height, width), and these; or sums of both."""

    sums: Array
    weights: Array

    def plus(self, other: _Weighted) -> _Weighted:
        return _Weighted(self.sums + other.sums, self.weights + other.weights)

    def divided(self) -> Array:
        """The mean; 0 where there are no samples."""
        weights = np.where(self.weights > 0, self.weights, 1)
        mean: Array = self.sums / _like(weights, self.sums)
        return mean


@dataclass(frozen=True, eq=False)
class _Sums:
    """Renders that are put together, but not divided by their samples yet."""

    path: Path  # of the first
    files: dict[str, Path]  # of each seed
    metadata: Metadata
    layers: dict[str, _Weighted]  # all but the next
    squares: Array  # Σ (nᵢ sᵢ)²; not a number unless all standard errors are known
    told: float  # Σ nᵢ² relMSEᵢ, as the pictures state it
    derived: float  # the same, from their standard errors

    @property
    def samples(self) -> Array:
        return self.layers["RGB"].weights

    def plus(self, other: _Sums) -> _Sums:
        """Add a render that fits; else raise `ValueError`."""
        _check_fit(self, other)
        common = self.layers.keys() & other.layers.keys()
        added = {name: self.layers[name].plus(other.layers[name]) for name in common}
        return _Sums(
            self.path,
            {**self.files, **other.files},
            _join(self.metadata, other.metadata),
            {**self.layers, **other.layers, **added},
            self.squares + other.squares,
            self.told + other.told,
            self.derived + other.derived,
        )

    def divided(self) -> tuple[Layers, Metadata]:
        layers = {name: layer.divided() for name, layer in self.layers.items()}
        layers[SAMPLES] = self.samples
        metadata = {name: value for name, value in self.metadata.items() if name != "error"}
        if not np.isnan(self.squares).all():
            errors = _Weighted(np.sqrt(self.squares), self.samples).divided()
            layers[STANDARD_ERROR] = errors
            error = relative_mse(np.square(errors), layers["RGB"])
            if self.derived > 0:
                error *= self.told / self.derived
            metadata |= {"error": error} if np.isfinite(error) else {}
        return {name: layer.astype(np.float32) for name, layer in layers.items()}, metadata


def _read(path: Path) -> _Sums:
    single, metadata = read(path)
    _check_render(path, metadata)
    values = COPIES * single["RGB"].size + LAYER_COPIES * sum(map(np.size, single.values()))
    require_memory(values * DOUBLE, f"{path}: to merge it")
    layers = {name: layer.astype(np.float64) for name, layer in single.items()}
    image = layers["RGB"]
    samples = layers.pop(SAMPLES, np.full(image.shape[:2], metadata["spp"], np.float64))
    errors = layers.pop(STANDARD_ERROR, np.full_like(image, np.nan))
    _check_layers(path, samples, errors, image)
    derived = relative_mse(np.square(errors), image)
    told = metadata.get("error")
    weight = float(samples.mean()) ** 2
    return _Sums(
        path,
        dict.fromkeys(seeds(metadata), path),
        metadata,
        {n: _Weighted(layer * _like(samples, layer), samples) for n, layer in layers.items()},
        np.square(errors * _like(samples, errors)),
        weight * (told if isinstance(told, float) else derived),
        weight * derived,
    )


def _check_layers(path: Path, samples: Array, errors: Array, image: Array) -> None:
    """Raise `ValueError` if a layer with one of drpt's names has other content."""
    if samples.shape != image.shape[:2] or not ((samples >= 0) & (samples <= MOST)).all():
        raise ValueError(f"{path}: its layer {SAMPLES} is not one number >= 0 for each pixel")
    if errors.shape != image.shape or (errors < 0).any():
        raise ValueError(f"{path}: its layer {STANDARD_ERROR} is not three numbers >= 0 a pixel")


def _like(weights: Array, layer: Array) -> Array:
    """Weights (height, width) in a shape to multiply a layer with them."""
    return weights.reshape(*weights.shape, *[1] * (layer.ndim - 2))


def _check_render(path: Path, metadata: Metadata) -> None:
    missing = [name for name in NEEDED if name not in metadata]
    if missing:
        raise ValueError(f"{path}: this is no render: its metadata has no {_COMMA.join(missing)}")
    if metadata.get("denoised"):
        raise ValueError(f"{path}: it is denoised, so that its error is not that of its samples")


def _check_fit(sums: _Sums, new: _Sums) -> None:
    """Refuse a render of something else, and samples that are there already."""
    (height, width), (h, w) = new.samples.shape, sums.samples.shape
    if (height, width) != (h, w):
        raise ValueError(f"{new.path}: its size is {width}x{height}, that of {sums.path} {w}x{h}")
    if new.metadata["scene"] != sums.metadata["scene"]:
        raise ValueError(f"{new.path}: its scene is not that of {sums.path}")
    for name in SAME:
        value, expected = new.metadata[name], sums.metadata[name]
        if value != expected:
            raise ValueError(f"{new.path}: {name} is {value}, and {expected} in {sums.path}")
    for name in sorted(new.layers.keys() & sums.layers.keys()):
        if new.layers[name].sums.ndim != sums.layers[name].sums.ndim:
            words = f"its layer {name} has not the channels of that of {sums.path}"
            raise ValueError(f"{new.path}: {one_line(words)}")
    for seed in sorted(new.files.keys() & sums.files.keys()):
        where = sums.files[seed]
        raise ValueError(f"{new.path}: its seed {seed} is in {where}, too: other noise is needed")


def _join(ours: Metadata, theirs: Metadata) -> Metadata:
    both = (ours, theirs)
    values = {name: [m[name] for m in both if name in m] for name in {**ours, **theirs}}
    return {name: _joined(name, found) for name, found in values.items()}


def _joined(name: str, values: list[Any]) -> Any:
    """One value for those that two renders have; there may be a single one."""
    if name in SUMMED:
        return sum(values)
    if name in ("partial", "error_uncertain"):
        return any(values)
    if all(value == values[0] for value in values):
        return values[0]
    texts = (text for value in values for text in str(value).split(_COMMA))
    return _COMMA.join(dict.fromkeys(texts))
