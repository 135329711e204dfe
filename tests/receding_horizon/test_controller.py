from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import Bounds, Horizon, Problem
from maneuver_automaton.receding_horizon import Guarantee, Origin, RecedingHorizon, simulate, within
from maneuver_automaton.receding_horizon.rest_of_plan import missed
from tests.receding_horizon.loops import AHEAD, NEAR, parking_loop, straight
from tests.search.cases import (
    REEDS_SHEPP,
    SLOW_AND_FAST,
    TABLE_2,
    robot,
    without_rest,
)

FREE = Horizon(max_trims=4)
PAIR = {"rest": (0.0, 0.0), "slow": (0.5, 0.0), "fast": (1.0, 0.0)}


def controller(problem=None, *, step=1.0, **settings) -> RecedingHorizon:
    return RecedingHorizon(problem or parking_loop(), step=step, **settings)


class TestOneStep:
    def test_the_first_plans_the_second_shifts(self):
        loop = controller(straight())
        control, first = loop.step([-2.0, 0.0, 0.0])
        assert control.tolist() == [1.0, 0.0]
        assert (first.origin, first.number, first.shifted_value) == (Origin.SEARCHED, 0, None)
        assert (first.value, first.applied, first.applied_cost) == (2.0, 1.0, 1.0)
        assert (first.off_plan, first.replanned) == (None, False)
        control, second = loop.step(first.predicted)
        assert (second.value, second.accumulated_cost, second.time) == (1.0, 1.0, 1.0)
        assert (second.shifted_value, second.off_plan) == (1.0, 0.0)
        assert second.plan.word == ("ahead", "rest")
        assert second.plan.duration == pytest.approx(4.0)  # T, as before
        assert not second.replanned
        assert second.violations == ()

    def test_at_the_goal_it_rests(self):
        loop = controller(straight())
        control, step = loop.step([0.0, 0.0, 2.0 * math.pi])
        assert control.tolist() == [0.0, 0.0]
        assert step.arrived
        assert (step.value, step.plan.word, step.plan.duration) == (0.0, ("rest",), 4.0)

    def test_at_the_goal_without_rest_there_is_no_control(self):
        problem = straight(controls={"ahead": (1.0, 0.0)}, horizon=Horizon())
        control, step = controller(problem).step([0.0, 0.0, 0.0])
        assert control is None
        assert step.control is None
        assert (step.value, step.plan.word, step.applied) == (0.0, (), 1.0)


class TestElapsed:
    @pytest.mark.parametrize("elapsed", [0.0, 0.25, 0.5, 1.0, 1.5, 1.9])
    def test_the_plan_followed_for_longer_or_shorter_breaks_nothing(self, elapsed):
        loop = controller(straight())
        _, first = loop.step([-2.0, 0.0, 0.0])
        _, second = loop.step(first.plan.pose_at(elapsed), elapsed=elapsed)
        assert second.time == elapsed
        assert second.value == pytest.approx(2.0 - elapsed)
        assert second.accumulated_cost == pytest.approx(elapsed)
        assert second.violations == ()
        assert not second.replanned

    @pytest.mark.parametrize("elapsed", [-0.1, math.nan, math.inf])
    def test_no_time(self, elapsed):
        loop = controller(straight())
        loop.step([-2.0, 0.0, 0.0])
        with pytest.raises(ValueError, match=rf"elapsed must be at least 0, got {elapsed} s"):
            loop.step([-1.0, 0.0, 0.0], elapsed=elapsed)


class TestWrongInput:
    @pytest.mark.parametrize(
        ("state", "message"),
        [
            ([0.0, 1.0, math.nan], "measured_state: got nan, need finite numbers"),
            ([0.0, math.inf, 0.0], "measured_state: got inf, need finite numbers"),
            ([0.0, 1.0], r"measured_state: got shape \(2,\), need 3 components last"),
            ([0.0, 1.0, 0.0, 0.0], r"measured_state: got shape \(4,\), need 3 components last"),
            ([[0.0, 1.0, 0.0]], r"measured_state: got shape \(1, 3\), need \(3,\)"),
            ("here", "measured_state: got 'here', need numbers"),
        ],
    )
    def test_no_pose(self, state, message):
        with pytest.raises(ValueError, match=message):
            controller().step(state)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"step": 0.0}, "step must be positive, got 0.0 s"),
            ({"step": math.nan}, "step must be positive, got nan s"),
            ({"step": 8.1}, "step is 8.1 s, need at most the horizon, 8 s"),
            ({"time_limit": 0.0}, "time_limit must be positive, got 0.0 s"),
            ({"margin": -1.0}, "margin must be at least 0, got -1.0"),
            ({"margin": math.nan}, "margin must be at least 0, got nan"),
        ],
    )
    def test_settings(self, settings, message):
        with pytest.raises(ValueError, match=rf"^receding horizon: {message}$"):
            controller(**settings)

    def test_retiming_needs_a_rest(self):
        problem = parking_loop(without_rest(TABLE_2))
        with pytest.raises(ValueError, match="retimed plans need a rest trim"):
            controller(problem, retimed=True)
        controller(problem)

    @pytest.mark.parametrize(
        "problem", [straight(horizon=Horizon()), straight(cost=Cost(time=1.0))]
    )
    def test_retiming_needs_time_and_effort(self, problem):
        with pytest.raises(ValueError, match="need a fixed horizon and a cost with effort"):
            controller(problem, retimed=True)

    def test_a_first_plan_that_ends_elsewhere(self):
        problem = straight()
        first = Plan(problem.start, (problem.automaton.trims[1],), durations=[1.0])
        with pytest.raises(ValueError, match=r"first ends at \[-1.0, 0.0, 0.0\], need a plan"):
            controller(problem, first=first).step(problem.start)

    def test_a_first_plan_may_end_within_the_tolerance(self):
        problem = straight()
        goal = replace(problem.goals[0], tolerance_m=0.1)
        first = Plan(problem.start, (problem.automaton.trims[1],), durations=[1.95])
        loop = controller(replace(problem, goals=(goal,)), first=first)
        assert loop.step(problem.start)[1].plan.durations[0] == 1.95

    def test_a_first_plan_that_takes_too_long(self):
        problem = straight(horizon=Horizon(time=1.5))
        first = Plan(problem.start, (problem.automaton.trims[1],), durations=[2.0])
        with pytest.raises(ValueError, match=r"first takes 2 s, need at most 1\.5 s"):
            controller(problem, first=first).step(problem.start)


def test_a_first_plan_is_filled_with_rest():
    problem = straight()
    first = Plan(problem.start, (problem.automaton.trims[1],), durations=[2.0])
    _, step = controller(problem, first=first).step(problem.start)
    assert step.plan.word == ("ahead", "rest")
    assert step.plan.durations.tolist() == [2.0, 2.0]
    assert step.origin is Origin.FIRST


class TestMargin:
    def value_of_second(self, margin):
        # from a metre, all fast for a second costs 1.0; slow for two seconds costs 0.5
        problem = straight(1.0, controls=PAIR)
        fast = Plan(problem.start, (problem.automaton.trims[2],), durations=[1.0])
        loop = controller(problem, step=0.5, margin=margin, first=fast)
        _, step = loop.step(problem.start)
        _, step = loop.step(step.predicted)
        return step

    def test_a_new_word_must_be_cheaper_by_more(self):
        kept = self.value_of_second(0.3)
        assert kept.plan.word == ("fast", "rest")
        assert (kept.value, kept.replanned) == (0.5, False)

    @pytest.mark.parametrize("margin", [0.0, 0.2])
    def test_otherwise_it_is_taken(self, margin):
        taken = self.value_of_second(margin)
        assert taken.plan.word == ("slow", "rest")
        assert (taken.value, taken.replanned) == (0.25, True)
        assert taken.shifted_value == 0.5


class TestBudget:
    @pytest.mark.parametrize("horizon", [Horizon(time=8.0, max_trims=4), FREE, Horizon(time=8.0)])
    def test_never_nothing(self, horizon):
        loop = controller(parking_loop(horizon=horizon), time_limit=1e-9)
        pose = np.array([0.0, 1.0, 0.0])
        for _ in range(4):
            _, step = loop.step(pose)
            assert math.isfinite(step.value)
            assert missed(step.plan, loop.problem.goals[0]) <= 1e-9
            assert {one.guarantee for one in step.violations} <= {Guarantee.BUDGET}
            pose = step.predicted

    def test_it_is_said(self):
        loop = controller(time_limit=1e-9)
        loop.step([0.0, 1.0, 0.0])
        _, step = loop.step(loop.last.predicted)
        assert not step.exhaustive
        assert [str(one) for one in step.violations] == [
            "time budget: the search was cut short after 1e-09 s; the best plan so far is kept"
        ]


class TestBounds:
    def test_the_plan_stays_inside(self):
        bounds = Bounds(x=(-0.15, 1.0))
        problem = parking_loop(bounds=bounds)
        free_value = controller().step([0.0, 1.0, 0.0])[1].value
        _, step = controller(problem).step([0.0, 1.0, 0.0])
        assert step.value > free_value
        assert step.plan.sample().pose[:, 0].min() >= -0.15 - 1e-9
        assert step.lower_bound <= step.value

    def test_pushed_outside_it_comes_back(self):
        problem = parking_loop(bounds=Bounds(x=(-0.5, 0.5), y=(-0.5, 1.5)))
        loop = controller(problem)
        loop.step([0.0, 1.0, 0.0])
        _, step = loop.step([-0.7, 1.0, 0.0])
        assert missed(step.plan, problem.goals[0]) <= 1e-9


class TestHopeless:
    def test_no_word_leads_there(self):
        control, step = controller(parking_loop(AHEAD)).step([0.0, 1.0, 0.0])
        assert control.tolist() == [0.0, 0.0]
        assert step.value == math.inf
        assert [one.guarantee for one in step.violations] == [Guarantee.FEASIBILITY]

    def test_and_then_one_does(self):
        loop = controller(parking_loop(AHEAD))
        loop.step([0.0, 1.0, 0.0])
        control, step = loop.step([-1.0, 0.0, 0.0])
        assert control.tolist() == [1.0, 0.0]
        assert step.value == 1.0

    def test_out_of_time_the_quickest_is_applied(self):
        loop = controller(straight(9.0))
        _, step = loop.step([-9.0, 0.0, 0.0])
        assert step.plan.duration == pytest.approx(9.0)
        assert [str(one) for one in step.violations] == [
            "horizon: no plan was found that takes at most 4 s; the one applied takes 9 s"
        ]


class TestHold:
    def test_within_the_goal_it_stays_within(self):
        loop = controller(parking_loop(goal=NEAR), hold=True)
        _, step = loop.step([0.1, 0.05, 0.05])
        assert step.arrived
        samples = step.plan.sample(max_step_m=0.005, max_step_rad=0.005).pose
        ends = step.plan.pose_at(step.plan.start_time + np.arange(1, 6) * loop.settings.step)
        inside = [within(pose, NEAR) for pose in samples]
        assert all(inside) or all(within(pose, NEAR) for pose in ends)


class TestSwitches:
    COST = Cost(length=1.0, switch=0.1, direction_change=0.3)

    def test_their_price_is_paid_when_they_are_driven(self):
        problem = Problem(
            robot(REEDS_SHEPP),
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            cost=self.COST,
            horizon=Horizon(max_trims=5),
        )
        loop = controller(problem, step=0.3)
        _, first = loop.step(problem.start)
        step, spent = first, 0.0
        while not step.arrived:
            assert step.accumulated_cost == pytest.approx(spent)
            assert spent + step.value <= first.value + 1e-9
            assert step.violations == ()
            spent += step.applied_cost
            _, step = loop.step(step.predicted)
        assert spent <= first.value + 1e-9


@pytest.mark.parametrize(
    "problem",
    [
        parking_loop(start=(-0.5, 1.2, 0.7)),  # a word that moves all the time costs too much
        parking_loop(  # it may cost less than a quick one
            SLOW_AND_FAST, start=(-0.1, 0.9, 0.7), horizon=Horizon(time=5.0, max_trims=4)
        ),
    ],
    ids=["table 2", "slow and fast"],
)
def test_no_word_is_left_out_that_would_be_cheaper(problem):
    for step in simulate(problem, step=1.0, steps=6).steps:
        _, alone = controller(replace(problem, start=step.pose), step=1.0).step(step.pose)
        assert step.value == pytest.approx(alone.value, rel=1e-9)


class TestLowerBound:
    """A lower bound is below every plan, also below those that were found and not taken."""

    def test_a_margin_keeps_a_dearer_plan_and_does_not_call_it_the_best(self):
        problem = parking_loop()
        costlier = plan(problem, alternatives=1).alternatives[0]
        loop = controller(problem, step=0.5, first=costlier.plan, margin=1.0)
        _, step = loop.step(problem.start)
        _, kept = loop.step(step.predicted)
        _, best = controller(replace(problem, start=step.predicted), step=0.5).step(step.predicted)
        assert not kept.replanned
        assert best.value < kept.value - 1e-6
        assert kept.lower_bound <= best.value + 1e-12
        assert not kept.exhaustive

    def test_at_another_pace_trims_cost_less_than_in_the_library(self):
        problem = straight(2.0)
        _, step = controller(problem, retimed=True).step(problem.start)
        assert step.value == pytest.approx(1.0)  # 2 m in 4 s, the least effort there is
        assert step.lower_bound == pytest.approx(1.0)
