from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.models import Unicycle
from maneuver_automaton.optimal_control import (
    OptimalControlSolution,
    SolveStatus,
    UniformEffortExample,
)
from maneuver_automaton.optimal_control.uniform_effort import quadratic_effort
from maneuver_automaton.plotting import (
    draw_efforts,
    draw_node_efforts,
    save_retiming_figure,
    save_uniform_effort_figure,
)
from maneuver_automaton.plotting.effort import (
    draw_accumulated,
    draw_example_controls,
    draw_example_states,
    draw_paces,
    draw_spreads,
)
from maneuver_automaton.refinement.retiming import retime
from tests.plotting.cases import assert_picture, parking_plan, plan_of


def example_of(nodes, *, between=False):
    """Something like a solution of the example, without a solver: spoilt at its ends."""
    time = np.linspace(0.0, 50.0, nodes)
    count = nodes - 1 if between else nodes
    control = np.column_stack([0.03 * np.cos(np.linspace(0, 3, count)), np.full(count, 0.05)])
    control[0] *= 1.2
    effort = quadratic_effort((), control.T)
    total = np.interp(time, np.linspace(0, 50, count), np.cumsum(effort) * 50 / count)
    solution = OptimalControlSolution(
        status=SolveStatus.SOLVED,
        reason="",
        time=time,
        state=np.outer(1.0 - time / 50.0, [0.1, 1.0, 0.8]),
        control=control,
        cost=total[-1] * 2,
        integrals={"cost": 2 * total, "effort": total},
        iterations=3,
        build_s=0.1,
        solve_s=0.1,
        worst_defect=0.0,
        worst_violation=0.0,
    )
    return UniformEffortExample(
        solution=solution,
        cost=0.5,
        smoothing_error=0.0,
        effort=effort,
        spread=np.ptp(effort),
        inner_spread=np.ptp(effort[2:-2]),
    )


EXAMPLES = [example_of(n) for n in (50, 200, 1000)]


def legend_of(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_the_two_nodes_at_each_end_are_marked():
    ax = Figure().add_subplot()
    rings = draw_node_efforts(ax, EXAMPLES)
    for example, ring in zip(EXAMPLES, rings, strict=True):
        ends = [0, 1, -2, -1]
        expected = np.column_stack([example.solution.time[ends], example.effort[ends]])
        np.testing.assert_allclose(ring.get_offsets(), expected)
    for example, line in zip(EXAMPLES, ax.lines, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), example.effort[2:-2])
    assert legend_of(ax) == ["50 nodes", "200 nodes", "1000 nodes", "two nodes at each end"]


def test_controls_between_nodes_are_drawn_in_the_middle():
    ax = Figure().add_subplot()
    speed, turn_rate = draw_example_controls(ax, example_of(51, between=True))
    assert speed.get_xdata()[0] == 0.5
    assert len(turn_rate.get_xdata()) == 50


def test_the_effort_is_compared_with_a_straight_line():
    ax = Figure().add_subplot()
    cost, effort, straight = draw_accumulated(ax, EXAMPLES[0])
    np.testing.assert_array_equal(cost.get_ydata(), EXAMPLES[0].accumulated_cost)
    np.testing.assert_array_equal(straight.get_ydata(), effort.get_ydata()[[0, -1]])
    assert legend_of(ax) == ["x4, cost", "x5, effort", "straight line"]


def test_states_have_their_units():
    ax = Figure().add_subplot()
    assert len(draw_example_states(ax, EXAMPLES[0])) == 3
    assert legend_of(ax) == ["x1 [m]", "x2 [m]", "x3 [rad]"]


def test_spreads_are_in_percent_and_in_order():
    ax = Figure().add_subplot()
    every, inner = draw_spreads(ax, EXAMPLES[::-1])
    np.testing.assert_array_equal(every.get_xdata(), [50, 200, 1000])
    np.testing.assert_allclose(every.get_ydata(), [100.0 * e.spread for e in EXAMPLES])
    assert (np.array(inner.get_ydata()) < every.get_ydata()).all()


def test_the_figure_of_the_example_is_written(tmp_path):
    save_uniform_effort_figure(EXAMPLES, tmp_path / "effort.png")
    assert_picture(tmp_path / "effort.png")
    with pytest.raises(ValueError, match="got no example, need at least one"):
        save_uniform_effort_figure([], tmp_path / "none.png")


def test_efforts_are_steps_before_and_after():
    retiming = retime(plan_of(["straight", "spin", "rest"], [2.0, 1.0, 1.0]), Unicycle())
    ax = Figure().add_subplot()
    before, after = draw_efforts(ax, retiming)
    np.testing.assert_allclose(
        before.get_segments()[0],
        [[0, 2.25], [2, 2.25], [2, 1.0], [3, 1.0], [3, 0], [4, 0]],
    )
    np.testing.assert_allclose(after.get_segments()[0], [[0, 1], [3, 1], [3, 1], [4, 1]])
    assert legend_of(ax) == ["before", "after", "uniform, without limits"]
    low, high = ax.get_ylim()
    assert low < 0.0
    assert high > 2.25


def test_both_plans_stand_on_the_path_at_equal_times():
    retiming = retime(plan_of(["straight", "spin", "rest"], [2.0, 1.0, 1.0]), Unicycle())
    before, after = draw_paces(Figure().add_subplot(), retiming)
    for dots, plan in ((before, retiming.before), (after, retiming.after)):
        poses = plan.pose_at(np.linspace(0.0, 4.0, 25))
        np.testing.assert_allclose(dots.get_xydata(), poses[:, :2], atol=1e-12)


def test_the_figure_of_a_retiming_is_written(tmp_path):
    retiming = retime(parking_plan(), Unicycle())
    labels = ["speed [m/s]", "turn rate [rad/s]"]
    save_retiming_figure(retiming, tmp_path / "retiming.png", labels=labels)
    assert_picture(tmp_path / "retiming.png")
    with pytest.raises(ValueError, match="got 1 labels for 2 controls"):
        save_retiming_figure(retiming, tmp_path / "none.png", labels=["speed"])
    with pytest.raises(ValueError, match="the plan has no trim"):
        save_retiming_figure(retime(plan_of([], []), Unicycle()), tmp_path / "none.png")
