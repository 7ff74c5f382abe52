"""Pictures in notebooks."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from drpt.output import write_png

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def figure(image: NDArray[np.float32], *captions: str) -> str:
    """HTML that shows linear radiance (height, width, 3) as a PNG would, and lines below it."""
    png = BytesIO()
    write_png(png, image, {})
    height, width, _ = image.shape
    return (
        '<figure style="margin: 0">'
        f'<img src="data:image/png;base64,{b64encode(png.getvalue()).decode()}" alt="a render" '
        f'width="{width}" height="{height}" style="max-width: 100%; height: auto">'
        f"<figcaption>{'<br>'.join(map(escape, captions))}</figcaption></figure>"
    )
