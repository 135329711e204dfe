from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import (
    ClosedLoop,
    Disturbance,
    Guarantee,
    Origin,
    RecedingHorizon,
    simulate,
    within,
)
from maneuver_automaton.receding_horizon.statistics import outcome_of
from maneuver_automaton.scenario import load_scenario
from tests.receding_horizon.loops import (
    EFFORT,
    NEAR,
    SCENARIOS,
    assert_same_steps,
    off_goal,
    parking_loop,
    straight,
    totals,
)
from tests.search.cases import REVERSED_SPIN, robot

# The paper's Table 1: i, x_1, u_1(0), V, costs of the closed loop so far and V together.
TABLE_1 = """\
0 -2.00 2.0 4.00 4.000
1 -1.80 1.8 3.24 3.640
2 -1.62 1.7 2.626 3.350
3 -1.45 1.5 2.105 3.118
4 -1.30 1.3 1.690 2.928
5 -1.17 1.2 1.371 2.778
6 -1.05 1.1 1.105 2.656
7 -0.94 1.0 0.886 2.558
8 -0.84 0.9 0.708 2.480
9 -0.75 0.8 0.565 2.418
10 -0.67 0.7 0.451 2.368
20 -0.21 0.3 0.045 2.192
"""


def loop_of(name: str) -> ClosedLoop:
    """The closed loop of a scenario that comes with the project."""
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    part = scenario.receding_horizon
    assert part is not None
    return simulate(scenario.problem, step=part.step_s, steps=part.steps)


@pytest.fixture(scope="module")
def table_1() -> ClosedLoop:
    return loop_of("table1")


class TestQuantisedControls:
    """Section 5.1 of the paper, over all trims of the grid."""

    @pytest.mark.parametrize("row", TABLE_1.splitlines())
    def test_every_printed_digit(self, table_1, row):
        i, *printed = row.split()
        step = table_1.steps[int(i)]
        assert step.control is not None
        assert step.control[1] == 0.0
        numbers = (
            step.pose[0],
            step.control[0],
            step.value,
            step.accumulated_cost + step.value,
        )
        for text, number in zip(printed, numbers, strict=True):
            digits = len(text.split(".")[1])
            assert f"{number:.{digits}f}" == text
        assert step.time == pytest.approx(0.1 * int(i))

    def test_the_last_row(self, table_1):
        assert len(table_1.problem.automaton) == 1681
        assert table_1.reached
        assert len(table_1.steps) == 35
        assert table_1.times[-1] == pytest.approx(3.5)
        assert f"{table_1.cost:.3f}" == "2.182"
        assert np.abs(table_1.poses[-1]).max() <= 1e-9
        assert list(table_1.violations) == []
        assert all(audit.passed for audit in table_1.audits)

    def test_the_coarse_grid(self):
        loop = loop_of("table1_coarse")
        assert loop.reached
        assert len(loop.steps) == 20
        assert loop.cost == pytest.approx(2.6, abs=1e-9)  # the paper prints 3.000
        assert list(loop.violations) == []

    @pytest.mark.parametrize(("dearest_first", "steps"), [(True, 35), (False, None)])
    def test_the_order_of_equal_plans_decides(self, dearest_first, steps):
        # with least cost first, rest comes before the last centimetres, again and again
        speeds = {f"{v / 10:.1f}": (v / 10, 0.0) for v in range(21)}
        problem = Problem(
            robot(speeds), [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0], cost=EFFORT, horizon=Horizon(time=1.0)
        )
        assert arrival(problem, dearest_first=dearest_first, at_most=60) == steps


def arrival(problem: Problem, *, dearest_first: bool, at_most: int) -> int | None:
    """Steps until the goal, where every step sorts its optimal plan in its own way; None: never."""
    pose = problem.start
    for number in range(at_most):
        if np.abs(pose).max() <= 1e-9:
            return number
        _, step = RecedingHorizon(problem, step=0.1).step(pose)
        best = step.plan
        order = sorted(
            range(len(best.trims)),
            key=lambda k: best.trims[k].control[0],
            reverse=dearest_first,
        )
        driven = Plan(pose, [best.trims[k] for k in order], durations=best.durations[order])
        assert np.abs(driven.end).max() <= 1e-9  # just as optimal
        pose = driven.pose_at(0.1)
    return None


class TestParking:
    """Section 5.3 of the paper."""

    @pytest.mark.parametrize("name", ["parking_loop", "parking_loop_reversed_spin"])
    def test_the_best_word_is_followed_to_the_goal(self, name):
        loop = loop_of(name)
        assert loop.reached
        assert not any(step.replanned for step in loop.steps)
        values = [step.value for step in loop.steps]
        assert all(later < earlier for earlier, later in itertools.pairwise(values))
        assert np.abs(loop.poses[-1]).max() <= 1e-9
        assert loop.cost == pytest.approx(values[0], abs=1e-9)
        assert loop.cost == pytest.approx(4.6615840195, abs=1e-9)
        assert list(loop.violations) == []
        assert loop.steps_bound == 5
        assert len(loop.steps) <= loop.steps_bound

    @pytest.mark.parametrize("controls", [None, REVERSED_SPIN])
    def test_from_a_dearer_word_it_replans_and_ends_cheaper(self, controls):
        problem = parking_loop(controls)
        costlier = plan(problem, alternatives=6).alternatives
        better = 0
        for one in costlier:
            loop = simulate(problem, step=1.0, steps=12, first=one.plan)
            assert loop.steps[0].origin is Origin.FIRST
            assert loop.steps[0].value == pytest.approx(one.cost, abs=1e-9)
            assert loop.reached
            assert list(loop.violations) == []
            assert loop.cost <= one.cost + 1e-9
            assert (totals(loop)[1:] <= totals(loop)[:-1] + 1e-9).all()
            if any(step.replanned for step in loop.steps):
                assert loop.cost < one.cost - 1e-6
                better += 1
        assert better


class TestEnds:
    @pytest.mark.parametrize("turns", [0.0, 2.0, -6.0])
    def test_the_start_is_the_goal(self, turns):
        loop = simulate(parking_loop(start=(0.0, 0.0, turns * math.pi)), step=1.0)
        assert (loop.reached, loop.status, loop.reason) == (True, "reached", "")
        assert (loop.steps, loop.cost, loop.value) == ((), 0.0, 0.0)
        assert loop.poses.shape == (1, 3)
        assert loop.times.tolist() == [0.0]

    def test_any_heading(self):
        goal = Goal(pose=[0.0, 0.0, 0.0], free_heading=True)
        loop = simulate(parking_loop(goal=goal), step=0.5)
        assert loop.reached
        assert list(loop.violations) == []
        assert loop.cost <= loop.steps[0].value + 1e-9
        assert np.linalg.norm(loop.poses[-1, :2]) <= 1e-9

    def test_too_few_steps(self):
        loop = simulate(parking_loop(), step=1.0, steps=2)
        assert (loop.reached, loop.status) == (False, "steps_spent")
        assert loop.reason == "the goal is not reached after 2 steps"
        assert loop.value == pytest.approx(4.6615840195 - loop.cost)
        assert len(loop.steps) == 2

    def test_out_of_time_it_arrives_late(self):
        loop = simulate(straight(9.0), step=1.0)
        assert loop.reached
        assert len(loop.steps) == 9
        assert loop.steps[0].violations[0].guarantee is Guarantee.HORIZON

    def test_bounds_are_kept(self):
        bounds = Bounds(x=(-0.15, 1.0))
        loop = simulate(parking_loop(bounds=bounds), step=1.0)
        assert loop.reached
        assert list(loop.violations) == []
        for piece in loop.driven:
            assert piece.sample().pose[:, 0].min() >= -0.15 - 1e-9


class TestDisturbances:
    NOISE = Disturbance(position_m=0.02, heading_rad=0.02, seed=4)

    def test_every_plan_meets_the_goal_from_the_measured_pose(self):
        loop = simulate(parking_loop(goal=NEAR), step=1.0, steps=20, disturbance=self.NOISE)
        assert loop.reached
        for step, pose in zip(loop.steps, loop.poses, strict=False):
            assert step.pose.tolist() == pose.tolist()
            assert off_goal(loop, step) <= 1e-9
            assert step.violations == ()
            for one in step.disturbed:
                assert one.guarantee in (Guarantee.DECREASE, Guarantee.FEASIBILITY)
                assert "off the plan" in one.reason

    @pytest.mark.parametrize("after", [0, 1, 2, 3, 5])
    @pytest.mark.parametrize("push", [(0.1, 0.2, 0.3), (-0.4, 0.0, 0.0), (0.0, 0.0, 3.0)])
    def test_pushed_it_still_arrives_exactly(self, after, push):
        upset = Disturbance(pushes={after: push})
        loop = simulate(parking_loop(), step=0.5, disturbance=upset)
        assert loop.reached
        assert np.abs(loop.poses[-1, :2]).max() <= 1e-9
        assert max(off_goal(loop, step) for step in loop.steps) <= 1e-9
        pushed = SE2(loop.driven[after].end) @ SE2(np.array(push))
        assert np.abs(loop.poses[after + 1] - pushed.pose).max() <= 1e-12
        assert all(number == after + 1 for number, _ in loop.disturbed)
        assert not list(loop.violations)

    def test_the_same_seed_gives_the_same_loop_and_another_another(self):
        problem = parking_loop(goal=NEAR)
        one, two = (simulate(problem, step=1.0, steps=9, disturbance=self.NOISE) for _ in range(2))
        assert one.poses.tolist() == two.poses.tolist()
        for a, b in zip(one.steps, two.steps, strict=True):
            assert_same_steps(a, b)
        other = simulate(problem, step=1.0, steps=9, disturbance=replace(self.NOISE, seed=5))
        assert other.poses[1].tolist() != one.poses[1].tolist()

    def test_what_is_measured_is_not_where_it_is(self):
        upset = Disturbance(measured_position_m=0.01, measured_heading_rad=0.01, seed=2)
        loop = simulate(parking_loop(goal=NEAR), step=1.0, steps=20, disturbance=upset)
        assert loop.reached
        assert all(
            step.pose.tolist() != pose.tolist()
            for step, pose in zip(loop.steps, loop.poses, strict=False)
        )

    def test_another_vehicle_than_its_model(self):
        upset = Disturbance(twist_scale=(0.9, 1.0, 1.1))
        loop = simulate(parking_loop(goal=NEAR), step=0.5, disturbance=upset)
        assert loop.reached
        twist = loop.driven[0].trims[0].body_velocity
        planned = loop.steps[0].plan.trims[0].body_velocity
        assert twist.tolist() == pytest.approx((planned * [0.9, 1.0, 1.1]).tolist())

    @pytest.mark.parametrize(("aside", "hits"), [(0.3, 0), (1.0, 1)])
    def test_a_collision_that_it_makes_alone_is_no_breach(self, aside, hits):
        # it drives beside what it plans, and knows a step later
        problem = Problem(
            robot({"rest": (0.0, 0.0), "ahead": (1.0, 0.0), "spin": (0.0, 1.0)}),
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            obstacles=Box([1.0, 0.5], center=[1.5, 1.0]),
        )
        upset = Disturbance(delay=1, pushes={0: (-0.2, aside, 0.0)})
        loop = simulate(problem, step=1.0, steps=2, disturbance=upset)
        assert len(loop.steps) == 2
        assert list(loop.violations) == []
        assert len(list(loop.collisions)) == len(list(loop.disturbed)) == hits
        assert len(outcome_of(loop).collisions) == hits

    def test_a_vehicle_that_drives_further_than_it_thinks_is_judged_where_it_is(self):
        problem = Problem(
            robot({"rest": (0.0, 0.0), "ahead": (1.0, 0.0), "spin": (0.0, 1.0)}),
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            obstacles=Box([0.2, 0.5], center=[1.6, 0.0]),
        )
        upset = Disturbance(twist_scale=(2.0, 1.0, 1.0))
        (step,) = simulate(problem, step=1.0, steps=1, disturbance=upset).steps
        assert step.clearance_m == 0.0
        assert len(step.disturbed) == 1
        assert not step.violations

    def test_a_step_late_the_push_is_seen_a_step_later(self):
        upset = Disturbance(delay=1, pushes={0: (0.1, 0.1, 0.1)})
        loop = simulate(parking_loop(goal=NEAR), step=0.5, disturbance=upset)
        assert [bool(step.off_plan) for step in loop.steps[:4]] == [False, False, True, False]
        assert loop.reached

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"position_m": -1.0}, "position_m must be at least 0, got -1.0"),
            ({"heading_rad": math.nan}, "heading_rad must be at least 0, got nan"),
            ({"measured_position_m": math.inf}, "measured_position_m must be finite, got inf"),
            ({"delay": 2}, "delay must be 0 or 1 steps, got 2"),
            ({"seed": -1}, "seed must be a whole number of at least 0, got -1"),
        ],
    )
    def test_wrong_numbers(self, settings, message):
        with pytest.raises(ValueError, match=f"^disturbance: {message}$"):
            Disturbance(**settings)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"twist_scale": (1.0, 1.0)}, r"twist_scale: got shape \(2,\), need 3 components"),
            ({"pushes": {50: (1.0, 1.0)}}, r"push after step 50: got shape \(2,\), need 3"),
            ({"pushes": {0: (1.0, 1.0, math.nan)}}, "push after step 0: got nan"),
        ],
    )
    def test_what_does_not_fit_the_vehicle_is_said_at_once(self, settings, message):
        with pytest.raises(ValueError, match=message):
            simulate(straight(), step=1.0, disturbance=Disturbance(**settings))


class TestStay:
    def test_exactly_at_the_goal_it_rests_for_all_steps(self):
        loop = simulate(straight(), step=1.0, steps=6, stay=True)
        assert loop.reached
        assert len(loop.steps) == 6
        assert loop.inside == (False, False, True, True, True, True, True)
        assert loop.cost == pytest.approx(2.0)

    def test_shaken_it_stays_within_the_tolerance(self):
        upset = Disturbance(position_m=0.01, heading_rad=0.01, seed=1)
        loop = simulate(parking_loop(goal=NEAR), step=1.0, steps=16, stay=True, disturbance=upset)
        first = loop.inside.index(True)
        assert all(loop.inside[first:])
        assert list(loop.inside) == [within(pose, NEAR) for pose in loop.poses]


CASES = {
    "followed": {},
    "free": {"horizon": Horizon(max_trims=4)},
    "shaken": {"goal": NEAR},
    "pushed": {},
    "stay": {"goal": NEAR},
}
UPSETS = {
    "shaken": Disturbance(position_m=0.02, heading_rad=0.02, measured_position_m=0.01, seed=3),
    "stay": Disturbance(position_m=0.02, heading_rad=0.02, seed=3),
    "pushed": Disturbance(pushes={2: (0.1, 0.2, 0.3)}),
}


class TestRestart:
    @pytest.mark.parametrize("case", sorted(CASES))
    def test_from_any_step_it_goes_on_to_the_last_bit(self, case):
        problem = parking_loop(**CASES[case])
        settings = {
            "step": 0.5,
            "disturbance": UPSETS.get(case),
            "stay": case == "stay",
        }
        whole = simulate(problem, steps=12, **settings)
        for done, last in enumerate(whole.steps[:-1], start=1):
            here = replace(problem, start=whole.poses[done])
            again = simulate(here, steps=12 - done, last=last, **settings)
            assert again.poses.tolist() == whole.poses[done:].tolist()
            for a, b in zip(whole.steps[done:], again.steps, strict=True):
                assert_same_steps(a, b)
            assert again.cost == whole.cost
            assert again.reached == whole.reached


def test_progress_is_told():
    seen = []
    loop = simulate(straight(), step=1.0, progress=seen.append)
    assert [step.number for step in seen] == [0, 1]
    assert tuple(seen) == loop.steps


def test_audits_on_demand():
    assert len(simulate(straight(), step=1.0).audits) == 2
    assert simulate(straight(), step=1.0, audit=False).audits == ()


def test_a_piece_that_the_model_does_not_drive_fails_its_audit():
    problem = straight()
    liar = replace(problem.automaton.trims[1], body_velocity=[1.5, 0.0, 0.0])
    first = Plan(problem.start, (liar,), durations=[4.0 / 3.0])
    loop = simulate(problem, step=1.0, steps=1, first=first)
    assert [audit.passed for audit in loop.audits] == [False]
