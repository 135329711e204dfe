"""Closed loops among obstacles that move: nothing is hit that could be waited for or evaded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Goal, Horizon, SearchSettings
from maneuver_automaton.receding_horizon import (
    Decision,
    Disturbance,
    Guarantee,
    RecedingHorizon,
    simulate,
)
from tests.receding_horizon.loops import totals
from tests.receding_horizon.scenes import (
    among,
    cannot_stop,
    clearances,
    crossing,
    moving_obstacle,
    on_the_goal,
)


def decisions(loop) -> list[Decision]:
    return [step.decision for step in loop.steps]


def assert_free(loop) -> None:
    assert clearances(loop).min() > 0.0
    assert list(loop.collisions) == []
    assert all(audit.passed for audit in loop.audits)
    assert loop.min_clearance_m == pytest.approx(clearances(loop).min(), abs=2e-3)


class TestWaitingAndEvading:
    @pytest.mark.slow
    def test_as_predicted_the_first_plan_is_driven_and_its_value_falls(self):
        loop = simulate(among(crossing()), step=0.5)
        assert loop.reached
        assert_free(loop)
        assert list(loop.violations) == []
        total = totals(loop)
        assert (total[1:] <= total[:-1] + 1e-8).all()
        assert loop.cost < 7.0

    @pytest.mark.slow
    def test_the_goal_is_left_to_what_passes_over_it(self):
        # it could be there after 6 s, and 1.2 s later would be hit
        passing = moving_obstacle([0.0, 7.0, 13.0], [(6.0, -7.0), (6.0, -1.0), (6.0, 5.0)])
        loop = simulate(among(passing), step=0.5)
        assert loop.reached
        assert_free(loop)
        assert loop.times[-1] > 8.0
        assert passing.motion is not None
        assert np.hypot(*(passing.motion.at(loop.times[-1]) - loop.poses[-1])[:2]) > 0.8

    @pytest.mark.parametrize("side", [(6.0, 6.0)])
    def test_before_a_goal_that_becomes_occupied_it_stops(self, side):
        stays = moving_obstacle([0.0, 5.0], [side, (6.0, 0.0)])
        problem = among(stays, search=SearchSettings(max_expansions=100))
        loop = simulate(problem, step=0.5, steps=16, time_limit=60.0)
        assert_free(loop)
        away = np.hypot(*(loop.poses[:, :2] - [6.0, 0.0]).T)
        assert away[8:].max() <= away[8] + 1e-9  # on, and never back
        assert away[-1] < 1.5
        assert set(decisions(loop)[-4:]) == {Decision.STOPPED}

    def test_a_goal_that_need_not_stay_free_is_taken_at_once(self):
        passing = moving_obstacle([0.0, 7.6, 14.0], [(6.0, -7.6), (6.0, -1.0), (6.0, 5.0)])
        loop = simulate(among(passing), step=0.5, stand=0.5)
        assert loop.times[-1] == pytest.approx(6.0)

    @pytest.mark.slow
    def test_at_the_goal_it_makes_room_and_comes_back(self):
        passing = moving_obstacle([0.0, 14.0, 22.0], [(6.0, -9.0), (6.0, -4.0), (6.0, 4.0)])
        loop = simulate(among(passing), step=0.5, steps=60, stay=True)
        assert loop.reached
        assert_free(loop)
        assert not all(loop.inside[12:])
        assert loop.inside[-1]

    @pytest.mark.parametrize("places", [[(8.0, 0.0), (-8.0, 0.0)], [(4.0, -5.0), (2.0, 5.0)]])
    def test_what_cannot_stop_evades(self, places):
        loop = simulate(among(moving_obstacle([0.0, 8.0], places), robot=cannot_stop()), step=0.5)
        assert loop.reached
        assert_free(loop)

    @pytest.mark.slow
    def test_what_cannot_stop_goes_round_until_the_goal_is_free(self):
        loop = simulate(among(on_the_goal(), robot=cannot_stop()), step=0.5, look_ahead=20.0)
        assert loop.reached
        assert_free(loop)
        assert loop.times[-1] > 12.0

    @pytest.mark.slow
    def test_a_fixed_time_is_exceeded_where_waiting_takes_longer(self):
        problem = among(
            on_the_goal(), goal=[6.0, 0.0, 0.0], cost=Cost(effort=1.0), horizon=Horizon(time=10.0)
        )
        loop = simulate(problem, step=0.5, steps=60)
        assert loop.reached
        assert_free(loop)

    @pytest.mark.slow
    def test_with_noise_nothing_is_hit(self):
        upset = Disturbance(position_m=0.01, heading_rad=0.02, seed=4)
        goal = Goal(pose=[6.0, 0.0, 0.0], tolerance_m=0.1, free_heading=True)
        # moving obstacles keep moving; a step's noise is less than the margin
        loop = simulate(among(crossing(), goal=goal, margin=0.1), step=0.5, disturbance=upset)
        assert loop.reached
        assert_free(loop)


class TestPredictions:
    @pytest.mark.slow
    def test_one_that_turns_out_wrong_is_flagged_and_evaded(self):
        problem = among(crossing())
        away = moving_obstacle([0.0, 9.0], [(3.0, -3.0), (3.0, -12.0)])
        loop = simulate(
            problem, step=0.5, obstacles=lambda k: [away] if k < 4 else problem.obstacles
        )
        assert loop.reached
        assert_free(loop)
        taken = {violation.guarantee for number, violation in loop.disturbed if number == 4}
        assert Guarantee.FEASIBILITY in taken
        assert all(number == 4 for number, _ in loop.disturbed)
        assert all(violation.reason.endswith("obstacles moved") for _, violation in loop.disturbed)
        assert not list(loop.violations)

    def test_what_is_not_seen_is_hit_and_judged_by_what_there_is(self):
        loop = simulate(among(crossing()), step=0.5, obstacles=lambda _: [])
        assert loop.reached
        number, violation = next(loop.collisions)
        assert number == 4
        assert "the vehicle touches obstacle 0" in violation.reason
        assert loop.min_clearance_m == 0.0

    def test_the_controller_takes_new_obstacles_and_keeps_them(self):
        controller = RecedingHorizon(among(), step=0.5)
        _, first = controller.step([0.0, 0.0, 0.0])
        assert (first.decision, first.free_until) == (Decision.PLANNED, None)
        _, second = controller.step(first.predicted, obstacles=[Disc(1.0, [3.0, 0.0])])
        assert second.decision is Decision.REPLANNED
        _, third = controller.step(second.predicted)
        assert third.value <= second.value - second.applied_cost + 1e-9
        assert len(controller.problem.obstacles) == 1
        _, fourth = controller.step(third.predicted, obstacles=[])
        assert fourth.value < third.value - 0.5

    @pytest.mark.slow
    def test_the_time_of_the_world_goes_on(self):
        late = replace(
            among(moving_obstacle([50.0, 56.0], [(3.0, -3.0), (3.0, 3.0)])), start_time=50.0
        )
        one, two = simulate(among(crossing()), step=0.5), simulate(late, step=0.5)
        assert two.times - 50.0 == pytest.approx(one.times)
        assert two.poses == pytest.approx(one.poses, abs=1e-6)


class TestCollisionMitigation:
    def test_what_cannot_be_evaded_is_flagged(self):
        wall = moving_obstacle([0.0, 1.0], [(0.0, -3.0), (0.0, 3.0)], Box([20.0, 0.2]))
        loop = simulate(among(wall), step=0.5)
        assert loop.reached
        assert decisions(loop)[0] is Decision.MITIGATED
        assert loop.steps[0].violations[0].guarantee is Guarantee.SAFETY
        assert "contact is predicted at 0.4" in loop.steps[0].violations[0].reason
        assert loop.steps[0].free_until == pytest.approx(0.45, abs=0.05)
        assert next(loop.collisions)[0] == 0
        assert decisions(loop)[-1] is not Decision.MITIGATED

    @pytest.mark.exhaustive
    @pytest.mark.slow
    def test_it_is_put_off_as_long_as_can_be(self):
        faster = moving_obstacle([0.0, 9.0], [(-4.0, 0.0), (14.0, 0.0)], Box([0.2, 40.0]))
        loop = simulate(among(faster, goal=[-9.0, 0.0, 0.0]), step=0.5, steps=6)
        assert set(decisions(loop)) == {Decision.MITIGATED}
        assert loop.poses[-1] == pytest.approx([3.0, 0.0, 0.0])


def test_a_moved_scene_has_the_moved_loop():
    problem = among(crossing(), Box([1.0, 1.0], [4.0, 1.5]))
    move = SE2(np.array([-20.0, 5.0, 1.1]))
    one, two = (simulate(each, step=0.5) for each in (problem, problem.moved(move)))
    assert [step.plan.word for step in one.steps] == [step.plan.word for step in two.steps]
    assert decisions(one) == decisions(two)
    assert (move @ SE2(one.poses)).pose == pytest.approx(two.poses, abs=1e-6)


def test_retimed_plans_among_moving_obstacles_are_refused():
    settings = {"cost": Cost(effort=1.0), "horizon": Horizon(time=20.0)}
    with pytest.raises(ValueError, match="retimed plans meet moving obstacles at other times"):
        RecedingHorizon(among(crossing(), **settings), step=1.0, retimed=True)
