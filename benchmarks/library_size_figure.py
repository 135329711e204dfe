"""Draw what a larger library gains and what it takes: cost and time per step by number of trims."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogLocator,
    NullFormatter,
    NullLocator,
)

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.plotting.colors import SEQUENCE
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import plain_page, write_figure
from maneuver_automaton.plotting.style import tidy

WIDTH, HEIGHT = 9.6, 3.4  # [in] of the page, and below its title
COST, MEDIAN, SLOWEST = SEQUENCE[0], SEQUENCE[2], SEQUENCE[1]
LEAST_GAP = 0.09  # between numbers of trims, of the axis
NARROW = 10.0  # costs within this factor are numbered by round numbers, not by decades


ROUND = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # costs numbered in every decade
CLOSE = (*(k / 20.0 for k in range(20, 60, 4)), *(k / 4.0 for k in range(12, 40)))
FINE = tuple(k / 20.0 for k in range(20, 200))  # where the costs are very near each other


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LibrarySizes:
    """The same closed loop with libraries of different size, smallest first."""

    trims: Array  # (n,) numbers of trims
    costs: Array  # (n,) of the closed loop
    medians_s: Array  # (n,) time per step, the median
    slowest_s: Array  # (n,) the 99th percentile

    def __post_init__(self) -> None:
        for name in ("trims", "costs", "medians_s", "slowest_s"):
            freeze(self, name)
            array = getattr(self, name)
            if array.ndim != 1 or array.shape != self.trims.shape or not array.size:
                raise ValueError(
                    f"library sizes: got {name} of shape {array.shape}, need one number for each "
                    "library, and at least one"
                )
            if not (array > 0.0).all():
                raise ValueError(
                    f"library sizes: {name} must be positive for a logarithm, got {array.min()}"
                )
        if (np.diff(self.trims) <= 0.0).any():
            raise ValueError(
                f"library sizes: trims must increase, got {', '.join(f'{n:g}' for n in self.trims)}"
            )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LibrarySizeArtists:
    """What `draw_library_sizes` has drawn."""

    costs: Line2D
    medians: Line2D
    slowest: Line2D


def draw_library_sizes(cost_axes: Axes, time_axes: Axes, sizes: LibrarySizes) -> LibrarySizeArtists:
    """Draw closed-loop cost and time per step against the number of trims, all logarithmic.

    Parameters
    ----------
    cost_axes, time_axes : Axes
        Where to draw the cost, and the times.
    sizes : LibrarySizes
        What to draw.

    Returns
    -------
    LibrarySizeArtists
        The artists, by what they show.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> sizes = LibrarySizes(
    ...     trims=[5, 41], costs=[3.2, 2.2], medians_s=[1e-3, 2e-3], slowest_s=[2e-3, 5e-3]
    ... )
    >>> left, right = Figure().subplots(1, 2)
    >>> draw_library_sizes(left, right, sizes).costs.get_xdata().tolist()
    [5.0, 41.0]
    """
    for ax in (cost_axes, time_axes):
        ax.set_xscale("log")
        ax.set_yscale("log")
    (costs,) = cost_axes.plot(
        sizes.trims, sizes.costs, color=COST, linewidth=1.8, marker="o", markersize=5.0
    )
    (medians,) = time_axes.plot(
        sizes.trims, sizes.medians_s, color=MEDIAN, linewidth=1.8, marker="o", markersize=5.0
    )
    (slowest,) = time_axes.plot(
        sizes.trims, sizes.slowest_s, color=SLOWEST, linewidth=1.8, marker="s", markersize=4.6
    )
    tidy(cost_axes, x="trims in the library", y="cost of the closed loop")
    tidy(time_axes, x="trims in the library", y="time per step [s]")
    for ax in (cost_axes, time_axes):
        _number_trims(ax, sizes.trims)
    _number_costs(cost_axes, sizes.costs)
    _whole_decades(time_axes, np.concatenate([sizes.medians_s, sizes.slowest_s]))
    time_axes.legend(
        [slowest, medians], ["99th percentile", "median"], loc="lower left",
        bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False, fontsize=8.0,
    )  # fmt: skip
    return LibrarySizeArtists(costs=costs, medians=medians, slowest=slowest)


def save_library_size_figure(sizes: LibrarySizes, path: str | Path, *, title: str = "") -> None:
    """Write the picture of `draw_library_sizes`, cost on the left and times on the right.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    sides = [["costs", "times"]]
    figure, axes = plain_page(Look(title=title), [], sides, width=WIDTH, height=HEIGHT)
    draw_library_sizes(axes["costs"], axes["times"], sizes)
    write_figure(figure, path)


def _number_trims(ax: Axes, trims: Array) -> None:
    """A number at the smallest and largest library, and at others that leave room for it."""
    at = np.log(trims)
    least = LEAST_GAP * (at[-1] - at[0])
    shown = [0] if len(at) == 1 else [0, len(at) - 1]
    for k in range(1, len(at) - 1):
        if min(abs(at[k] - at[n]) for n in shown) >= least:
            shown.append(k)
    ax.xaxis.set_major_locator(FixedLocator(trims[np.sort(shown)].tolist()))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
    ax.xaxis.set_minor_locator(NullLocator())


def _number_costs(ax: Axes, costs: Array) -> None:
    """Round numbers where the costs are near each other, decades otherwise."""
    low, high = float(costs.min()), float(costs.max())
    room = (high / low) ** 0.1 if high > low else 1.5
    ax.set_ylim(low / room, high * room)
    if high / low < NARROW:
        steps = ROUND if high / low > 2.5 else CLOSE if high / low > 1.3 else FINE
        decades = 10.0 ** np.arange(np.floor(np.log10(low)) - 1, np.ceil(np.log10(high)) + 1)
        ticks = np.multiply.outer(decades, steps).ravel()
        inside = ticks[(ticks >= low / room) & (ticks <= high * room)]
        ax.yaxis.set_major_locator(FixedLocator(inside.tolist()))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        ax.yaxis.set_minor_locator(NullLocator())


def _whole_decades(ax: Axes, seconds: Array) -> None:
    low, high = np.floor(np.log10(seconds.min() / 1.02)), np.ceil(np.log10(1.02 * seconds.max()))
    ax.set_ylim(10.0**low, 10.0**high)
    ax.yaxis.set_major_locator(LogLocator())
    ax.yaxis.set_minor_formatter(NullFormatter())
