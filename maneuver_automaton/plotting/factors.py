"""Draw by how much short words of a designed library are costlier than the shortest paths."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.patches import Circle

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import GREY, INK
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import plain_page, write_figure
from maneuver_automaton.plotting.paths import draw_goal, draw_headings
from maneuver_automaton.plotting.style import tidy

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
        across,
        across,
        factors,
        cmap=SHADES,
        vmin=1.0,
        vmax=most,
        shading="nearest",
        rasterized=True,
    )
    ax.add_patch(Circle((0.0, 0.0), proof.radius, fill=False, edgecolor=GREY))
    size = ARROW * proof.radius
    draw_headings(ax, np.stack([np.zeros(3), proof.worst]), length=size)
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
