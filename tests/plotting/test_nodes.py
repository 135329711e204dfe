from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from maneuver_automaton.plotting.searches import draw_nodes

NODES = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 1.0], [3.0, 1.0, -2.0]])


def test_a_tick_per_node_points_where_it_heads():
    ax = Figure().add_subplot()
    ticks = draw_nodes(ax, NODES)
    np.testing.assert_array_equal(ticks.get_offsets(), NODES[:, :2])
    np.testing.assert_allclose(np.arctan2(ticks.V, ticks.U), NODES[:, 2])
    assert ticks.get_array() is None
    assert not np.isfinite(ax.dataLim.get_points()).all()  # the limits are those of the plan


def test_costs_are_colours():
    ax = Figure().add_subplot()
    ticks = draw_nodes(ax, NODES, cost=[0.0, 2.0, 5.0])
    assert ticks.get_clim() == (0.0, 5.0)
    FigureCanvasAgg(ax.figure).draw()
    assert len(np.unique(ticks.get_facecolor(), axis=0)) == 3


def test_no_node_is_no_tick():
    ax = Figure().add_subplot()
    draw_nodes(ax, np.zeros((0, 3)), cost=np.zeros(0))
    FigureCanvasAgg(ax.figure).draw()


def test_wrong_input_is_named():
    ax = Figure().add_subplot()
    with pytest.raises(ValueError, match=r"nodes: got shape \(3,\), need \(n, 3\)"):
        draw_nodes(ax, NODES[0])
    with pytest.raises(ValueError, match=r"nodes: got \(2,\) costs for 3 nodes"):
        draw_nodes(ax, NODES, cost=[1.0, 2.0])
