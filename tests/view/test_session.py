"""Sessions, step by step: what is told, in which order, and what stops it."""

from __future__ import annotations

import json
import struct
from shutil import unpack_archive
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest

import drpt
from drpt.output import read
from drpt.view.frames import half_floats, stops_of
from drpt.view.scenes import Scenes
from drpt.view.session import MAX_FRAMES, MAX_WAITING, ProtocolError, Session
from drpt.view.shares import Urgency
from drpt.view.show import REFERENCE_SPP

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

SIDE = 12
# Half floats have 11 bits.
HALF = 2.0**-11
# Share of a reference's error in that of 64 independent samples: 2^14 Sobol' points.
REFERENCE = 64 / REFERENCE_SPP
MIS = {"mode": "mis", "sampler": "sobol", "bounces": 2}
PLAIN = {"mode": "explicit", "sampler": "independent", "bounces": 2}


class Frame(NamedTuple):
    header: dict[str, Any]
    payload: bytes

    def images(self) -> dict[str, NDArray[np.float16]]:
        arrays = np.frombuffer(self.payload, "<f2").reshape(-1, SIDE, SIDE, 3)
        return dict(zip(self.header["images"], arrays, strict=True))


def unpacked(message: str | bytes) -> Frame:
    assert isinstance(message, bytes)
    (length,) = struct.unpack_from("<I", message)
    assert (4 + length) % 8 == 0
    return Frame(json.loads(message[4 : 4 + length]), message[4 + length :])


class Browser:
    """A session, and what it has told."""

    def __init__(self, scene: str = "cornell-box") -> None:
        self.woken = 0
        self.session = Session(Scenes(scene, SIDE, SIDE), lambda: None, self.wake)
        self.number = 0
        hello = self.take()
        assert hello["type"] == "hello"
        self.state: dict[str, Any] = hello["state"]

    def wake(self) -> None:
        self.woken += 1

    def say(self, kind: str, **message: Any) -> None:
        self.session.receive(json.dumps({"type": kind, **message}))

    def view(self, **changes: Any) -> None:
        self.state |= changes
        self.number += 1
        self.say("view", number=self.number, state=self.state)

    def step(self, steps: int = 1) -> None:
        for _ in range(steps):
            assert self.session.has_work()
            self.session.step()

    def take(self) -> dict[str, Any]:
        message = self.session.next_message()
        assert isinstance(message, str)
        taken: dict[str, Any] = json.loads(message)
        return taken

    def take_binary(self) -> Frame:
        message = self.session.next_message()
        assert message is not None
        return unpacked(message)

    def next_frame(self) -> Frame:
        """Step until there is a frame, and draw it."""
        for _ in range(100):
            while (message := self.session.next_message()) is not None:
                if isinstance(message, bytes):
                    self.say("drawn")
                    return unpacked(message)
            self.step()
        raise AssertionError("there is no frame")


def test_a_view_brings_its_scene_and_then_frames() -> None:
    browser = Browser()
    assert not browser.session.has_work()
    browser.view(halves=[MIS], spp=64)
    browser.step(3)
    scene = browser.take()
    assert (scene["type"], scene["number"], scene["width"]) == ("scene", 1, SIDE)
    assert [shape["light"] for shape in scene["shapes"]] == [True, *[False] * 5]
    frame = browser.take_binary()
    assert (frame.header["type"], frame.header["number"], frame.header["half"]) == ("frame", 1, 0)
    assert frame.header["spp"] > 0


def test_what_is_waited_for_is_urgent() -> None:
    browser = Browser()
    browser.view(halves=[MIS], spp=64)
    seen: list[Urgency] = []
    while (urgency := browser.session.urgency()) is not None and len(seen) < 5:
        seen.append(urgency)
        browser.step()
    change, show, refine = Urgency.CHANGE, Urgency.SHOW, Urgency.REFINE
    assert seen[:3] == [change, change, show]
    assert set(seen[3:]) <= {refine}


def test_it_refines_until_all_samples_are_there_and_shows_what_render_gives() -> None:
    browser = Browser()
    browser.view(halves=[MIS], spp=2**16, seed=5)
    seen = [browser.next_frame()]
    while not seen[-1].header["done"]:
        seen.append(browser.next_frame())
    spp = [frame.header["spp"] for frame in seen]
    assert spp == sorted(set(spp))
    assert spp[-1] == 2**16
    scene = drpt.load_scene("cornell-box").resized(SIDE, SIDE)
    whole = drpt.render(scene, 2**16, 2, "mis", seed=5).image
    assert seen[-1].images()["radiance"] == pytest.approx(whole, rel=HALF, abs=1e-6)
    browser.session.next_message()
    assert not browser.session.has_work()


def test_frames_go_no_faster_than_they_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drpt.view.show.FRAME_REST", 0)
    browser = Browser()
    browser.view(halves=[MIS], spp=2**20)
    browser.step(3)
    browser.take()
    frames = [browser.take_binary()]
    for _ in range(MAX_FRAMES):
        browser.step(2)
        if (message := browser.session.next_message()) is not None:
            frames.append(unpacked(message))
    assert len(frames) == MAX_FRAMES
    browser.say("drawn")
    assert browser.take_binary().header["spp"] > frames[-1].header["spp"]


def test_the_latest_view_wins() -> None:
    browser = Browser()
    for radius in range(1, 50):
        browser.view(edits={"0": {"radius": radius}})
    browser.step()
    assert browser.take()["shapes"][0]["radius"] == 49
    assert browser.next_frame().header["number"] == 49


def test_a_half_that_stays_the_same_goes_on_and_the_other_starts_anew() -> None:
    browser = Browser()
    browser.view(halves=[MIS, PLAIN])
    before = [browser.next_frame().header for _ in range(6)]
    browser.view(halves=[MIS, {**PLAIN, "bounces": 1}])
    frames: dict[int, int] = {}
    while len(frames) < 2:
        header = browser.next_frame().header
        frames.setdefault(header["half"], header["spp"])
    kept = max(header["spp"] for header in before if header["half"] == 0)
    assert frames[0] >= kept
    assert frames[1] < kept


def test_halves_keep_pace() -> None:
    browser = Browser()
    browser.view(halves=[MIS, PLAIN], spp=2**20)
    spp = {0: 0, 1: 0}
    for _ in range(12):
        header = browser.next_frame().header
        assert spp[header["half"]] <= spp[1 - header["half"]]
        spp[header["half"]] = header["spp"]


def test_a_restart_takes_all_samples_anew() -> None:
    browser = Browser()
    browser.view(halves=[MIS], spp=2**20)
    first = browser.next_frame().header["spp"]
    assert browser.next_frame().header["spp"] > first
    browser.say("restart", number=2)
    again = browser.next_frame().header
    assert (again["number"], again["spp"]) == (2, first)


def test_what_is_paused_waits_but_a_change_is_seen() -> None:
    browser = Browser()
    browser.view(halves=[MIS], spp=2**20)
    browser.next_frame()
    browser.say("pause", paused=True)
    while browser.session.has_work():
        browser.step()
        browser.session.next_message()
    browser.view(halves=[PLAIN])
    assert browser.next_frame().header["number"] == 2
    while browser.session.has_work():
        browser.step()
    browser.say("pause", paused=False)
    assert browser.session.has_work()


def test_the_measured_error_is_that_of_the_picture_alone() -> None:
    """The mean square of what is shown has that of the reference in it."""
    browser = Browser()
    browser.view(halves=[PLAIN], difference="reference", spp=64)
    frames = [browser.next_frame()]
    while browser.session.has_work():
        frames.append(browser.next_frame())
    first, last = (
        next(frame for frame in order if "difference" in frame.header["images"])
        for order in (frames, reversed(frames))
    )
    squares = np.square(last.images()["difference"].astype(np.float64))
    assert last.header["reference_spp"] == REFERENCE_SPP
    assert last.header["measured"] == pytest.approx(squares.mean(), rel=REFERENCE)
    assert first.header["measured"] < np.square(first.images()["difference"], dtype=float).mean()


def test_the_difference_from_the_other_half_is_the_other_s_reversed() -> None:
    browser = Browser()
    browser.view(halves=[MIS, {**MIS, "bounces": 0}], difference="other", spp=16)
    frames: dict[int, Frame] = {}
    while not (len(frames) == 2 and all(frame.header["done"] for frame in frames.values())):
        frame = browser.next_frame()
        frames[frame.header["half"]] = frame
    first, second = (frames[half].images()["difference"] for half in (0, 1))
    assert first.max() > 0
    assert second.min() < 0
    assert (np.sign(first) == -np.sign(second)).all()


def test_a_pixel_is_told_with_its_paths() -> None:
    browser = Browser()
    browser.view(halves=[MIS], pixel=[6, 9], paths=5, spp=2**12)
    assert browser.next_frame().header["pixel"]["column"] == 6
    browser.step()
    told = browser.take()
    assert (told["type"], told["column"], told["row"], told["number"]) == ("pixel", 6, 9, 1)
    assert len(told["paths"]) == 5
    for path in told["paths"]:
        total = np.sum([vertex["contribution"] for vertex in path["vertices"]], axis=0)
        assert path["radiance"] == pytest.approx(total)
        x, y = path["vertices"][0]["at"]
        assert 6 <= x <= 7
        assert 9 <= y <= 10
    frame = browser.next_frame()
    mean = frame.images()["radiance"][9, 6]
    assert frame.header["pixel"]["mean"] == pytest.approx(mean, rel=HALF)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"edits": {"0": {"radius": -1}}}, "edits[0].radius: -1 is not allowed"),
        ({"pixel": [SIDE, 0]}, f"pixel: [{SIDE}, 0] is not allowed; the picture is {SIDE}x{SIDE}"),
        ({"scene": "/etc/passwd"}, "scene: '/etc/passwd' is not allowed; it must be one of"),
        ({"spp": "many"}, "spp: 'many' is not allowed"),
    ],
)
def test_what_is_refused_leaves_the_picture(changes: dict[str, Any], words: str) -> None:
    browser = Browser()
    browser.view(halves=[MIS])
    browser.next_frame()
    browser.view(**changes)
    browser.step()
    refused = browser.take()
    assert (refused["type"], refused["number"]) == ("refused", 2)
    assert words in refused["message"]
    assert browser.next_frame().header["number"] == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        "{}",
        '{"type": "quit"}',
        '{"type": "view"}',
        '{"type": "view", "number": -1, "state": {}}',
        '{"type": "pause", "paused": 1}',
        '{"type": "drawn", "frames": 2}',
        '{"type": "save", "what": "jpg", "half": 0, "exposure": 0}',
        '{"type": "save", "what": "png", "half": 2, "exposure": 0}',
        '{"type": "save", "what": "png", "half": 0, "exposure": NaN}',
        "[" * 100_000,
    ],
)
def test_what_is_no_message_is_an_error(text: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        Browser().session.receive(text)
    assert len(str(caught.value)) < 250


def test_wishes_for_files_do_not_pile_up() -> None:
    browser = Browser()
    for _ in range(MAX_WAITING):
        browser.say("save", what="png", half=0, exposure=0)
    with pytest.raises(ProtocolError, match="waiting already"):
        browser.say("save", what="png", half=0, exposure=0)


def test_one_that_is_not_listened_to_stops() -> None:
    browser = Browser()
    for _ in range(2 * MAX_WAITING):
        browser.view()
        if not browser.session.has_work():
            break
        browser.step()
    assert not browser.session.has_work()
    browser.session.next_message()
    assert browser.session.has_work()


def test_pictures_and_scenes_can_be_saved(tmp_path: Path) -> None:
    browser = Browser()
    browser.view(halves=[MIS], edits={"0": {"radius": 30}})
    radiance = browser.next_frame().images()["radiance"]
    browser.say("pause", paused=True)
    for what in ("exr", "png", "scene"):
        browser.say("save", what=what, half=1, exposure=0)
    browser.step(3)
    files = {}
    for suffix in ("exr", "png", "toml"):
        header, content = browser.take_binary()
        assert header["name"] == f"cornell-box.{suffix}"
        files[suffix] = tmp_path / header["name"]
        files[suffix].write_bytes(content)
    layers, _ = read(files["exr"])
    assert layers["RGB"] == pytest.approx(radiance, rel=HALF, abs=1e-6)
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    shapes = drpt.load_scene(files["toml"]).shapes
    assert isinstance(shapes[0], drpt.Sphere)
    assert shapes[0].radius == 30


def test_a_scene_of_large_meshes_is_zipped(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    mesh = drpt.Mesh(rng.random((1200, 3)), [[0, 1, 2]], material=drpt.Diffuse(0.5))
    scene = drpt.Scene(
        camera=drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8),
        shapes=[mesh, drpt.Sphere((0, 0, 5), 1, radiance=1)],
    )
    scene.save(tmp_path / "mine.toml")
    browser = Browser(str(tmp_path / "mine.toml"))
    browser.view(halves=[MIS])
    browser.next_frame()
    browser.say("save", what="scene", half=0, exposure=0)
    browser.step()
    header, content = browser.take_binary()
    assert header["name"] == "mine.zip"
    (tmp_path / "mine.zip").write_bytes(content)
    unpack_archive(tmp_path / "mine.zip", tmp_path / "unpacked")
    assert drpt.load_scene(tmp_path / "unpacked" / "mine.toml") == scene


def test_a_failure_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    browser = Browser()
    browser.view(halves=[MIS])
    monkeypatch.setattr("drpt.view.progressive.Progressive.step", _fail)
    browser.step(2)
    browser.take()
    assert browser.take() == {"type": "failed", "message": "no memory"}
    assert not browser.session.has_work()


def _fail(*_: object) -> None:
    raise MemoryError("no memory")


def test_numbers_that_json_lacks_are_null() -> None:
    """A single sample has no error that is known."""
    browser = Browser()
    browser.view(halves=[PLAIN], spp=1, pixel=[6, 1])
    header = browser.next_frame().header
    assert header["error"] is None
    assert header["pixel"]["standard_error"] == [None] * 3


def test_a_picture_is_saved_when_there_is_one() -> None:
    browser = Browser()
    browser.view(halves=[MIS])
    browser.say("save", what="exr", half=0, exposure=0)
    frames = 0
    while True:
        browser.step()
        message = browser.session.next_message()
        if isinstance(message, bytes):
            header, _ = unpacked(message)
            if header["type"] == "file":
                break
            frames += 1
    assert frames == 1


def test_a_picture_that_cannot_be_saved_leaves_the_view(monkeypatch: pytest.MonkeyPatch) -> None:
    browser = Browser()
    browser.view(halves=[MIS])
    browser.next_frame()
    monkeypatch.setattr("drpt.view.session.picture_file", _fail)
    browser.say("save", what="png", half=0, exposure=0)
    browser.step()
    assert browser.take() == {"type": "failed", "message": "no memory"}
    assert browser.next_frame().header["number"] == 1


def test_a_view_is_seen_before_the_next() -> None:
    """As while a slider is dragged, faster than anything is rendered."""
    browser = Browser()
    seen = set()
    for _ in range(200):
        browser.view(seed=browser.number)
        browser.step()
        while (message := browser.session.next_message()) is not None:
            if isinstance(message, bytes):
                seen.add(unpacked(message).header["number"])
                browser.say("drawn")
    assert len(seen) > 40


def test_equal_halves_are_rendered_once() -> None:
    browser = Browser()
    browser.view(halves=[MIS, MIS], difference="other", spp=2**20)
    for _ in range(6):
        assert not browser.next_frame().images()["difference"].any()


def test_shapes_are_told_only_if_they_have_changed() -> None:
    browser = Browser()
    told: list[tuple[int, bool]] = []
    changes: list[dict[str, Any]] = [
        {},
        {"seed": 1},
        {"camera": {"azimuth": 5, "elevation": 0, "zoom": 0}},
        {"edits": {"0": {"radius": 5}}},
        {"scene": "furnace", "edits": {}},
    ]
    for change in changes:
        browser.view(**change)
        while not told or told[-1][0] < browser.number:
            browser.step()
            while (message := browser.session.next_message()) is not None:
                if isinstance(message, str):
                    scene = json.loads(message)
                    told.append((scene["number"], "shapes" in scene))
    assert told == [(1, True), (2, False), (3, False), (4, True), (5, True)]


@pytest.mark.parametrize("radiance", [1e-12, 1.0, 1e20])
def test_no_brightness_is_lost_on_the_way(radiance: float, tmp_path: Path) -> None:
    ball = drpt.Sphere((0, 0, 0), 1, radiance=radiance)
    camera = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 12, 8, 8)
    drpt.Scene(camera=camera, shapes=[ball]).save(tmp_path / "ball.toml")
    browser = Browser(str(tmp_path / "ball.toml"))
    browser.view(halves=[MIS])
    frame = browser.next_frame()
    shown = float(frame.images()["radiance"].max()) * 2.0 ** frame.header["stops"]
    assert shown == pytest.approx(radiance, rel=HALF)


def test_a_picture_that_is_nowhere_finite_is_shown_as_it_is() -> None:
    nothing = np.full((2, 2, 3), np.nan, np.float32)
    assert stops_of(nothing) == 0
    assert np.isnan(np.frombuffer(half_floats(nothing), "<f2")).all()
