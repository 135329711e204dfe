"""The closed loop of vehicles with inertia: guarantees from step to step, maneuvers finished."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.cutting import NOTHING, committed, head_of
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.formats.closed_loop_json import (
    closed_loop_to_dict,
    load_steps,
    save_closed_loop,
)
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.receding_horizon import (
    Decision,
    Disturbance,
    Guarantee,
    ManeuverHorizon,
    Origin,
    over_maneuvers,
    simulate,
)
from maneuver_automaton.receding_horizon.rest_of_plan import rested
from tests.inertia import car_automaton, unicycle_automaton
from tests.matrix.vehicles import VEHICLES
from tests.quickly import quick_are
from tests.search.cases import compiled_only

pytestmark = compiled_only
NEAR = Goal(pose=[3.0, 1.0, 1.0], tolerance_m=0.06, tolerance_rad=0.06)


def posed(goal=(3.0, 1.0, 1.0), *, automaton=None, **changed) -> Problem:
    return Problem(automaton or unicycle_automaton(), [0.0, 0.0, 0.0], goal, **changed)


def assert_nothing_interrupted(loop) -> None:
    """Every maneuver that a step leaves under way is finished by the following ones."""
    for now, then in itertools.pairwise(loop.steps):
        busy = committed(now.plan, now.applied)
        if not busy:
            continue
        promised = now.plan.primitives[len(head_of(now.plan, now.applied).primitives) - 1]
        first = then.plan.primitives[0]
        assert first.name == promised.name
        assert then.plan.primitive_durations[0] == pytest.approx(busy, abs=10 * NOTHING)


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem",
    [
        posed(),
        posed([5.0, 1.0, 1.0], automaton=car_automaton()),
        posed(cost=Cost(time=1.0, length=0.5, effort=0.1, switch=0.2)),
        posed([3.0, 2.0, 0.0], horizon=Horizon(max_time=12.0)),
    ],
    ids=["unicycle", "car", "mixed cost", "longest time"],
)
def test_undisturbed_the_first_plan_is_what_it_costs(problem):
    loop = simulate(problem, step=0.3, time_limit=2.0)
    assert loop.reached, loop.reason
    assert not list(loop.violations)
    assert loop.cost <= loop.steps[0].value + 1e-9
    kept = [step for step in loop.steps[1:] if not step.replanned]
    assert all(step.origin is Origin.SHIFTED for step in kept)
    totals = [step.value + step.accumulated_cost for step in loop.steps]
    assert (np.diff(totals) < 1e-9).all()  # the value falls by what was applied, or more
    assert loop.cost == pytest.approx(totals[-1], abs=1e-9)
    assert all(audit.passed for audit in loop.audits)
    assert max(audit.max_dynamics_defect for audit in loop.audits) < 1e-9
    assert_nothing_interrupted(loop)


@pytest.mark.parametrize(
    ("automaton", "body", "far"),
    [
        (unicycle_automaton(), Disc(0.22), 4.0),
        pytest.param(car_automaton(), Box([4.0, 1.8], [1.4, 0.0]), 40.0, marks=pytest.mark.slow),
    ],
    ids=["unicycle", "car"],
)
@pytest.mark.parametrize("comes", quick_are([False], [False, True], exhaustive=True))
def test_it_comes_near_a_goal_that_becomes_occupied(automaton, body, far, comes):
    box = Box([0.6, 0.6])
    there = Motion([0.0, 2.0], [[far, far, 0.0], [far, 0.0, 0.0]])
    known = {"obstacles": [Obstacle(box, motion=there)]} if comes else {}
    # one that appears is another value at every step, as from a detector
    appears = lambda number: [box.moved(SE2([far, 0.0, 0.0]))] if number >= 4 else []  # noqa: E731
    loop = simulate(
        posed(
            [far, 0.0, 0.0],
            automaton=automaton,
            footprint=body,
            search=SearchSettings(max_expansions=300),
            **known,
        ),
        step=0.5,
        steps=60,
        obstacles=None if comes else appears,
        time_limit=60.0,
    )
    assert "the goal is blocked" in loop.reason
    off = far - loop.poses[:, 0]
    front = 0.22 if isinstance(body, Disc) else 3.4
    assert (np.diff(off) <= 1e-9).all()  # never away
    assert 0.0 < off[-1] - 0.3 - front < 0.1 * far
    assert loop.steps[-1].decision is Decision.STOPPED


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_disturbed_it_stays_feasible_and_interrupts_no_maneuver(seed):
    upset = Disturbance(position_m=0.004, heading_rad=0.004, seed=seed)
    loop = simulate(posed(NEAR), step=0.25, time_limit=0.5, disturbance=upset, steps=60)
    assert loop.reached, loop.reason
    assert loop.problem.goals[0].off(loop.poses[-1])[0] < 0.06
    assert all(audit.passed for audit in loop.audits)
    assert {one.guarantee for _, one in loop.disturbed} <= {
        Guarantee.DECREASE,
        Guarantee.FEASIBILITY,
    }
    assert not list(loop.violations)
    assert_nothing_interrupted(loop)
    assert any(step.origin is Origin.REANCHORED for step in loop.steps)


def test_a_push_during_a_maneuver_is_answered_after_it():
    problem = posed([4.0, 0.5, 0.0])
    first = ManeuverHorizon(problem, step=0.25)
    _, log = first.step([0.0, 0.0, 0.0])
    assert committed(log.plan, 0.25) > 0.0
    _, then = first.step(log.predicted + np.array([0.02, 0.03, 0.01]))
    assert then.decision.leads
    assert max(problem.goals[0].off(then.plan.end)) < 1e-8
    assert then.plan.primitives[0].name == log.plan.primitives[0].name
    assert then.off_plan == pytest.approx(np.hypot(0.02, 0.03), abs=1e-6)


def test_a_fixed_time_is_prolonged_by_rest():
    problem = posed(horizon=Horizon(time=8.0), cost=Cost(effort=1.0, time=0.1))
    loop = simulate(problem, step=0.5, time_limit=2.0, steps=30)
    assert loop.reached, loop.reason
    assert all(step.plan.duration == pytest.approx(8.0, abs=1e-8) for step in loop.steps)
    assert not list(loop.violations)


@pytest.mark.slow
def test_a_moved_loop_is_the_moved_loop():
    by = SE2([4.0, -2.0, 1.0])
    here = simulate(posed(), step=0.5, time_limit=5.0)
    there = simulate(posed().moved(by), step=0.5, time_limit=5.0)
    assert len(here.steps) == len(there.steps)
    assert np.abs((by @ SE2(here.poses)).pose - there.poses).max() < 1e-6


def test_a_margin_keeps_the_known_word():
    problem = posed([5.0, 1.0, 1.0], automaton=car_automaton())
    loop = simulate(problem, step=0.5, margin=5.0, time_limit=0.2)
    assert loop.reached
    assert not any(step.replanned for step in loop.steps)


def test_what_cannot_be_reached_is_said():
    problem = posed([3.0, 1.0, 1.0], horizon=Horizon(max_time=1.0))
    _, log = ManeuverHorizon(problem, step=0.5, time_limit=0.2).step([0.0, 0.0, 0.0])
    assert log.decision is Decision.STOPPED
    assert [one.guarantee for one in log.violations] == [Guarantee.FEASIBILITY]


@pytest.mark.slow
def test_a_loop_that_was_stopped_goes_on_from_its_file(tmp_path):
    problem = posed()
    whole = simulate(problem, step=0.4, time_limit=5.0)
    begun = simulate(problem, step=0.4, time_limit=5.0, steps=2)
    save_closed_loop(begun, tmp_path / "loop.json")
    steps, poses = load_steps(tmp_path / "loop.json", problem.automaton)
    assert committed(steps[-1].plan, steps[-1].applied) > 0.0  # in the midst of a maneuver
    there = replace(problem, start=poses[-1])
    rest = simulate(there, step=0.4, time_limit=5.0, last=steps[-1])
    assert rest.reached
    assert np.abs(rest.poses - whole.poses[2:]).max() < 1e-9
    assert rest.cost == pytest.approx(whole.cost, abs=1e-9)


@pytest.mark.parametrize(
    ("changed", "asked", "message"),
    [
        ({}, {"retimed": True}, "receding horizon: retimed is for vehicles without inertia"),
        (
            {},
            {"disturbance": Disturbance(twist_scale=(0.9, 1.0, 1.0))},
            "receding horizon: disturbance: twist_scale is for vehicles without inertia",
        ),
        ({}, {"step": 0.0}, "receding horizon: step must be positive, got 0.0 s"),
        (
            {"horizon": Horizon(time=8.0)},
            {"step": 9.0},
            "receding horizon: step is 9 s, need at most the horizon, 8 s",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(changed, asked, message):
    with pytest.raises(ValueError) as error:
        simulate(posed(**changed), **({"step": 0.5} | asked))
    assert str(error.value).startswith(message)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_plan_that_ends_within_the_tolerance_is_kept(noise):
    """In a zone a vehicle without inertia ends where it likes within the goal's tolerance."""
    robot = Automaton.of_controls(
        Unicycle(),
        {"rest": (0, 0), "ahead": (1, 0), "slow": (0.4, 0), "spin": (0, 1), "cw": (0, -1)},
    )
    goal = Goal(pose=[4.0, 1.0, 0.5], tolerance_m=0.08, tolerance_rad=0.1)
    zone = Zone(shape=Box([1.0, 1.0], [2.0, 0.5]), max_speed=0.5)
    problem = posed(goal, automaton=robot, zones=[zone])
    upset = Disturbance(position_m=noise, heading_rad=noise, seed=1)
    loop = simulate(problem, step=0.4, time_limit=60.0, steps=40, disturbance=upset)
    assert loop.reached, loop.reason
    assert all(audit.passed for audit in loop.audits)
    assert goal.off(loop.steps[0].plan.end)[0] > 1e-3  # it is not the middle
    if not noise:
        assert [step.decision for step in loop.steps[1:]] == [Decision.KEPT] * (len(loop.steps) - 1)


def test_the_goal_must_stay_free_for_as_long_as_is_asked():
    """A disc comes over the goal eight seconds after the start, three after the arrival."""
    coming = Obstacle(Disc(0.4), motion=Motion([4.0, 10.0], [[3.0, 4.0, 0.0], [3.0, -2.0, 0.0]]))
    problem = posed(
        [3.0, 0.0, 0.0],
        obstacles=[coming],
        footprint=Disc(0.2),
        search=SearchSettings(max_expansions=2000),
    )
    for stand, decision in ((0.5, Decision.PLANNED), (6.0, Decision.APPROACHED)):
        _, step = ManeuverHorizon(problem, step=0.5, stand=stand, time_limit=30.0).step([0, 0, 0])
        assert step.decision is decision, stand
        arrives = bool(np.abs(step.plan.end - problem.goals[0].pose).max() < 1e-9)
        assert arrives is (decision is Decision.PLANNED)


def test_what_cannot_be_evaded_is_flagged_with_the_time_of_contact():
    wall = Motion([0.0, 2.0], [[-4.0, 0.0, 0.0], [4.0, 0.0, 0.0]])  # at 4 m/s, contact after 0.95 s
    problem = posed(
        [3.0, 0.0, 0.0],
        obstacles=[Obstacle(Box([0.2, 40.0]), motion=wall)],
        footprint=Disc(0.2),
        search=SearchSettings(max_expansions=200),
    )
    _, step = ManeuverHorizon(problem, step=1.0, time_limit=30.0).step([0.0, 0.0, 0.0])
    assert step.decision is Decision.MITIGATED
    assert [one.guarantee for one in step.violations] == [Guarantee.SAFETY]
    assert 0.925 < step.free_until < 1.2  # as it stands it would be hit first of these


@pytest.mark.slow
@pytest.mark.parametrize(("look_ahead", "stops_at"), [(1.0, 1.0), (60.0, 5.0)])
def test_the_fail_safe_trajectory_looks_ahead_as_far_as_is_asked(look_ahead, stops_at):
    """Where it could brake a disc passes later; farther on, where the last plan ends, none does."""
    _, begun = ManeuverHorizon(posed([5.0, 0.0, 0.0]), step=0.5).step([0.0, 0.0, 0.0])
    cage = [Box([0.2, 4.2], [12.0 + side, 0.0]) for side in (2.0, -2.0)]
    cage += [Box([4.2, 0.2], [12.0, side]) for side in (2.0, -2.0)]
    passing = Obstacle(Disc(0.4), motion=Motion([12.0, 16.0], [[1.0, 6.0, 0.0], [1.0, -6.0, 0.0]]))
    problem = posed(
        [12.0, 0.0, 0.0],
        obstacles=[*cage, passing],
        footprint=Disc(0.2),
        search=SearchSettings(max_expansions=200),
    )
    controller = ManeuverHorizon(
        problem, step=0.5, look_ahead=look_ahead, last=replace(begun, decision=Decision.APPROACHED)
    )
    _, step = controller.step(begun.predicted)
    assert step.decision is Decision.APPROACHED
    assert step.plan.end[0] == pytest.approx(stops_at)
    assert step.plan.primitives[0].name == begun.plan.primitives[0].name  # is finished


def crossing(begin=1.0, lasting=6.0, *, radius=0.4):
    """A disc that crosses the way of a robot from the origin to (5, 0)."""
    motion = Motion([begin, begin + lasting], [[2.5, -3.0, 0.0], [2.5, 3.0, 0.0]])
    return Obstacle(Disc(radius), motion=motion)


def test_an_obstacle_that_was_not_foreseen_is_answered():
    """It is predicted to stand still for a second, then it is seen to cross."""
    there = crossing(1.0)
    still = Obstacle(Disc(0.4, [2.5, -3.0]))
    problem = posed(
        [5.0, 0.0, 0.0],
        obstacles=[there],
        footprint=Box([0.4, 0.3]),
        search=SearchSettings(max_expansions=2000),
    )
    loop = simulate(
        problem,
        step=0.5,
        time_limit=30.0,
        steps=60,
        obstacles=lambda number: [still] if number < 3 else [there],
    )
    assert loop.reached, loop.reason
    assert not list(loop.collisions)
    assert_nothing_interrupted(loop)


def test_a_fixed_time_that_ends_in_motion_is_what_is_left_of_it():
    goal = Goal(pose=[6.0, 0.5, 0.0], trim="1, 0")
    problem = posed(
        goal,
        start_trim="1, 0",
        horizon=Horizon(time=9.0),
        cost=Cost(effort=1.0),
        search=SearchSettings(max_expansions=4000),
    )
    loop = simulate(problem, step=0.5, time_limit=30.0, steps=40)
    assert loop.reached, loop.reason
    assert loop.times[-1] == pytest.approx(9.0, abs=1e-6)


@pytest.mark.parametrize("case", ["zones", "fixed time"])
def test_a_vehicle_that_cannot_rest_meets_zones_and_a_fixed_time(case):
    """Dubins' car has no rest, neither to begin with nor to fill a fixed time."""
    controls = {"left": (1.0, 1.0), "straight": (1.0, 0.0), "right": (1.0, -1.0)}
    robot = Automaton.of_controls(Unicycle(), controls)
    zone = Zone(shape=Box([1.0, 1.0], [3.0, -4.0]), max_speed=0.5)
    changed = {"zones": {"zones": (zone,)}, "fixed time": {"horizon": Horizon(time=16.0)}}[case]
    search = SearchSettings(max_expansions=400)
    problem = posed([6.0, 2.0, 0.5], automaton=robot, search=search, **changed)
    loop = simulate(problem, step=1.0, time_limit=30.0, steps=30)
    assert loop.reached, loop.reason
    assert max(problem.goals[0].off(loop.poses[-1])) < 1e-8
    if case == "fixed time":
        assert loop.times[-1] == pytest.approx(16.0, abs=1e-6)


class TestAmongWhatMoves:
    @pytest.mark.exhaustive
    @pytest.mark.slow
    def test_a_moved_problem_has_the_moved_loop(self):
        """The goal is taken until a disc leaves it: it approaches, waits, and arrives."""
        leaving = Motion([6.0, 10.0], [[5.0, 0.0, 0.0], [5.0, 6.0, 0.0]])
        problem = posed(
            [5.0, 0.0, 0.0],
            obstacles=[crossing(0.5), Obstacle(Disc(0.4), motion=leaving)],
            footprint=Box([0.4, 0.3]),
            search=SearchSettings(max_expansions=300),
        )
        move = SE2([-8.0, 3.0, 1.1])
        one, two = (simulate(p, step=1.0, time_limit=60.0) for p in (problem, problem.moved(move)))
        for loop in (one, two):
            assert loop.reached, loop.reason
            assert not list(loop.violations)
        assert [step.decision for step in one.steps] == [step.decision for step in two.steps]
        assert (move @ SE2(one.poses)).pose[:, :2] == pytest.approx(two.poses[:, :2], abs=1e-6)

    @pytest.mark.exhaustive
    @pytest.mark.slow
    def test_where_it_stands_it_makes_room(self):
        """Its goal is walled in, so that there is no plan; what comes drives over its start."""
        cage = [Box([0.2, 4.2], [9.0 + side, 0.0]) for side in (2.0, -2.0)]
        cage += [Box([4.2, 0.2], [9.0, side]) for side in (2.0, -2.0)]
        coming = Obstacle(Disc(0.5), motion=Motion([0.0, 9.0], [[0.0, -5.0, 0.0], [0.0, 4.0, 0.0]]))
        problem = posed(
            [9.0, 0.0, 0.0],
            obstacles=[*cage, coming],
            footprint=Box([0.4, 0.3]),
            search=SearchSettings(max_expansions=20),
        )
        loop = simulate(problem, step=0.5, time_limit=30.0, steps=22)
        decisions = {step.decision for step in loop.steps}
        assert Decision.EVADED in decisions
        assert Decision.MITIGATED not in decisions
        assert loop.min_clearance_m > 0.0
        assert_nothing_interrupted(loop)

    @pytest.mark.slow
    def test_every_step_holds_a_motion_that_stays_free(self):
        """What a step holds is free to its end, and after it where the vehicle then stands."""
        problem = posed(
            [5.0, 0.0, 0.0],
            obstacles=[crossing(0.5), crossing(3.0, radius=0.7)],
            footprint=Box([0.4, 0.3]),
            search=SearchSettings(max_expansions=300),
        )
        loop = simulate(problem, step=0.5, time_limit=30.0)
        assert loop.reached, loop.reason
        for step in loop.steps:
            assert step.free_until >= 9.0
            held = rested(step.plan, step.plan.trims[-1], 2.0)
            audit = audit_plan(
                held,
                Goal(pose=held.end),
                problem.automaton.model,
                footprint=problem.footprint,
                obstacles=problem.obstacles,
            )
            assert audit.passed, audit.reason

    @pytest.mark.parametrize("inertia", quick_are([False], [True, False]))
    def test_what_appears_where_it_stands_is_foreseen(self, inertia):
        """A gate closes over its start for good while it waits for the goal to be left."""
        controls = {"rest": (0.0, 0.0), "on": (1.0, 0.0), "left": (0.8, 0.8), "back": (-0.6, 0.0)}
        robot = unicycle_automaton() if inertia else Automaton.of_controls(Unicycle(), controls)
        gate = Obstacle(Box([0.4, 9.0], [0.0, 0.0]), present_s=(6.0, np.inf))
        cage = [Box([0.2, 4.2], [9.0 + side, 0.0]) for side in (2.0, -2.0)]
        cage += [Box([4.2, 0.2], [9.0, side]) for side in (2.0, -2.0)]
        problem = posed(
            [9.0, 0.0, 0.0],
            automaton=robot,
            obstacles=[gate, *cage],
            footprint=Box([0.4, 0.3]),
            search=SearchSettings(max_expansions=20),
        )
        loop = simulate(problem, step=0.5, time_limit=5.0, steps=14)
        assert loop.min_clearance_m > 0.0
        assert not any(step.decision is Decision.MITIGATED for step in loop.steps)

    @pytest.mark.parametrize("begins_there", quick_are([False], [True, False]))
    def test_at_its_goal_it_makes_room_for_what_comes(self, begins_there):
        """It drives to its goal, or stands there at first, and stays until a disc comes."""
        coming = Motion([4.0, 10.0], [[2.0, -4.0, 0.0], [2.0, 4.0, 0.0]])
        goal = Goal(pose=[2.0, 0.0, 0.0], tolerance_m=0.1, tolerance_rad=0.1)
        problem = posed(
            goal,
            obstacles=[Obstacle(Disc(0.4), motion=coming)],
            footprint=Box([0.4, 0.3]),
            search=SearchSettings(max_expansions=300),
        )
        if begins_there:
            problem = replace(problem, start=goal.pose)
        loop = simulate(problem, step=0.5, steps=22, stand=2.0, stay=True, time_limit=20.0)
        assert loop.reached
        assert loop.min_clearance_m > 0.0
        assert Decision.MITIGATED not in {step.decision for step in loop.steps}
        assert_nothing_interrupted(loop)

    @pytest.mark.parametrize(
        ("top", "ahead", "clearance"), [(-1.0, 6.0, 3.0), (-1.0, 0.0, 0.0), (-9.0, 0.0, None)]
    )
    def test_in_flight_it_keeps_what_it_has_at_its_own_heights(self, top, ahead, clearance):
        vehicle = VEHICLES["helicopter"]
        problem = vehicle.problem(body_height=(-2.0, 2.0), margin=4.0)
        x, y, _, z = problem.start
        tower = Obstacle(Box([2.0, 2.0], [x + ahead, y]), height=(z - 30.0, z + top))
        here, broken = over_maneuvers.within_its_margin(replace(problem, obstacles=(tower,)))
        if clearance is None:
            assert (here.margin, broken) == (4.0, "")
        else:
            assert here.margin == pytest.approx(0.5 * clearance, abs=1e-9)
            assert broken == f"the clearance is {clearance:g} m, need 4 m"

    @pytest.mark.parametrize("static", quick_are([True], [False, True]))
    def test_pushed_within_its_margin_it_drives_on_and_says_so(self, static):
        wall = Box([4.0, 0.2], [0.0, -0.35])  # 0.1 m beside the body
        problem = posed(
            [5.0, 1.0, 0.0],
            obstacles=[wall] if static else [wall, crossing(0.5)],
            footprint=Box([0.4, 0.3]),
            margin=0.08,
            search=SearchSettings(max_expansions=300),
        )
        controller = ManeuverHorizon(problem, step=0.5, time_limit=20.0)
        _, step = controller.step([0.0, -0.05, 0.0])  # 0.05 m
        assert [one.guarantee for one in step.violations] == [Guarantee.SAFETY]
        assert "the clearance is 0.05 m, need 0.08 m" in step.violations[0].reason
        assert step.decision is Decision.PLANNED
        _, step = controller.step([0.0, 0.0, 0.0], elapsed=0.0)
        assert Guarantee.SAFETY not in [one.guarantee for one in step.violations]


def test_the_log_can_be_written():
    loop = simulate(posed(), step=0.5, time_limit=1.0)
    document = json.loads(json.dumps(closed_loop_to_dict(loop), allow_nan=False))
    assert document["reached"] is True
    assert document["steps"][0]["control"] == loop.steps[0].control.tolist()
