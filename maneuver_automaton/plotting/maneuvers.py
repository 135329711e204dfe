"""Draw the maneuvers of a library: each by itself, or, where they are many, by where they begin."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE, Color
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import plain_page, write_figure
from maneuver_automaton.plotting.paths import DART
from maneuver_automaton.plotting.style import SMALL_PT, shortened
from maneuver_automaton.plotting.track import placed
from maneuver_automaton.primitives import Maneuver

MOST_SINGLE = 48  # maneuvers that have a panel each
MOST_PANELS = 120
PANEL, LINE, LEAST_WIDTH = 1.5, 0.13, 4.8  # [in] of a panel, of a line of its name, of a page
COLUMNS = 8
NAME_LENGTH, HARD = 25, "\N{NO-BREAK SPACE}"
FULL_COLOR = 0.6  # [rad] of a change of heading
ROOM = 1.35  # side of a panel, over the size of what is in it
DART_SIZE = 0.075  # of the side of a panel


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ManeuverArtists:
    """Artists of `draw_maneuvers`: a path for each maneuver, darts at start and ends."""

    paths: LineCollection
    darts: PolyCollection


def draw_maneuvers(ax: Axes, maneuvers: Sequence[Maneuver]) -> ManeuverArtists:
    """Draw `maneuvers` on `ax`, to scale from the origin, which heads right.

    The colour of a path tells its change of heading: orange to the left, blue to the right, grey
    for none. Dots are a second apart. A motion that is not known is a dashed straight line.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> go = Maneuver(name="go", source="rest", target="ahead", displacement=[1.0, 0.0, 0.0])
    >>> len(draw_maneuvers(Figure().add_subplot(), [go]).paths.get_segments())
    1
    """
    center, half = _frame_of(maneuvers)
    courses = [_poses(maneuver) for maneuver in maneuvers]
    colors = [_color(maneuver) for maneuver in maneuvers]
    paths = LineCollection(
        [poses[:, :2] for poses in courses], colors=colors, linewidths=1.3, zorder=3.0,
        linestyles=["solid" if one.course is not None else (0, (3, 2)) for one in maneuvers],
    )  # fmt: skip
    ax.add_collection(paths)
    size = 2.0 * half * DART_SIZE
    ends = np.array([one.displacement[:3] for one in maneuvers]).reshape(-1, 3)
    darts = PolyCollection(
        [*placed([size * DART], np.zeros((1, 3))), *placed([0.85 * size * DART], ends)],
        facecolors=[INK, *colors], linewidths=0.0, zorder=4.0,
    )  # fmt: skip
    ax.add_collection(darts)
    seconds = _seconds(maneuvers)
    ax.plot(
        seconds[:, 0], seconds[:, 1], linestyle="none", marker="o", markersize=1.8, color=INK,
        zorder=3.5,
    )  # fmt: skip
    _frame(ax, center, half)
    return ManeuverArtists(paths=paths, darts=darts)


def save_maneuvers_figure(
    automaton: Automaton, path: str | Path, *, look: Look | None = None
) -> None:
    """Write pictures of every maneuver of an `automaton`, each panel to its own scale.

    Up to 48 have a panel each; more are drawn together with those that leave the same trim, in at
    most 120 panels. The file is replaced in one step; its ending chooses the format.

    Parameters
    ----------
    automaton : Automaton
        What to draw.
    path : str or Path
        Where to write.
    look : Look, optional
        Title, width and style; the height follows from the panels.

    Raises
    ------
    ValueError
        If there is no maneuver.
    """
    panels = _panels(automaton)
    if not panels:
        raise ValueError(f"{automaton.name or 'automaton'}: has no maneuver to draw")
    look = look or Look()
    left_out, panels = len(panels) - MOST_PANELS, panels[:MOST_PANELS]
    stated = look.is_paper or look.size is not None
    columns = max(1, min(int(look.width / PANEL) if stated else COLUMNS, len(panels)))
    rows = math.ceil(len(panels) / columns)
    above = LINE * max(name.count("\n") + 1 for name, _ in panels)
    more = f"; {left_out} more trims are left out" if left_out > 0 else ""
    name = shortened(automaton.name or automaton.model.name.replace("_", " "), 40)
    legend = "how wide a panel is stands in it; dots are 1 s apart; orange turns left, blue right"
    figure, axes = plain_page(
        replace(look, size=None),
        [f"{name}: {_count(automaton)}", legend + more],
        [
            [str(k) if k < len(panels) else "" for k in range(first, first + columns)]
            for first in range(0, rows * columns, columns)
        ],
        width=look.width if stated else max(columns * PANEL, LEAST_WIDTH),
        height=rows * (PANEL + above),
    )
    for ax, (name, maneuvers) in zip(axes.values(), panels, strict=True):
        draw_maneuvers(ax, maneuvers)
        ax.text(
            0.04, 0.04, f"{np.ptp(ax.get_xlim()):.2g} m", transform=ax.transAxes, color=INK,
            fontsize=SMALL_PT - 2.0,
        )  # fmt: skip
        ax.set_title(name, fontsize=SMALL_PT - 2.0, color=INK, parse_math=False, pad=2.5)
    write_figure(figure, path)


def _panels(automaton: Automaton) -> list[tuple[str, list[Maneuver]]]:
    """Titles, and the maneuvers under each."""
    if len(automaton.maneuvers) <= MOST_SINGLE:
        return [
            (f"{_wrapped(one.source)}\n{_wrapped(f'to {one.target}, {one.duration:.3g} s')}", [one])
            for one in automaton.maneuvers
        ]
    leaving: dict[str, list[Maneuver]] = {}
    for one in automaton.maneuvers:
        leaving.setdefault(one.source, []).append(one)
    return [
        (f"{_wrapped(f'from {name}')}\n{len(many)} maneuver{'s' if len(many) > 1 else ''}", many)
        for name in automaton.trim_names
        if (many := leaving.get(name))
    ]


def _wrapped(name: str) -> str:
    """A name in lines as wide as a panel, broken between its parts rather than within them."""
    held = shortened(name, 3 * NAME_LENGTH).replace(" ", HARD).replace(f",{HARD}", ", ")
    return textwrap.fill(held, NAME_LENGTH).replace(HARD, " ")


def _count(automaton: Automaton) -> str:
    trims, maneuvers = len(automaton), len(automaton.maneuvers)
    plural = "s" if maneuvers > 1 else ""
    return f"{maneuvers} maneuver{plural} between {trims} trim{'s' if trims > 1 else ''}"


def _poses(maneuver: Maneuver) -> Array:
    if maneuver.course is not None:
        return maneuver.course.pose
    return np.stack([np.zeros_like(maneuver.displacement), maneuver.displacement])


def _seconds(maneuvers: Sequence[Maneuver]) -> Array:
    """Positions (n, 2) every full second, the ends left out."""
    rows = [
        one.course.pose_at(np.arange(1.0, one.duration))[:, :2]
        for one in maneuvers
        if one.course is not None and one.duration > 1.0
    ]
    return np.concatenate([np.zeros((0, 2)), *rows])


def _color(maneuver: Maneuver) -> Color:
    turn = float(maneuver.displacement[2])
    share = min(1.0, abs(turn) / FULL_COLOR)
    towards = SEQUENCE[1] if turn > 0.0 else SEQUENCE[0]
    red, green, blue = (
        (1.0 - share) * grey + share * full for grey, full in zip(GREY, towards, strict=True)
    )
    return red, green, blue


def _frame_of(maneuvers: Sequence[Maneuver]) -> tuple[Array, float]:
    """Centre (2,) and half the width [m] of a square around the origin and all paths."""
    points = np.concatenate([np.zeros((1, 2)), *(_poses(one)[:, :2] for one in maneuvers)])
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), 0.5 * ROOM * float((high - low).max()) or 1.0


def _frame(ax: Axes, center: Array, half: float) -> None:
    ax.set_aspect("equal")
    ax.set_xlim(center[0] - half, center[0] + half)
    ax.set_ylim(center[1] - half, center[1] + half)
    ax.set_xticks([0.0])
    ax.set_yticks([0.0])
    ax.tick_params(labelbottom=False, labelleft=False, length=0.0)
    ax.grid(visible=True, color=GREY, alpha=0.3, linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[:].set(color=GREY, linewidth=0.5, alpha=0.6)
