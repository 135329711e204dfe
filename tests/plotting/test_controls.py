from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting import draw_controls
from maneuver_automaton.plotting.controls import draw_over_time
from maneuver_automaton.plotting.track import Track
from maneuver_automaton.primitives import Trim
from tests.plotting.cases import parking_plan, plan_of


def test_controls_are_steps_between_the_switching_times():
    plan = plan_of(["spin", "straight"], [1.0, 2.0], start_time=10.0)
    speed, turn_rate = Figure().subplots(2, 1)
    drawn = draw_controls([speed, turn_rate], plan, labels=["speed [m/s]", "turn rate [rad/s]"])
    steps = [np.array(artists.steps.get_segments()) for artists in drawn]
    np.testing.assert_array_equal(steps[0], [[[10, 0], [11, 0]], [[11, 1.5], [13, 1.5]]])
    np.testing.assert_array_equal(steps[1], [[[10, 1], [11, 1]], [[11, 0], [13, 0]]])
    np.testing.assert_array_equal(drawn[0].jumps.get_segments(), [[[11, 0], [11, 1.5]]])
    times = [line[0][0] for line in drawn[0].switches.get_segments()]
    assert times == [10.0, 11.0, 13.0]
    assert speed.get_ylabel() == "speed [m/s]"
    assert turn_rate.get_xlabel() == "time [s]"


def test_axes_and_labels_must_match_the_controls():
    with pytest.raises(ValueError, match="got 3 axes and 0 labels, need 1 or 2 axes"):
        draw_controls(Figure().subplots(3, 1), parking_plan())
    with pytest.raises(ValueError, match="1 labels"):
        draw_controls(Figure().subplots(2, 1), parking_plan(), labels=["speed"])


def test_values_that_hardly_vary_are_a_line_above_zero_without_an_offset():
    axes = Figure().subplots(2, 1)
    ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[2.99999, 1e6 + 3.0])
    draw_controls(axes, Plan(np.zeros(3), (ahead,), durations=[1.0]))
    axes[0].figure.canvas.draw()
    for ax in axes:
        assert ax.yaxis.get_offset_text().get_text() == ""
        assert ax.get_ylim()[0] < 0.0


def test_so_many_switches_that_lines_would_hide_the_steps_have_none():
    axes = Figure().subplots(2, 1)
    few, _ = draw_controls(axes, plan_of(["straight", "spin"] * 5, [0.1] * 10))
    many, _ = draw_controls(axes, plan_of(["straight", "spin"] * 20, [0.1] * 40))
    assert len(few.switches.get_segments()) == 11
    assert len(many.switches.get_segments()) == 0
    assert many.jumps.get_linewidths()[0] < few.jumps.get_linewidths()[0]


def test_a_label_longer_than_its_axes_is_in_lines():
    column = Figure(figsize=(4.0, 5.0)).subplots(4, 1)
    label = "angular acceleration [rad/s²]"
    draw_over_time(column[0], Track(np.zeros(3), ()), [], label=label, colors={})
    assert "\n" in column[0].get_ylabel()


def test_one_axes_takes_all_controls_in_different_styles():
    ax = Figure().add_subplot()
    drawn = draw_controls(ax, parking_plan(), labels=["speed", "turn rate"])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["speed", "turn rate"]
    ax.figure.canvas.draw()
    legend, inner = ax.get_legend().get_window_extent(), ax.get_window_extent()
    assert legend.x0 >= inner.x1  # beside the curves, and within the page
    assert legend.x1 <= ax.figure.bbox.x1
    dashes = [str(artists.steps.get_linestyle()[0]) for artists in drawn]
    assert dashes[0] != dashes[1]
    low, high = ax.get_ylim()
    assert low < -0.25
    assert high > 1.5
