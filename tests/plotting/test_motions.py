from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from maneuver_automaton.plotting import draw_plane
from maneuver_automaton.plotting.colors import MOST_TRIMS, motion_names, track_colors, twist_color
from tests.plotting.cases import plan_of_trims

GRID = {
    f"{v:.1f}, {w:.1f}": np.array([v, 0.0, w])
    for v in np.linspace(-1.0, 1.0, 9)
    for w in np.linspace(-1.0, 1.0, 9)
}


def test_many_trims_are_named_by_how_they_move_each_motion_once():
    names = motion_names(GRID, many=True)
    assert len(names) == 9  # ahead and back, straight and to each side; turns on the spot; rest
    assert "ahead, turning left, 0.25 (pale) to 1 m/s" in names
    assert "turn right on the spot, 0.25 (pale) to 1 rad/s" in names
    assert names["rest"] == "0.0, 0.0"


def test_of_those_that_move_alike_the_faster_is_darker():
    colors = track_colors(GRID)
    shades = [sum(colors[f"{v:.1f}, 0.0"]) for v in (0.2, 0.5, 0.8, 1.0)]
    assert (np.diff(shades) < 0.0).all()


def test_the_legend_of_a_long_plan_is_short_and_has_no_name_twice():
    ax = Figure().add_subplot()
    draw_plane(ax, plan_of_trims(3 * MOST_TRIMS))
    legend = ax.get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["ahead, turning left, 1 m/s", "start", "goal"]


def test_a_platform_that_goes_any_way_is_named_by_eight_directions():
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ways = {f"{a:.2f}": np.array([np.cos(a), np.sin(a), 0.0]) for a in angles}
    names = list(motion_names(ways, many=True))
    assert len(names) == 8
    assert names[:2] == ["ahead, 1 m/s", "ahead and to the left, 1 m/s"]
    assert len({track_colors(ways)[name] for name in ways}) == 8


def test_a_step_aside_is_told_from_one_ahead():
    colors = np.array(
        [twist_color(np.array([*v, 0.0])) for v in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    )
    gaps = np.linalg.norm(colors[:, None] - colors, axis=-1)[np.triu_indices(4, 1)]
    assert gaps.min() > 0.2
