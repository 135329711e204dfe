"""Automata of vehicles that translations alone move, and the headings of their poses."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.headings import trim_headings
from maneuver_automaton.automaton.library import load_library, save_library
from maneuver_automaton.groups import SE2, translations
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.problem import Goal, Problem
from tests import translations as vehicles

STAGE, BOAT = vehicles.stage(), vehicles.boat()


@pytest.fixture(scope="module")
def boat():
    return Automaton.of_model(BOAT, {"heading": np.pi / 2 * np.arange(4), "speed": [1.0]})


def stage():
    return Automaton.of_grid(STAGE, [[-1, 0, 1], [-1, 0, 1]])


def test_a_stage_is_made_in_every_way():
    controls = Automaton.of_controls(STAGE, {"slant": (0.5, 0.25)})
    grid, model = stage(), Automaton.of_model(STAGE, {"v_x": [0.5], "v_y": [0.25]})
    by_hand = Automaton(
        STAGE, (Trim(name="slant", body_velocity=[0.5, 0.25], control=[0.5, 0.25]),)
    )
    for one in (controls, model, by_hand):
        assert one.body_velocities.tolist() == [[0.5, 0.25, 0.0]]
    assert grid.body_velocities.shape == (9, 3)
    assert grid.is_kinematic


def test_a_trim_keeps_its_place_along_the_axes_of_the_world(boat):
    for heading, trim in zip(trim_headings(boat), boat.trims, strict=True):
        end = trim.coast(SE2([1.0, 2.0, heading]), 3.0).pose
        way = 3.0 * np.array([np.cos(heading) + 0.3, np.sin(heading)])
        np.testing.assert_allclose(end, [1.0 + way[0], 2.0 + way[1], heading], atol=1e-12)


def test_a_maneuver_along_the_axes_of_the_world_gets_a_heading(boat):
    course = Trajectory(
        time=np.array([0.0, 2.0]),
        pose=np.array([[0.0, 0.0], [1.0, 3.0]]),
        reduced_state=np.array([[np.pi / 2], [np.pi]]),
        control=np.zeros((2, 2)),
    )
    values = {"name": "hop", "source": boat.trim_names[1], "target": boat.trim_names[2]}
    hop = Maneuver(displacement=[1.0, 3.0], duration=2.0, course=course, **values)
    (seen,) = Automaton(BOAT, boat.trims, (hop,)).maneuvers
    np.testing.assert_allclose(seen.displacement, [3.0, -1.0, np.pi / 2], atol=1e-12)
    unknown = Maneuver(displacement=[1.0, 3.0], duration=2.0, **values)
    with pytest.raises(ValueError, match="maneuver 'hop': has no course, need one to know how far"):
        Automaton(BOAT, boat.trims, (unknown,))


def test_ends_get_the_heading_that_there_is(boat):
    problem = Problem(stage(), [0, 0], [[3, 1], [4, 1]])
    assert problem.start.tolist() == [0, 0, 0]
    assert [goal.pose.tolist() for goal in problem.goals] == [[3, 1, 0], [4, 1, 0]]
    assert problem.start_trim is None
    problem = Problem(boat, [0, 0, np.pi / 2], [3, 1, 2 * np.pi])
    assert problem.first_trim is boat.trims[1]
    assert problem.last_trim(problem.goals[0]) is boat.trims[0]


def test_a_goal_of_any_heading_is_one_goal_for_each(boat):
    for goal in ([3, 1], Goal(pose=[3, 1, 0.123], free_heading=True)):
        problem = Problem(boat, [0, 0, 0], goal)
        assert [one.trim for one in problem.goals] == list(boat.trim_names)


@pytest.mark.parametrize(
    ("start", "goal", "said"),
    [
        (
            [0, 0, 0],
            [3, 1, 0.3],
            "goal: the boat has no trim of heading 0.3 rad, the nearest is 0 ",
        ),
        (
            [0, 0, 1.5],
            [3, 1],
            "start: the boat has no trim of heading 1.5 rad, the nearest is 1.57",
        ),
        ([0, 0], [3, 1], "start: got no heading, need .x, y, heading.: the boat has trims of the"),
        ([0, 0, 0], [3, 1, 0, 0], "goal: pose has shape .4,., need 2 numbers for the boat, or 3"),
    ],
)
def test_a_heading_that_no_trim_has_is_refused_with_the_nearest(boat, start, goal, said):
    with pytest.raises(ValueError, match=said) as caught:
        Problem(boat, start, goal)
    assert "\n" not in str(caught.value)


def test_a_trim_of_another_heading_is_refused(boat):
    with pytest.raises(ValueError, match=r"via 2: the boat has no trim of heading 0\.3 rad"):
        Problem(boat, [0, 0, 0], [3, 1], via=[[1, 0, 0], [2, 1, 0.3]])
    problem = Problem(boat, [0, 0, 0], [3, 1], start_trim=boat.trim_names[1])
    with pytest.raises(ValueError, match=r"start: has the heading 0 rad, but trim 'heading 1\.57"):
        _ = problem.first_trim
    with pytest.raises(ValueError, match=r"goal: has the heading 0 rad, but trim 'heading 1\.57"):
        Problem(boat, [0, 0, 0], Goal(pose=[3, 1, 0], trim=boat.trim_names[1]))


def test_a_problem_is_moved_by_translations_alone(boat):
    problem = Problem(boat, [0, 0, 0], [3, 1, 0])
    for by in (translations(2)([5.0, 6.0]), SE2([5.0, 6.0, 2 * np.pi])):
        np.testing.assert_allclose(problem.moved(by).goals[0].pose[:2], [8.0, 7.0], atol=1e-12)
    with pytest.raises(ValueError, match="problem: translations alone move the boat, but the mot"):
        problem.moved(SE2([0.0, 0.0, 0.5]))


def test_a_library_is_read_again(boat, tmp_path):
    save_library(boat, tmp_path / "boat.json")
    again = load_library(tmp_path / "boat.json", model=BOAT)
    assert again.trim_names == boat.trim_names
    for one, other in zip(again.maneuvers, boat.maneuvers, strict=True):
        np.testing.assert_allclose(one.displacement, other.displacement, atol=1e-12)
