"""The automaton: names, numbers and classes of its trims, and the graph they make."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidAutomaton, ManeuverAutomatonError, UnknownTrim
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Car, SingleTrack, Unicycle, UserModel
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from tests.inertia import CAR
from tests.search.cases import NAMED_TABLE_2 as TABLE_2

ROBOT = Automaton.of_controls(Unicycle(), TABLE_2)


def trim(name, velocity=(1.0, 0.0, 0.0), control=(1.0, 0.0), **more):
    return Trim(name=name, body_velocity=velocity, control=control, **more)


def test_of_controls_by_hand():
    assert ROBOT.trim_names == tuple(TABLE_2)
    assert len(ROBOT) == 5
    assert ROBOT.controls.tolist() == [list(control) for control in TABLE_2.values()]
    assert ROBOT.body_velocities.tolist() == [[v, 0.0, w] for v, w in TABLE_2.values()]
    assert ROBOT["clockwise"].body_velocity.tolist() == [-0.25, 0.0, -1.0]
    assert ROBOT["clockwise"] is ROBOT.trims[2]


def test_a_car_turns_by_its_wheelbase():
    car = Automaton.of_controls(Car(wheelbase=2.0), {"left": (4.0, math.pi / 4)})
    np.testing.assert_allclose(car["left"].body_velocity, [4.0, 0.0, 2.0], atol=1e-14)


def test_a_vehicle_that_climbs():
    glider = UserModel(
        name="glider",
        group=SE2xR,
        control_names=("speed", "turn", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )
    automaton = Automaton.of_controls(glider, {"up": (2.0, 0.5, 1.0)})
    assert automaton.body_velocities.tolist() == [[2.0, 0.0, 0.5, 1.0]]


def test_tables_cannot_be_written():
    for table in (ROBOT.controls, ROBOT.body_velocities):
        with pytest.raises(ValueError, match="read-only"):
            table[0, 0] = 1.0


@pytest.mark.parametrize("name", TABLE_2)
def test_index_of_finds_every_trim(name):
    assert ROBOT.trims[ROBOT.index_of(name)].name == name


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("straigt", "no trim 'straigt' among rest, straight, clockwise, anticlockwise, spin; "
                    "did you mean 'straight'?"),
        ("Rest", "no trim 'Rest' among rest, straight, clockwise, anticlockwise, spin; "
                 "did you mean 'rest'?"),
        ("xyz", "no trim 'xyz' among rest, straight, clockwise, anticlockwise, spin"),
        ("", "no trim '' among rest, straight, clockwise, anticlockwise, spin"),
    ],
)  # fmt: skip
def test_an_unknown_name_says_what_there_is(name, message):
    for ask in (ROBOT.index_of, ROBOT.__getitem__):
        with pytest.raises(UnknownTrim) as error:
            ask(name)
        assert str(error.value) == message
        assert isinstance(error.value, LookupError)
        assert isinstance(error.value, ManeuverAutomatonError)


def test_a_long_list_of_names_is_cut():
    many = Automaton.of_grid(Unicycle(), [np.arange(5.0), np.arange(4.0)])
    with pytest.raises(UnknownTrim) as error:
        many.index_of("speed 1, turn_rate 9")
    assert str(error.value) == (
        "no trim 'speed 1, turn_rate 9' among "
        + ", ".join(f"speed {v}, turn_rate {w}" for v in range(3) for w in range(4))
        + ", ...; did you mean 'speed 1, turn_rate 3'?"
    )


@pytest.mark.parametrize(
    ("controls", "message"),
    [
        ({}, "automaton: got no trim, need at least one"),
        ({"a": (1.0,)}, "trim 'a': control has shape (1,), need 2 numbers (speed, turn_rate)"),
        ({"a": 1.0}, "trim 'a': control has shape (), need 2 numbers (speed, turn_rate)"),
        ({"a": (1.0, math.nan)}, "trim 'a': control: got nan, need finite numbers"),
        ({"a": "fast"}, "trim 'a': control: got 'fast', need numbers"),
        ({"a": (2.5, 0.0)},
         "trim 'a': speed = 2.5 is outside the limits [-2, 2] of the unicycle"),
        ({"b": (0.0, -1.25)},
         "trim 'b': turn_rate = -1.25 is outside the limits [-1, 1] of the unicycle"),
        ({" ": (0.0, 0.0)}, "trim: got the name ' ', need at least one visible character"),
    ],
)  # fmt: skip
def test_wrong_controls_are_named(controls, message):
    with pytest.raises(ValueError) as error:
        Automaton.of_controls(Unicycle(max_speed=2.0, max_turn_rate=1.0), controls)
    assert str(error.value) == message


def test_a_control_at_its_limit_is_admitted():
    limit = 0.1 + 0.2
    robot = Automaton.of_controls(Unicycle(max_speed=0.3), {"ahead": (limit, 0.0)})
    assert robot.controls[0, 0] == limit


def boat(*trims, maneuvers=()):
    """An automaton of a vehicle that has a speed as its reduced state."""
    model = UserModel(
        name="boat",
        group=SE2,
        control_names=("push", "rudder"),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, u[1]],
        dynamics=lambda z, u: [u[0] - z[0]],
    )
    return Automaton(model, trims, maneuvers)


SLOW = trim("slow", reduced_state=[1.0])
SLOW_TURN = trim("slow turn", (1.0, 0.0, 0.5), (1.0, 0.5), reduced_state=[1.0 + 1e-15])
FAST = trim("fast", (3.0, 0.0, 0.0), (3.0, 0.0), reduced_state=[3.0])


def test_a_control_alone_makes_no_trim_of_a_vehicle_with_inertia():
    with pytest.raises(InvalidAutomaton) as error:
        Automaton.of_controls(boat(SLOW).model, {"ahead": (1.0, 0.0)})
    assert str(error.value) == (
        "boat: has the reduced state speed, so a control alone makes no trim"
    )


def test_wrong_trims_are_named():
    with pytest.raises(InvalidAutomaton, match=r"^automaton: got no trim, need at least one$"):
        Automaton(Unicycle(), ())
    with pytest.raises(InvalidAutomaton, match=r"^trim 'a': the name is used twice$"):
        Automaton(Unicycle(), (trim("a"), trim("b"), trim("a")))
    with pytest.raises(InvalidAutomaton) as error:
        Automaton(Unicycle(), (trim("a"), trim("b", (1.0, 0.0, 0.0, 0.0))))
    assert str(error.value) == (
        "trim 'b': got twist (4,) and control (2,), need (3,) and (2,) for the unicycle"
    )
    with pytest.raises(InvalidAutomaton, match=r"^trim 'a': got twist \(3,\) and control \(1,\)"):
        Automaton(Unicycle(), (trim("a", control=(1.0,)),))


def test_maneuvers_fit_their_trims():
    with pytest.raises(InvalidAutomaton) as error:
        Automaton(Unicycle(), (trim("a", reduced_state=[1.0]),))
    assert str(error.value) == "trim 'a': got reduced state (1,), need (0,) for the unicycle"
    jump = Maneuver(name="jump", source="slow", target="fast", displacement=np.zeros(4))
    with pytest.raises(InvalidAutomaton) as error:
        boat(SLOW, FAST, maneuvers=(jump,))
    assert str(error.value) == (
        "maneuver 'jump': got a displacement of 4 numbers, need 3, as the trims have"
    )
    course = Trajectory(
        time=np.array([0.0, 1.0]),
        pose=np.zeros((2, 3)),
        reduced_state=np.array([[1.0], [2.0]]),
        control=np.zeros((2, 2)),
    )
    short = Maneuver(
        name="short",
        source="slow",
        target="fast",
        displacement=np.zeros(3),
        duration=1.0,
        course=course,
    )
    with pytest.raises(InvalidAutomaton) as error:
        boat(SLOW, FAST, maneuvers=(short,))
    assert str(error.value) == (
        "maneuver 'short': ends at the reduced state (2), but trim 'fast' has (3)"
    )


def test_a_library_of_a_model_in_one_call():
    grid = {"speed": [-2.5, 0.0, 2.5], "steering": [-0.75, 0.0, 0.75]}
    library = Automaton.of_model(CAR, grid)
    assert len(library) == 9
    assert len(library.maneuvers) == 40
    assert len(Automaton.of_model(CAR, grid, pairs="all").maneuvers) == 72
    # steering alone, and speed alone, have no late maneuver of their own
    both = Automaton.of_model(CAR, grid, late=True).maneuvers
    assert sum(m.name.endswith(", late") for m in both) == 16
    strokes = Automaton.of_model(CAR, grid, strokes=[-1.0, 0.5]).maneuvers[40:]
    assert [m.name for m in strokes[:2]] == [
        "speed 0, steering -0.75, speed over -1",
        "speed 0, steering -0.75, speed over 0.5",
    ]
    assert len(strokes) == 6
    assert all(m.source == m.target for m in strokes)


def test_points_without_a_trim_are_refused_or_left_out():
    grid = {"speed": [0.0, 2.5], "turn_rate": [0.0, 1.0]}
    with pytest.raises(InvalidAutomaton) as error:
        Automaton.of_model(CAR, grid)
    assert str(error.value) == (
        "grid: 2 of 4 points have no trim, such as 'speed 0, turn_rate 1': "
        "no steady motion: turn_rate stays off by 1"
    )
    assert len(Automaton.of_model(CAR, grid, leave_out=True)) == 2
    with pytest.raises(InvalidAutomaton, match="grid: 1 of 1 points have no trim"):
        Automaton.of_model(CAR, {"speed": [9.0], "steering": [0.0]}, leave_out=True)


def test_a_coupled_vehicle_gets_trims_alone():
    library = Automaton.of_model(SingleTrack(), {"speed": [10.0, 20.0], "turn_rate": [0.0, 0.1]})
    assert (len(library), library.maneuvers) == (4, ())


@pytest.mark.parametrize("end", ["source", "target"])
def test_a_maneuver_joins_trims_that_are_there(end):
    names = {"source": "slow", "target": "fast"} | {end: "fasst"}
    jump = Maneuver(name="jump", displacement=np.zeros(3), **names)
    with pytest.raises(UnknownTrim, match=r"no trim 'fasst' among slow, fast; did you mean 'fast'"):
        boat(SLOW, FAST, maneuvers=(jump,))


def test_a_grid_is_named_after_its_controls():
    axes = [np.linspace(-2.0, 2.0, 41), np.linspace(-2.0, 2.0, 41)]
    grid = Automaton.of_grid(Unicycle(), axes)
    assert len(grid) == 1681
    assert grid.trim_names[0] == "speed -2, turn_rate -2"
    assert grid.trim_names[-1] == "speed 2, turn_rate 2"
    assert grid["speed 0.3, turn_rate -1.7"].control.tolist() == [axes[0][23], axes[1][3]]
    assert grid.rest == grid.index_of("speed 0, turn_rate 0")


@given(axes=st.tuples(*[st.lists(st.integers(-5, 5), min_size=1, max_size=4, unique=True)] * 2))
def test_a_grid_holds_the_product_of_its_axes(axes):
    grid = Automaton.of_grid(Unicycle(), axes)
    assert len(grid) == len(axes[0]) * len(axes[1])
    assert grid.controls.tolist() == [[v, w] for v in axes[0] for w in axes[1]]


def test_a_grid_has_no_minus_zero_in_its_names():
    assert Automaton.of_grid(Unicycle(), [[-0.0], [1.0]]).trim_names == ("speed 0, turn_rate 1",)


def test_a_value_that_stands_twice_in_an_axis_counts_once():
    assert len(Automaton.of_grid(Unicycle(), [[1.0, 2.0, 1.0], [0.0]])) == 2


def test_wrong_grids_are_named():
    with pytest.raises(ValueError) as error:
        Automaton.of_grid(Unicycle(), [[0.0, 1.0]])
    assert str(error.value) == (
        "grid: got 1 axes, need 2 for the controls speed, turn_rate of the unicycle"
    )
    with pytest.raises(ValueError, match=r"^grid: axis 1: got nan, need finite numbers$"):
        Automaton.of_grid(Unicycle(), [[0.0], [math.nan]])
    with pytest.raises(ValueError, match="outside the limits"):
        Automaton.of_grid(Unicycle(max_speed=1.0), [[0.0, 2.0], [0.0]])


@pytest.mark.parametrize(
    ("controls", "groups"),
    [
        ([(1, 0), (0, 1), (1, 0), (0, 1), (1, 0)], [0, 1, 0, 1, 0]),
        ([(1, -0.0), (1, 0.0)], [0, 0]),
        ([(1, 0), (1, 1e-99), (1, 2)], [0, 1, 2]),
        ([(2, 0)], [0]),
    ],
)
def test_equal_twists_share_the_first_trim_s_index(controls, groups):
    robot = Automaton.of_controls(Unicycle(), {str(k): c for k, c in enumerate(controls)})
    assert robot.twist_groups.tolist() == groups


@given(
    controls=st.lists(st.tuples(st.integers(-1, 1), st.integers(-1, 1)), min_size=1, max_size=12)
)
def test_twist_groups_are_those_of_a_slow_search(controls):
    robot = Automaton.of_controls(Unicycle(), {str(k): c for k, c in enumerate(controls)})
    assert robot.twist_groups.tolist() == [controls.index(control) for control in controls]


def test_trims_of_equal_reduced_state_are_one_class():
    assert ROBOT.trim_classes.tolist() == [0] * 5
    classes = boat(FAST, SLOW, SLOW_TURN).trim_classes
    assert classes[1] == classes[2] != classes[0]


def test_rest_is_the_first_trim_that_stands_still():
    assert ROBOT.rest == 0
    controls = {"spin": (0, 1), "wait": (0, -0.0), "park": (0, 0)}
    assert Automaton.of_controls(Unicycle(), controls).rest == 1
    assert Automaton.of_controls(Unicycle(), {"ahead": (1, 0)}).rest is None


def test_the_graph_of_a_kinematic_vehicle_joins_all_to_all():
    graph = ROBOT.graph()
    assert set(graph.nodes) == set(TABLE_2)
    assert graph.nodes["spin"]["trim"] is ROBOT["spin"]
    assert graph.number_of_edges() == 5 * 4
    for _, _, data in graph.edges(data=True):
        assert data["maneuver"].duration == 0.0
        assert not data["maneuver"].displacement.any()
    assert not any(graph.has_edge(name, name) for name in TABLE_2)


def test_the_graph_of_a_vehicle_with_inertia():
    jump = Maneuver(
        name="jump", source="slow", target="fast", displacement=[2.0, 0.0, 0.0], duration=1.0
    )
    graph = boat(SLOW, SLOW_TURN, FAST, maneuvers=(jump, jump)).graph()
    edges = sorted((a, b) for a, b in graph.edges())
    assert edges == [
        ("slow", "fast"),
        ("slow", "fast"),
        ("slow", "slow turn"),
        ("slow turn", "slow"),
    ]
    assert graph.get_edge_data("slow", "fast")[0]["maneuver"] is jump


def test_a_switch_changes_nothing():
    switch = ROBOT.switch(1, 4)
    assert (switch.source, switch.target) == ("straight", "spin")
    assert switch.duration == 0.0
    assert switch.displacement.tolist() == [0.0, 0.0, 0.0]
