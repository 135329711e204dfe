"""Draw what a search has expanded: a tick per pose, coloured by its cost."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import as_array
from maneuver_automaton.plotting.colors import GREY, INK
from maneuver_automaton.plotting.style import SMALL_PT

COLORMAP = "viridis_r"  # pale for cheap, dark for costly; made for colour-blind readers too
TICK_IN = 0.05  # [in] length of a tick


def draw_nodes(ax: Axes, nodes: ArrayLike, *, cost: ArrayLike | None = None) -> Quiver:
    """Draw expanded `nodes` on `ax`, which keeps its limits: ticks that point where each heads.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    nodes : (n, 3) array_like
        Poses [m, m, rad].
    cost : (n,) array_like, optional
        What their colours show, such as the cost to come; all are grey if left out.

    Returns
    -------
    Quiver
        The ticks; a colour bar can be made from them.

    Raises
    ------
    ValueError
        If the nodes are no poses, or the costs are not as many.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ticks = draw_nodes(Figure().add_subplot(), [[0, 0, 0], [1, 2, 0.5]], cost=[0.0, 3.0])
    >>> ticks.get_offsets().tolist(), ticks.get_clim()
    ([[0.0, 0.0], [1.0, 2.0]], (0.0, 3.0))
    """
    poses = as_array("nodes", nodes, last=3)
    if poses.ndim != 2:
        raise ValueError(f"nodes: got shape {poses.shape}, need (n, 3)")
    x, y, heading = poses.T
    ticks = Quiver(
        ax, x, y, np.cos(heading), np.sin(heading), color=[GREY], units="inches",
        scale_units="inches", scale=1.0 / TICK_IN, width=0.011, headwidth=1.0, headlength=0.0,
        headaxislength=0.0, minlength=0.0, alpha=0.8, zorder=1.5,
    )  # fmt: skip
    if cost is not None:
        costs = as_array("nodes: cost", cost)
        if costs.shape != x.shape:
            raise ValueError(f"nodes: got {costs.shape} costs for {len(x)} nodes")
        ticks.set_array(costs)
        ticks.set_cmap(COLORMAP)
        ticks.autoscale()
    ax.add_collection(ticks, autolim=False)
    return ticks


def draw_cost_bar(figure: Figure, ax: Axes, ticks: Quiver) -> None:
    """A colour bar of nodes with costs, above the axes where they are."""
    bar = figure.colorbar(
        ticks, ax=ax, location="top", shrink=0.5, aspect=30, pad=0.02, anchor=(1, 0)
    )
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=SMALL_PT - 1.0, length=2.0, width=0.5, pad=1.5, labelcolor=INK)
    bar.set_label("cost of expanded nodes", fontsize=SMALL_PT, color=INK)
