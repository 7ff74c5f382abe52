"""Denoising by Open Image Denoise: less noise for some bias, which no standard error shows."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from drpt.distribution import install_command

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray


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
    image: NDArray[np.float32],
    albedo: NDArray[np.float32] | None = None,
    normal: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Return an image with less noise, guided by what the camera sees first.

    The result is biased: it looks converged where it is not. Albedo and normals keep edges sharp,
    but first hits know nothing of what a glossy surface mirrors; so Open Image Denoise is not told
    that they are free of noise, with which reflections blur.

    Parameters
    ----------
    image
        Linear radiance, float32 of shape (height, width, 3). Pixels that are not finite stay as
        they are.
    albedo
        From 0 to 1, of the same shape.
    normal
        In world space, from -1 to 1, of the same shape.

    Raises
    ------
    ValueError
        A shape is wrong.
    ImportError
        See :func:`load_denoiser`.
    """
    for name, layer in {"image": image, "albedo": albedo, "normal": normal}.items():
        if layer is not None:
            _check_shape(name, layer.shape, image.shape)
    finite = np.isfinite(image).all(axis=-1, keepdims=True)
    clean = load_denoiser().denoise(np.where(finite, image, 0), albedo, normal, hdr=True)
    return np.where(finite, clean, image)


def _check_shape(name: str, shape: tuple[int, ...], whole: tuple[int, ...]) -> None:
    if shape != whole or shape[2:] != (3,) or 0 in shape:
        allowed = "(height, width, 3), the same for all layers"
        raise ValueError(f"{name}: shape {shape} is not allowed; it must be {allowed}")
