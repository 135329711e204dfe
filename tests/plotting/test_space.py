from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import art3d

from maneuver_automaton.planning import PlanStatus
from maneuver_automaton.plotting import flies_among_heights, save_picture
from maneuver_automaton.plotting.cast import cast_of
from maneuver_automaton.plotting.space import RIM, draw_space
from maneuver_automaton.recording import recording_of
from tests.plotting.cases import TOWN, assert_picture, flight, parking_plan, result_of


def test_what_memory_held_is_no_corner(monkeypatch, tmp_path):
    """Roofs have more corners than walls, and memory that nobody wrote may hold any number."""
    held = {**vars(np), "empty": lambda shape: np.resize([-1e308, 1e308], shape)}
    monkeypatch.setattr(art3d, "np", SimpleNamespace(**held))
    save_picture(flight(), tmp_path / "plan_3d.png", view="space")


def test_a_flight_without_a_plan_is_written(tmp_path):
    none = dataclasses.replace(
        flight(), plan=None, goal_index=None, cost=None, terminal_error=None,
        status=PlanStatus.OUT_OF_BUDGET, reason="no plan within 5 s",
    )  # fmt: skip
    save_picture(none, tmp_path / "plan_3d.png", view="space")
    assert_picture(tmp_path / "plan_3d.png")


def test_space_is_drawn_to_scale_with_every_wall_and_stroke():
    figure = Figure()
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    faces = draw_space(ax, cast_of(recording_of(flight(TOWN[:1]))))
    figure.canvas.draw()
    low, high = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()]).T
    scale = np.asarray(ax._box_aspect) / (high - low)
    assert np.ptp(scale) < 1e-9 * scale.max()
    assert set(np.atleast_1d(faces.get_linewidths())) == {RIM}  # no width follows a face
    assert [float(mark.get_data_3d()[2][0]) for mark in ax.lines] == [0.0, 2.5]


def test_only_flights_among_heights_need_space():
    assert flies_among_heights(flight())
    assert not flies_among_heights(flight(TOWN[2:3]))
    assert not flies_among_heights(result_of(parking_plan()))
    with pytest.raises(ValueError) as error:
        save_picture(result_of(parking_plan()), "plan_3d.png", view="space")
    assert str(error.value) == "a picture in space: the unicycle has no altitude"
