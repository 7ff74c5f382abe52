"""The render thread: it serves all sessions in turn, and ends."""

from __future__ import annotations

import json
import threading
import time
from typing import TYPE_CHECKING

import pytest

import drpt
from drpt.view.shares import Urgency
from drpt.view.worker import MAX_SESSIONS, TooManySessions, Worker

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drpt.view.session import Session

# Seconds after which what was waited for does not come.
PATIENCE = 30.0


class Client:
    """A session, and how many frames of it have come."""

    def __init__(self, worker: Worker) -> None:
        self.ready = threading.Event()
        self.session: Session = worker.open(self.ready.set)
        self.frames = 0
        self.state = json.loads(str(self.session.next_message()))["state"]

    def view(self, spp: int) -> None:
        state = {**self.state, "spp": spp}
        self.session.receive(json.dumps({"type": "view", "number": 1, "state": state}))

    def listen(self) -> None:
        while (message := self.session.next_message()) is not None:
            if isinstance(message, bytes):
                self.frames += 1
                self.session.receive('{"type": "drawn"}')


def wait_for(frames: int, *clients: Client) -> None:
    """Listen until each of them has got so many frames."""
    end = time.monotonic() + PATIENCE
    while any(client.frames < frames for client in clients):
        assert time.monotonic() < end, "no frame has come"
        clients[0].ready.wait(0.01)
        for client in clients:
            client.listen()


@pytest.fixture
def worker() -> Iterator[Worker]:
    worker = Worker("furnace", width=8, height=8)
    worker.start()
    yield worker
    worker.stop()


@pytest.mark.slow
def test_ten_sessions_are_served_at_once(worker: Worker) -> None:
    clients = [Client(worker) for _ in range(10)]
    for client in clients:
        client.view(2**20)
    wait_for(3, *clients)


def test_who_has_left_is_served_no_more(worker: Worker) -> None:
    gone, other = Client(worker), Client(worker)
    gone.view(2**20)
    wait_for(1, gone)
    worker.close(gone.session)
    worker.close(gone.session)
    other.view(2**20)
    wait_for(3, other)
    while gone.session.next_message() is not None:
        pass
    wait_for(6, other)
    assert gone.session.next_message() is None


def test_who_never_listens_stops_nobody(worker: Worker) -> None:
    deaf, other = Client(worker), Client(worker)
    for _ in range(200):
        deaf.view(2**20)
    other.view(2**20)
    wait_for(5, other)


def test_a_change_is_seen_before_others_are_refined(worker: Worker) -> None:
    clients = [Client(worker) for _ in range(10)]
    for client in clients[1:]:
        client.view(2**20)
    wait_for(1, *clients[1:])
    before = sum(client.frames for client in clients[1:])
    clients[0].view(2**20)
    wait_for(1, *clients)
    assert sum(client.frames for client in clients[1:]) - before < len(clients) - 1


class Asking:
    """A session that always waits for a step, until a clock has come to an end."""

    END = 200.0
    clock = 0.0

    def __init__(self, seconds: float, urgency: Urgency) -> None:
        self._seconds, self._urgency = seconds, urgency
        self.used = 0.0

    def urgency(self) -> Urgency | None:
        return self._urgency if Asking.clock < Asking.END else None

    def step(self) -> None:
        self.used += self._seconds
        Asking.clock += self._seconds


def test_who_asks_for_kernels_leaves_others_their_time(monkeypatch: pytest.MonkeyPatch) -> None:
    asking = [Asking(1.5, Urgency.CHANGE), *(Asking(0.1, Urgency.REFINE) for _ in range(3))]
    opened = iter(asking)
    monkeypatch.setattr("drpt.view.worker.Session", lambda *_: next(opened))
    monkeypatch.setattr("drpt.view.worker.perf_counter", lambda: Asking.clock)
    worker = Worker("furnace")
    for _ in asking:
        worker.open(lambda: None)
    worker.start()
    end = time.monotonic() + PATIENCE
    while Asking.clock < Asking.END:
        assert time.monotonic() < end, "nobody is served"
        time.sleep(0.001)
    worker.stop()
    assert [session.used for session in asking] == pytest.approx([50, 50, 50, 50], abs=3)


def test_there_is_an_end_to_sessions(worker: Worker) -> None:
    sessions = [Client(worker).session for _ in range(MAX_SESSIONS)]
    with pytest.raises(TooManySessions, match=f"{MAX_SESSIONS} viewers at most"):
        worker.open(lambda: None)
    worker.close(sessions[0])
    Client(worker)


def test_it_ends_amid_its_work() -> None:
    worker = Worker("furnace", width=8, height=8)
    worker.start()
    client = Client(worker)
    client.view(2**20)
    wait_for(1, client)
    worker.stop()
    assert not [thread for thread in threading.enumerate() if thread.name == "render"]


@pytest.mark.parametrize(("scene", "width"), [("no-such", None), ("furnace", 0)])
def test_a_scene_that_is_wrong_is_told_at_once(scene: str, width: int | None) -> None:
    with pytest.raises(drpt.SceneError):
        Worker(scene, width=width)
