from __future__ import annotations

from itertools import permutations

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import SecondOrderUnicycle, Unicycle
from maneuver_automaton.plotting import (
    draw_automaton,
    draw_motions,
    trim_colors,
)
from maneuver_automaton.primitives import Maneuver, Trim
from tests.plotting.cases import ROBOT

GRID = Automaton.of_grid(Unicycle(), [np.linspace(-2, 2, 9), np.linspace(-2, 2, 9)])


def with_inertia():
    speeds = (0.0, 1.0, 2.0)
    trims = tuple(
        Trim(
            name=f"speed {v:g}",
            body_velocity=np.array([v, 0.0, 0.0]),
            control=np.zeros(2),
            reduced_state=np.array([v, 0.0]),
        )
        for v in speeds
    )
    maneuvers = tuple(
        Maneuver(
            name=f"{a:g} to {b:g}",
            source=f"speed {a:g}",
            target=f"speed {b:g}",
            displacement=np.array([1.0, 0.0, 0.0]),
            duration=1.0,
        )
        for a, b in ((0.0, 1.0), (1.0, 2.0), (2.0, 1.0), (1.0, 0.0))
    )
    robot = SecondOrderUnicycle(
        max_speed=2.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
    )
    return Automaton(robot, trims, maneuvers, name="with inertia")


def test_trims_are_nodes_and_free_switches_are_lines():
    artists = draw_automaton(Figure().add_subplot(), ROBOT)
    assert [text.get_text() for text in artists["names"]] == list(ROBOT.trim_names)
    assert len(artists["nodes"].get_paths()) == 5
    assert len(artists["switches"].get_segments()) == 10
    assert artists["maneuvers"] == ()
    colors = trim_colors({trim.name: trim.body_velocity for trim in ROBOT.trims})
    assert [to_rgb(color) for color in artists["motions"].get_colors()] == list(colors.values())


def test_maneuvers_are_arrows_and_classes_do_not_switch():
    artists = draw_automaton(Figure().add_subplot(), with_inertia())
    assert len(artists["maneuvers"]) == 4
    assert len(artists["switches"].get_segments()) == 0


def test_many_trims_are_points_over_turn_rate_and_speed():
    ax = Figure().add_subplot()
    artists = draw_automaton(ax, GRID)
    assert "nodes" not in artists
    np.testing.assert_array_equal(artists["points"].get_offsets(), GRID.body_velocities[:, [2, 0]])
    assert ax.get_xlabel() == "turn rate [rad/s]"


def test_motions_last_a_second_and_are_to_scale():
    ax = Figure().add_subplot()
    segments = draw_motions(ax, ROBOT).get_segments()
    np.testing.assert_allclose(segments[1][[0, -1]], [[0.0, 0.0], [1.5, 0.0]])
    end = ROBOT["anticlockwise"].coast(_origin(), 1.0).pose
    np.testing.assert_allclose(segments[3][-1], end[:2], atol=1e-12)
    assert ax.get_aspect() == 1.0


def _origin():
    return Unicycle().group.identity()


def test_switches_and_motions_have_arrow_heads():
    ax = Figure(figsize=(4.0, 4.0)).add_subplot()
    artists = draw_automaton(ax, ROBOT)
    many = len(artists["switches"].get_segments())
    heads = [len(part.get_paths()) for part in ax.collections if isinstance(part, PolyCollection)]
    assert many == 10
    assert 2 * many in heads  # at both ends: they go either way
    ax = Figure().add_subplot()
    draw_motions(ax, ROBOT)
    heads = [len(part.get_paths()) for part in ax.collections if isinstance(part, PolyCollection)]
    assert heads[0] == 3  # of those that leave their place


def test_hundreds_of_maneuvers_are_thin_pale_lines_that_join_both_ways():
    few = with_inertia()
    trims = [
        Trim(
            name=f"speed {k}", body_velocity=[1.0 + k, 0.0, 0.0], control=np.zeros(2),
            reduced_state=[1.0 + k, 0.0],
        )
        for k in range(20)
    ]  # fmt: skip
    maneuvers = [
        Maneuver(
            name=f"{a} to {b}", source=f"speed {a}", target=f"speed {b}",
            displacement=[1.0, 0.0, 0.0], duration=1.0,
        )
        for a, b in permutations(range(20), 2)
    ]  # fmt: skip
    ax = Figure(figsize=(4.0, 4.0)).add_subplot()
    arrows = draw_automaton(ax, Automaton(few.model, tuple(trims), tuple(maneuvers)))["maneuvers"]
    assert len(arrows) == 20 * 19 // 2
    assert all(arrow.get_alpha() < 0.5 for arrow in arrows)
