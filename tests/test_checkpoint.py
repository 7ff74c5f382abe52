"""Checkpoints: the same bits after every interruption, or a refusal that says why."""

from __future__ import annotations

import hashlib
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import warnings
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import drpt
from drpt.checkpoint import BODY, FORMAT, MAGIC, Checkpoint, CheckpointError
from drpt.kernel import launch
from drpt.kernel.launch import Launcher, forget
from drpt.kernel.primitives import make_primitives
from tests.scenes import BALL, LAMP, LAMP_AND_BALL, scene_of

SETTINGS: dict[str, Any] = {"spp": 100, "bounces": 2, "mode": "mis", "sampler": "sobol", "seed": 3}
ALWAYS = 1e-9
"""Seconds between states that are over after each pass."""
PASSES = 7
"""Passes of 16 samples and of what is left."""
RENDER = sys.modules["drpt.render"]


@pytest.fixture(autouse=True)
def _many_passes_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drpt.plan.LAUNCH_PATHS", 96 * 16)
    monkeypatch.setattr("drpt.plan.LAUNCH_PIXELS", 40)
    monkeypatch.setattr("drpt.plan.LAUNCH_LANES", 40)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "state.drpt"


def rendering_of(path: Path | None = None, **change: Any) -> drpt.Rendering:
    settings = {"scene": LAMP_AND_BALL, **SETTINGS, **change}
    return drpt.Rendering(checkpoint=path, checkpoint_interval=ALWAYS, **settings)


def finish(rendering: drpt.Rendering) -> drpt.Result:
    for _ in rendering.passes():
        pass
    return rendering.result()


def run_passes(rendering: drpt.Rendering, count: int) -> None:
    passes = rendering.passes()
    for _ in range(count):
        next(passes)
    passes.close()


def assert_equal(a: drpt.Result, b: drpt.Result) -> None:
    assert np.array_equal(a.image, b.image, equal_nan=True)
    assert np.array_equal(a.standard_error, b.standard_error, equal_nan=True)
    assert (a.spp, a.rays, a.non_finite) == (b.spp, b.rays, b.non_finite)
    assert (a.first_non_finite, a.warning) == (b.first_non_finite, b.warning)
    assert np.array_equal(a.error, b.error, equal_nan=True)


VARIANTS: list[dict[str, Any]] = [
    {},
    {"sampler": "independent"},
    {"error": False},
    {"jitter": False, "mode": "implicit"},
    {"seed": 2**100},
    {"target_error": 1e-9},
    {"scene": scene_of(BALL, drpt.Sphere((0, 2, 1), 0.5, radiance=0))},
]


class TestResuming:
    @pytest.mark.parametrize("variant", VARIANTS)
    @pytest.mark.parametrize("after", [1, 3, PASSES - 1])
    def test_it_gives_the_same_bits(self, after: int, variant: dict[str, Any], path: Path) -> None:
        whole = finish(rendering_of(**variant))
        run_passes(rendering_of(path, **variant), after)
        resumed = rendering_of(path, **variant)
        assert 0 < resumed.spp < 100
        assert resumed.result().partial
        found = finish(resumed)
        assert not found.partial
        assert_equal(found, whole)

    def test_it_can_happen_after_each_pass(self, path: Path) -> None:
        for _ in range(PASSES):
            run_passes(rendering_of(path), 1)
        assert_equal(rendering_of(path).result(), finish(rendering_of()))

    def test_an_exception_amid_a_pass_leaves_the_passes_before(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole, launch, count = finish(rendering_of()), Launcher.launch, 0

        def interrupted(self: Launcher, *arguments: Any) -> Any:
            nonlocal count
            count += 1
            if count == 8:  # the second of three parts of the third pass
                raise KeyboardInterrupt
            return launch(self, *arguments)

        monkeypatch.setattr(Launcher, "launch", interrupted)
        with pytest.raises(KeyboardInterrupt):
            finish(rendering_of(path))
        resumed = rendering_of(path)
        assert resumed.spp == 32
        assert_equal(finish(resumed), whole)

    def test_the_interrupted_rendering_itself_can_go_on(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole, launch, count = finish(rendering_of()), Launcher.launch, 0

        def interrupted(self: Launcher, *arguments: Any) -> Any:
            nonlocal count
            count += 1
            if count in (2, 9):
                raise KeyboardInterrupt
            return launch(self, *arguments)

        monkeypatch.setattr(Launcher, "launch", interrupted)
        rendering = rendering_of(path)
        for _ in range(2):
            with pytest.raises(KeyboardInterrupt):
                finish(rendering)
        assert_equal(finish(rendering), whole)
        assert_equal(rendering_of(path).result(), whole)

    def test_a_finished_render_is_there_at_once(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole = finish(rendering_of(path))
        monkeypatch.setattr(Launcher, "launch", None)
        assert_equal(finish(rendering_of(path)), whole)
        again = drpt.render(LAMP_AND_BALL, checkpoint=path, **SETTINGS)
        assert_equal(again, whole)

    def test_a_render_that_stopped_early_stays_so(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        change: dict[str, Any] = {"spp": 2**16, "target_error": 1e-3}
        stopped = finish(rendering_of(path, **change))
        assert 64 <= stopped.spp < 2**16
        monkeypatch.setattr(drpt.Rendering, "_run", None)  # which traces samples
        again = finish(rendering_of(path, **change))
        assert_equal(again, stopped)
        assert not again.partial

    def test_it_stops_where_an_uninterrupted_one_does(self, path: Path) -> None:
        change: dict[str, Any] = {"spp": 2**16, "target_error": 1e-3}
        whole = finish(rendering_of(**change))
        for after in (1, 2, 1):
            run_passes(rendering_of(path, **change), after)
        assert_equal(finish(rendering_of(path, **change)), whole)

    @pytest.mark.filterwarnings("ignore:.*samples were not finite")
    def test_what_was_not_finite_is_remembered(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from drpt.kernel.integrators.path import Tracer

        follow = Tracer.follow

        def broken(self: Tracer, first: Any, sampler: Any) -> Any:
            import drjit as dr

            radiance, rays = follow(self, first, sampler)
            bad = (sampler.pixel == 31) & (sampler.index == 10)
            return radiance + dr.select(bad, float("nan"), 0), rays

        monkeypatch.setattr(Tracer, "follow", broken)
        whole = finish(rendering_of(sampler="independent"))
        assert whole.first_non_finite == (7, 2, 10)
        run_passes(rendering_of(path, sampler="independent"), 2)
        assert_equal(finish(rendering_of(path, sampler="independent")), whole)

    def test_seconds_add_up(self, path: Path) -> None:
        run_passes(rendering_of(path), 3)
        before = rendering_of(path).result().seconds
        assert finish(rendering_of(path)).seconds > before > 0

    def test_render_takes_a_checkpoint(self, path: Path) -> None:
        run_passes(rendering_of(path), 3)
        resumed = drpt.render(LAMP_AND_BALL, checkpoint=str(path), **SETTINGS)
        assert_equal(resumed, finish(rendering_of()))


class TestWhenItIsSaved:
    def test_there_is_one_in_the_end_whatever_the_interval(self, path: Path) -> None:
        rendering = drpt.Rendering(
            LAMP_AND_BALL, checkpoint=path, checkpoint_interval=1e9, **SETTINGS
        )
        passes = rendering.passes()
        next(passes)
        assert not path.exists()
        passes.close()
        assert rendering_of(path).spp == 16

    def test_the_interval_is_heeded(self, path: Path) -> None:
        passes = rendering_of(path).passes()
        for done in range(16, 100, 16):
            assert next(passes) == done
            copy = shutil.copy(path, path.with_name("copy.drpt"))
            assert rendering_of(Path(copy)).spp == done

    def test_it_takes_the_place_of_the_one_before_and_leaves_no_other_file(
        self, path: Path
    ) -> None:
        finish(rendering_of(path))
        assert list(path.parent.iterdir()) == [path]

    @pytest.mark.parametrize("value", [0, -1, "30", None, float("nan")])
    def test_a_bad_interval_is_refused(self, value: Any, path: Path) -> None:
        with pytest.raises(ValueError, match=r"^checkpoint_interval: .* a finite number > 0$"):
            drpt.Rendering(LAMP_AND_BALL, checkpoint=path, checkpoint_interval=value)


OTHER: list[tuple[dict[str, Any], str]] = [
    ({"spp": 101}, "spp is 100 there and 101 here"),
    ({"bounces": 1}, "bounces is 2 there and 1 here"),
    ({"mode": "explicit"}, "mode is mis there and explicit here"),
    ({"sampler": "independent"}, "sampler is sobol there and independent here"),
    ({"seed": 4}, "seed is 3 there and 4 here"),
    ({"jitter": False}, "jitter is True there and False here"),
    ({"error": False}, "error is True there and False here"),
    ({"scene": scene_of(BALL, LAMP, height=9)}, "scene is height = 8 there and height = 9 here"),
    (
        {"scene": scene_of(replace(BALL, radius=1 + 2**-50), LAMP)},
        "scene is radius = 1.0 there and radius = 1.000000000000000",
    ),
    ({"scene": scene_of(LAMP)}, "scene is "),
]


class TestAnotherRender:
    @pytest.mark.parametrize(("change", "difference"), OTHER)
    def test_it_is_refused_with_the_difference(
        self, change: dict[str, Any], difference: str, path: Path
    ) -> None:
        run_passes(rendering_of(path), 2)
        before = path.read_bytes()
        with pytest.raises(CheckpointError, match="it belongs to another render: ") as error:
            rendering_of(path, **change)
        assert str(error.value).startswith(f"{path}: ")
        assert difference in str(error.value)
        assert "\n" not in str(error.value)
        assert path.read_bytes() == before

    @pytest.mark.parametrize("name", ["drpt", "drjit", "mitsuba", "numpy"])
    def test_another_version_is_refused(
        self, name: str, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        run_passes(rendering_of(path), 1)
        real = RENDER.versions
        monkeypatch.setattr(RENDER, "versions", lambda *names: {**real(*names), name: "99.0"})
        with pytest.raises(CheckpointError, match=rf"version of {name} is .* there and 99\.0 here"):
            rendering_of(path)

    @pytest.mark.parametrize(
        ("name", "there"),
        [("backend", {"name": "cuda"}), ("version of LLVM", {"llvm_version": "99.0"})],
    )
    def test_another_backend_is_refused(
        self, name: str, there: dict[str, Any], path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from drpt.kernel import backend

        run_passes(rendering_of(path), 1)
        other = replace(backend.describe(), **there)
        monkeypatch.setattr(backend, "describe", lambda: other)
        (value,) = there.values()
        with pytest.raises(CheckpointError, match=rf"{name} is .* there and {value} here"):
            rendering_of(path)

    def test_vectors_of_another_width_are_no_difference(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from drpt.kernel import backend

        run_passes(rendering_of(path), 1)
        wide = replace(backend.describe(), vector_width=3)
        monkeypatch.setattr(backend, "describe", lambda: wide)
        assert rendering_of(path).spp == 16

    def test_a_scene_that_is_prepared_otherwise_is_refused(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As another library might round it."""
        run_passes(rendering_of(path), 1)
        forget()

        def rounded_otherwise(shapes: Any) -> Any:
            primitives = make_primitives(shapes)
            return replace(primitives, spheres=primitives.spheres * (1 + 2**-23))

        monkeypatch.setattr(launch, "make_primitives", rounded_otherwise)
        with pytest.raises(CheckpointError, match=r"prepared scene is \w+ there and \w+ here"):
            rendering_of(path)

    @pytest.mark.parametrize("sizes", [2, 40])
    def test_another_vertex_is_refused(self, sizes: int, path: Path) -> None:
        """Of a small mesh, which is spelt out, and of a large one, of which there is a checksum."""

        def scene(height: float) -> drpt.Scene:
            x, y = np.mgrid[:sizes, :sizes].reshape(2, -1).astype(float)
            z = np.zeros_like(x)
            z[-1] = height
            corner = np.arange(sizes * sizes).reshape(sizes, sizes)
            faces = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:]], axis=-1)
            mesh = drpt.Mesh(np.stack([x, y, z], 1), faces.reshape(-1, 3), material=BALL.material)
            return scene_of(mesh, LAMP)

        run_passes(rendering_of(path, scene=scene(0.0)), 1)
        with pytest.raises(CheckpointError, match="another render: scene is "):
            rendering_of(path, scene=scene(1e-9))

    def test_threads_are_no_difference(self, path: Path) -> None:
        from drpt.kernel import backend

        whole = finish(rendering_of())
        run_passes(rendering_of(path), 3)
        threads = backend.describe().threads
        backend.set_thread_count(1)
        try:
            assert_equal(finish(rendering_of(path)), whole)
        finally:
            backend.set_thread_count(threads)


class TestDamage:
    @pytest.fixture
    def saved(self, path: Path) -> bytes:
        run_passes(rendering_of(path), 2)
        return path.read_bytes()

    def refuse(self, content: bytes, path: Path) -> str:
        path.write_bytes(content)
        checkpoint = Checkpoint(path, {}, 1)
        with pytest.raises(CheckpointError) as error:
            checkpoint.load()
        assert path.read_bytes() == content
        assert str(error.value).startswith(f"{path}: ")
        return str(error.value)

    def test_a_flipped_bit_is_seen_wherever_it_is(self, saved: bytes, path: Path) -> None:
        places = {*range(BODY + 100), *range(BODY, len(saved), 37), len(saved) - 1}
        for place in sorted(places):
            damaged = bytearray(saved)
            damaged[place] ^= 1 << (place % 8)
            message = self.refuse(bytes(damaged), path)
            expected = "is damaged"
            if place < len(MAGIC):
                expected = "is no checkpoint" if place < len(FORMAT) else "its format is"
            assert expected in message

    def test_a_missing_end_is_seen(self, saved: bytes, path: Path) -> None:
        for length in {*range(BODY + 100), *range(BODY, len(saved), 37), len(saved) - 1}:
            self.refuse(saved[:length], path)

    def test_what_follows_is_seen(self, saved: bytes, path: Path) -> None:
        assert "is damaged" in self.refuse(saved + b"\0", path)

    @pytest.mark.parametrize("content", [b"", b"PK\3\4", b"\x89PNG\r\n\x1a\n" + bytes(100)])
    def test_other_files_are_refused(self, content: bytes, path: Path) -> None:
        assert "this is no checkpoint" in self.refuse(content, path)

    def test_a_render_refuses_it_and_leaves_it(self, saved: bytes, path: Path) -> None:
        path.write_bytes(saved[:-1])
        with pytest.raises(CheckpointError, match="it is damaged"):
            drpt.render(LAMP_AND_BALL, checkpoint=path, **SETTINGS)
        assert path.read_bytes() == saved[:-1]

    def test_an_array_of_objects_is_not_unpickled(self, path: Path) -> None:
        class Bomb:
            def __reduce__(self) -> Any:
                return (os.mkdir, (str(path.parent / "exploded"),))

        body = io.BytesIO()
        np.savez(body, state=np.array([Bomb()], dtype=object))
        content = MAGIC + hashlib.sha256(body.getvalue()).digest() + body.getvalue()
        assert "cannot be read" in self.refuse(content, path)
        assert not (path.parent / "exploded").exists()

    def test_it_holds_no_pickle(self, saved: bytes, path: Path) -> None:
        with open(path, "rb") as stream:
            stream.seek(BODY)
            with np.load(stream, allow_pickle=False) as archive:
                assert {"state", "total", "blocks"} <= set(archive)
                assert all(array.dtype.kind in "fU" for array in archive.values())


def sealed(body: bytes) -> bytes:
    """A checkpoint with a valid checksum of whatever it holds."""
    return MAGIC + hashlib.sha256(body).digest() + body


def archive(compression: int = zipfile.ZIP_STORED, **members: Any) -> bytes:
    """An NPZ archive of arrays, or of members as they are."""
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", compression) as file:
        for name, member in members.items():
            stream = io.BytesIO()
            np.save(stream, member, allow_pickle=False) if isinstance(member, np.ndarray) else None
            file.writestr(f"{name}.npy", stream.getvalue() or member)
    return body.getvalue()


WRONG_FACTS: list[tuple[str, Any, str]] = [
    ("spp", 0, "spp: 0 is not allowed; it must be a whole number from 1 to 100"),
    ("spp", 101, "spp: 101 is not allowed"),
    ("spp", "32", "spp: '32' is not allowed"),
    ("spp", 32.0, "spp: 32.0 is not allowed"),
    ("spp", True, "spp: True is not allowed"),
    ("spp", [[1]] * 50, "spp: [[1], [1]"),
    ("block", 0, "block: 0 is not allowed"),
    ("block", 3, "block: 3 is not allowed; it must be a power of two"),
    ("block", 1, "block: 1 is not allowed; it must be a power of two, at most 8 of which hold 32"),
    ("block", 2**20, "blocks is an array of"),
    ("rays", -1, "rays: -1 is not allowed"),
    ("rays", None, "rays: None is not allowed"),
    ("non_finite", 10**6, "non_finite: 1000000 is not allowed"),
    ("non_finite", 1, "0 pixels of total are not finite, and 1 samples are said to be so"),
    ("first_non_finite", [0, 0, 0], "first_non_finite: [0, 0, 0] is not allowed"),
    ("seconds", float("nan"), "seconds: nan is not allowed"),
    ("seconds", "long", "seconds: 'long' is not allowed"),
    ("last_look", [1], "last_look: [1] is not allowed"),
    ("last_look", [64, "x"], "last_look: 64 is not allowed"),
]


class TestImpossibleContent:
    @pytest.fixture
    def saved(self, path: Path) -> dict[str, Any]:
        run_passes(rendering_of(path), 2)
        with np.load(io.BytesIO(path.read_bytes()[BODY:])) as arrays:
            return dict(arrays)

    def refuse(self, content: bytes, path: Path) -> str:
        path.write_bytes(content)
        with pytest.raises(CheckpointError) as error:
            rendering_of(path)
        assert path.read_bytes() == content
        assert str(error.value).startswith(f"{path}: ")
        assert str(error.value).isprintable()
        assert len(str(error.value)) < 600
        return str(error.value)

    def with_state(self, saved: dict[str, Any], path: Path, change: Any) -> str:
        state = json.loads(str(saved["state"]))
        change(state)
        return self.refuse(sealed(archive(**{**saved, "state": np.array(json.dumps(state))})), path)

    def test_as_it_is_it_is_taken(self, saved: dict[str, Any], path: Path) -> None:
        path.write_bytes(sealed(archive(**saved)))
        assert rendering_of(path).spp == 32

    @pytest.mark.parametrize(("name", "value", "problem"), WRONG_FACTS)
    def test_wrong_facts(
        self, name: str, value: Any, problem: str, saved: dict[str, Any], path: Path
    ) -> None:
        message = self.with_state(saved, path, lambda state: state["facts"].update({name: value}))
        assert f"no render can be in its state: {problem}" in message

    @pytest.mark.parametrize("name", ["spp", "rays", "seconds", "last_look"])
    def test_a_missing_fact(self, name: str, saved: dict[str, Any], path: Path) -> None:
        message = self.with_state(saved, path, lambda state: state["facts"].pop(name))
        assert f"{name} is missing" in message

    @pytest.mark.parametrize("name", ["identity", "facts"])
    @pytest.mark.parametrize("value", [None, [], "x", 3])
    def test_a_part_that_is_no_table(
        self, name: str, value: Any, saved: dict[str, Any], path: Path
    ) -> None:
        message = self.with_state(saved, path, lambda state: state.update({name: value}))
        assert f"{name} is missing, or no table" in message

    def test_an_identity_of_other_types(self, saved: dict[str, Any], path: Path) -> None:
        message = self.with_state(
            saved, path, lambda state: state["identity"].update(scene="\x1b[2J" + "x" * 5000)
        )
        assert "belongs to another render: scene is \\x1b[2J" in message
        message = self.with_state(saved, path, lambda state: state["identity"].update(spp=[[1]]))
        assert "identity has a list or a table for spp" in message

    @pytest.mark.parametrize(
        "text", ["[" * 100000, "3", "null", "{", "[]", '{"identity": 1e999}', "9" * 5000]
    )
    def test_a_text_that_is_no_state(self, text: str, saved: dict[str, Any], path: Path) -> None:
        content = sealed(archive(**{**saved, "state": np.array(text)}))
        assert "its content cannot be read" in self.refuse(content, path)

    @pytest.mark.parametrize(
        "state", [np.array(3), np.array(["a"]), np.array(b"{}"), np.zeros((0,)), None]
    )
    def test_a_state_that_is_no_text(self, state: Any, saved: dict[str, Any], path: Path) -> None:
        arrays = {name: array for name, array in saved.items() if name != "state"}
        arrays |= {} if state is None else {"state": state}
        assert "the array state is missing, or no text" in self.refuse(
            sealed(archive(**arrays)), path
        )

    @pytest.mark.parametrize("name", ["total", "blocks"])
    def test_wrong_arrays(self, name: str, saved: dict[str, Any], path: Path) -> None:
        array = saved[name]
        wrong = (array[..., :2], array[:-1], array.astype(np.float16), array.astype(str), array[0])
        for found in wrong:
            message = self.refuse(sealed(archive(**{**saved, name: found})), path)
            assert f"{name} is an array of " in message
        others = {key: value for key, value in saved.items() if key != name}
        assert f"{name} is missing" in self.refuse(sealed(archive(**others)), path)

    @pytest.mark.parametrize("name", ["total", "blocks"])
    @pytest.mark.parametrize("value", [np.nan, -1, -np.inf])
    def test_wrong_sums(self, name: str, value: float, saved: dict[str, Any], path: Path) -> None:
        saved[name][..., 5, 1] = value
        assert "no render can be in its state: " in self.refuse(sealed(archive(**saved)), path)

    def test_an_archive_that_inflates(self, saved: dict[str, Any], path: Path) -> None:
        bomb = archive(zipfile.ZIP_DEFLATED, **saved, bomb=np.zeros(10**7))
        path.write_bytes(sealed(bomb))
        rendering_of(path)  # which one can: 80 MB
        bomb = archive(zipfile.ZIP_BZIP2, **saved, bomb=np.zeros(10**6))
        assert "a method that is not read" in self.refuse(sealed(bomb), path)

    def test_a_header_that_tells_of_too_much(self, saved: dict[str, Any], path: Path) -> None:
        head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999, 3), }"
        head = head.ljust(117) + b"\n"
        member = b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head
        message = self.refuse(sealed(archive(**{**saved, "total": member})), path)
        assert "its header tells of 2.4 PB, and 0 bytes follow" in message

    def test_sizes_that_the_archive_cannot_hold(self, saved: dict[str, Any], path: Path) -> None:
        content = bytearray(archive(**saved))
        entry = content.index(b"PK\1\2")
        content[entry + 24 : entry + 28] = (2**31).to_bytes(4, "little")
        assert "is said to be 2.147 GB, which" in self.refuse(sealed(bytes(content)), path)

    @pytest.mark.parametrize("body", [b"", b"PK\5\6", b"PK\5\6" + bytes(18), bytes(1000)])
    def test_what_is_no_archive(self, body: bytes, path: Path) -> None:
        assert "its content cannot be read" in self.refuse(sealed(body), path)

    @pytest.mark.parametrize("line", [b"\xff\xfe\n", b"\x1b[2J\n", b"\0\0"])
    def test_first_bytes_that_are_no_text(self, line: bytes, path: Path) -> None:
        assert "its format is " in self.refuse(FORMAT + line + bytes(100), path)
        assert "this is no checkpoint" in self.refuse(line * 50, path)


def test_an_interrupt_before_the_first_pass_leaves_no_checkpoint(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Launcher, "launch", interrupted)
    with pytest.raises(KeyboardInterrupt):
        finish(rendering_of(path))
    assert list(path.parent.iterdir()) == []


class TestLock:
    def test_another_render_is_kept_off_until_the_passes_end(self, path: Path) -> None:
        passes = rendering_of(path).passes()
        next(passes)
        with pytest.raises(CheckpointError, match="another render is using it"):
            rendering_of(path)
        passes.close()
        assert rendering_of(path).spp == 16

    def test_the_lock_is_beside_the_file_and_goes_with_the_render(self, path: Path) -> None:
        rendering = rendering_of(path)
        assert [found.suffix for found in path.parent.iterdir()] == [".lock"]
        finish(rendering)
        assert list(path.parent.iterdir()) == [path]

    def test_a_link_to_the_file_has_its_lock(self, path: Path, tmp_path: Path) -> None:
        (tmp_path / "elsewhere").mkdir()
        link = tmp_path / "elsewhere" / "link.drpt"
        link.symlink_to(path)
        rendering = rendering_of(path)
        with pytest.raises(CheckpointError, match=r"link\.drpt: another render is using it"):
            rendering_of(link)
        finish(rendering)

    def test_where_nothing_can_be_locked_that_is_said(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(_: int) -> bool:
            raise OSError(37, "No locks available")

        monkeypatch.setattr("drpt.files.locking.try_lock", fail)
        with pytest.raises(CheckpointError, match=r"state\.drpt: it cannot be locked .*available"):
            rendering_of(path)
        assert list(path.parent.iterdir()) == []

    def test_a_process_with_another_temporary_folder_is_kept_off(
        self, path: Path, tmp_path: Path
    ) -> None:
        passes = rendering_of(path).passes()
        next(passes)
        (tmp_path / "other").mkdir()
        code = f"""
import pathlib
from drpt.checkpoint import Checkpoint, CheckpointError
try:
    Checkpoint(pathlib.Path({str(path)!r}), {{}}, 1).lock()
except CheckpointError as error:
    print(error)
"""
        environment = {**os.environ, "TMPDIR": str(tmp_path / "other")}
        ran = subprocess.run(
            [sys.executable, "-c", code], env=environment, stdout=-1, text=True, check=True
        )
        assert ran.stdout == f"{path}: another render is using it\n"
        assert list((tmp_path / "other").iterdir()) == []
        passes.close()

    def test_a_callback_that_raises_leaves_a_checkpoint_and_no_lock(self, path: Path) -> None:
        def fail(_: drpt.Result) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            drpt.render(LAMP_AND_BALL, checkpoint=path, on_pass=fail, **SETTINGS)
        assert rendering_of(path).spp == 16


class TestPlaces:
    def test_a_missing_folder_is_found_before_the_render(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError, match=r"state\.drpt: the folder .* does not exist"):
            rendering_of(tmp_path / "nowhere" / "state.drpt")

    def test_a_folder_is_no_checkpoint(self, tmp_path: Path) -> None:
        with pytest.raises(IsADirectoryError, match="this is a folder"):
            rendering_of(tmp_path)

    def test_a_folder_that_vanishes_is_warned_about_and_the_render_goes_on(
        self, tmp_path: Path
    ) -> None:
        folder = tmp_path / "folder"
        folder.mkdir()
        rendering = rendering_of(folder / "state.drpt")
        passes = rendering.passes()
        next(passes)
        shutil.rmtree(folder)
        with pytest.warns(RuntimeWarning, match=r"^no checkpoint: .*state\.drpt: it could not be"):
            for _ in passes:
                pass
        assert_equal(rendering.result(), finish(rendering_of()))
        assert not folder.exists()

    def test_a_folder_that_comes_back_is_used_again(self, tmp_path: Path) -> None:
        folder = tmp_path / "folder"
        folder.mkdir()
        passes = rendering_of(folder / "state.drpt").passes()
        next(passes)
        shutil.rmtree(folder)
        with pytest.warns(RuntimeWarning, match="no checkpoint"):
            next(passes)
        folder.mkdir()
        next(passes)
        passes.close()
        assert rendering_of(folder / "state.drpt").spp == 48

    def test_a_full_disk_is_warned_about_and_leaves_the_state_before(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        passes = rendering_of(path).passes()
        next(passes)
        before = path.read_bytes()

        def full(*_: Any) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("os.fsync", full)
        with pytest.warns(RuntimeWarning, match="could not be written .No space left on device"):
            next(passes)
        assert path.read_bytes() == before
        assert not list(path.parent.glob(".drpt-*.tmp"))
        monkeypatch.undo()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            passes.close()

    def test_without_one_nothing_is_written(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        finish(rendering_of())
        assert list(tmp_path.iterdir()) == []


KILLS = 20
CHILD = """
import sys
import time
import numpy as np
import drpt
import drpt.plan
drpt.plan.LAUNCH_PATHS = 96 * 16
drpt.plan.LAUNCH_PIXELS = 50
drpt.plan.LAUNCH_LANES = 40
from tests.scenes import LAMP_AND_BALL
path = sys.argv[1] if len(sys.argv) > 1 else None
rendering = drpt.Rendering(
    LAMP_AND_BALL, {spp}, 2, seed=7, checkpoint=path, checkpoint_interval=1e-6
)
print(rendering.spp, flush=True)
for _ in rendering.passes():
    time.sleep(0.03 if path else 0)  # lest it be over before the last kill
result = rendering.result()
facts = result.image.tobytes(), result.standard_error.tobytes()
print(hash(facts), result.spp, result.rays, result.non_finite)
"""


def start_child(spp: int, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", CHILD.format(spp=spp), *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONHASHSEED": "0"},
        cwd=Path(__file__).parents[1],
    )


@pytest.mark.slow
def test_a_render_killed_twenty_times_has_the_bits_of_one_that_was_not(path: Path) -> None:
    """Of 512 passes, in two launches each, some run between two kills; or none.

    They take 15 s at the least, and 20 children live for 15 s at the most.
    """
    spp, chance = 2**13, random.Random(1)
    with start_child(spp) as child:
        expected = child.communicate()[0].splitlines()[-1]
    resumed = [0]
    while len(resumed) <= KILLS:
        with start_child(spp, str(path)) as child:
            assert child.stdout is not None
            resumed.append(int(child.stdout.readline()))
            time.sleep(chance.uniform(0.3, 0.75))
            child.kill()
        assert child.returncode == -signal.SIGKILL
    assert resumed == sorted(resumed)
    assert len(set(resumed)) > KILLS // 2  # most of them came further than the one before
    with start_child(spp, str(path)) as child:
        found = child.communicate()[0].splitlines()
    assert int(found[0]) >= resumed[-1]
    assert found[-1] == expected
