"""Denoising by Open Image Denoise: less noise for some bias, which no standard error shows."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from drpt.distribution import install_command

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray


def load_denoiser() -> ModuleType:
    """Import the optional package ``mitsuba-oidn``, which holds Open Image Denoise.

    Raises
    ------
    ImportError
        It is not installed, or does not work here.
    """
    try:
        return import_module("mitsuba_oidn")
    except ImportError as error:
        install = f"{install_command('denoise')} installs it"
        raise ImportError(f"denoise: it needs Open Image Denoise ({error}); {install}") from error


def denoise(
    image: ArrayLike, albedo: ArrayLike | None = None, normal: ArrayLike | None = None
) -> NDArray[np.float32]:
    """Return an image with less noise, guided by what the camera sees first.

    The result is biased: it looks converged where it is not. Albedo and normals keep edges sharp,
    but first hits know nothing of what a glossy surface mirrors; so Open Image Denoise is not told
    that they are free of noise, with which reflections blur.

    Parameters
    ----------
    image
        Linear radiance of shape (height, width, 3); other numbers become float32. Pixels that are
        not finite stay as they are.
    albedo
        From 0 to 1, of the same shape.
    normal
        In world space, from -1 to 1, of the same shape; Open Image Denoise takes it only together
        with the albedo.

    Raises
    ------
    ValueError
        A shape is wrong, something is not a number, or there is a normal without an albedo.
    ImportError
        See :func:`load_denoiser`.
    """
    picture = _floats("image", image)
    guides = {
        name: None if guide is None else _floats(name, guide)
        for name, guide in (("albedo", albedo), ("normal", normal))
    }
    for name, layer in {"image": picture, **guides}.items():
        if layer is not None:
            _check_shape(name, layer.shape, picture.shape)
    if albedo is None and normal is not None:
        raise ValueError("albedo: None is not allowed; there must be one where there is a normal")
    finite = np.isfinite(picture).all(axis=-1, keepdims=True)
    clean = load_denoiser().denoise(np.where(finite, picture, 0), *guides.values(), hdr=True)
    return np.where(finite, clean, picture)


def _floats(name: str, layer: ArrayLike) -> NDArray[np.float32]:
    """Return a layer as float32, in rows; larger numbers become infinite."""
    try:
        values = np.asarray(layer)
    except ValueError:  # rows of different lengths
        values = np.array(None)
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{name}: {values.dtype} is not allowed; it must be an array of numbers")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values, np.float32)


def _check_shape(name: str, shape: tuple[int, ...], whole: tuple[int, ...]) -> None:
    if shape != whole or shape[2:] != (3,) or 0 in shape:
        allowed = "(height, width, 3), the same for all layers"
        raise ValueError(f"{name}: shape {shape} is not allowed; it must be {allowed}")
