"""Draw how a search went on, and what is proven of the words of a designed library."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.patches import Circle
from matplotlib.ticker import NullFormatter

from maneuver_automaton._arrays import Array
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import plain_page, write_figure
from maneuver_automaton.plotting.paths import draw_goal, draw_headings
from maneuver_automaton.plotting.style import tidy

EARLIEST = 1e-3  # [s] from where time is drawn, on a logarithmic axis
ABOVE = 1.35  # times the final cost, up to which first plans are drawn


def save_progress_figure(result: PlanResult, path: str | Path, *, title: str = "") -> None:
    """Write the picture of a search: what the best plan cost, and what was proven, over time.

    A `title` stands above the numbers.

    Raises
    ------
    ValueError
        If the result holds no plan.
    """
    if result.plan is None or result.cost is None or result.bound is None:
        raise ValueError("progress: the result holds no plan, so there is nothing to draw")
    gap = 0.0 if result.gap is None else 100.0 * result.gap
    said = "proven optimal" if result.bound.optimal else f"gap {gap:.2g} % by {result.bound.kind}"
    lines = [f"Cost {result.cost:.6g}, {said}"]
    figure, axes = plain_page(Look(title=title), lines, [["search"]], width=6.4, height=3.3)
    draw_progress(axes["search"], result)
    write_figure(figure, path)


def draw_progress(ax: Axes, result: PlanResult) -> None:
    """Draw steps of cost and bound, the gap between them shaded, each named at its end."""
    assert result.cost is not None
    assert result.bound is not None
    costs = [(max(at, EARLIEST), cost) for at, cost in result.improvements]
    bounds = [(max(at, EARLIEST), bound) for at, bound in result.bound.history]
    costs = costs or [(EARLIEST, result.cost)]
    bounds = bounds or [(EARLIEST, result.bound.value)]
    end = 1.1 * max(costs[-1][0], bounds[-1][0], 10.0 * EARLIEST)
    known = end / 1.1 * 1.02  # what ended the search may be in neither history
    costs += [(known, result.cost), (end, result.cost)]
    bounds += [(known, result.bound.value), (end, result.bound.value)]
    times = sorted({at for at, _ in (*costs, *bounds) if at >= max(costs[0][0], bounds[0][0])})
    upper = [min(cost for at, cost in costs if at <= time) for time in times]
    lower = [max(bound for at, bound in bounds if at <= time) for time in times]
    ax.fill_between(times, lower, upper, step="post", color=GREY, alpha=0.25, linewidth=0.0)
    for steps, color, name, lifted in (
        (costs, SEQUENCE[0], "cost", 3),
        (bounds, SEQUENCE[1], "lower bound", -9),
    ):
        ax.step(*zip(*steps, strict=True), where="post", color=color, linewidth=1.6)
        ax.annotate(
            f"{name} {steps[-1][1]:.6g}", steps[-1], xytext=(5, lifted),
            textcoords="offset points", fontsize=8.0, color=INK,
        )  # fmt: skip
    ax.set_xscale("log")
    ax.xaxis.set_minor_formatter(NullFormatter())  # between the decades labels lie on each other
    ax.set_xlim(EARLIEST, end)
    ax.set_ylim(0.0, ABOVE * result.cost if result.cost > 0.0 else 1.0)
    tidy(ax, x="time since the search began [s]", y="cost")
    ax.tick_params(which="minor", length=1.5, width=0.4, color=GREY)


SHADES = "viridis_r"
PLACES, HEADINGS = 51, 37  # from the start to the edge of the disc, and around
ARROW = 0.08  # of the radius


class _Factors(Protocol):
    """What is proven of the words of a designed library, `DesignedLibrary.words`."""

    @property
    def max_trims(self) -> int: ...
    @property
    def radius(self) -> float: ...
    @property
    def factor(self) -> float: ...
    @property
    def sampled(self) -> float: ...
    @property
    def worst(self) -> Array: ...
    def factors(self, goals: Array) -> Array: ...


def draw_factor(ax: Axes, proof: _Factors) -> QuadMesh:
    """Draw the factor over the goals of a `proof`: at each place that of the worst heading.

    The start is in the middle and looks to the right; the worst goal that was met is marked.

    Parameters
    ----------
    ax : Axes
        Where to draw; its scale is made equal in x and y.
    proof : WordsProof
        What was proven, `DesignedLibrary.words`.

    Returns
    -------
    QuadMesh
        The places, coloured.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton import Automaton, Unicycle, design_library
    >>> box = Automaton.of_grid(Unicycle(), [[-1.0, 1.0], [-1.0, 0.0, 1.0]])
    >>> words = design_library(box, max_trims=4, radius=2.0).words
    >>> round(float(draw_factor(Figure().add_subplot(), words).get_array().max()), 6)
    1.0
    """
    half = np.linspace(0.0, proof.radius, PLACES)
    across = np.concatenate([-half[:0:-1], half])
    factors = np.ma.masked_invalid(_worst_factors(proof, half))
    most = max(proof.sampled, 1.0 + 1e-3)
    places = ax.pcolormesh(
        across, across, factors, cmap=SHADES, vmin=1.0, vmax=most, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    ax.add_patch(Circle((0.0, 0.0), proof.radius, fill=False, edgecolor=GREY))
    draw_headings(ax, np.stack([np.zeros(3), proof.worst]), length=ARROW * proof.radius)
    draw_goal(ax, proof.worst, color=INK)
    ax.set_aspect("equal", adjustable="box")
    tidy(ax, x="x [m]", y="y [m]")
    ax.grid(visible=False)
    return places


def save_factor_figure(proof: _Factors, path: str | Path) -> None:
    """Write a picture of the factor over the goals of a `proof`; see `draw_factor`.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    words = (
        f"Words of at most {proof.max_trims} trims: factor {proof.factor:.4g} proven, "
        f"{proof.sampled:.4g} met"
    )
    figure, axes = plain_page(Look(), [words], [["goals"]], width=6.4, height=5.0)
    bar = figure.colorbar(draw_factor(axes["goals"], proof), aspect=24.0, pad=0.03)
    bar.set_label("factor, at the worst heading")
    write_figure(figure, path)


def _worst_factors(proof: _Factors, half: Array) -> Array:
    """Greatest factor (2 n - 1, 2 n - 1) over all headings at each place; NaN where none counts."""
    x, y = np.meshgrid(half, half)
    inside = np.hypot(x, y) <= proof.radius
    most = np.full(int(inside.sum()), np.nan)
    for heading in np.linspace(-math.pi, math.pi, HEADINGS):
        goals = np.column_stack([x[inside], y[inside], np.full(len(most), heading)])
        most = np.fmax(most, proof.factors(goals))
    quarter = np.full(x.shape, np.nan)
    quarter[inside] = most
    upper = np.concatenate([quarter[:, :0:-1], quarter], axis=1)
    return np.concatenate([upper[:0:-1], upper])
