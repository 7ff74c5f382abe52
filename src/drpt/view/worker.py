"""The render thread, which gives all sessions equal shares of its time."""

from __future__ import annotations

from threading import Condition, Thread
from time import perf_counter
from typing import TYPE_CHECKING

from drpt.kernel import backend
from drpt.view.scenes import Scenes
from drpt.view.session import Session
from drpt.view.shares import Shares

if TYPE_CHECKING:
    from collections.abc import Callable

MAX_SESSIONS = 32
"""Each of them may hold up to four films, of 30 MB in the largest pictures, and unsent files."""


class TooManySessions(RuntimeError):  # noqa: N818 -- it says what is wrong
    """No more browsers are served."""


class Worker:
    """Renders what sessions show, a step of one after a step of another, in equal shares of time.

    Parameters
    ----------
    scene_name
        Name of a built-in scene, or path of a scene file.
    width, height
        Size of the pictures in pixels; see :class:`drpt.view.scenes.Scenes`.

    Raises `SceneError`, which names the file and the field.
    """

    def __init__(
        self, scene_name: str, *, width: int | None = None, height: int | None = None
    ) -> None:
        self._scenes = Scenes(scene_name, width, height)
        self._shares = Shares[Session]()
        self._change = Condition()
        self._stopping = False
        self._thread = Thread(target=self._run, name="render")

    def start(self) -> None:
        """Start to render; raises `drpt.kernel.backend.BackendError` where nothing can."""
        backend.load()
        self._thread.start()

    def stop(self) -> None:
        """Stop after the step that is running."""
        with self._change:
            self._stopping = True
            self._change.notify()
        self._thread.join()

    def open(self, ready: Callable[[], None]) -> Session:
        """Return a new session, which calls ``ready`` when it has something to send.

        Raises `TooManySessions`.
        """
        session = Session(self._scenes, ready, self._wake)
        with self._change:
            if len(self._shares.members) == MAX_SESSIONS:
                raise TooManySessions(f"{MAX_SESSIONS} viewers at most")
            self._shares.join(session)
        return session

    def close(self, session: Session) -> None:
        """Forget a session, if it is there."""
        with self._change:
            self._shares.leave(session)

    def _wake(self) -> None:
        with self._change:
            self._change.notify()

    def _run(self) -> None:
        while (session := self._next()) is not None:
            start = perf_counter()
            session.step()
            with self._change:
                self._shares.charge(session, perf_counter() - start)

    def _next(self) -> Session | None:
        """Wait for a session with something to do; None at the end."""
        with self._change:
            while not self._stopping:
                found = {session: session.urgency() for session in self._shares.members}
                waiting = {
                    session: urgency for session, urgency in found.items() if urgency is not None
                }
                if session := self._shares.next(waiting):
                    return session
                self._change.wait()
        return None
