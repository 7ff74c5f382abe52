"""Settings: what is refused, and how."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import drpt
from drpt.settings import (
    MAX_BOUNCES,
    MAX_SPP,
    SAMPLERS,
    Settings,
    check_positive,
    check_switch,
    check_whole,
)

SCENE = drpt.load_scene("furnace")


def test_defaults_are_those_of_render() -> None:
    settings = Settings(SCENE)
    assert (settings.spp, settings.bounces, settings.mode) == (64, 3, drpt.Mode.MIS)
    assert (settings.sampler, settings.seed, settings.jitter) == ("sobol", 0, True)
    assert settings.pixels == SCENE.camera.width * SCENE.camera.height


BAD: list[tuple[dict[str, Any], str]] = [
    ({"scene": "cornell-box"}, "a drpt.Scene, as drpt.load_scene returns it"),
    ({"scene": None}, "a drpt.Scene"),
    ({"spp": 0}, "a whole number from 1 to 281474976710656"),
    ({"spp": 2.0}, "a whole number from 1"),
    ({"spp": True}, "a whole number from 1"),
    ({"spp": MAX_SPP + 1}, "a whole number from 1"),
    ({"bounces": -1}, "a whole number from 0 to 65536"),
    ({"bounces": MAX_BOUNCES + 1}, "a whole number from 0 to 65536"),
    ({"bounces": "3"}, "a whole number from 0"),
    ({"mode": "bidirectional"}, "one of implicit-uniform, implicit, explicit-uniform, explicit, "),
    ({"mode": None}, "one of implicit-uniform"),
    ({"sampler": "halton"}, "one of sobol, independent"),
    ({"sampler": ["sobol"]}, "one of sobol, independent"),
    ({"seed": -1}, "a whole number >= 0"),
    ({"seed": 0.5}, "a whole number >= 0"),
    ({"seed": float("nan")}, "a whole number >= 0"),
    ({"jitter": 1}, "True or False"),
    ({"jitter": "no"}, "True or False"),
]


@pytest.mark.parametrize(("bad", "allowed"), BAD)
def test_bad_settings_are_refused_by_name(bad: dict[str, Any], allowed: str) -> None:
    (field,) = bad
    with pytest.raises(ValueError, match=rf"^{field}: .* is not allowed; it must be ") as error:
        Settings(**{"scene": SCENE, **bad})
    assert repr(bad[field]) in str(error.value)
    assert allowed in str(error.value)
    assert "\n" not in str(error.value)


GOOD: list[tuple[dict[str, Any], Any]] = [
    ({"spp": 1}, 1),
    ({"spp": MAX_SPP}, 2**48),
    ({"spp": np.int64(2)}, 2),
    ({"bounces": np.int32(0)}, 0),
    ({"bounces": MAX_BOUNCES}, 2**16),
    ({"mode": "explicit"}, drpt.Mode.EXPLICIT),
    ({"mode": drpt.Mode.IMPLICIT}, drpt.Mode.IMPLICIT),
    *(({"sampler": sampler}, sampler) for sampler in SAMPLERS),
    ({"seed": 2**100}, 2**100),
    ({"seed": np.uint8(3)}, 3),
    ({"jitter": np.bool_(False)}, False),
]


@pytest.mark.parametrize(("good", "kept"), GOOD)
def test_good_settings_are_kept_as_plain_values(good: dict[str, Any], kept: Any) -> None:
    (field,) = good
    value = getattr(Settings(**{"scene": SCENE, **good}), field)
    assert value == kept
    assert type(value) is type(kept)


def test_settings_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        Settings(SCENE).spp = 3  # type: ignore[misc]


@pytest.mark.parametrize("value", [0, -1, 0.0, float("nan"), float("inf"), True, "1", None, 1j])
def test_numbers_that_are_not_positive_are_refused(value: object) -> None:
    with pytest.raises(
        ValueError, match=r"^time_limit: .* it must be a finite number > 0$"
    ) as error:
        check_positive("time_limit", value)
    assert repr(value) in str(error.value)


def test_positive_numbers_become_floats() -> None:
    for value in (3, 0.25, np.float32(0.5), np.int64(7)):
        checked = check_positive("time_limit", value)
        assert checked == value
        assert type(checked) is float


def test_checks_tell_types_apart() -> None:
    assert check_switch("error", False) is False
    with pytest.raises(ValueError, match=r"^error: 0 is not allowed"):
        check_switch("error", 0)
    assert check_whole("column", 7, 0, 7) == 7
    with pytest.raises(ValueError, match=r"^column: 8 is not allowed; .* from 0 to 7$"):
        check_whole("column", 8, 0, 7)
