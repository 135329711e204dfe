from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.analysis import FeasibleSet
from maneuver_automaton.plotting import draw_feasible_slice, save_feasible_figure
from maneuver_automaton.plotting.feasible import level_times, start_slice
from maneuver_automaton.problem import Goal
from tests.plotting.cases import assert_picture
from tests.plotting.loops import parking


def cone(*, headings=(0.0, 1.5), within=2.0, exhaustive=True, goal=(0.0, 0.0, 0.0)):
    """Least times that are the distance from the origin, inf on the right of the first slice."""
    x, y = np.linspace(-3.0, 3.0, 25), np.linspace(-2.0, 2.0, 17)
    times = np.broadcast_to(np.hypot(x, y[:, None]), (len(headings), 17, 25)).copy()
    times[0, :, x > 1.0] = np.inf
    return FeasibleSet(
        problem=parking(goal),
        within=within,
        x=x,
        y=y,
        headings=np.array(headings),
        times=times,
        exhaustive=exhaustive,
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_picture(count, tmp_path):
    found = cone(headings=np.linspace(0.0, 5.0, count), exhaustive=count > 1)
    save_feasible_figure(found, tmp_path / "set.png")
    assert_picture(tmp_path / "set.png")


def test_the_edge_is_where_the_time_is_up():
    artists = draw_feasible_slice(Figure().add_subplot(), cone(within=1.5), 1)
    assert artists.edge is not None
    corners = np.concatenate([path.vertices for path in artists.edge.get_paths()])
    assert np.allclose(np.hypot(*corners.T), 1.5, atol=0.02)
    assert artists.levels is not None
    assert np.allclose(artists.levels.levels, [0.25, 0.5, 0.75, 1.0, 1.25])


def test_the_edge_closes_where_there_is_no_plan():
    artists = draw_feasible_slice(Figure().add_subplot(), cone(within=1.5), 0)
    assert artists.edge is not None
    corners = np.concatenate([path.vertices for path in artists.edge.get_paths()])
    assert 1.0 <= corners[:, 0].max() <= 1.25


def test_cells_outside_are_left_out():
    found = cone()
    cells = draw_feasible_slice(Figure().add_subplot(), found, 0).cells.get_array()
    assert cells.count() == np.count_nonzero(found.feasible[0])


@pytest.mark.parametrize("within", [0.1, 50.0])
def test_all_or_hardly_any_within_the_time(within, tmp_path):
    found = dataclasses.replace(cone(within=within), times=cone().times + 0.2)
    save_feasible_figure(found, tmp_path / "set.png")
    assert_picture(tmp_path / "set.png")


def test_the_start_is_in_the_slice_of_its_heading():
    found = cone(headings=(2.0, 2.0 * np.pi + 0.1))
    assert start_slice(found) == 1
    left, right = Figure().subplots(1, 2)
    assert draw_feasible_slice(left, found, 0).start is None
    drawn = draw_feasible_slice(right, found, 1)
    assert drawn.start is not None
    assert drawn.start.get_offsets().tolist() == [[0.0, 1.0]]
    assert right.get_aspect() == 1.0


def test_a_goal_of_any_heading_has_no_arrow():
    found = cone(headings=(2.0,), goal=Goal(pose=(0.0, 0.0, 0.0), free_heading=True))
    drawn = draw_feasible_slice(Figure().add_subplot(), found, 0)
    assert drawn.headings is None
    assert len(drawn.goals) == 1


def test_level_lines_are_round_and_below_the_limit():
    assert np.allclose(level_times(cone(within=8.0)), [1.5, 3.0, 4.5, 6.0])


def test_wrong_slices_are_named():
    with pytest.raises(ValueError) as error:
        draw_feasible_slice(Figure().add_subplot(), cone(), 2)
    assert str(error.value) == "feasible set: got slice 2, need one from 0 to 1"
    found = cone()
    line = dataclasses.replace(found, x=found.x[:1], times=found.times[..., :1])
    with pytest.raises(ValueError) as error:
        draw_feasible_slice(Figure().add_subplot(), line, 0)
    assert str(error.value) == "feasible set: got a grid of 1 by 17, need at least 2 by 2"
