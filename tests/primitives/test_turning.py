"""Turns between headings, against an ODE solver and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import translations
from maneuver_automaton.models import UserModel

CURRENT = np.array([0.3, -0.2])


def river(**limits):
    return UserModel(
        name="boat",
        group=translations(2),
        control_names=("speed", "turn_rate"),
        reduced_names=("heading",),
        velocity=lambda z, u: [
            u[0] * np.cos(z[0]) + CURRENT[0],
            u[0] * np.sin(z[0]) + CURRENT[1],
        ],
        dynamics=lambda z, u: [u[1]],
        **limits,
    )


LIMITED = river(control_limits=np.array([[0.0, 1.0], [-0.8, 0.5]]))
GRID = {"heading": np.pi / 2 * np.arange(4), "speed": [1.0, 0.5]}


def test_a_turn_ends_where_a_solver_says():
    boat = Automaton.of_model(LIMITED, GRID)
    assert len(boat.maneuvers) == 16
    for maneuver in boat.maneuvers:
        source = boat[maneuver.source]
        heading, (speed, _) = boat.model.heading(source.reduced_state), source.control
        rate = maneuver.course.control[0, 1]

        def motion(time, _, heading=heading, rate=rate, speed=speed):
            angle = heading + rate * time
            return [speed * np.cos(angle) + CURRENT[0], speed * np.sin(angle) + CURRENT[1]]

        end = solve_ivp(motion, (0.0, maneuver.duration), [0.0, 0.0], rtol=1e-11, atol=1e-12)
        cos, sin = np.cos(heading), np.sin(heading)
        x, y = end.y[:, -1]
        seen = [cos * x + sin * y, cos * y - sin * x, rate * maneuver.duration]
        np.testing.assert_allclose(maneuver.displacement, seen, atol=1e-9)
        target = boat.model.heading(boat[maneuver.target].reduced_state)
        assert np.remainder(heading + seen[2] - target + 1.0, 2 * np.pi) == pytest.approx(1.0)
        assert boat[maneuver.target].control[0] == speed


def test_turns_take_the_shorter_side_and_half_a_turn_both():
    every = Automaton.of_model(LIMITED, GRID, pairs="all")
    turns = np.array([maneuver.displacement[2] for maneuver in every.maneuvers])
    assert len(turns) == 2 * 4 * 4
    assert np.abs(turns).max() == pytest.approx(np.pi)
    assert (turns > 0.0).sum() == (turns < 0.0).sum()
    some = Automaton.of_model(LIMITED, GRID, pairs=[(0, 2)])
    assert [maneuver.target for maneuver in some.maneuvers] == [some.trim_names[2]]


def test_two_headings_are_joined_once_each_way():
    boat = Automaton.of_model(LIMITED, {"heading": [0.0, 1.0], "speed": [1.0]})
    assert [round(float(m.displacement[2]), 9) for m in boat.maneuvers] == [1.0, -1.0]


def test_without_a_limit_or_a_second_heading_there_are_no_turns():
    assert not Automaton.of_model(river(), GRID).maneuvers
    assert not Automaton.of_model(LIMITED, {"heading": [1.0], "speed": [1.0, 0.5]}).maneuvers
