"""What an automaton can do, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import (
    Car,
    SecondOrderUnicycle,
    Unicycle,
    UserModel,
)
from maneuver_automaton.primitives import Maneuver, Trim
from tests.inertia import CAR, HELICOPTER

GLIDER = UserModel(
    name="glider",
    group=SE2xR,
    control_names=("v", "turn", "climb"),
    velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
)


@pytest.mark.parametrize(
    ("controls", "reason"),
    [
        ([(0, 0)], "only rest: the vehicle never moves"),
        ([(1, 0), (-1, 0), (0, 0)], "only straights: the heading never changes"),
        ([(0, 1), (0, -1)], "only spins: the position never changes"),
        ([(1, 1), (-2, -2)], "only one circle: every trim runs along the same one"),
        ([(1, 1), (1, 0)], ""),
        ([(1, 1), (1, -1)], ""),
        ([(1, 1), (-1, 1)], ""),
        ([(0, 1), (1, 0)], ""),
        ([(0, 1e-6), (1e-6, 0)], ""),
    ],
)
def test_planar_vehicles(controls, reason):
    robot = Automaton.of_controls(Unicycle(), {str(k): c for k, c in enumerate(controls)})
    report = validate(robot)
    assert report.reason == reason
    assert report.controllable == (not reason)
    assert report.connected
    assert report.dead_ends == report.unused == report.duplicates == ()


def test_a_car_that_only_turns_left_and_drives_ahead_reaches_every_pose():
    car = Automaton.of_controls(Car(wheelbase=2.0), {"left": (1, 0.4), "ahead": (1, 0)})
    assert validate(car).controllable


@pytest.mark.parametrize(
    ("controls", "reason"),
    [
        ([(1, 1, 0), (1, 0, 0)], "only level trims: the height never changes"),
        ([(1, 1, 1), (1, 0, 0)], "only climbing and level trims: the height never falls"),
        ([(1, 1, -1), (1, 0, 0)], "only sinking and level trims: the height never rises"),
        (
            [(1, 1, 1), (1, -1, -1), (2, 0, 0)],
            "turn rate and climb rate are proportional: height and heading stay coupled",
        ),
        ([(1, 1, 1), (1, -1, -1), (2, 1, 0)], ""),
        ([(1, 1, 1), (1, 0, -1)], ""),
        ([(0, 0, 1), (0, 0, -1), (0, 1, 0)], "only spins: the position never changes"),
    ],
)
def test_vehicles_that_climb(controls, reason):
    glider = Automaton.of_controls(GLIDER, {str(k): c for k, c in enumerate(controls)})
    assert validate(glider).reason == reason


def test_equal_twists_are_told():
    robot = Automaton.of_controls(Unicycle(), {"a": (1, 0), "b": (0, 1), "c": (1, -0.0)})
    assert validate(robot).duplicates == (("a", "c"),)


def boat(*maneuvers: tuple[str, str]) -> Automaton:
    """Trims at three speeds, a slow class of two and two others, joined by maneuvers."""
    model = UserModel(
        name="boat",
        group=SE2,
        control_names=("turn",),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, u[0]],
        dynamics=lambda z, u: [0.0],
    )
    trims = [("slow", 1, 0), ("slow turn", 1, 1), ("fast", 2, 0), ("very fast", 3, 0)]
    return Automaton(
        model,
        tuple(
            Trim(name=name, body_velocity=[v, 0, w], control=[w], reduced_state=[v])
            for name, v, w in trims
        ),
        tuple(
            Maneuver(name="", source=a, target=b, displacement=np.zeros(3), duration=1.0)
            for a, b in maneuvers
        ),
    )


def test_classes_joined_both_ways():
    report = validate(
        boat(("slow", "fast"), ("fast", "slow turn"), ("fast", "very fast"), ("very fast", "slow"))
    )
    assert report.connected
    assert report.dead_ends == report.unused == ()
    assert report.controllable


def test_a_dead_end_and_an_unused_trim():
    report = validate(boat(("slow turn", "fast")))
    assert report.components == (("slow", "slow turn"), ("fast",), ("very fast",))
    assert report.dead_ends == ("fast",)
    assert report.unused == ("very fast",)
    assert report.controllable  # within the slow class


def test_two_straights_and_what_joins_them():
    whole = boat(("slow", "fast"), ("fast", "slow"))
    straights = (whole.trims[0], whole.trims[2])
    straight = Automaton(whole.model, straights, whole.maneuvers)
    assert validate(straight).reason == "only straights: the heading never changes"
    apart = Automaton(whole.model, straights)
    assert validate(apart).reason == (
        "no trims that reach each other reach every pose; only straights: the heading never changes"
    )
    swerve = tuple(replace(m, displacement=[1.0, 0.0, 0.3]) for m in whole.maneuvers)
    assert validate(Automaton(whole.model, straights, swerve)).reason == (
        "no trim turns: the heading changes in steps only, those of maneuvers"
    )


@pytest.mark.parametrize(
    ("displacement", "reason"),
    [
        ([0.0, 0.0, 0.0], "only one circle: every trim runs along the same one"),
        (SE2.exp([0.7, 0.0, 0.7]).pose, "only one circle: every trim runs along the same one"),
        ([0.0, 0.0, 0.5], ""),  # in place: the center moves
        ([0.5, 0.0, 0.0], ""),
    ],
)
def test_one_turning_trim_and_a_maneuver_back_to_it(displacement, reason):
    turn = Trim(name="turn", body_velocity=[1, 0, 1], control=[1], reduced_state=[1.0])
    back = Maneuver(
        name="hop", source="turn", target="turn", displacement=displacement, duration=1.0
    )
    assert validate(Automaton(boat().model, (turn,), (back,))).reason == reason


def test_two_trims_about_one_center_joined_by_maneuvers():
    """Circles of 1 m and 2 m about the same point, joined by steps aside."""
    trims = tuple(
        Trim(name=name, body_velocity=[v, 0, 1], control=[1], reduced_state=[v])
        for name, v in (("inner", 1.0), ("outer", 2.0))
    )
    out, into = (
        Maneuver(name="", source=a, target=b, displacement=[0.0, y, 0.0], duration=1.0)
        for a, b, y in (("inner", "outer", -1.0), ("outer", "inner", 1.0))
    )
    report = validate(Automaton(boat().model, trims, (out, into)))
    assert report.reason == "only one circle: every trim runs along the same one"
    wide = replace(out, displacement=[0.0, -1.5, 0.0])
    assert validate(Automaton(boat().model, trims, (wide, into))).controllable


def test_libraries_of_vehicles_with_inertia():
    car = CAR
    whole = Automaton.of_model(car, {"speed": [-1.0, 0.0, 1.0], "steering": [-0.5, 0.0, 0.5]})
    report = validate(whole)
    assert report.connected
    assert report.controllable
    straight = Automaton.of_model(car, {"speed": [-1.0, 0.0, 1.0], "steering": [0.0]})
    assert validate(straight).reason == "only straights: the heading never changes"
    robot = SecondOrderUnicycle(
        max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
    )
    spins = Automaton.of_model(robot, {"speed": [0.0], "turn_rate": [-1.0, 0.0, 1.0]})
    assert validate(spins).reason == "only spins: the position never changes"
    trims_alone = Automaton(car, whole.trims)
    assert not validate(trims_alone).controllable  # every state is a class of its own


def test_a_helicopter_that_can_turn_climb_and_sink():
    grid = {"speed": [0.0, 5.0], "turn_rate": [0.0, 0.5], "climb": [-1.0, 0.0, 1.0]}
    trims = Automaton.of_model(HELICOPTER, grid).trims
    joined = tuple(
        Maneuver(name="", source=a.name, target=b.name, displacement=np.zeros(4), duration=1.0)
        for a, b in zip(trims, (*trims[1:], trims[0]), strict=True)
    )
    assert validate(Automaton(HELICOPTER, trims, joined)).controllable
    level = [trim for trim in trims if trim.body_velocity[3] >= 0.0]
    kept = tuple(
        Maneuver(name="", source=a.name, target=b.name, displacement=np.zeros(4), duration=1.0)
        for a, b in zip(level, (*level[1:], level[0]), strict=True)
    )
    assert validate(Automaton(HELICOPTER, tuple(level), kept)).reason == (
        "only climbing and level trims: the height never falls"
    )


@pytest.mark.slow
def test_forty_thousand_trims():
    axis = np.linspace(-1.0, 1.0, 200)
    report = validate(Automaton.of_grid(Unicycle(), [axis, axis]))
    assert report.controllable
    assert len(report.components[0]) == 40_000
