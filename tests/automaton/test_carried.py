"""What is carried moves rigidly with the vehicle wherever its frame says."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import carried, tail_of, with_samples_at
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive
from tests.inertia import TRAILER


def plan_with_trailer(start=(1.0, 2.0, 0.7)):
    """Straighten up behind the car, then a straight: the hitch angle changes and stays."""
    course = drive(
        TRAILER, np.array([0.3]), control=np.array([[0.5, 0.2], [0.5, -0.4]]), durations=[1.0, 0.7]
    )
    hitch = course.reduced_state[-1]
    begin = Trim(name="bent", body_velocity=[0, 0, 0], control=[0, 0], reduced_state=[0.3])
    end = Trim(name="then", body_velocity=[0, 0, 0], control=[0, 0], reduced_state=hitch)
    bend = Maneuver(
        name="bend",
        source="bent",
        target="then",
        displacement=course.pose[-1],
        duration=1.7,
        course=course,
    )
    return Plan(start, (begin, end), durations=[0.0, 2.0], maneuvers=(bend,), start_time=5.0)


def test_the_trailer_is_where_the_hitch_says():
    plan = plan_with_trailer()
    behind = carried(plan, TRAILER, "trailer")
    course = plan.maneuvers[0].course
    times = 5.0 + course.time
    hitch = course.reduced_state[:, 0]
    poses = plan.pose_at(times)
    heading = poses[:, 2] - hitch
    expected = poses[:, :2] - 0.5 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    np.testing.assert_allclose(behind.pose_at(times)[:, :2], expected, atol=1e-12)
    np.testing.assert_allclose(behind.pose_at(times)[:, 2], heading, atol=1e-12)
    assert behind.duration == plan.duration


def test_a_trailer_is_pulled_along_its_own_axis():
    """No point of its axle moves sideways: the law of the trailer, not of the code."""
    behind = carried(plan_with_trailer(), TRAILER, "trailer")
    poses = behind.pose_at(5.0 + np.linspace(0.0, 1.6, 400))
    ways = np.diff(poses[:, :2], axis=0)
    middle = 0.5 * (poses[1:, 2] + poses[:-1, 2])
    sideways = -np.sin(middle) * ways[:, 0] + np.cos(middle) * ways[:, 1]
    assert np.abs(sideways).max() < 2e-6


@pytest.mark.parametrize("after", [0.4, 1.0, 1.5, 2.5])
def test_what_is_left_of_a_plan_carries_the_trailer_to_the_same_places(after):
    """Within the maneuver the hitch angle is no more that of the trim before it."""
    plan = plan_with_trailer()
    plan = with_samples_at(plan, [plan.start_time + after], TRAILER)
    times = np.linspace(plan.start_time + after, plan.start_time + plan.duration, 50)
    behind = carried(plan, TRAILER, "trailer").pose_at(times)
    left = tail_of(plan, after)
    np.testing.assert_allclose(carried(left, TRAILER, "trailer").pose_at(times), behind, atol=1e-9)


def test_a_moved_plan_carries_the_moved_trailer():
    by = SE2([3.0, -1.0, 2.0])
    one = carried(plan_with_trailer(), TRAILER, "trailer").moved(by)
    other = carried(plan_with_trailer().moved(by), TRAILER, "trailer")
    np.testing.assert_allclose(other.end, one.end, atol=1e-12)
    np.testing.assert_allclose(other.pose_at(5.8), one.pose_at(5.8), atol=1e-12)


def test_what_is_not_carried():
    with pytest.raises(ValueError, match="not in tuple"):
        carried(plan_with_trailer(), TRAILER, "caravan")
