"""From linear radiance to what an 8-bit display is sent."""

from __future__ import annotations

from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

CURVES = ("srgb", "filmic")
"""``srgb`` shows radiance as it is and clips it at 1; ``filmic`` rolls bright radiance off."""
MAX_STOPS = 100.0
"""Largest exposure: a float32 radiance times 2^100 is far from the end of float64."""

_FILMIC_WHITE = 8.0  # what `filmic` maps to more than 1
_MAGENTA = (1.0, 0.0, 1.0)


def check_look(exposure: float, curve: str) -> None:
    """Raise `ValueError` unless the exposure is in ±100 stops, and the curve one of `CURVES`."""
    if not isinstance(exposure, Real) or not abs(exposure) <= MAX_STOPS:
        allowed = f"a number of stops from {-MAX_STOPS:g} to {MAX_STOPS:g}"
        raise ValueError(f"exposure: {exposure!r} is not allowed; it must be {allowed}")
    if curve not in CURVES:
        raise ValueError(f"curve: {curve!r} is not allowed; it must be one of {', '.join(CURVES)}")


def to_display(
    radiance: NDArray[np.floating[Any]], exposure: float = 0.0, curve: str = "srgb"
) -> NDArray[np.uint8]:
    """Return what an 8-bit sRGB display is sent for linear radiance, shape (…, 3).

    The radiance is multiplied by 2^exposure, bent by the curve, clipped to [0, 1] and encoded;
    where it is not a number, the pixel is magenta.

    Source: IEC 61966-2-1 (1999).
    """
    with np.errstate(invalid="ignore", over="ignore"):  # infinity times 0 is not a number
        exposed = np.maximum(radiance * np.exp2(np.float64(exposure)), 0.0)
    linear = np.minimum(filmic(exposed) if curve == "filmic" else exposed, 1.0)
    linear[np.isnan(linear).any(axis=-1)] = _MAGENTA
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    levels: NDArray[np.uint8] = np.floor(255 * encoded + 0.5).astype(np.uint8)
    return levels


def filmic(radiance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return linear display values for linear radiance >= 0: 0 for 0, 0.8 for 1, 1 from 7.24 on.

    Source: Narkowicz 2015, "ACES Filmic Tone Mapping Curve"; a fit of the ACES reference rendering
    and output transforms, channel by channel. Radiance above 8 is taken as 8, which is white.
    """
    x = np.minimum(radiance, _FILMIC_WHITE)
    return np.minimum(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 1.0)
