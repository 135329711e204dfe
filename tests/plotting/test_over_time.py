from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.colors import track_colors
from maneuver_automaton.plotting.over_time import draw_over_time
from maneuver_automaton.plotting.track import Track, step_curves, track_of_plan
from maneuver_automaton.primitives import Trim
from tests.plotting.cases import plan_of


def drawn(ax, plan, k, label="speed [m/s]"):
    track = track_of_plan(plan)
    colors = track_colors(track.twists)
    return draw_over_time(ax, track, step_curves(track, k), label=label, colors=colors)


def test_controls_are_steps_between_the_switching_times():
    plan = plan_of(["spin", "straight"], [1.0, 2.0], start_time=10.0)
    axes = Figure().subplots(2, 1)
    speed, turn = (drawn(ax, plan, k) for k, ax in enumerate(axes))
    assert np.array(speed["steps"].get_segments()).tolist() == [
        [[10, 0], [11, 0]], [[11, 1.5], [13, 1.5]],
    ]  # fmt: skip
    assert np.array(turn["steps"].get_segments()).tolist() == [
        [[10, 1], [11, 1]], [[11, 0], [13, 0]],
    ]  # fmt: skip
    np.testing.assert_array_equal(speed["jumps"].get_segments(), [[[11, 0], [11, 1.5]]])
    assert [line[0][0] for line in speed["switches"].get_segments()] == [10.0, 11.0, 13.0]
    assert (axes[0].get_ylabel(), axes[0].get_xlabel()) == ("speed [m/s]", "time [s]")


def test_values_that_hardly_vary_are_a_line_above_zero_without_an_offset():
    axes = Figure().subplots(2, 1)
    ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[2.99999, 1e6 + 3.0])
    for k, ax in enumerate(axes):
        drawn(ax, Plan(np.zeros(3), (ahead,), durations=[1.0]), k)
    axes[0].figure.canvas.draw()
    for ax in axes:
        assert ax.yaxis.get_offset_text().get_text() == ""
        assert ax.get_ylim()[0] < 0.0


def test_so_many_switches_that_lines_would_hide_the_steps_have_none():
    axes = Figure().subplots(2, 1)
    few = drawn(axes[0], plan_of(["straight", "spin"] * 5, [0.1] * 10), 0)
    many = drawn(axes[1], plan_of(["straight", "spin"] * 20, [0.1] * 40), 0)
    assert len(few["switches"].get_segments()) == 11
    assert len(many["switches"].get_segments()) == 0
    assert many["jumps"].get_linewidths()[0] < few["jumps"].get_linewidths()[0]


def test_a_label_longer_than_its_axes_is_in_lines():
    column = Figure(figsize=(4.0, 5.0)).subplots(4, 1)
    label = "angular acceleration [rad/s\u00b2]"
    draw_over_time(column[0], Track(np.zeros(3), ()), [], label=label, colors={})
    assert "\n" in column[0].get_ylabel()
