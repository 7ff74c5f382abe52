"""Shares of time, simulated: each step takes the seconds that a test says."""

from __future__ import annotations

import pytest

from drpt.view.shares import LEAD, MAX_DEBT, Shares, Urgency

# Seconds that are simulated, and the longest step in them.
SPAN, LONGEST = 1000.0, MAX_DEBT - LEAD[Urgency.CHANGE]


def spent(shares: Shares[str], steps: dict[str, tuple[float, Urgency]]) -> dict[str, float]:
    """Seconds that each member gets, all of whom always wait for a step of some seconds."""
    used = dict.fromkeys(steps, 0.0)
    while sum(used.values()) < SPAN:
        member = shares.next({name: urgency for name, (_, urgency) in steps.items()})
        assert member is not None
        seconds, _ = steps[member]
        shares.charge(member, seconds)
        used[member] += seconds
    return used


@pytest.fixture
def shares() -> Shares[str]:
    shares = Shares[str]()
    for name in "abcd":
        shares.join(name)
    return shares


@pytest.mark.parametrize("urgency", [Urgency.REFINE, Urgency.CHANGE])
def test_who_asks_for_long_steps_gets_no_more(shares: Shares[str], urgency: Urgency) -> None:
    steps = dict.fromkeys("bcd", (0.1, Urgency.REFINE)) | {"a": (LONGEST, urgency)}
    used = spent(shares, steps)
    slack = LONGEST + LEAD[Urgency.CHANGE]
    assert all(abs(used[name] - SPAN / 4) <= slack for name in "abcd")


def test_two_who_ask_for_long_steps_leave_half(shares: Shares[str]) -> None:
    steps = dict.fromkeys("ab", (LONGEST, Urgency.CHANGE))
    used = spent(shares, steps | dict.fromkeys("cd", (0.1, Urgency.REFINE)))
    assert used["c"] + used["d"] == pytest.approx(SPAN / 2, abs=2 * LONGEST)


def test_a_change_comes_first(shares: Shares[str]) -> None:
    shares.charge("a", 0.9 * LEAD[Urgency.CHANGE])
    waiting = dict.fromkeys("abcd", Urgency.REFINE)
    assert shares.next(waiting) == "b"
    assert shares.next(waiting | {"a": Urgency.CHANGE}) == "a"
    shares.charge("a", 0.2 * LEAD[Urgency.CHANGE])
    assert shares.next(waiting | {"a": Urgency.CHANGE}) == "b"


def test_what_can_be_shown_is_shown_whatever_it_took(shares: Shares[str]) -> None:
    shares.charge("a", 1e6)
    assert shares.next(dict.fromkeys("bcd", Urgency.CHANGE) | {"a": Urgency.SHOW}) == "a"


def test_after_a_very_long_step_each_of_the_others_gets_a_bounded_time(
    shares: Shares[str],
) -> None:
    waiting = dict.fromkeys("abcd", Urgency.REFINE)
    assert shares.next(waiting) == "a"
    shares.charge("a", 1e6)
    steps = 0
    while (member := shares.next(waiting)) != "a":
        assert member is not None
        shares.charge(member, 0.1)
        steps += 1
    assert 0.1 * steps == pytest.approx(3 * MAX_DEBT, abs=0.4)


def test_nobody_saves_time_for_later(shares: Shares[str]) -> None:
    spent(shares, {"a": (0.1, Urgency.REFINE), "b": (0.1, Urgency.REFINE)})
    used = spent(shares, dict.fromkeys("abcd", (0.1, Urgency.REFINE)))
    assert all(used[name] == pytest.approx(SPAN / 4, abs=0.2) for name in "abcd")


def test_who_joins_late_has_no_more_to_get(shares: Shares[str]) -> None:
    steps = dict.fromkeys("abcd", (0.1, Urgency.REFINE))
    spent(shares, steps)
    shares.join("e")
    used = spent(shares, steps | {"e": (0.1, Urgency.REFINE)})
    assert used["e"] == pytest.approx(SPAN / 5, abs=0.2)


def test_who_has_left_is_not_charged(shares: Shares[str]) -> None:
    shares.leave("a")
    shares.leave("a")
    shares.charge("a", 1)
    assert shares.members == ["b", "c", "d"]
    assert shares.next({}) is None
