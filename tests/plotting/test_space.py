from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import art3d

from maneuver_automaton.automaton.stock import load_stock_library
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Polygon
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.plotting import draw_space, flies_among_heights, save_space_figure
from maneuver_automaton.plotting.space import RIM
from maneuver_automaton.problem import Problem
from tests.plotting.cases import NO_ERROR, assert_picture, flight_plan, parking_plan, result_of

TOWN = (
    Obstacle(Box([4.0, 3.0], [10.0, 4.0], 0.3), height=(0.0, 9.0)),
    Obstacle(Disc(2.0, [18.0, -4.0]), height=(2.0, 5.0)),
    Obstacle(Polygon([[25.0, 0.0], [30.0, 0.0], [30.0, 5.0], [28.0, 1.0]])),
    Obstacle(Box([1.0, 1.0]), height=(0.0, 3.0), motion=Motion([0.0, 1.0], np.ones((2, 3)))),
)


def flight(obstacles=TOWN, plan=None):
    craft = load_stock_library("helicopter")
    plan = flight_plan() if plan is None else plan
    problem = Problem(craft, plan.start, plan.end, obstacles=obstacles)
    return PlanResult(
        problem=problem, status=PlanStatus.FOUND, reason="", plan=plan, goal_index=0, cost=12.0,
        terminal_error=NO_ERROR, clearance_m=0.5,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("obstacles", [TOWN, TOWN[:1], ()], ids=["town", "one", "none"])
def test_flights_are_written(obstacles, tmp_path):
    save_space_figure(flight(obstacles), tmp_path / "plan_3d.png")
    assert_picture(tmp_path / "plan_3d.png")


def test_what_memory_held_is_no_corner(monkeypatch, tmp_path):
    """Roofs have more corners than walls, and memory that nobody wrote may hold any number."""
    held = {**vars(np), "empty": lambda shape: np.resize([-1e308, 1e308], shape)}
    monkeypatch.setattr(art3d, "np", SimpleNamespace(**held))
    save_space_figure(flight(), tmp_path / "plan_3d.png")


def test_a_flight_without_a_plan_is_written(tmp_path):
    none = dataclasses.replace(
        flight(), plan=None, goal_index=None, cost=None, terminal_error=None,
        status=PlanStatus.OUT_OF_BUDGET, reason="no plan within 5 s",
    )  # fmt: skip
    save_space_figure(none, tmp_path / "plan_3d.png")
    assert_picture(tmp_path / "plan_3d.png")


def test_space_is_drawn_to_scale_with_every_wall_and_stroke():
    figure = Figure()
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    artists = draw_space(ax, flight(TOWN[:1]))
    figure.canvas.draw()
    low, high = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()]).T
    scale = np.asarray(ax._box_aspect) / (high - low)
    assert np.ptp(scale) < 1e-9 * scale.max()
    assert set(np.atleast_1d(artists.faces.get_linewidths())) == {RIM}  # no width follows a face
    assert len(artists.ends) == 2
    assert [float(mark.get_data_3d()[2][0]) for mark in artists.ends] == [0.0, 2.5]


def test_only_flights_among_heights_need_space():
    assert flies_among_heights(flight().problem)
    assert not flies_among_heights(flight(TOWN[2:3]).problem)
    assert not flies_among_heights(result_of(parking_plan()).problem)
    with pytest.raises(ValueError) as error:
        save_space_figure(result_of(parking_plan()), "plan_3d.png")
    assert str(error.value) == "a picture in space: the unicycle has no altitude"
