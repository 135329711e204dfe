"""Draw a fleet over time: a bar for each vehicle, and how near any two come to each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, NullFormatter

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.controls import TIME_LABEL
from maneuver_automaton.plotting.fleet_cast import Cast, Member
from maneuver_automaton.plotting.fleet_distances import distance_times, nearest_others
from maneuver_automaton.plotting.fleet_plane import HATCH
from maneuver_automaton.plotting.style import SMALL_PT, line_handle, shortened, tidy

RESTS = 0.66  # a rest's shade of the vehicle's colour, towards white
MARGIN: Color = (0.86, 0.10, 0.10)
THICK = 0.72  # of a row
NAME = 10  # characters of a name beside its bar
STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # between the numbers beside bars
NEAR = 2.0  # times the reach of the largest body, and twice that, is still looked at
MOST_ROWS, LEAST_ROW = 13, 0.13  # that have a number each, and the height of a number [in]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BarArtists:
    """Artists of `draw_bars`."""

    bars: PolyCollection  # one for each drive and each rest, vehicle by vehicle
    missing: PolyCollection  # one for each vehicle without a plan, hatched


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DistanceArtists:
    """Artists of `draw_fleet_distances`."""

    least: Line2D
    margin: Line2D


def draw_bars(ax: Axes, cast: Cast) -> BarArtists:
    """Draw a bar for each vehicle from when it may leave until it arrives; rests are light."""
    spans = [(k, one, span) for k, one in enumerate(cast.members) for span in one.spans]
    none = [k for k, one in enumerate(cast.members) if one.course is None]
    artists = BarArtists(
        bars=PolyCollection(
            [_bar(k, first, last) for k, _, (first, last, _) in spans], linewidths=0.0,
            facecolors=[_shade(one, rests=rests) for _, one, (_, _, rests) in spans], zorder=2.0,
        ),
        missing=PolyCollection(
            [_bar(k, cast.begin, cast.begin + _span(cast)) for k in none],
            facecolors="white", edgecolors=[cast.members[k].color for k in none], linewidths=0.7,
            hatch=HATCH, zorder=2.0,
        ),
    )  # fmt: skip
    for part in (artists.bars, artists.missing):
        ax.add_collection(part, autolim=False)
    tidy(ax, x=TIME_LABEL, y="vehicle" if cast.many else "")
    ax.set_ylim(len(cast.members) - 0.4, -0.6)
    _name_rows(ax, cast)
    ax.grid(visible=False, axis="y")
    ax.set_xlim(*time_limits(cast))
    return artists


def draw_nearest(ax: Axes, cast: Cast) -> DistanceArtists:
    """Draw the least distance of any two bodies, measured by shapely every 0.05 s."""
    times = distance_times(cast)
    return draw_fleet_distances(ax, cast, times, nearest_others(cast.members, times).min(axis=1))


def draw_fleet_distances(ax: Axes, cast: Cast, times: Array, least: Array) -> DistanceArtists:
    """Draw the least distance (n,) of any two bodies at times (n,) [s], and the margin as a line.

    Distances of many lengths of a body are cut off.
    """
    (line,) = ax.plot(times, least, color=INK, linewidth=1.3, zorder=3.0)
    margin = ax.axhline(cast.margin, color=MARGIN, linewidth=1.0, zorder=2.5)
    tidy(ax, x=TIME_LABEL, y="distance [m]")
    ax.set_title(
        f"nearest two, shapely every {times[1] - times[0]:.2g} s",
        fontsize=SMALL_PT,
        color=INK,
        loc="left",
        pad=3.0,
    )
    most = float(np.max(least, initial=cast.margin, where=np.isfinite(least)))
    near = max(NEAR * max(one.reach for one in cast.members), float(least.min()), cast.margin)
    top = min(most, NEAR * near) or 1.0
    ax.set_ylim(-0.03 * top, 1.08 * top)
    ax.set_xlim(*time_limits(cast))
    return DistanceArtists(least=line, margin=margin)


def time_handles(cast: Cast, *, distances: bool) -> tuple[list[Artist], list[str]]:
    """Legend handles and names of bars, and of the lines of distances."""
    handles: list[Artist] = []
    names: list[str] = []
    if any(rests for one in cast.members for *_, rests in one.spans):
        handles.append(Patch(facecolor=shaded(GREY, RESTS - 0.1)))
        names.append("rests (light)")
    if distances:
        handles += [line_handle(INK, width=1.3), line_handle(MARGIN, width=1.0)]
        names += ["nearest two bodies", f"margin, {cast.margin:g} m"]
    return handles, names


def _bar(row: int, first: float, last: float) -> Array:
    low, high = row - 0.5 * THICK, row + 0.5 * THICK
    return np.array([[first, low], [last, low], [last, high], [first, high]])


def _shade(one: Member, *, rests: bool) -> Color:
    return shaded(one.color, RESTS) if rests else one.color


def _name_rows(ax: Axes, cast: Cast) -> None:
    """Names beside the rows; of many, some of the numbers that stand at the starts."""
    count = len(cast.members)
    room = min(MOST_ROWS, ax.get_window_extent().height / ax.figure.dpi / LEAST_ROW)
    step = next((step for step in STEPS if count / step <= max(room, 1.0)), STEPS[-1])
    rows = list(range(count)) if step == 1 else [k - 1 for k in range(step, count + 1, step)]
    ax.yaxis.set_major_locator(FixedLocator(rows))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(axis="y", length=0.0)
    labels = [cast.members[k].label if cast.many else cast.members[k].name for k in rows]
    ax.set_yticks(rows, [shortened(label, NAME) for label in labels], fontsize=SMALL_PT)
    for text, k in zip(ax.get_yticklabels(), rows, strict=True):
        text.set_parse_math(False)
        text.set_color(shaded(cast.members[k].color, -0.2))


def time_limits(cast: Cast) -> tuple[float, float]:
    """What axes over time show of a fleet [s]."""
    span = _span(cast)
    return cast.begin - 0.01 * span, cast.begin + 1.02 * span


def _span(cast: Cast) -> float:
    """How long all takes [s]; not nothing."""
    return cast.end - cast.begin or 1.0
