from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.receding_horizon.rest_of_plan import (
    NOTHING,
    commute,
    costliest_first,
    rest_of,
)
from tests.compare import assert_same_motion
from tests.quickly import draws
from tests.search.cases import TABLE_2, helicopter, robot

TRIMS = robot(TABLE_2 | {"back": (-0.5, 0.0), "slow spin": (0.0, 0.1), "wide": (1.5, 0.3)}).trims
FLYING = helicopter().trims
FEW = settings(max_examples=draws(60))


def plan_of(trims, *names, durations, start=(0.0, 0.0, 0.0)) -> Plan:
    by_name = {trim.name: trim for trim in trims}
    return Plan(start, tuple(by_name[name] for name in names), durations=durations)


@st.composite
def plans(draw, trims=TRIMS) -> Plan:
    word = draw(st.lists(st.sampled_from(trims), min_size=0, max_size=5))
    times = draw(
        st.lists(st.floats(0.01, 3.0), min_size=len(word), max_size=len(word)),
    )
    start = draw(st.tuples(*[st.floats(-5.0, 5.0)] * len(trims[0].body_velocity)))
    return Plan(start, tuple(word), durations=times, start_time=draw(st.floats(0.0, 9.0)))


def rates_of(plan: Plan) -> np.ndarray:
    return np.array([float(np.sum(trim.control**2)) for trim in plan.trims])


@given(plan=plans(), share=st.floats(0.0, 1.2))
@FEW
def test_the_rest_leads_where_the_plan_led(plan, share):
    after = share * plan.duration
    rest = rest_of(plan, after)
    assert rest.start_time == plan.start_time + after
    assert rest.duration == pytest.approx(max(0.0, plan.duration - after), abs=1e-8)
    assert_same_motion(SE2(rest.end), SE2(plan.end), atol=1e-7)


@given(plan=plans(), share=st.floats(0.0, 1.0))
@FEW
def test_padded_it_lasts_as_long_again_and_ends_at_the_same_pose(plan, share):
    after = share * plan.duration
    rest = rest_of(plan, after, pad=TRIMS[0])
    assert rest.duration == pytest.approx(plan.duration, abs=1e-8)
    assert_same_motion(SE2(rest.end), SE2(plan.end), atol=1e-7)


@given(plan=plans(), one=st.floats(0.0, 2.0), two=st.floats(0.0, 2.0))
@FEW
def test_shifting_twice_is_shifting_for_the_sum(plan, one, two):
    twice, once = rest_of(rest_of(plan, one), two), rest_of(plan, one + two)
    at = np.linspace(0.0, once.duration, 5) + once.start_time
    assert_same_motion(SE2(twice.pose_at(at)), SE2(once.pose_at(at)), atol=1e-7)


def test_what_lasts_no_time_leaves_the_word():
    plan = plan_of(TRIMS, "straight", "spin", durations=[1.0, 1.0])
    assert rest_of(plan, 1.0 - 0.5 * NOTHING).word == ("spin",)
    assert rest_of(plan, 1.0).durations.tolist() == [1.0]
    assert rest_of(plan, 1.5, pad=TRIMS[0]).durations.tolist() == [0.5, 1.5]
    assert rest_of(plan, 2.0).word == ()


def test_a_rest_is_prolonged_not_repeated():
    plan = plan_of(TRIMS, "straight", "rest", durations=[1.0, 1.0])
    rest = rest_of(plan, 0.25, pad=TRIMS[0])
    assert rest.word == ("straight", "rest")
    assert rest.durations.tolist() == [0.75, 1.25]


def test_from_where_the_vehicle_is():
    plan = plan_of(TRIMS, "straight", durations=[2.0])
    rest = rest_of(plan, 1.0, start=np.array([7.0, 8.0, 0.0]))
    assert rest.start.tolist() == [7.0, 8.0, 0.0]
    assert rest.end.tolist() == pytest.approx([8.5, 8.0, 0.0])


@pytest.mark.parametrize("trims", [TRIMS, FLYING])
@given(data=st.data())
@FEW
def test_ordering_moves_no_end_and_takes_no_longer(trims, data):
    plan = data.draw(plans(trims))
    ordered = costliest_first(plan, rates_of(plan))
    group = group_of(plan.start.size)
    assert_same_motion(group(ordered.end), group(plan.end), atol=1e-8, modulo_turn=True)
    assert ordered.duration == pytest.approx(plan.duration)
    rates = np.array([float(np.sum(trim.control**2)) for trim in ordered.trims])
    assert float(rates @ ordered.durations) == pytest.approx(float(rates_of(plan) @ plan.durations))
    if ordered.trims:
        first = [float(np.sum(p.trims[0].control ** 2)) for p in (plan, ordered)]
        assert first[1] >= first[0]


def test_straights_and_turns_about_one_centre_go_by_falling_cost_and_rest_comes_last():
    plan = plan_of(
        TRIMS, "rest", "back", "straight", "slow spin", "spin", durations=[1.0, 2.0, 3.0, 4.0, 5.0]
    )
    ordered = costliest_first(plan, rates_of(plan))
    assert ordered.word == ("straight", "back", "spin", "slow spin", "rest")
    assert ordered.durations.tolist() == [3.0, 2.0, 5.0, 4.0, 1.0]


def test_equal_neighbours_become_one():
    plan = plan_of(TRIMS, "back", "straight", "back", durations=[1.0, 2.0, 3.0])
    ordered = costliest_first(plan, rates_of(plan))
    assert ordered.word == ("straight", "back")
    assert ordered.durations.tolist() == [2.0, 4.0]


def test_a_climb_joins_no_trims_that_do_not_commute():
    # a climb commutes with the straight before it and the turn after it, these two do not
    plan = plan_of(
        FLYING, "ahead", "lift", "left", durations=[1.0, 1.0, 1.0], start=(0.0, 0.0, 0.0, 0.0)
    )
    for order in itertools.permutations([1.0, 2.0, 3.0]):
        ordered = costliest_first(plan, np.array(order))
        assert np.abs(ordered.end - plan.end).max() <= 1e-12


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1.0, 1e3])
def test_slow_trims_commute_no_more_than_fast_ones(scale):
    ahead, spin = np.array([scale, 0.0, 0.0]), np.array([0.0, 0.0, scale])
    assert not commute(ahead, spin)
    assert commute(ahead, -3.0 * ahead)
    assert commute(spin, -3.0 * spin)
    assert commute(ahead, np.zeros(3))
    turn = np.array([scale, 0.0, scale])
    assert commute(turn, -0.3 * turn)
    assert not commute(turn, ahead)
