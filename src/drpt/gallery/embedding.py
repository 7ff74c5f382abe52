"""Pictures that lie inside the page."""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from typing import TYPE_CHECKING

from drpt.output import to_display

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from drpt.gallery.figures import Crop

EFFORT = 1
"""Of the compression, from 0 to 6: more takes seconds for 5 % of the page."""


def address(image: NDArray[np.floating]) -> str:
    """Return linear colours (height, width, 3) as the address of a lossless sRGB picture."""
    from PIL import Image

    stream = BytesIO()
    Image.fromarray(to_display(image)).save(stream, format="WebP", lossless=True, method=EFFORT)
    return f"data:image/webp;base64,{b64encode(stream.getvalue()).decode()}"


def cut(image: NDArray[np.floating], crop: Crop) -> NDArray[np.floating]:
    """Return the pixels of a place in a square picture."""
    size = image.shape[0]
    left, top, side = (round(size * share) for share in (crop.left, crop.top, crop.side))
    return image[top : top + side, left : left + side]
