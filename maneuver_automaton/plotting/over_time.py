"""Draw what happens over time: values, bars of driving and rest, speeds, and distances.

Distances are measured by shapely at samples, to be looked at: what is proven is in the result.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, NullFormatter
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.cast import Actor, Cast, rings_with_radius
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.paths import JUMP
from maneuver_automaton.plotting.style import (
    SMALL_PT,
    Entries,
    control_labels,
    dashed_handle,
    line_handle,
    mark_handle,
    shortened,
    tidy,
)
from maneuver_automaton.plotting.together import HATCH
from maneuver_automaton.plotting.track import Track, TrackPiece, solids_at, step_curves
from maneuver_automaton.recording import Curve, Mover

STEP_S, MOST_STEPS = 0.05, 20_000  # between samples; no more of them, however long it takes
AT_ONCE = 2_000_000  # pairs in memory
Numbers = NDArray[Any]


def distance_times(begin: float, end: float) -> Array:
    """Times (n,) at which distances are measured [s], 0.05 s apart unless it takes long."""
    steps = min(max(1, int(np.ceil((end - begin) / STEP_S))), MOST_STEPS)
    return np.linspace(begin, end, steps + 1)


def nearest_others(actors: Sequence[Actor], times: Array) -> Array:
    """Distance of each vehicle from the nearest other at times (n,) [s]: (n, vehicles) [m].

    It is inf where there is no other. Pairs that a circle around each shows to be further apart
    than another pair are not measured.
    """
    rows = [
        (owner, ring, grown, part.pose_at(times))
        for owner, one in enumerate(actors)
        for part in one.parts
        for ring, grown in rings_with_radius(part.bodies.get("", ()))
    ]
    owners = np.array([owner for owner, *_ in rows])
    seen = [[one.mover.is_there(time) for time in times.tolist()] for one in actors]
    there = np.array(seen)[owners]  # (parts, n)
    heights = np.array([_heights(one, times) for one in actors])[owners]  # (parts, n, 2)
    apart = np.full((len(times), len(actors)), np.inf)
    chunk = max(1, AT_ONCE // len(rows) ** 2)
    for first in range(0, len(times), chunk):
        part = slice(first, first + chunk)
        moved = [(ring, grown, poses[part, :3]) for _, ring, grown, poses in rows]
        nearest = _nearest(moved, owners, there[:, part], heights[:, part])
        for row, owner in enumerate(owners):
            apart[part, owner] = np.minimum(apart[part, owner], nearest[row])
    return apart


def _heights(one: Actor, times: Array) -> Array:
    """Lowest and highest point of a vehicle at times (n,) [s]: (n, 2) [m], infinite if any."""
    low, high = (0.0, 0.0) if one.mover.problem is None else one.mover.problem.body_height
    altitude = one.mover.pose_at(times)[:, 3:].sum(axis=1)  # 0 in the plane
    if one.mover.start.size == 3 and not low < high:
        low, high = -np.inf, np.inf
    return np.column_stack([altitude + low, altitude + high])


def _nearest(
    rows: Sequence[tuple[Array, float, Array]], owners: Numbers, there: Numbers, heights: Array
) -> Array:
    """Distance (parts, n) of each part from the nearest part of another vehicle."""
    middles, radii, placed = [], [], []
    for ring, grown, poses in rows:
        middle = 0.5 * (ring.min(axis=0) + ring.max(axis=0))
        middles.append(SE2(poses).act(middle))
        radii.append(float(np.linalg.norm(ring - middle, axis=1).max()) + grown)
        placed.append(solids_at(ring, poses))
    at, solid = np.array(middles), np.array(placed)
    wide, larger = np.array(radii), np.array([by for _, by, _ in rows])
    low = np.linalg.norm(at[:, None] - at[None], axis=-1) - (wide[:, None] + wide)[..., None]
    above = np.maximum(heights[:, None, :, 0] - heights[None, :, :, 1], 0.0)
    above = np.maximum(above, above.swapaxes(0, 1))
    low = np.where(above > 0.0, np.hypot(np.maximum(low, 0.0), above), low)
    low[owners[:, None] == owners] = np.inf
    low[~(there[:, None] & there[None])] = np.inf

    def measured(one: Numbers, other: Numbers, time: Numbers) -> Array:
        apart = shapely.distance(solid[one, time], solid[other, time])
        aside = np.maximum(apart - larger[one] - larger[other], 0.0)
        return np.asarray(np.hypot(aside, above[one, other, time]))

    parts, steps = np.indices(low.shape[1:])
    least = measured(parts, low.argmin(axis=1), steps)
    least[np.isinf(low.min(axis=1))] = np.inf
    one, other, time = np.nonzero(low < least[:, None])
    np.minimum.at(least, (one, time), measured(one, other, time))
    return np.asarray(least)


def thinned(times: Array, values: Array, *, most: int) -> tuple[Array, Array]:
    """At most about so many of the samples, with the least of those between them."""
    width = -(-len(times) // most)
    begins = range(0, len(times), width)
    least = [begin + int(np.argmin(values[begin : begin + width])) for begin in begins]
    kept = np.unique([0, *least, len(times) - 1])
    return times[kept], values[kept]


MOST_STATES = 4  # panels of reduced state and controls
RESTS, LEFT_TO_PAY = 0.66, 0.35  # shades of the vehicle's colour, towards white
BROKEN: Color = (0.86, 0.10, 0.10)
MARGIN = BROKEN
THICK, BESIDE = 0.72, 0.46  # of a row: its bar, and from its middle where marks stand
NAME = 10  # characters of a name beside its bar
STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # between the numbers beside bars
NEAR = 2.0  # times the reach of the largest body, and twice that, is still looked at
MOST_ROWS = 13  # that have a number each
ROW, LEAST_ROWS, MOST_ROWS_HIGH = 0.17, 0.6, 2.4  # heights of bars, compared with other panels
SHORTEST_S = 1e-6  # what a clock may have missed, for the logarithm
OWN_PANEL = ("value", "spent", "lower bound", "solve time")  # labels of curves


class Panel(NamedTuple):
    """Something over time: what draws it, its height compared with others, its legend."""

    draw: Callable[[Axes], object]
    height: float = 1.0
    entries: Entries = ()


def panels_of(cast: Cast) -> list[Panel]:
    """All that is known of a cast over time."""
    panels: list[Panel] = []
    if len(cast.actors) > 1 and not cast.recording.alternatives and not cast.on_roads:
        panels.append(_bars(cast))
        if cast.end > cast.recording.begin:
            panels.append(_distances(cast))
    values = [one for one in cast.recording.curves if one.label == "value"]
    if any(one.time.size > 1 for one in values):
        panels.append(_values(cast))
    if cast.is_alone:
        panels += _quantities(cast)
    elif cast.on_roads or cast.recording.alternatives:
        panels += _compared(cast)
    for curve in cast.recording.curves:
        if curve.label == "solve time" and cast.is_alone and curve.time.size:
            panels.append(Panel(partial(_draw_solve_times, cast=cast, curve=curve)))
    return panels


def _quantities(cast: Cast) -> list[Panel]:
    """Reduced state, controls and altitude of one vehicle, in the colours of its trims."""
    (one,) = cast.actors
    track = one.track
    if not track.pieces:
        return []
    states, controls = labels_of(one.mover, track.pieces[0])
    curves: list[tuple[str, Sequence[Array]]] = [
        (name, [np.stack([piece.time, piece.state[:, k]], axis=-1) for piece in track.pieces])
        for k, name in enumerate(states[:MOST_STATES])
    ]
    if len(states) + len(controls) <= MOST_STATES or not states:
        curves += [(name, step_curves(track, k)) for k, name in enumerate(controls)]
    if track.climbs:
        altitude = [np.stack([piece.time, piece.pose[:, 3]], axis=-1) for piece in track.pieces]
        curves.append(("z [m]", altitude))

    def panel(label: str, curve: Sequence[Array]) -> Panel:
        return Panel(lambda ax: draw_over_time(ax, track, curve, label=label, colors=cast.colors))

    return [panel(label, curve) for label, curve in curves]


def _compared(cast: Cast) -> list[Panel]:
    """Speeds on roads and controls of alternatives, a line for each in its colour."""
    driving = [one for one in cast.actors if one.track.pieces]
    if not driving:
        return []
    states, controls = labels_of(driving[0].mover, driving[0].track.pieces[0])
    count = len(states) + len(controls)

    def draw(ax: Axes, k: int) -> None:
        for one in reversed(driving):
            pieces = one.track.pieces
            if k < len(states):
                curve = np.concatenate([np.stack([p.time, p.state[:, k]], axis=-1) for p in pieces])
            else:
                curve = np.concatenate(step_curves(one.track, k - len(states)))
            ax.plot(*curve.T, color=one.color, linewidth=1.4)
        tidy(ax, x=TIME_LABEL, y=within(ax, [*states, *controls][k]))

    more = {one.label: one.unit for one in cast.recording.curves if one.label not in OWN_PANEL}

    def draw_curves(ax: Axes, label: str) -> None:
        colors = {one.mover.name: one.color for one in cast.actors}
        for one in (one for one in cast.recording.curves if one.label == label):
            ax.plot(one.time, one.value, color=colors[one.mover], linewidth=1.4)
        tidy(ax, x=TIME_LABEL, y=within(ax, f"{label} [{more[label]}]"))

    return [
        *(Panel(partial(draw, k=k)) for k in range(min(count, max(MOST_STATES - len(more), 1)))),
        *(Panel(partial(draw_curves, label=label)) for label in more),
    ]


def labels_of(mover: Mover, piece: TrackPiece) -> tuple[list[str], list[str]]:
    """Labels of reduced state and controls of a vehicle."""
    counts, model = (piece.state.shape[1], piece.control.shape[1]), mover.model
    named = mover.names if model is None else (model.reduced_names, model.control_names)
    return tuple(  # type: ignore[return-value]
        control_labels(names) if len(names) == count else [f"{kind} {k + 1}" for k in range(count)]
        for names, count, kind in zip(named, counts, ("state", "control"), strict=True)
    )


def _values(cast: Cast) -> Panel:
    """What is left to pay, one vehicle's upon another's, what was spent, and the sum of both."""
    entries: list[tuple[Artist, str]] = [
        (Patch(facecolor=shaded(GREY, LEFT_TO_PAY)), "left to pay (value)"),
        (line_handle(GREY, width=1.6), "spent"),
        (dashed_handle(INK, (0, (4, 2)), width=1.0), "sum"),
    ]
    if any(one.label == "lower bound" for one in cast.recording.curves):
        entries.append((line_handle(INK, width=1.0), "lower bound"))
    for kind, color, said in (
        ("broken", BROKEN, "guarantee broken"),
        ("disturbed", GREY, "by noise"),
    ):
        if any(event.kind == kind for event in cast.recording.events):
            entries.append((mark_handle("x", size=5.0, edge=color), said))
    return Panel(lambda ax: _draw_values(ax, cast), 1.2, entries)


def _draw_values(ax: Axes, cast: Cast) -> None:
    curves = cast.recording.curves
    shares = [one for one in curves if one.label == "value" and one.mover]
    shares = shares or [one for one in curves if one.label == "value"]
    colors = {one.mover.name: one.color for one in cast.actors}
    times = shares[0].time
    known = np.array([one.value for one in shares])
    known = np.where(np.isfinite(known), known, 0.0)
    ax.stackplot(
        times, known, linewidth=0.0, zorder=2.0,
        colors=[shaded(colors[one.mover], LEFT_TO_PAY) for one in shares],
    )  # fmt: skip
    total = known.sum(axis=0)
    for spent in (one for one in curves if one.label == "spent"):
        total = total + spent.value
        ax.plot(spent.time, spent.value, color=GREY, linewidth=1.6, zorder=2.6)
        ax.plot(times, total, color=INK, linewidth=1.0, dashes=(4, 2), zorder=2.8)
    for bound in (one for one in curves if one.label == "lower bound"):
        ax.plot(bound.time, bound.value, color=INK, linewidth=1.0, zorder=2.4)
    for kind, color in (("disturbed", GREY), ("broken", BROKEN)):
        at = np.unique([one.time for one in cast.recording.events if one.kind == kind])
        height = np.interp(at, times, total)
        ax.scatter(at, height, s=26.0, marker="x", color=[color], linewidths=1.4, zorder=3.2)
    tidy(ax, x=TIME_LABEL, y="cost")
    ax.set_xlim(*_limits(cast))
    ax.set_ylim(0.0, 1.1 * float(np.max(total, initial=0.0)) or 1.0)


def _draw_solve_times(ax: Axes, cast: Cast, curve: Curve) -> None:
    """How long every step took to decide, on a logarithmic axis, a ring where it replanned."""
    times, seconds = curve.time, np.maximum(curve.value, SHORTEST_S)
    again = np.isin(times, [one.time for one in cast.recording.events if one.kind == "replanned"])
    ax.set_yscale("log")
    ax.plot(
        times, seconds, color=GREY, linewidth=0.6, marker="o", markersize=3.0,
        markerfacecolor=INK, markeredgewidth=0.0, zorder=2.5,
    )  # fmt: skip
    ax.scatter(
        times[again], seconds[again], s=30.0, facecolors="none", edgecolors=[INK],
        linewidths=1.0, zorder=3.0,
    )  # fmt: skip
    low, high = math.log10(seconds.min() / 1.02), math.log10(seconds.max() * 1.02)
    ax.set_ylim(10.0 ** math.floor(low), 10.0 ** math.ceil(high))  # whole decades
    ax.set_xlim(*_limits(cast))
    tidy(ax, x=TIME_LABEL, y="to decide [s]")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(which="minor", length=1.5, width=0.4, color=GREY)


def _bars(cast: Cast) -> Panel:
    """A bar for each vehicle from when it may leave until it arrives; rests are light."""
    entries: list[tuple[Artist, str]] = []
    if any(rests for one in cast.actors for *_, rests in one.spans):
        entries.append((Patch(facecolor=shaded(GREY, RESTS - 0.1)), "rests (light)"))
    kinds = {event.kind for event in cast.recording.events}
    if "exchanged" in kinds:
        entries.append((mark_handle("o", size=5.0), "plan exchanged"))
    if "void" in kinds:
        entries.append((mark_handle("x", size=5.0), "plan void"))
    height = min(max(ROW * len(cast.actors), LEAST_ROWS), MOST_ROWS_HIGH)
    return Panel(lambda ax: draw_bars(ax, cast), height, entries)


def draw_bars(ax: Axes, cast: Cast) -> PolyCollection:
    """Draw a bar for each vehicle, a mark where its plan was exchanged or void, or it was pushed.

    One polygon for each drive and each rest, vehicle by vehicle; who has no plan is hatched.
    """
    spans = [(k, one, span) for k, one in enumerate(cast.actors) for span in one.spans]
    bars = PolyCollection(
        [_bar(k, first, last) for k, _, (first, last, _) in spans], linewidths=0.0, zorder=2.0,
        facecolors=[
            shaded(one.color, RESTS) if rests else one.color for _, one, (_, _, rests) in spans
        ],
    )  # fmt: skip
    none = [k for k, one in enumerate(cast.actors) if not one.mover.has_plan]
    begin = cast.recording.begin
    missing = PolyCollection(
        [_bar(k, begin, begin + _span(cast)) for k in none], facecolors="white",
        edgecolors=[cast.actors[k].color for k in none], linewidths=0.7, hatch=HATCH, zorder=2.0,
    )  # fmt: skip
    for part in (bars, missing):
        ax.add_collection(part, autolim=False)
    events = cast.recording.events
    rows = {one.mover.name: k for k, one in enumerate(cast.actors)}
    look = {"s": 16.0, "facecolors": "white", "edgecolors": [INK], "zorder": 4.0}
    swaps = {event.time for event in events if event.kind == "exchanged"}
    held = [(time, k) for k, one in enumerate(cast.actors) for time, _ in one.held[1:]]
    _scatter(ax, [(time, k) for time, k in held if time in swaps], look)
    look = {"s": 18.0, "marker": "x", "color": [INK], "linewidths": 1.0, "zorder": 4.0}
    _scatter(ax, [(e.time, rows[e.mover]) for e in events if e.kind == "void"], look)
    pushed = [(time, k + BESIDE) for k, one in enumerate(cast.actors) for time, _ in one.jumps]
    look = {"s": 9.0, "marker": "|", "color": [JUMP], "linewidths": 1.0, "zorder": 3.5}
    _scatter(ax, pushed, look)
    tidy(ax, x=TIME_LABEL, y="vehicle" if cast.is_many else "")
    ax.set_ylim(len(cast.actors) - 0.4, -0.6)
    _name_rows(ax, cast)
    ax.grid(visible=False, axis="y")
    ax.set_xlim(*_limits(cast))
    return bars


def _scatter(ax: Axes, places: Sequence[tuple[float, float]], look: dict[str, object]) -> None:
    at = np.array(places).reshape(-1, 2)
    ax.scatter(at[:, 0], at[:, 1], **look)  # type: ignore[arg-type]


def _bar(row: int, first: float, last: float) -> Array:
    low, high = row - 0.5 * THICK, row + 0.5 * THICK
    return np.array([[first, low], [last, low], [last, high], [first, high]])


def _name_rows(ax: Axes, cast: Cast) -> None:
    """Names beside the rows; of many, some of the numbers that stand at the starts."""
    count = len(cast.actors)
    step = next((step for step in STEPS if count / step <= MOST_ROWS), STEPS[-1])
    rows = list(range(count)) if step == 1 else [k - 1 for k in range(step, count + 1, step)]
    ax.yaxis.set_major_locator(FixedLocator(rows))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(axis="y", length=0.0)
    labels = [cast.actors[k].label if cast.is_many else cast.actors[k].name for k in rows]
    ax.set_yticks(rows, [shortened(label, NAME) for label in labels], fontsize=SMALL_PT)
    for text, k in zip(ax.get_yticklabels(), rows, strict=True):
        text.set_parse_math(False)
        text.set_color(shaded(cast.actors[k].color, -0.2))


def _distances(cast: Cast) -> Panel:
    """The least distance of any two bodies, measured by shapely every 0.05 s, and the margin."""
    margin = cast.recording.world.margin
    entries: list[tuple[Artist, str]] = [
        (line_handle(INK, width=1.3), "nearest two bodies"),
        (line_handle(MARGIN, width=1.0), f"margin, {margin:g} m"),
    ]

    def draw(ax: Axes) -> None:
        times = distance_times(cast.recording.begin, cast.end)
        draw_distances(ax, cast, times, nearest_others(cast.actors, times).min(axis=1))

    return Panel(draw, 1.0, entries)


def draw_distances(ax: Axes, cast: Cast, times: Array, least: Array) -> None:
    """Draw the least distance (n,) of any two bodies at times (n,) [s], and the margin as a line.

    Distances of many lengths of a body are cut off.
    """
    margin = cast.recording.world.margin
    ax.plot(times, least, color=INK, linewidth=1.3, zorder=3.0)
    ax.axhline(margin, color=MARGIN, linewidth=1.0, zorder=2.5)
    tidy(ax, x=TIME_LABEL, y="distance [m]")
    said = f"nearest two, shapely every {times[1] - times[0]:.2g} s"
    ax.set_title(said, fontsize=SMALL_PT, color=INK, loc="left", pad=3.0)
    most = float(np.max(least, initial=margin, where=np.isfinite(least)))
    near = max(NEAR * max(one.reach for one in cast.actors), float(least.min()), margin)
    top = min(most, NEAR * near) or 1.0
    ax.set_ylim(-0.03 * top, 1.08 * top)
    ax.set_xlim(*_limits(cast))


def _limits(cast: Cast) -> tuple[float, float]:
    """What axes over time show of a cast [s]."""
    span = _span(cast)
    return cast.recording.begin - 0.01 * span, cast.recording.begin + 1.02 * span


def _span(cast: Cast) -> float:
    """How long all takes [s]; not nothing."""
    return cast.end - cast.recording.begin or 1.0


TIME_LABEL = "time [s]"
CONSTANT, NEAR = 0.02, 0.2  # of the largest value: varies less, or more, then zero is in view
CROWDED = 30  # pieces from which on lines where trims change would hide what they part
CHARACTER, OVER = 0.066, 0.1  # [in] of a label, and how far it may stand over its axes


def draw_over_time(
    ax: Axes,
    track: Track,
    curves: Sequence[Array],
    *,
    label: str,
    colors: Mapping[str, Color],
) -> dict[str, LineCollection]:
    """Draw one curve (n, 2) per piece of a `track` in the colour of its trim.

    The artists by what they show: steps, jumps from trim to trim, and switching times.
    """
    shown = [colors[piece.name] for piece in track.pieces]
    times = track.switching_times
    crowded = len(track.pieces) > CROWDED
    artists = {
        "steps": LineCollection(
            curves, colors=shown, linewidths=2.4, capstyle="butt", zorder=3.0
        ),
        "jumps": LineCollection(
            [np.stack([a[-1], b[0]]) for a, b in pairwise(curves)],
            colors=[GREY], linewidths=0.35 if crowded else 0.9, zorder=2.5,
        ),
        "switches": LineCollection(
            [] if crowded else [[(t, 0.0), (t, 1.0)] for t in times],
            colors=[(*GREY, 0.6)], linewidths=0.6,
            transform=ax.get_xaxis_transform(), zorder=1.5,
        ),
    }  # fmt: skip
    for what, part in artists.items():
        ax.add_collection(part, autolim=what != "switches")
    _set_limits(ax, times, curves)
    tidy(ax, x=TIME_LABEL, y=within(ax, label))
    ax.grid(visible=False, axis="x")
    return artists


def within(ax: Axes, label: str) -> str:
    """The label, in lines where it is longer than the axes are high."""
    high = ax.bbox.height / ax.get_figure(root=True).dpi  # type: ignore[union-attr]
    most = max(12, int((high + OVER) / CHARACTER))
    return label if len(label) <= most else "\n".join(textwrap.wrap(label, most))


def _set_limits(ax: Axes, times: Array, curves: Sequence[Array]) -> None:
    """Whole duration in x; in y the values seen so far, with zero and a little room."""
    begin, end = (times[0], times[-1]) if times.size else (0.0, 1.0)
    low, high = ax.dataLim.intervaly if np.isfinite(ax.dataLim.intervaly).all() else (0.0, 0.0)
    values = np.concatenate([[low, high], *(curve[:, 1] for curve in curves)])
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if not CONSTANT * size < high - low <= NEAR * size:
        low, high = min(low, 0.0), max(high, 0.0)
    room = 0.12 * (high - low) or 1.0
    ax.set_xlim(begin - 0.01 * (end - begin), end + 0.01 * (end - begin))
    ax.set_ylim(low - room, high + room)
