"""Time by one clock, and expansions: what is left of them, and shares of it."""

from __future__ import annotations

import time

import pytest

from maneuver_automaton.budget import FIRST_LATE, LATE, LATE_SHARE, MOMENT, Budget, EvenPace, Pace

DAY = 86400.0  # [s] no test takes as long


def test_time_runs_from_the_begin_to_the_deadline():
    budget = Budget.from_now(DAY)
    assert budget.seconds == pytest.approx(DAY)
    assert 0.0 <= budget.elapsed <= budget.seconds
    assert 0.0 < budget.left <= DAY
    assert not budget.is_over
    over = Budget(began=time.monotonic() - 2.0, deadline=time.monotonic() - 1.0)
    assert over.is_over
    assert over.left == 0.0


def test_a_part_has_its_own_begin_and_its_share_of_what_is_left():
    budget = Budget.from_now(DAY, expansions=70)
    part = budget.part(0.25)
    assert budget.began <= part.began
    assert part.seconds == pytest.approx(DAY / 4.0, rel=1e-2)
    assert part.expansions == 70
    over = Budget(began=0.0, deadline=0.0)
    assert over.part(0.5, at_least=0.1).seconds == pytest.approx(0.1)


def test_a_stage_takes_a_share_and_leaves_time_for_others_where_work_is_counted():
    timed, counted = Budget.from_now(DAY), Budget.from_now(DAY, expansions=70)
    assert timed.stage(0.5).deadline < timed.deadline
    assert timed.stage(0.5).began == timed.began
    stage = counted.stage(0.5)
    assert timed.stage(0.5).deadline < stage.deadline < counted.deadline
    assert stage.expansions == 70


def test_expansions_that_are_spent_are_gone():
    budget = Budget.from_now(DAY, expansions=70)
    assert budget.less(30).expansions == 40
    assert budget.less(30).less(60).expansions == 0
    assert Budget.from_now(DAY).less(10**9).expansions is None


def test_whatever_clock_there_is_is_asked_by_all_its_parts():
    now = 10.0
    budget = Budget.from_now(8.0, clock=lambda: now)
    assert (budget.began, budget.deadline, budget.before(3.0).deadline) == (10.0, 18.0, 15.0)
    now = 14.0
    assert (budget.elapsed, budget.left, budget.part(0.5).deadline) == (4.0, 4.0, 16.0)
    now = 18.0
    assert budget.is_over
    assert budget.stage(0.5).is_over


def test_what_was_found_may_be_checked_a_moment_longer():
    now = 10.0
    budget = Budget(began=10.0, deadline=18.0, clock=lambda: now)
    assert budget.left_to_check == pytest.approx(8.0 * (1.0 + LATE_SHARE) + LATE)
    now = 18.0 + 8.0 * LATE_SHARE + LATE
    assert budget.left_to_check == 0.0
    assert budget._replace(late=FIRST_LATE).left_to_check == pytest.approx(FIRST_LATE - LATE)
    delayed = Budget(began=10.0, deadline=18.0, clock=lambda: now, worked=time.process_time())
    assert delayed.left_to_check > 8.0


def test_portions_of_work_take_a_moment_each():
    now = 0.0
    pace = Pace(Budget(began=0.0, deadline=1.0, clock=lambda: now), steps=64, most=256)
    taken = []
    for each in (1e-5, 1e-5, 1e-3, 1e-3, 1e-3):  # [s] of a step
        taken.append(pace.take(10**6))
        now += taken[-1] * each
    assert taken[1:3] == [256, 256]
    assert taken[3:] == [pytest.approx(MOMENT / 1e-3, abs=1)] * 2
    now = 1.0
    assert pace.take(3) == 0


def test_even_steps_are_parted_only_where_time_gets_short():
    now = 0.0
    pace = EvenPace(Budget(began=0.0, deadline=1.0, clock=lambda: now), most=10, each=0.01)
    taken = []
    while step := pace.take(100):
        taken.append(step)
        now += 0.03 * step
    assert taken == [10, 10, 10, 3]  # the next would end at 1.02 s
