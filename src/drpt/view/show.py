"""What a session shows: the halves of a picture, their references, and the pixel looked into."""

from __future__ import annotations

from collections import deque
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.error import DARK
from drpt.view.edits import edited
from drpt.view.frames import finite, half_floats, pack, stops_of
from drpt.view.progressive import Progressive
from drpt.view.state import Half

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    from drpt.result import Result
    from drpt.scene import Scene
    from drpt.view.state import State

REFERENCE_SPP = 2**14
REFERENCE_LEAD = 4
"""So many samples a reference has for one of a half, as long as both are rendered."""
FRAME_REST = 3
"""So many times as long as a frame has taken, no other of the same half is made."""
REFERENCE_SEED = 2**53
"""One that no state has, so that the noise of a reference is not that of what is compared."""


class Show:
    """A state, and how far it has been rendered.

    Parameters
    ----------
    number
        The browser's number of the state.
    state
        What is shown.
    scene
        The scene of the state, without its edits.
    before
        What was shown before; what is the same in it goes on.

    Raises `ValueError`, which names the field, where the state does not fit the scene.
    """

    def __init__(self, number: int, state: State, scene: Scene, before: Show | None = None) -> None:
        self.number, self.state, self._base = number, state, scene
        self.scene = self._same_scene(before) or edited(scene, state.edits, state.camera)
        _check_pixel(state, self.scene)
        known = before._renders if before else []
        self.halves = [
            _known_or_new(known, Progressive(self.scene, half, state.spp, state.seed))
            for half in state.halves
        ]
        self._references = {
            bounces: _known_or_new(known, _reference(self.scene, bounces))
            for bounces in {half.bounces for half in state.halves}
            if state.difference == "reference"
        }
        numbers = range(len(self.halves))
        self._unseen, self._stale = set(numbers), set(numbers)
        self._due = dict.fromkeys(numbers, 0.0)
        self._untold = deque(numbers if state.pixel else ())

    def has_the_shapes_of(self, other: Show) -> bool:
        """Whether both have the same scene with the same edits."""
        return self._base is other._base and self.state.edits == other.state.edits

    def _same_scene(self, before: Show | None) -> Scene | None:
        if before is None or not self.has_the_shapes_of(before):
            return None
        return before.scene if before.state.camera == self.state.camera else None

    @property
    def _renders(self) -> list[Progressive]:
        return [*self.halves, *self._references.values()]

    # --- steps ------------------------------------------------------------------------------------

    @property
    def is_seen(self) -> bool:
        """Whether there was a frame of every half."""
        return not self._unseen

    def has_shown(self, half: int) -> bool:
        """Whether there was a frame of a half."""
        return half not in self._unseen

    def next_stale(self, waiting: Collection[int], *, idle: bool) -> int | None:
        """A half of which there is more to see than in its last frame.

        While frames of it wait to be sent, and unless the render is ``idle``, only at times: frames
        take time, too.
        """
        for half in self._stale:
            if not self.halves[half].spp:
                continue
            rested = idle or perf_counter() >= self._due[half]
            if half in self._unseen or (half not in waiting and rested):
                return half
        return None

    def next_untold(self) -> int | None:
        """A half whose paths through the pixel have not been told."""
        return self._untold[0] if self._untold else None

    def next_render(self, *, paused: bool) -> Progressive | None:
        """What is to take the next samples: of what is not finished, the one with the fewest.

        So halves are seen after about as many, and references run ahead of them. Where it is
        paused, what has none yet gets some.
        """
        share = {id(render): REFERENCE_LEAD for render in self._references.values()}
        renders = self.halves if paused else self._renders
        unfinished = [render for render in renders if not (render.spp if paused else render.done)]
        return min(unfinished, key=lambda it: it.spp / share.get(id(it), 1), default=None)

    def advance(self, render: Progressive) -> None:
        """Take more samples; what they are seen in is stale from then on."""
        render.step()
        self._stale |= {half for half in range(len(self.halves)) if render in self._seen_in(half)}

    def _seen_in(self, half: int) -> list[Progressive]:
        """What the frames of a half are made of."""
        truth = self._truth(half)
        return [self.halves[half], *([truth] if truth else [])]

    def _truth(self, half: int) -> Progressive | None:
        """What a half's difference is from."""
        if self.state.difference == "other":
            return self.halves[1 - half]
        return self._references.get(self.state.halves[half].bounces)

    # --- messages ---------------------------------------------------------------------------------

    def frame(self, half: int) -> bytes:
        """Return the message that shows a half."""
        start = perf_counter()
        self._stale.discard(half)
        self._unseen.discard(half)
        render, truth = self.halves[half], self._truth(half)
        result = render.result()
        stops = stops_of(result.image)
        payload = half_floats(result.image, stops)
        measured, difference = None, None
        if truth and truth.spp:
            true = truth.result()
            difference = relative_difference(result.image, true.image)
            payload += half_floats(difference)
            measured = finite(float(np.mean(np.square(difference, dtype=np.float64))) - true.error)
        header = {
            "type": "frame",
            "number": self.number,
            "half": half,
            "width": self.scene.camera.width,
            "height": self.scene.camera.height,
            "spp": result.spp,
            "seconds": result.seconds,
            "paths_per_second": render.paths_per_second,
            "rays": result.rays,
            "error": finite(result.error),
            "measured": measured if self.state.difference == "reference" else None,
            "reference_spp": truth.spp if truth and self.state.difference == "reference" else None,
            "done": render.done,
            "warning": result.warning,
            "pixel": self._pixel(result),
            "stops": stops,
            "images": ["radiance", *(["difference"] if difference is not None else [])],
        }
        message = pack(header, payload)
        self._due[half] = perf_counter() + FRAME_REST * (perf_counter() - start)
        return message

    def _pixel(self, result: Result) -> dict[str, Any] | None:
        if self.state.pixel is None:
            return None
        column, row = self.state.pixel
        return {
            "column": column,
            "row": row,
            "mean": list(map(finite, result.image[row, column])),
            "standard_error": list(map(finite, result.standard_error[row, column])),
        }

    def paths(self, half: int) -> dict[str, Any]:
        """Return the message that tells the paths through the pixel."""
        from drpt.view.paths import describe_paths

        assert self.state.pixel is not None
        self._untold.remove(half)
        column, row = self.state.pixel
        count = min(self.state.paths, self.state.spp)
        paths = describe_paths(self.scene, self.halves[half].rendering.vertices(column, row, count))
        return {
            "type": "pixel",
            "number": self.number,
            "half": half,
            "column": column,
            "row": row,
            **_first_hit(paths),
            "paths": paths,
        }


def _reference(scene: Scene, bounces: int) -> Progressive:
    return Progressive(scene, Half(bounces=bounces), REFERENCE_SPP, REFERENCE_SEED)


def _known_or_new(known: list[Progressive], new: Progressive) -> Progressive:
    """A render that does the same as the new one; else that, which is known from then on."""
    for render in known:
        if render.does_the_same_as(new):
            return render
    known.append(new)
    return new


def relative_difference(
    image: NDArray[np.float32], truth: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return (x − t) / √(t² + 0.01), whose mean square is the relMSE."""
    with np.errstate(invalid="ignore", over="ignore"):  # such differences are not a number
        return np.asarray((image - truth) / np.sqrt(np.square(truth) + np.float32(DARK)))


def _first_hit(paths: list[dict[str, Any]]) -> dict[str, Any]:
    """The surface that most paths through a pixel meet first."""
    first = [path["vertices"][0] for path in paths if path["vertices"]]
    shapes = [vertex["shape"] for vertex in first]
    if not shapes:  # a scene without light
        return {"surface": None, "point": None}
    most = max(first, key=lambda vertex: shapes.count(vertex["shape"]))
    return {"surface": most["shape"], "point": most["point"]}


def _check_pixel(state: State, scene: Scene) -> None:
    width, height = scene.camera.width, scene.camera.height
    if state.pixel and not (state.pixel[0] < width and state.pixel[1] < height):
        raise ValueError(
            f"pixel: {list(state.pixel)} is not allowed; the picture is {width}x{height}"
        )
