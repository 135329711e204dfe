"""Problems: every form of start and goal, what is refused, and the law that moves them."""

from __future__ import annotations

import inspect
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton import load_stock_library
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.errors import UnknownTrim
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Unicycle, UserModel
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.via import Via

ROBOT = Automaton.of_controls(
    Unicycle(), {"rest": (0.0, 0.0), "straight": (1.5, 0.0), "spin": (0.0, 1.0)}
)
GLIDER = Automaton.of_controls(
    UserModel(
        name="glider",
        group=SE2xR,
        control_names=("turn", "climb"),
        velocity=lambda z, u: [1.0, 0.0, u[0], u[1]],
    ),
    {"ahead": (0.0, 0.0), "up": (0.0, 0.5), "left": (1.0, 0.0)},
)


def problem(start=(0.0, 0.0, 0.0), goals=(1.0, 2.0, 0.5), **more):
    return Problem(ROBOT, start, goals, **more)


def poses(one):
    return [goal.pose.tolist() for goal in one.goals]


@pytest.mark.parametrize("start", [[1, 2, 0.5], (1.0, 2.0, 0.5), SE2([1.0, 2.0, 0.5])])
def test_forms_of_a_start(start):
    assert problem(start).start.tolist() == [1.0, 2.0, 0.5]


@pytest.mark.parametrize(
    "goal",
    [
        [1, 2, 0.5],
        np.array([1.0, 2.0, 0.5]),
        SE2([1.0, 2.0, 0.5]),
        Goal(pose=[1.0, 2.0, 0.5]),
        [[1.0, 2.0, 0.5]],
        [Goal(pose=[1.0, 2.0, 0.5])],
        Goal(SE2([1.0, 2.0, 0.5])),
    ],
)
def test_forms_of_one_goal(goal):
    assert poses(problem(goals=goal)) == [[1.0, 2.0, 0.5]]


@pytest.mark.parametrize(
    "goals",
    [
        [[1, 0, 0], [0, 1, 0.5]],
        np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]),
        [Goal(pose=[1, 0, 0]), Goal(pose=[0, 1, 0.5])],
        (Goal(pose=[1, 0, 0]), Goal(pose=[0, 1, 0.5])),
    ],
)
def test_forms_of_several_goals(goals):
    assert poses(problem(goals=goals)) == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]


def test_goals_keep_what_they_say():
    goal = Goal(pose=[1, 0, 0], trim="rest", free_heading=True, tolerance_m=0.1, tolerance_rad=0.2)
    assert problem(goals=[goal, Goal(pose=[0, 0, 0])]).goals[0] is goal


def test_a_goal_is_exact_unless_it_says_otherwise():
    goal = problem().goals[0]
    assert (goal.tolerance_m, goal.tolerance_rad, goal.free_heading, goal.trim) == (0, 0, 0, None)


def test_with_height_there_are_four_numbers():
    glide = Problem(GLIDER, SE2xR([0, 0, 0, 1]), [[1, 0, 0, 2], [3, 0, 0, 2]])
    assert glide.start.tolist() == [0.0, 0.0, 0.0, 1.0]
    assert poses(glide) == [[1.0, 0.0, 0.0, 2.0], [3.0, 0.0, 0.0, 2.0]]


def test_arrays_are_read_only_copies():
    start, goal = np.zeros(3), np.ones(3)
    one = problem(start, goal)
    start[0] = goal[0] = 9.0
    assert one.start[0] == 0.0
    assert one.goals[0].pose[0] == 1.0
    for array in (one.start, one.goals[0].pose):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0


def test_defaults():
    one = problem()
    assert one.cost.time == 1.0
    assert one.rates.tolist() == [1.0, 1.0, 1.0]
    assert (one.horizon.time, one.horizon.max_trims, one.horizon.max_time) == (None, None, None)
    assert one.horizon.min_coast == 0.0
    assert one.search.method == "auto"
    assert one.start_time == 0.0


def test_rates_by_hand():
    assert problem(cost=Cost(effort=1.0, norm=0.5, time=0.25)).rates.tolist() == [0.25, 3.25, 1.75]


@pytest.mark.parametrize(
    ("start", "goals", "message"),
    [
        ([0, 0], [0, 0, 0], "start: got shape (2,), need 3 components last"),
        ([0, 0, 0, 0], [0, 0, 0], "start: got shape (4,), need 3 components last"),
        (SE2xR([0, 0, 0, 0]), [0, 0, 0], "start: got shape (4,), need 3 components last"),
        ([0, 0, math.nan], [0, 0, 0], "start: got nan, need finite numbers"),
        ("here", [0, 0, 0], "start: got 'here', need numbers"),
        ([0, 0, 0], [0, 0], "goal: pose has 2 numbers, need 3 for the unicycle"),
        ([0, 0, 0], [[0, 0]], "goal: pose has 2 numbers, need 3 for the unicycle"),
        ([0, 0, 0], [1, 2, 3, 4], "goal: pose has 4 numbers, need 3 for the unicycle"),
        ([0, 0, 0], [[1, 2, 3, 4]], "goal: pose has 4 numbers, need 3 for the unicycle"),
        ([0, 0, 0], SE2xR([1, 2, 3, 4]), "goal: pose has 4 numbers, need 3 for the unicycle"),
        ([0, 0, 0], Goal(pose=[1, 2, 3, 4]), "goal: pose has 4 numbers, need 3 for the unicycle"),
        ([0, 0, 0], [], "goal: got shape (0,), need one pose or a list of poses"),
        ([0, 0, 0], 7.0, "goal: got shape (), need one pose or a list of poses"),
        ([0, 0, 0], [[[1, 2, 3]]],
         "goal: got shape (1, 1, 3), need one pose or a list of poses"),
        ([0, 0, 0], "there", "goal: pose: got 'there', need numbers"),
        ([0, 0, 0], [0, 0, math.inf], "goal: pose: got inf, need finite numbers"),
    ],
)  # fmt: skip
def test_wrong_poses_are_named(start, goals, message):
    with pytest.raises(ValueError) as error:
        problem(start, goals)
    assert str(error.value) == message


def test_a_start_and_a_goal_are_single_poses():
    with pytest.raises(ValueError, match="need one pose"):
        problem([[0, 0, 0]], [1, 2, 3])
    with pytest.raises(ValueError, match="need one pose"):
        Goal(pose=[[1, 2, 3]])


@pytest.mark.parametrize(
    "goals",
    [
        [SE2([1, 0, 0]), SE2([0, 1, 0.5])],
        SE2([[1, 0, 0], [0, 1, 0.5]]),
        [Goal(pose=[1, 0, 0]), [0, 1, 0.5]],
    ],
)
def test_several_goals_of_either_form(goals):
    assert poses(problem(goals=goals)) == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]


@pytest.mark.parametrize(
    "via",
    [
        [SE2([1, 0, 0]), SE2([0, 1, 0.5])],
        SE2([[1, 0, 0], [0, 1, 0.5]]),
        [Via(SE2([1, 0, 0])), SE2([0, 1, 0.5])],
    ],
)
def test_poses_on_the_way_of_either_form(via):
    via = problem(via=via).via
    assert [one.pose.tolist() for one in via] == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]


def test_too_few_numbers_for_a_vehicle_that_climbs():
    with pytest.raises(ValueError) as error:
        Problem(GLIDER, [0, 0, 0, 0], [1, 2, 3])
    assert str(error.value) == "goal: pose has 3 numbers, need 4 for the glider"
    with pytest.raises(ValueError, match=r"^start: got shape \(3,\), need 4 components last$"):
        Problem(GLIDER, [0, 0, 0], [1, 2, 3, 4])


@pytest.mark.parametrize(
    "values",
    [
        {"start_trim": "straigth"},
        {"goals": Goal(pose=[1, 0, 0], trim="straigth")},
        {"goals": [Goal(pose=[1, 0, 0]), Goal(pose=[1, 0, 0], trim="straigth")]},
    ],
)
def test_unknown_trims_are_named_with_the_nearest(values):
    with pytest.raises(UnknownTrim) as error:
        problem(**values)
    assert str(error.value) == (
        "no trim 'straigth' among rest, straight, spin; did you mean 'straight'?"
    )


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"start_time": math.nan}, "start: time must be finite, got nan s"),
        ({"start_time": -math.inf}, "start: time must be finite, got -inf s"),
        ({"obstacles": [{"disc_m": 1.0}]},
         "obstacles: got {'disc_m': 1.0}, need Obstacle, OccupancyMap, Polygon, Disc or "
         "Box, geometry of shapely, or corners (n, 2)"),
    ],
)  # fmt: skip
def test_what_else_is_wrong_is_said(values, message):
    with pytest.raises(ValueError) as error:
        problem(**values)
    assert str(error.value) == message


@pytest.mark.parametrize("name", ["tolerance_m", "tolerance_rad"])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_tolerances_are_numbers_of_at_least_zero(name, value):
    with pytest.raises(ValueError) as error:
        Goal(pose=[0, 0, 0], **{name: value})
    need = "finite" if value == math.inf else "at least 0"
    assert str(error.value) == f"goal: {name} must be {need}, got {value}"


def test_the_pose_of_a_goal_has_two_to_four_numbers():
    with pytest.raises(ValueError, match=r"^pose: got shape \(5,\), need 2 or 3 or 4 components"):
        Goal(pose=np.zeros(5))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"time": 0.0}, "horizon: time must be positive, got 0.0 s"),
        ({"time": -1.0}, "horizon: time must be positive, got -1.0 s"),
        ({"time": math.inf}, "horizon: time must be finite, got inf s"),
        ({"time": math.nan}, "horizon: time must be positive, got nan s"),
        ({"max_time": 0.0}, "horizon: max_time must be positive, got 0.0 s"),
        ({"max_time": math.nan}, "horizon: max_time must be positive, got nan s"),
        ({"time": 1.0, "max_time": 2.0},
         "horizon: max_time is for a free final time, but time is fixed"),
        ({"max_trims": 0}, "horizon: max_trims must be at least 1, got 0"),
        ({"min_coast": -0.1}, "horizon: min_coast must be at least 0, got -0.1 s"),
        ({"min_coast": math.nan}, "horizon: min_coast must be at least 0, got nan s"),
        ({"min_coast": math.inf}, "horizon: min_coast must be finite, got inf s"),
    ],
)  # fmt: skip
def test_wrong_horizons_are_named(values, message):
    with pytest.raises(ValueError) as error:
        Horizon(**values)
    assert str(error.value) == message


@pytest.mark.parametrize("name", ["x", "y", "z"])
@pytest.mark.parametrize("pair", [(1.0, 1.0), (2.0, 1.0), (1.0,), (0.0, 1.0, 2.0), (0.0, math.nan)])
def test_bounds_are_low_and_high(name, pair):
    with pytest.raises(ValueError) as error:
        Bounds(**{name: pair})
    assert str(error.value) == (f"bounds: {name} must be [low, high] with low < high, got {pair}")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"method": "latice"},
         "search: method must be one of auto, words, insertion, lattice, got 'latice'"),
        ({"max_expansions": 0}, "search: max_expansions must be at least 1, got 0"),
    ],
)  # fmt: skip
def test_wrong_search_settings_are_named(values, message):
    with pytest.raises(ValueError) as error:
        SearchSettings(**values)
    assert str(error.value) == message


POSES = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0))


@given(start=POSES, goals=st.lists(POSES, min_size=1, max_size=3), by=POSES)
def test_moving_moves_start_and_goals_and_nothing_else(start, goals, by):
    one = problem(start, [Goal(pose=goal, tolerance_m=0.1) for goal in goals], start_time=3.0)
    moved = one.moved(SE2(by))
    assert moved.start.tolist() == (SE2(by) @ SE2(start)).pose.tolist()
    for before, after in zip(one.goals, moved.goals, strict=True):
        assert after.pose.tolist() == (SE2(by) @ SE2(before.pose)).pose.tolist()
        assert after.tolerance_m == 0.1
    assert moved.automaton is one.automaton
    assert moved.cost is one.cost
    assert moved.horizon is one.horizon
    assert moved.start_time == 3.0


def test_moving_with_height():
    moved = Problem(GLIDER, [0, 0, 0, 1], [5, 0, 0, 2]).moved(SE2xR([1, 2, math.pi / 2, 10]))
    np.testing.assert_allclose(moved.start, [1, 2, math.pi / 2, 11], atol=1e-15)
    np.testing.assert_allclose(moved.goals[0].pose, [1, 7, math.pi / 2, 12], atol=1e-15)


@pytest.mark.parametrize("bounds", [Bounds(x=(-1, 1)), Bounds(y=(-1, 1)), Bounds(z=(-1, 1))])
def test_bounds_break_the_symmetry(bounds):
    with pytest.raises(ValueError, match=r"^problem: bounds do not move with the symmetry$"):
        problem(bounds=bounds).moved(SE2([1, 0, 0]))


def boat_automaton(*maneuvers):
    boat = UserModel(
        name="boat",
        group=SE2,
        control_names=("push",),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, 0.0],
        dynamics=lambda z, u: [u[0] - z[0]],
    )
    trims = tuple(
        Trim(name=name, body_velocity=[v, 0, 0], control=[v], reduced_state=[v])
        for name, v in (("slow", 1.0), ("fast", 2.0))
    )
    return Automaton(boat, trims, maneuvers)


def test_a_vehicle_with_inertia_begins_and_ends_in_a_trim():
    need = "the boat has no trim that stands still, need the name of one of its trims: slow, fast"
    with pytest.raises(ValueError, match=f"^start: {need}$"):
        Problem(boat_automaton(), [0, 0, 0], [1, 0, 0])
    with pytest.raises(ValueError, match=f"^goal: {need}$"):
        Problem(boat_automaton(), [0, 0, 0], [1, 0, 0], start_trim="slow")
    goal = Goal(pose=[1, 0, 0], trim="fast")
    boat = Problem(boat_automaton(), [0, 0, 0], goal, start_trim="slow")
    assert (boat.first_trim.name, boat.last_trim(goal).name) == ("slow", "fast")


def test_the_cost_of_a_maneuver_is_integrated_along_its_course():
    """From 1 to 2 m/s in a second, pushed with 2.58...: effort u^2, length, and time by hand."""
    course = Trajectory(
        time=np.array([0.0, 1.0]),
        pose=np.array([[0, 0, 0], [1.5, 0, 0.0]]),
        reduced_state=np.array([[1.0], [2.0]]),
        control=np.array([[2.5], [2.5]]),
    )
    hurry = Maneuver(
        name="hurry",
        source="slow",
        target="fast",
        displacement=[1.5, 0, 0],
        duration=1.0,
        course=course,
    )
    automaton = boat_automaton(hurry)
    goal = Goal(pose=[5.5, 0, 0], trim="fast")
    cost = Cost(effort=1.0, length=10.0, time=100.0)
    boat = Problem(automaton, [0, 0, 0], goal, start_trim="slow", cost=cost)
    plan = Plan([0, 0, 0], automaton.trims, durations=[2.0, 1.0], maneuvers=(hurry,))
    assert plan.word == ("slow", "hurry", "fast")
    assert plan.end.tolist() == [5.5, 0, 0]
    coasting = 2.0 * (1.0 + 10.0 + 100.0) + 1.0 * (4.0 + 20.0 + 100.0)
    assert boat.cost_of(plan) == pytest.approx(coasting + 2.5**2 + 15.0 + 100.0)


def test_every_parameter_is_documented():
    described = inspect.getdoc(Problem).split("Parameters\n")[1].split("Raises\n")[0]
    for name in inspect.signature(Problem).parameters:
        assert re.search(rf"^{name} : ", described, flags=re.MULTILINE), name


@pytest.mark.parametrize("name", ["bounds", "horizon", "search"])
def test_nothing_is_no_setting(name):
    with pytest.raises(ValueError, match=rf"^{name}: got None, need \w+\(\.\.\.\)$"):
        problem(**{name: None})


@pytest.mark.parametrize(
    ("name", "moving", "same"),
    [
        ("car_with_trailer", "speed 3, hitch 0", True),  # its speed is no state
        ("second_order_car", "speed 2.5, steering 0", False),
    ],
)
def test_a_moving_trim_in_the_state_of_rest_is_like_rest(name, moving, same):
    library = load_stock_library(name)
    there = Problem(library, [0, 0, 0], Goal([9, 1, 0], trim=moving), start_trim=moving)
    assert Problem(library, [0, 0, 0], [9, 1, 0]).rests_at_both_ends
    assert there.rests_at_both_ends == same
