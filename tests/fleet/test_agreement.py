"""Messages that get lost: whichever one it is, nobody drives what another does not expect."""

from __future__ import annotations

import pytest

from maneuver_automaton import simulate_fleet
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.shapes import (
    Disc,
)
from maneuver_automaton.fleet import Message
from maneuver_automaton.fleet.agreement import _Agreement
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.vehicle import OwnPlan
from tests.fleet.robots import at_rest, crossing, least_distance

MOST = 200  # messages of the small example, more than it sends


def found(cost: float) -> OwnPlan:
    motion = Motion([0.0], [[0.0, 0.0, 0.0]])
    return OwnPlan(
        Plan([0, 0, 0], (), durations=[]), cost, 0, FleetCourse(((Disc(0.1),),), (motion,))
    )


class Drops:
    """Loses the messages of some numbers, and notes all."""

    def __init__(self, *numbers: int) -> None:
        self.numbers = numbers
        self.seen: list[Message] = []

    def __call__(self, message: Message) -> bool:
        self.seen.append(message)
        return len(self.seen) - 1 in self.numbers


def three(*dropped: int):
    """Three vehicles that hold plans, and what they say to each other."""
    drops = Drops(*dropped)
    held = {k: found(float(k)) for k in range(3)}
    agreement = _Agreement("abc", drops, tries=1)
    agreement.start(held)
    return agreement, held, drops


def never(_):
    return False


def test_all_agree():
    agreement, held, drops = three()
    other = found(9.0)
    assert agreement.agree(0, other, held[0], never)
    assert agreement.unknown({**held, 0: other}) == []
    assert [one.kind for one in drops.seen] == ["asks", "agrees", "asks", "agrees", *["drives"] * 2]


@pytest.mark.parametrize("lost", range(4))
def test_without_all_acknowledgements_the_plan_is_held(lost):
    agreement, held, _ = three(lost)
    assert not agreement.agree(0, found(9.0), held[0], never)
    assert agreement.unknown(held) == []
    assert agreement.others_of(1)[0] == [held[0]]  # told that it was withdrawn


def test_it_is_said_again():
    agreement, held, drops = three(0, 2)  # the first message to b, and the first answer of b
    agreement.tries = 3
    assert agreement.agree(0, found(9.0), held[0], never)
    assert [one.kind for one in drops.seen[:5]] == ["asks", "asks", "agrees", "asks", "agrees"]


def test_who_refuses():
    agreement, held, drops = three()
    assert not agreement.agree(0, found(9.0), held[0], lambda j: j == 2)
    assert agreement.unknown(held) == []
    assert [one.kind for one in drops.seen if one.sender == "c"] == []


def test_both_plans_are_expected_until_the_doubt_ends():
    agreement, held, _ = three(4)  # "drives" does not reach b
    other = found(9.0)
    assert agreement.agree(0, other, held[0], never)
    assert agreement.others_of(1)[0] == [held[0], other]
    assert agreement.others_of(2)[0] == [other]
    held[0] = other
    agreement.begin(1, held)
    assert agreement.others_of(1)[0] == [other]


def test_a_withdrawal_that_is_lost():
    agreement, held, _ = three(1, 2)  # b's answer, and the withdrawal to b
    other = found(9.0)
    assert not agreement.agree(0, other, held[0], never)
    assert agreement.others_of(1)[0] == [held[0], other]
    agreement.begin(1, held)
    assert agreement.others_of(1)[0] == [held[0]]


def test_who_enters_is_known_to_all_or_waits():
    for lost, enters in ((), True), ((0,), False), ((2,), False):
        agreement, held, _ = three(*lost)
        agreement.leave(2)
        assert agreement.enter(7, 2, held[2], {0: held[0], 1: held[1]}) is enters
        assert (2 in agreement.expected) is enters


def test_who_enters_does_not_wait_for_who_has_left_since():
    agreement, held, drops = three()
    agreement.leave(2)
    assert agreement.enter(7, 2, held[2], {0: held[0]})
    assert {message.step for message in drops.seen} == {7}
    assert [*agreement.others_of(2)] == [0]


def driven_without(*numbers: int, steps: int = 40):
    drops = Drops(*numbers)
    fleet = crossing()
    log = simulate_fleet(
        fleet, step=1.0, first=at_rest(fleet), time_limit=60.0, lost=drops, steps=steps
    )
    return log, drops


@pytest.mark.exhaustive
@pytest.mark.slow
def test_each_message_lost_in_turn():
    """Whichever message is lost: every guarantee holds, and both arrive."""
    whole, drops = driven_without()
    assert whole.reached
    assert 20 < len(drops.seen) < MOST
    for number in range(len(drops.seen)):
        log, _ = driven_without(number)
        assert log.reached, number
        assert [*log.violations] == [], number
        assert log.distance_m >= 0.1 - 1e-9, number


@pytest.mark.parametrize("share", [2, 3, 7])
def test_many_lost(share):
    log, _ = driven_without(*range(0, 1000, share))
    assert [*log.violations] == []
    assert least_distance(log) >= 0.1 - 1e-9


def test_all_lost_nobody_moves():
    log, _ = driven_without(*range(100_000), steps=10)
    assert not log.reached
    assert [*log.swaps] == []
    assert [*log.violations] == []
