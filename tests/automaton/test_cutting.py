"""Plans cut in time: both parts together are the plan, each is what the model does."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import (
    committed,
    head_of,
    joined,
    tail_of,
    with_samples_at,
)
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal
from tests.inertia import car_automaton
from tests.quickly import draws


@functools.cache
def driven() -> Plan:
    """Ahead, a turn for no time, back, and rest."""
    car = car_automaton()
    names = ("rest", "2, 0", "2, 0.6", "-1, 0", "rest")
    by_ends = {(one.source, one.target): one for one in car.maneuvers}
    return Plan(
        [1.0, 2.0, 0.5],
        [car[name] for name in names],
        durations=[0.5, 1.0, 0.0, 0.7, 0.3],
        maneuvers=[by_ends[ends] for ends in itertools.pairwise(names)],
        start_time=3.0,
    )


@given(share=st.floats(0.0, 1.0))
@settings(max_examples=draws(40))
def test_head_and_tail_are_the_plan(share):
    plan, model = driven(), car_automaton().model
    at = share * plan.duration
    plan = with_samples_at(plan, [plan.start_time + at], model)
    head, tail = head_of(plan, at), tail_of(plan, at)
    assert head.duration == pytest.approx(at, abs=2e-9)
    assert head.duration + tail.duration == pytest.approx(plan.duration, abs=2e-9)
    assert tail.start_time == pytest.approx(plan.start_time + at)
    assert np.abs(head.end - tail.start).max() < 1e-8
    assert np.abs(tail.end - plan.end).max() < 1e-8
    times = np.linspace(plan.start_time, plan.start_time + plan.duration, 50)
    ahead = times < plan.start_time + at
    poses = np.concatenate([head.pose_at(times[ahead]), tail.pose_at(times[~ahead])])
    assert np.abs(poses - plan.pose_at(times)).max() < 1e-6


@pytest.mark.parametrize("at", [0.2, 0.9, 1.7, 4.0, 5.5, 8.0])
def test_both_parts_pass_the_audit(at):
    model = car_automaton().model
    plan = with_samples_at(driven(), [3.0 + at], model)
    for part in (head_of(plan, at), tail_of(plan, at)):
        if part.primitives:
            audit = audit_plan(part, Goal(pose=part.end), model)
            assert audit.passed, audit.reason
            assert audit.max_dynamics_defect < 1e-9


def test_a_maneuver_under_way_is_named_by_what_is_left_of_it():
    plan = driven()  # rest for half a second, then two seconds up to 2 m/s
    assert committed(plan, 0.25) == 0.0
    assert committed(plan, 0.5) == 0.0
    assert committed(plan, 1.0) == pytest.approx(1.5)
    assert committed(plan, 3.0) == 0.0


@pytest.mark.parametrize("at", [0.2, 1.0, 3.0, 3.5, 5.0])
def test_parts_join_again(at):
    plan = driven()
    rest = committed(plan, at)
    whole = joined(head_of(plan, at + rest), tail_of(plan, at + rest))
    assert whole.word == plan.word
    assert np.abs(whole.end - plan.end).max() < 1e-12
    assert whole.duration == pytest.approx(plan.duration, abs=1e-9)


def test_the_end_of_a_plan_is_its_last_trim():
    plan = driven()
    tail = tail_of(plan, plan.duration)
    assert [trim.name for trim in tail.trims] == ["rest"]
    assert tail.duration == pytest.approx(0.0, abs=1e-12)
    assert head_of(plan, 0.0).duration == 0.0


TRIMS = [
    Trim(name=name, body_velocity=twist, control=[0.0])
    for name, twist in (("ahead", [2, 0, 0]), ("left", [1, 0, 1]), ("rest", [0, 0, 0]))
]
TIMES = st.sampled_from([0.0, 1e-10, 0.5, 1.0]) | st.floats(0.0, 5.0)


@given(
    pieces=st.lists(st.tuples(st.sampled_from(TRIMS), TIMES), min_size=2, max_size=5),
    at=TIMES | st.floats(0.0, 20.0),
)
def test_a_plan_of_trims_is_cut_as_one_whose_switches_are_named(pieces, at):
    word, times = zip(*pieces, strict=True)
    plan = Plan([1.0, 2.0, 0.5], word, durations=times, start_time=3.0)
    named = replace(plan, maneuvers=(None,) * (len(word) - 1))
    for cut in (head_of, tail_of):
        part, expected = cut(plan, at), cut(named, at)
        assert part.trims == expected.trims
        assert part.durations.tolist() == expected.durations.tolist()
        assert (part.start_time, part.maneuvers) == (expected.start_time, ())
        assert part.start.tolist() == expected.start.tolist()
        assert not part.start.flags.writeable
        assert not part.durations.flags.writeable
