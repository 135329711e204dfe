"""Plans of others are held against a problem as the planner's own are."""

from __future__ import annotations

from dataclasses import replace

import pytest

import maneuver_automaton as ma

CAR = ma.Car(wheelbase=2.7, max_steering=0.5)
CONTROLS = {"ahead": (1.0, 0.0), "left": (1.0, 0.4), "right": (1.0, -0.4), "back": (-1.0, 0.0)}


def problem(**others):
    car = ma.Automaton.of_controls(CAR, CONTROLS)
    return ma.Problem(car, [0, 0, 0], [12, 3, 0], **others)


def path(*steps, start=(0, 0, 0), model=CAR):
    """A path of another planner: controls, each for some time."""
    trims = ma.Automaton.of_controls(model, {str(k): step[:2] for k, step in enumerate(steps)})
    return ma.Plan(start, trims.trims, durations=[step[2] for step in steps])


def test_what_the_planner_returns_passes():
    wall = ma.Box([1.0, 1.0], [6.0, 0.0])
    posed = problem(obstacles=wall, footprint=ma.Box([4.0, 1.8], [1.35, 0.0]), margin=0.1)
    result = ma.plan(posed, time_limit=2.0)
    verdict = ma.verify(posed, result.plan)
    assert (verdict.passed, verdict.reason, verdict.goal_index) == (True, "", 0)
    assert verdict.cost == pytest.approx(result.cost, rel=1e-12)
    assert verdict.audit.min_clearance_m == pytest.approx(result.clearance_m, abs=1e-3)


@pytest.mark.parametrize(
    ("steps", "others", "said"),
    [
        ([(1.0, 0.0, 12.0)], {}, "3 m from the goal"),
        ([(1.0, 0.0, 12.0)], {"obstacles": ma.Disc(1.0, [6, 0])}, "obstacle 0 is hit in trim 0"),
        ([(1.0, 0.0, 12.0)], {"bounds": ma.Bounds(x=(-1, 5))}, "it leaves the bounds"),
        ([(1.0, 0.0, 12.0)], {"horizon": ma.Horizon(max_time=9.0)}, "at most 9 s"),
    ],
)
def test_the_first_condition_that_is_broken_is_named(steps, others, said):
    verdict = ma.verify(problem(**others), path(*steps))
    assert not verdict.passed
    assert said in verdict.reason
    assert verdict.cost == pytest.approx(12.0)


def test_a_sharper_curve_than_the_wheels_can_steer_is_named():
    curve = path((1.0, 0.6, 2.0), model=ma.Car(wheelbase=2.7, max_steering=0.7))
    posed = replace(problem(), goals=(ma.Goal(pose=curve.end),))
    verdict = ma.verify(posed, curve)
    assert not verdict.passed
    assert "steering" in verdict.reason
    assert verdict.audit is not None


def test_another_start_is_named():
    verdict = ma.verify(problem(), path((1.0, 0.0, 1.0), start=(0, 0.5, 0)))
    assert verdict.reason == "it starts at [0.0, 0.5, 0.0], the problem at [0.0, 0.0, 0.0]"
    assert verdict.audit is None


def test_one_goal_of_several_is_enough():
    ahead = path((1.0, 0.0, 5.0))
    goals = (ma.Goal(pose=[12, 3, 0]), ma.Goal(pose=[5, 0, 0]))
    verdict = ma.verify(replace(problem(), goals=goals), ahead)
    assert (verdict.passed, verdict.goal_index) == (True, 1)


def test_a_plan_in_space_is_none_in_the_plane():
    still = ma.Plan([0, 0, 0, 0], (), durations=[])
    with pytest.raises(ValueError, match="starts at a pose of 4 numbers, need 3"):
        ma.verify(problem(), still)
