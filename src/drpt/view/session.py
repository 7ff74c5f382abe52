"""A session: what one browser has asked to be shown, and what it is told.

Messages come and go in the server's thread. All else happens in the render thread, which asks one
session after the other to go a step.

A browser says, in JSON: ``view`` (show this state from now on), ``restart``, ``pause``, ``save``,
and ``drawn`` for each frame that it has drawn. It is told: ``hello`` once, with the default state;
after each view ``scene``, or ``refused`` and why; then frames, and what goes through its ``pixel``;
the files that it has asked to save; ``failed``, where something did. Frames and files are binary,
see :mod:`drpt.view.frames`; what is about a view has the number that the browser gave it.
"""

from __future__ import annotations

import json
from collections import deque
from functools import partial
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple

from drpt.settings import check_choice, check_number, check_switch, check_whole
from drpt.view.descriptions import describe_scene, hello
from drpt.view.frames import pack
from drpt.view.saving import FORMATS, picture_file, scene_file
from drpt.view.shares import Urgency
from drpt.view.show import Show
from drpt.view.state import MAX_SEED, read_state

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drpt.view.saving import File
    from drpt.view.scenes import Scenes

MAX_FRAMES = 2
"""Frames on their way to a browser: the one that it draws, and the next."""
MAX_WAITING = 32
"""Other messages that wait, either way."""
MAX_STOPS = 100.0


class ProtocolError(ValueError):
    """A message that the protocol does not have."""


class _View(NamedTuple):
    """What is to be shown from now on: another state, or the same ``afresh``, or both."""

    number: int
    state: object | None
    afresh: bool


class _Save(NamedTuple):
    what: str
    half: int
    exposure: float


class _Step(NamedTuple):
    """Something to do."""

    do: Callable[[], None]
    urgency: Urgency = Urgency.CHANGE


class Session:
    """What one browser is shown.

    Parameters
    ----------
    scenes
        Those that it may ask for.
    ready
        Called from the render thread whenever there is something to send.
    wake
        Called from the server's thread whenever there may be something to do.
    """

    def __init__(self, scenes: Scenes, ready: Callable[[], None], wake: Callable[[], None]) -> None:
        self._scenes, self._ready, self._wake = scenes, ready, wake
        self._lock = RLock()
        self._view: _View | None = None
        self._saves: deque[_Save] = deque()
        self._paused = False
        self._on_the_way = 0
        self._frames: dict[int, bytes] = {}
        self._messages: deque[str | bytes] = deque()
        self._show: Show | None = None
        self._tell(hello(scenes))

    # --- the server's thread ----------------------------------------------------------------------

    def receive(self, text: str) -> None:
        """Heed a message of the browser; raises `ProtocolError` for what is none."""
        try:
            message = json.loads(text)
            kind = message.pop("type")
            heed = self._heeds[kind]
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise ProtocolError(f"{text[:60]!r} is no message of the protocol") from None
        try:
            with self._lock:
                heed(self, **message)
        except (TypeError, ValueError) as error:
            raise ProtocolError(f"{kind}: {error}") from None
        self._wake()

    def _heed_view(self, *, number: int, state: object) -> None:
        afresh = self._view is not None and self._view.afresh
        self._view = _View(check_whole("number", number, 0, MAX_SEED), state, afresh)

    def _heed_restart(self, *, number: int) -> None:
        state = self._view.state if self._view else None
        self._view = _View(check_whole("number", number, 0, MAX_SEED), state, afresh=True)

    def _heed_pause(self, *, paused: bool) -> None:
        self._paused = check_switch("paused", paused)

    def _heed_drawn(self) -> None:
        self._on_the_way = max(0, self._on_the_way - 1)

    def _heed_save(self, *, what: str, half: int, exposure: float) -> None:
        if len(self._saves) == MAX_WAITING:
            raise ValueError(f"{MAX_WAITING} are waiting already")
        check_choice("what", what, FORMATS)
        check_whole("half", half, 0, 1)
        self._saves.append(
            _Save(what, half, check_number("exposure", exposure, -MAX_STOPS, MAX_STOPS))
        )

    _heeds: Mapping[str, Callable[..., None]] = {
        "view": _heed_view,
        "restart": _heed_restart,
        "pause": _heed_pause,
        "drawn": _heed_drawn,
        "save": _heed_save,
    }

    def next_message(self) -> str | bytes | None:
        """The next message to send, if there is one; frames only as fast as they are drawn."""
        with self._lock:
            if self._messages:
                message = self._messages.popleft()
            elif self._frames and self._on_the_way < MAX_FRAMES:
                message = self._frames.pop(next(iter(self._frames)))
                self._on_the_way += 1
            else:
                return None
        self._wake()
        return message

    # --- the render thread ------------------------------------------------------------------------

    def urgency(self) -> Urgency | None:
        """How urgent :meth:`step` is; None where there is nothing to do."""
        with self._lock:
            if len(self._messages) >= MAX_WAITING:
                return None
            step = self._next_step()
            return None if step is None else step.urgency

    def has_work(self) -> bool:
        """Whether :meth:`step` would do anything."""
        return self.urgency() is not None

    def step(self) -> None:
        """Do the first waiting step: handle a request, send a frame, or take more samples."""
        with self._lock:
            step = self._next_step()
        try:
            if step:
                step.do()
        except Exception as error:  # whatever it is, other sessions go on
            self._show = None
            self._fail(error)
        self._ready()

    def _next_step(self) -> _Step | None:
        """What is to be done next, if anything is."""
        show = self._show
        if self._view is not None and (show is None or show.is_seen):
            return _Step(self._change_view)  # a view is seen before the next: sliders are dragged
        if show is None:
            return None
        if self._saves and (self._saves[0].what == "scene" or show.is_seen):
            return _Step(partial(self._save, show))
        return self._next_of(show)

    def _next_of(self, show: Show) -> _Step | None:
        """Frames first, then what has no samples yet, paths before further samples."""
        render = show.next_render(paused=self._paused)
        if (half := show.next_stale(self._frames.keys(), idle=render is None)) is not None:
            urgency = Urgency.REFINE if show.has_shown(half) else Urgency.SHOW
            return _Step(partial(self._send_frame, show, half), urgency)
        if (render is None or render.spp) and (half := show.next_untold()) is not None:
            return _Step(partial(self._tell_paths, show, half))
        if render is None:
            return None
        urgency = Urgency.REFINE if render.spp else Urgency.CHANGE
        return _Step(partial(show.advance, render), urgency)

    def _change_view(self) -> None:
        with self._lock:
            view, self._view = self._view, None
        assert view is not None
        before = self._show
        try:
            state = before.state if before and view.state is None else read_state(view.state)
            base = self._scenes.load(state.scene)
            self._show = Show(view.number, state, base, None if view.afresh else before)
        except ValueError as error:
            self._tell({"type": "refused", "number": view.number, "message": str(error)})
            return
        self._tell(describe_scene(self._show, before))

    def _send_frame(self, show: Show, half: int) -> None:
        frame = show.frame(half)
        with self._lock:
            self._frames[half] = frame

    def _tell_paths(self, show: Show, half: int) -> None:
        self._tell(show.paths(half))

    def _save(self, show: Show) -> None:
        with self._lock:
            save = self._saves.popleft()
        try:
            file = self._file(show, save)
        except (OSError, ValueError, MemoryError) as error:
            self._fail(error)
            return
        header = {"type": "file", "name": file.name, "media": file.media}
        with self._lock:
            self._messages.append(pack(header, file.content))

    def _file(self, show: Show, save: _Save) -> File:
        if save.what == "scene":
            return scene_file(show.scene, self._scenes.file(show.state.scene))
        result = show.halves[min(save.half, len(show.halves) - 1)].result()
        return picture_file(result, Path(show.state.scene).stem, save.what, save.exposure)

    def _fail(self, error: Exception) -> None:
        self._tell({"type": "failed", "message": str(error) or type(error).__name__})

    def _tell(self, message: Mapping[str, Any]) -> None:
        with self._lock:
            self._messages.append(json.dumps(message, allow_nan=False))
