"""How a library covers the poses around it, on lattices that can be counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.analysis import (
    CoverageSettings,
    ReachSettings,
    dispersion,
    reached,
    settings_for,
    stretch_factor,
)
from maneuver_automaton.analysis.coverage import straight_costs
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.formats.lattice import Lattice, Move, automaton_of_lattice
from maneuver_automaton.models import SecondOrderUnicycle, Unicycle
from maneuver_automaton.primitives import Maneuver, Trim

QUARTER = np.pi / 2
HEADINGS = [k * QUARTER for k in range(4)]


def manhattan():
    """One cell ahead from each of four headings, and quarter turns on the spot."""
    moves = []
    for k, angle in enumerate(HEADINGS):
        ahead = [round(np.cos(angle)), round(np.sin(angle)), angle]
        moves.append(Move(start=k, end=k, poses=[[0, 0, angle], ahead]))
        moves += [
            Move(start=k, end=(k + turn) % 4, poses=[[0, 0, angle], [0, 0, angle + turn * QUARTER]])
            for turn in (1, -1)
        ]
    return automaton_of_lattice(Lattice(resolution=1.0, headings=HEADINGS, moves=tuple(moves)))


def reach(most, **changes):
    return ReachSettings(
        **{"measure": "time", "most": most, "same_m": 0.1, "same_rad": 0.1} | changes
    )


def test_poses_of_a_lattice_are_counted_with_their_costs():
    found = reached(manhattan(), settings=reach(1.0))
    assert found.costs.tolist() == [0.0, 1.0]
    found = reached(manhattan(), settings=reach(QUARTER + 1.0))
    assert found.complete
    assert len(found.costs) == 9  # here, 1 or 2 ahead; turned; turned and 1 ahead; 1 ahead, turned
    assert max(found.costs) == pytest.approx(QUARTER + 1.0)


def test_costs_are_the_least():
    automaton = manhattan()
    found = reached(automaton, settings=reach(6.0))
    for pose, cost in zip(found.poses, found.costs, strict=True):
        x, y = np.round(np.abs(pose[:2]))
        assert cost >= x + y - 1e-9
    there = np.flatnonzero(np.abs(found.poses[:, :2] - [2.0, 1.0]).max(axis=1) < 1e-9)
    assert found.costs[there].min() == pytest.approx(3.0 + QUARTER)


def test_steps_without_cost_are_free():
    found = reached(manhattan(), settings=reach(1.0, measure="length"))
    assert found.costs.max() == 1.0
    assert len(found.costs) == 4 + 4 * 4  # here, and each neighbour, with every heading


def test_a_search_that_is_cut_says_so():
    found = reached(manhattan(), settings=reach(20.0, most_nodes=50))
    assert not found.complete


def test_dispersion_of_a_fine_lattice_is_half_a_diagonal():
    settings = CoverageSettings(radius=2.0, samples=4000, reach=reach(14.0))
    found = dispersion(manhattan(), settings=settings)
    half = np.sqrt(0.5**2 + 0.5**2 + (QUARTER / 2) ** 2)
    assert 0.9 * half < found.largest <= half + 1e-9
    again = dispersion(manhattan(), settings=settings)
    assert again.largest == found.largest


def test_dispersion_moves_with_the_problem():
    """Another trim at the origin is another lattice, turned: with all headings it is the same."""
    settings = CoverageSettings(radius=2.0, samples=500, reach=reach(14.0))
    found = [dispersion(manhattan(), start=f"heading {k}", settings=settings) for k in (0, 1)]
    assert found[0].largest == pytest.approx(found[1].largest, abs=1e-9)


def test_the_stretch_factor_of_manhattan():
    """Turns cost nothing by length, so ways are |x| + |y|: at most sqrt 2 of the straight line."""
    settings = CoverageSettings(radius=3.0, pairs=400, reach=reach(6.0, measure="length"))
    found = stretch_factor(manhattan(), settings=settings)
    assert found.largest == pytest.approx(np.sqrt(2.0))
    assert abs(found.pose[0]) == pytest.approx(abs(found.pose[1]))
    assert abs(found.pose[2]) <= np.pi


def test_no_library_is_below_its_straight_line():
    robot = Automaton.of_controls(
        Unicycle(), {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    )  # fmt: skip
    settings = CoverageSettings(radius=1.5, pairs=5, reach=reach(2.0, edge_cost=0.5))
    found = stretch_factor(robot, settings=settings)
    assert found.largest >= 1.0


def test_a_vehicle_with_inertia_counts_words_that_end_at_rest():
    model = SecondOrderUnicycle(
        max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
    )
    robot = Automaton.of_model(model, {"speed": [0.0, 1.0], "turn_rate": [0.0]})
    found = reached(robot, settings=reach(3.0, edge_cost=0.5))
    rest = robot.trim_classes[robot.rest]
    ends = np.sort(found.poses[found.classes == rest, 0])
    np.testing.assert_allclose(ends, [0.0, 1.0, 1.5, 2.0], atol=1e-9)


def test_settings_fit_the_library():
    assert settings_for(manhattan()).reach.same_m == 0.25
    assert settings_for(manhattan()).radius == 2.0


def test_what_cannot_be_measured():
    rest = Automaton.of_controls(Unicycle(), {"rest": (0, 0)})
    with pytest.raises(ValueError, match="no word of at most 8 ends within 2 m"):
        stretch_factor(rest)
    with pytest.raises(ValueError, match="measure must be one of time, length, got 'fuel'"):
        ReachSettings(measure="fuel")
    with pytest.raises(ValueError, match="most must be positive"):
        ReachSettings(most=0.0)
    with pytest.raises(ValueError, match="radius must be positive"):
        CoverageSettings(radius=-1.0)


def test_the_straight_line_knows_the_speed_of_maneuvers():
    trim = Trim(name="rest", body_velocity=np.zeros(3), control=np.zeros(2))
    hop = Maneuver(
        name="hop", source="rest", target="rest", displacement=[2.0, 0.0, 0.5], duration=1.0
    )
    poses = np.array([[4.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0 * np.pi]])
    least = straight_costs(Automaton(Unicycle(), (trim,), (hop,)), poses)
    np.testing.assert_allclose(least, [2.0, 2.0, 0.0], atol=1e-15)
