"""Guesses from kinematic plans, polished and closed: exact, inside limits, equivariant."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.groups import SE2
from maneuver_automaton.optimal_control.polishing import intervals_for, polish
from maneuver_automaton.optimal_control.scene import BodyPart, Point
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.problem import Bounds
from maneuver_automaton.refinement.closure import closed
from maneuver_automaton.refinement.gear_sequences import (
    without_shuffles,
)
from maneuver_automaton.refinement.guesses import path_guesses, timed
from maneuver_automaton.refinement.polish import NEAR, PolishTask, polish_guesses
from tests.inertia import CAR

BODY = Box([4.689, 1.942], [1.4155, 0.0])
HERE = SE2([0.0, 0.0, 0.0])
REST = np.zeros(2)
PATHS = path_guesses(CAR)
assert PATHS is not None


def trim(speed: float, curvature: float, name: str) -> Trim:
    return Trim(
        name=name,
        body_velocity=[speed, 0.0, speed * curvature],
        control=[speed, math.atan(2.8 * curvature)],
    )


def plan(*pieces: tuple[float, float, float]) -> Plan:
    """Speed, curvature and duration of each trim, from the identity."""
    trims = tuple(trim(v, kappa, f"trim {k}") for k, (v, kappa, _) in enumerate(pieces))
    return Plan([0.0, 0.0, 0.0], trims, durations=[one[2] for one in pieces])


def swerve(place: SE2 = HERE) -> PolishTask:
    """Past a box, from rest to rest, wherever that is."""
    end = (place @ SE2([14.0, 0.0, 0.0])).pose
    return PolishTask(
        model=CAR,
        start=place.pose,
        start_state=[0.0, 0.0],
        goal=tuple(end.tolist()),
        goal_state=(0.0, 0.0),
        parts=(BodyPart(solids=tuple(convex_pieces(BODY))),),
        obstacles=(Box([3.0, 2.0], [8.4, -0.4]).moved(place),),
    )


def around():
    """A guess for `swerve`: to the left and back."""
    kappa, angle = 0.3, 0.62
    arc = angle / kappa
    pieces = plan((1.0, kappa, arc), (1.0, -kappa, 2 * arc), (1.0, kappa, arc))
    reach = float(pieces.end[0])
    rest = (14.0 - reach) / 2.0
    whole = plan((1.0, 0.0, rest), (1.0, kappa, arc), (1.0, -kappa, 2 * arc), (1.0, kappa, arc),
                 (1.0, 0.0, rest))  # fmt: skip
    return PATHS.guess(whole, REST, REST)


def test_a_straight_stroke_is_timed_like_on_paper() -> None:
    run = timed(plan((1.0, 0.0, 10.0)), PATHS.pace)
    v, a = 0.9 * 2.5, 0.9  # 90 % of the limits
    assert run.duration == pytest.approx(10.0 / v + v / a, rel=2e-2)
    assert run.twist[:, 0].max() <= v + 1e-12


def test_closure_brings_a_motion_to_its_end_within_the_limits() -> None:
    rng = np.random.default_rng(3)
    control = np.clip(rng.normal(size=(60, 2)) * [0.4, 0.2], [-1.0, -0.5], [1.0, 0.5])
    control[10:14] = [1.0, 0.5]  # at their limits
    durations = np.full(60, 0.1)
    course = drive(CAR, [0.0, 0.0], control=control, durations=durations)
    end = np.concatenate([course.pose[-1], course.reduced_state[-1]]) + 1e-5
    found = closed(CAR, np.zeros(2), end.tolist(), control=control, durations=durations)
    assert not isinstance(found, str)
    assert found.error < 1e-12
    assert np.abs(found.control - control).max() < 1e-3
    assert (np.abs(found.control) <= [1.0, 0.5]).all()
    free = closed(CAR, np.zeros(2), [end[0], end[1], None, None, None], control=control,
                  durations=durations)  # fmt: skip
    assert not isinstance(free, str)
    assert np.abs(free.course.pose[-1, :2] - end[:2]).max() < 1e-12
    # an end that only a pace of hours meets is none to follow, which would take minutes
    far = closed(CAR, np.zeros(2), [9e6, *end[1:]], control=control, durations=durations)
    assert isinstance(far, str)
    assert far.startswith("the end could not be closed")


def test_the_goal_needs_a_place_and_the_start_its_limits() -> None:
    with pytest.raises(ValueError, match="place must be given"):
        PolishTask(model=CAR, start=[0, 0, 0], start_state=[0, 0], goal=(None, 0.0, 0.0),
                   goal_state=(0, 0))  # fmt: skip
    with pytest.raises(ValueError, match="outside the model's limits"):
        PolishTask(model=CAR, start=[0, 0, 0], start_state=[9, 0], goal=(1.0, 0.0, 0.0),
                   goal_state=(0, 0))  # fmt: skip


def test_a_polished_motion_is_exact_clean_and_inside_its_limits() -> None:
    task = swerve()
    motion = polish_guesses(task, [around()], budget=UNLIMITED).motion
    assert motion is not None
    assert np.abs(motion.course.pose[-1] - [14.0, 0.0, 0.0]).max() < 1e-12
    assert np.abs(motion.course.reduced_state[-1]).max() < 1e-12
    assert (np.abs(motion.control) <= [1.0, 0.5]).all()
    assert (np.abs(motion.course.reduced_state) <= [2.5, 0.75]).all()
    assert least_clearance(motion.course.pose, Box([3.0, 2.0], [8.4, -0.4])) > 0.0
    assert motion.duration < around().duration * 1.2
    stroke = motion.maneuver("polished", source="rest", target="rest")
    assert stroke.duration == motion.duration


def least_clearance(poses: np.ndarray, obstacle: Box) -> float:
    """Least distance of the body from an obstacle."""
    ring = shapely.Polygon(obstacle.corners)
    return min(shapely.Polygon(SE2(p).act(BODY.corners)).distance(ring) for p in poses)


def wide():
    """A guess for `swerve` that leads far around the box."""
    kappa, angle = 0.3, 0.8
    arc = angle / kappa
    bend = ((1.0, kappa, arc), (1.0, -kappa, 2 * arc), (1.0, kappa, arc))
    rest = (14.0 - float(plan(*bend).end[0])) / 2.0
    return PATHS.guess(plan((1.0, 0.0, rest), *bend, (1.0, 0.0, rest)), REST, REST)


def test_work_is_counted_in_iterations() -> None:
    result = polish_guesses(swerve(), [wide()] * 4, budget=UNLIMITED, most_iterations=60)
    assert 60 <= sum(one.iterations for one in result.attempts) < 60 + 8 * 60
    again = polish_guesses(swerve(), [wide()] * 4, budget=UNLIMITED, most_iterations=60)
    kinds = [[(one.kind, one.iterations) for one in run.attempts] for run in (result, again)]
    assert kinds[0] == kinds[1]


@pytest.mark.parametrize("obstacles", [(), (Box([1.0, 1.0], [7.0, 6.0]),)])
def test_where_no_line_holds_back_what_is_found_first_is_not_solved_again(obstacles) -> None:
    slow = replace(around(), duration=3.0 * around().duration)  # as good as none
    task = replace(swerve(), obstacles=obstacles)
    found = polish_guesses(task, [around(), around(), slow], budget=UNLIMITED)
    assert [(one.guess, one.kind) for one in found.attempts] == [
        (0, "fixed planes"), (1, "fixed planes"), (found.attempts[-1].guess, "finer"),
    ]  # fmt: skip


def test_a_guess_of_many_steps_gets_no_more_steps_than_the_best_may_have(monkeypatch) -> None:
    steps = []

    def recorded(model, ends, scene, guess, **values):
        steps.append(len(guess.control))
        return polish(model, ends, scene, guess, **values)

    monkeypatch.setattr("maneuver_automaton.refinement.polish.polish", recorded)
    many = replace(around(), state=around().state.repeat(3, 0),
                   control=around().control.repeat(3, 0))  # fmt: skip
    found = polish_guesses(replace(swerve(), obstacles=()), [around(), many], budget=UNLIMITED)
    assert found.motion is not None
    assert steps[1] == intervals_for(NEAR * found.motion.objective) < len(many.control)


def test_bounds_count_where_the_way_comes_near_to_them() -> None:
    task = swerve()
    free = polish_guesses(task, [around()], budget=UNLIMITED).motion
    assert free is not None
    far = replace(task, bounds=Bounds(x=(-99.0, 99.0), y=(-99.0, 99.0)))
    same = polish_guesses(far, [around()], budget=UNLIMITED).motion
    assert same is not None
    np.testing.assert_array_equal(same.control, free.control)
    most = 0.99 * float(free.course.pose[:, 1].max())
    low = replace(task, bounds=Bounds(x=(-99.0, 99.0), y=(-99.0, most)))
    motion = polish_guesses(low, [around()], budget=UNLIMITED).motion
    assert motion is not None
    assert motion.course.pose[:, 1].max() <= most
    assert free.duration < motion.duration < 1.01 * free.duration


def test_a_change_of_direction_by_millimetres_is_none_that_a_plan_keeps() -> None:
    speeds = np.array([0.0, 0.8, 0.8, 0.0, -0.006, 0.0, 0.01, 0.0, -0.8, 0.0])
    state = np.zeros((len(speeds), 5))
    state[:, 3] = speeds
    point = Point(state, np.zeros((len(speeds) - 1, 2)), np.full(len(speeds) - 1, 0.1))
    model = swerve().model
    gears = without_shuffles(model, point, 0.01)
    assert gears is not None
    assert np.count_nonzero(np.diff(gears)) == 1
    assert without_shuffles(model, point, 1e-6) is None  # all of its stretches are longer


@pytest.mark.slow
def test_what_closing_leads_beyond_a_limit_is_solved_with_more_room(monkeypatch) -> None:
    """Controls move a little once the end is closed, and states that follow from them add up."""
    refused = []

    def close(*args, **values):
        if not refused:
            refused.append(True)
            return "steering exceeds its limit by 2.99e-08 once the end is closed"
        return closed(*args, **values)

    monkeypatch.setattr("maneuver_automaton.refinement.polish.closed", close)
    found = polish_guesses(swerve(), [around()], budget=UNLIMITED)
    kinds = [attempt.kind for attempt in found.attempts]
    assert "room" in kinds
    assert kinds.index("room") > kinds.index("lines")
    assert found.motion is not None
    assert found.motion.error < 1e-9
