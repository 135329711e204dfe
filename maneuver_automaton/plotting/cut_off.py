"""Draw what is cut off: where a vehicle may get to, and the passage that is too narrow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import as_array
from maneuver_automaton.plotting.colors import INK, SEQUENCE
from maneuver_automaton.plotting.style import SMALL_PT

if TYPE_CHECKING:
    from maneuver_automaton.bounds import Narrowest

REACHED = (0.82, 0.89, 0.95)  # not through: squares of several sizes lie upon each other
RING_PT = 16.0  # size of the ring around the passage


def draw_cut_off(
    ax: Axes, reached: ArrayLike, *, narrowest: Narrowest | None = None
) -> PolyCollection:
    """Draw on `ax`, which keeps its limits, what of a scene is connected with the start.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    reached : (n, 4, 2) array_like
        Corners of the places that the vehicle's pose may get to [m].
    narrowest : Narrowest, optional
        The passage that is marked.

    Returns
    -------
    PolyCollection
        The places.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> square = [[[0, 0], [1, 0], [1, 1], [0, 1]]]
    >>> from maneuver_automaton.bounds import Narrowest
    >>> passage = Narrowest(place=(1.0, 0.5), missing=0.1)
    >>> len(draw_cut_off(Figure().add_subplot(), square, narrowest=passage).get_paths())
    1
    """
    corners = as_array("reached", reached, last=2)
    places = PolyCollection(
        list(corners), facecolors=[REACHED], edgecolors=[REACHED], linewidths=0.4, zorder=0.6
    )
    ax.add_collection(places, autolim=False)
    if narrowest is not None:
        x, y = narrowest.place
        ax.plot(
            [x], [y], marker="o", markersize=RING_PT, markerfacecolor="none",
            markeredgecolor=SEQUENCE[1], markeredgewidth=1.6, linestyle="none",
            scalex=False, scaley=False, zorder=6.0,
        )  # fmt: skip
        ax.annotate(
            f"{narrowest.missing:.2g} m too narrow", (x, y), xytext=(12.0, 10.0),
            textcoords="offset points", fontsize=SMALL_PT, color=INK, zorder=6.0,
        )  # fmt: skip
    return places
