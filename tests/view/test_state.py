"""What browsers may ask for: all of it is checked, and named where it is wrong."""

from __future__ import annotations

import json
from typing import Any

import pytest

from drpt.view.state import Half, Orbit, State, read_state

STATE = State(
    "veach",
    (Half("explicit", "independent", 2), Half()),
    seed=7,
    edits={3: {"radius": 0.5, "albedo": [0.1, 0.2, 0.3]}},
    camera=Orbit(30, -20, 0.5),
    pixel=(3, 4),
    difference="other",
)


def plain(state: State, **changes: Any) -> dict[str, Any]:
    """A state as it comes from a browser."""
    sent: dict[str, Any] = json.loads(json.dumps(state.json))
    return {**sent, **changes}


@pytest.mark.parametrize("state", [STATE, State("furnace")])
def test_states_come_back_as_they_went(state: State) -> None:
    assert read_state(plain(state)) == state


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"scene": 3}, "scene: 3 is not allowed; it must be a name"),
        ({"halves": []}, "halves: [] is not allowed; it must be a list of one or two"),
        ({"halves": [{"mode": "mis"}]}, "halves[0]: {'mode': 'mis'} is not allowed"),
        ({"spp": 0}, "spp: 0 is not allowed; it must be a whole number from 1 to 1048576"),
        ({"spp": True}, "spp: True is not allowed"),
        ({"seed": -1}, "seed: -1 is not allowed"),
        ({"edits": {"-1": {}}}, "edits: {'-1': {}} is not allowed; it must be an object for"),
        ({"edits": {"1": 5}}, "edits: {'1': 5} is not allowed"),
        ({"camera": None}, "camera: None is not allowed"),
        ({"pixel": [1]}, "pixel: [1] is not allowed; it must be null, or a column and a row"),
        ({"pixel": [1, -2]}, "pixel: -2 is not allowed"),
        ({"paths": 257}, "paths: 257 is not allowed; it must be a whole number from 1 to 256"),
        ({"difference": "?"}, "difference: '?' is not allowed; it must be one of none, reference"),
        ({"exposure": 1}, "is not allowed; it must be an object with scene, halves, spp"),
    ],
)
def test_what_is_wrong_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 -- its words are what is tested
        read_state(plain(STATE, **changes))
    assert words in str(caught.value)
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize(
    ("half", "words"),
    [
        ({"mode": "path"}, "halves[1].mode: 'path' is not allowed"),
        ({"sampler": "halton"}, "halves[1].sampler: 'halton' is not allowed"),
        ({"bounces": 65}, "halves[1].bounces: 65 is not allowed"),
    ],
)
def test_the_half_that_is_wrong_is_named(half: dict[str, Any], words: str) -> None:
    sent = plain(STATE)
    sent["halves"][1] |= half
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        read_state(sent)
    assert words in str(caught.value)


@pytest.mark.parametrize("zoom", [1e3, float("nan"), "near", None, True])
def test_the_camera_stays_within_reach(zoom: object) -> None:
    camera = {"azimuth": 0, "elevation": 0, "zoom": zoom}
    with pytest.raises(ValueError, match=r"^camera\.zoom: .* it must be a number from -16 to 16"):
        read_state(plain(STATE, camera=camera))


def test_one_half_has_no_other() -> None:
    with pytest.raises(ValueError, match="difference: 'other' is not allowed"):
        State("veach", difference="other")


@pytest.mark.parametrize("value", [None, [], "state", 3])
def test_a_state_is_an_object(value: object) -> None:
    with pytest.raises(ValueError, match=r"^state: "):
        read_state(value)
