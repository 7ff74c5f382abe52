"""Live preview in tev, an image viewer that takes pictures over the network.

Source: Müller, https://github.com/Tom94/tev; its packets by its own package ``tevclient``.
"""

from __future__ import annotations

import socket
import warnings
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from tevclient import packet

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DEFAULT_PORT = 14158
"""Where tev listens, unless it is told otherwise."""
TIMEOUT = 2.0
"""Seconds that a render waits for a viewer that does not answer, once."""

_CHANNELS = ["R", "G", "B"]
_BAND = 64  # rows of a packet, whose length has 32 bits


class Preview:
    """A picture in tev that follows a render.

    Parameters
    ----------
    address
        ``host:port`` of a running tev; without a port, `DEFAULT_PORT`.
    name
        What tev calls the picture; it replaces one of the same name.

    Raises
    ------
    ValueError
        The address is malformed.
    """

    def __init__(self, address: str, name: str) -> None:
        self._host, self._port = _parse(address)
        self._name = name
        self._created = False
        self._lost = False

    def update(self, image: NDArray[np.float32]) -> None:
        """Show an image (height, width, 3) of linear radiance.

        A viewer that cannot be reached gives one `RuntimeWarning`, after which there are no more
        attempts: a render goes on without its preview.
        """
        if self._lost:
            return
        try:
            self._send(image)
        except (OSError, UnicodeError) as error:  # the latter: no name of a host
            self._lost = True
            reason = getattr(error, "strerror", None) or error
            at = f"{self._host}:{self._port}"
            text = f"no preview: tev at {at} takes no picture ({reason}); is it running there?"
            warnings.warn(text, RuntimeWarning, stacklevel=2)

    def _send(self, image: NDArray[np.float32]) -> None:
        height, width, _ = image.shape
        with socket.create_connection((self._host, self._port), TIMEOUT) as connection:
            if not self._created:
                connection.sendall(packet.create_image(self._name, width, height, _CHANNELS))
                self._created = True
            for row in range(0, height, _BAND):
                band = image[row : row + _BAND]
                connection.sendall(packet.update_image(self._name, band, _CHANNELS, y=row))


def _parse(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname, parts.port
    except ValueError:  # a port that is none
        host = port = None
    if host is None or parts.netloc != address or parts.username is not None:
        example = f"host:port, such as localhost:{DEFAULT_PORT}"
        raise ValueError(f"tev: {address!r} is not allowed; it must be {example}")
    return host, DEFAULT_PORT if port is None else port
