"""What an automaton can do, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Car, Unicycle, UserModel
from maneuver_automaton.primitives import Maneuver, Trim

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


def test_no_class_reaches_every_pose_by_itself():
    whole = boat(("slow", "fast"), ("fast", "slow"))
    straight = Automaton(whole.model, (whole.trims[0], whole.trims[2]), whole.maneuvers)
    assert validate(straight).reason == (
        "no class of trims reaches every pose by itself; only straights: the heading never changes"
    )


def test_forty_thousand_trims():
    axis = np.linspace(-1.0, 1.0, 200)
    report = validate(Automaton.of_grid(Unicycle(), [axis, axis]))
    assert report.controllable
    assert len(report.components[0]) == 40_000
