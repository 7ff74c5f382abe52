"""The preview against a viewer that reads packets as tev does, and without any viewer."""

from __future__ import annotations

import socket
import struct
import threading
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest

from drpt.tev import DEFAULT_PORT, TIMEOUT, Preview

if TYPE_CHECKING:
    from collections.abc import Iterator

CREATE, UPDATE = 4, 6  # types of packets
# Longer than all of a preview's waits: a test that hangs ends.
PATIENCE = 5 * TIMEOUT

IMAGE = np.random.default_rng(0).random((150, 7, 3)).astype(np.float32)


class Reader:
    """The fields of a packet, one after the other, little-endian; names end with a 0."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def numbers(self, form: str) -> list[Any]:
        size = struct.calcsize(f"<{form}")
        head, self.data = self.data[:size], self.data[size:]
        return list(struct.unpack(f"<{form}", head))

    def name(self) -> str:
        head, _, self.data = self.data.partition(b"\0")
        return head.decode()


class Shown(NamedTuple):
    """A picture in the viewer, and whether it was asked to come to the front."""

    image: np.ndarray
    focus: bool


class Viewer:
    """What tev does with packets of the two types that a preview sends (its ``Ipc.cpp``)."""

    def __init__(self) -> None:
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE)
        self.address = "{}:{}".format(*self.socket.getsockname())
        self.pictures: dict[str, Shown] = {}
        self.types: list[int] = []

    def serve(self) -> None:
        """Take one connection until it ends."""
        connection, _ = self.socket.accept()
        with connection, connection.makefile("rb") as stream:
            while head := stream.read(4):
                (length,) = struct.unpack("<I", head)
                self.take(Reader(stream.read(length - 4)))

    def take(self, packet: Reader) -> None:
        kind, focus = packet.numbers("BB")
        name = packet.name()
        self.types.append(kind)
        if kind == CREATE:
            width, height, channels = packet.numbers("iii")
            assert [packet.name() for _ in range(channels)] == ["R", "G", "B"]
            self.pictures[name] = Shown(np.zeros((height, width, 3), np.float32), bool(focus))
        else:
            assert kind == UPDATE
            (channels,) = packet.numbers("i")
            assert [packet.name() for _ in range(channels)] == ["R", "G", "B"]
            x, y, width, height = packet.numbers("iiii")
            assert packet.numbers("qqq") == [0, 1, 2]  # offsets
            assert packet.numbers("qqq") == [3, 3, 3]  # strides
            part = np.frombuffer(packet.data, "<f4").reshape(height, width, 3)
            self.pictures[name].image[y : y + height, x : x + width] = part

    def watch(self, preview: Preview, image: np.ndarray) -> None:
        """Serve while a preview sends an image."""
        thread = threading.Thread(target=self.serve)
        thread.start()
        preview.update(image)
        thread.join(PATIENCE)
        assert not thread.is_alive()


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    viewer = Viewer()
    with viewer.socket:
        yield viewer


def unused_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port


def test_a_picture_appears_and_follows(viewer: Viewer) -> None:
    preview = Preview(viewer.address, "box, 64 spp")
    viewer.watch(preview, IMAGE)
    assert np.array_equal(viewer.pictures["box, 64 spp"].image, IMAGE)
    assert viewer.pictures["box, 64 spp"].focus
    viewer.watch(preview, 2 * IMAGE)
    assert np.array_equal(viewer.pictures["box, 64 spp"].image, 2 * IMAGE)
    assert viewer.types.count(CREATE) == 1  # a second one would take the focus again


def test_without_a_viewer_one_line_and_the_render_goes_on() -> None:
    preview = Preview(f"127.0.0.1:{unused_port()}", "box")
    with pytest.warns(
        RuntimeWarning, match=r"^no preview: tev at 127.0.0.1:\d+ .*\(.*refused"
    ) as told:
        preview.update(IMAGE)
    assert "\n" not in str(told[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        preview.update(IMAGE)


def test_a_viewer_that_goes_away_ends_the_preview(viewer: Viewer) -> None:
    preview = Preview(viewer.address, "box")
    viewer.watch(preview, IMAGE)
    viewer.socket.close()
    with pytest.warns(RuntimeWarning, match="no preview"):
        preview.update(IMAGE)


def test_a_viewer_that_hangs_costs_one_timeout(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lets connections in, but reads nothing: more is sent than buffers take."""
    monkeypatch.setattr("drpt.tev.TIMEOUT", 0.1)
    with pytest.warns(RuntimeWarning, match="timed out"):
        Preview(viewer.address, "box").update(np.zeros((2048, 2048, 3), np.float32))


@pytest.mark.parametrize("address", ["no..host:5", f"{'x' * 70}:5"])
def test_no_name_of_a_host_is_a_viewer_not_reached(address: str) -> None:
    with pytest.warns(RuntimeWarning, match="no preview"):
        Preview(address, "box").update(IMAGE)


@pytest.mark.parametrize(
    ("address", "host", "port"),
    [
        ("localhost:4000", "localhost", 4000),
        ("render-7.lab", "render-7.lab", DEFAULT_PORT),
        ("[::1]:4000", "::1", 4000),
    ],
)
def test_addresses(address: str, host: str, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, int]] = []

    def refuse(address: tuple[str, int], _: float) -> None:
        asked.append(address)
        raise ConnectionRefusedError

    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.warns(RuntimeWarning, match="no preview"):
        Preview(address, "box").update(IMAGE)
    assert asked == [(host, port)]


@pytest.mark.parametrize(
    "address", ["", ":4000", "localhost:tev", "localhost:99999", "me@localhost", "localhost/box"]
)
def test_malformed_addresses_are_refused(address: str) -> None:
    with pytest.raises(ValueError, match=r"^tev: '.*' is not allowed; it must be host:port"):
        Preview(address, "box")
