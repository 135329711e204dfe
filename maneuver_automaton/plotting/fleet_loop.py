"""The picture of a fleet's closed loop: what was driven and held, and how it went over time."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from maneuver_automaton.fleet import FleetLog
from maneuver_automaton.plotting.closed_loop import MOST_REASONS, TEXT_WIDTH
from maneuver_automaton.plotting.closed_loop_plane import JUMP, JUMP_STYLE, NEW_STYLE
from maneuver_automaton.plotting.closed_loop_time import BROKEN
from maneuver_automaton.plotting.colors import GREY, INK, shaded
from maneuver_automaton.plotting.controls import TIME_LABEL
from maneuver_automaton.plotting.fleet import reasons
from maneuver_automaton.plotting.fleet_cast import Cast
from maneuver_automaton.plotting.fleet_loop_cast import (
    fleet_costs,
    held_tracks,
    jumps_of,
    loop_cast_of,
    vehicle_values,
)
from maneuver_automaton.plotting.fleet_page import fleet_page
from maneuver_automaton.plotting.fleet_plane import draw_fleet_plane, plane_handles
from maneuver_automaton.plotting.fleet_time import (
    draw_bars,
    draw_nearest,
    time_handles,
    time_limits,
)
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import hide_times, write_figure
from maneuver_automaton.plotting.style import line_handle, tidy

HELD = 0.45  # towards white, the shade of plans that were held
VALUE = 0.35  # ... and of what is left to pay
BESIDE = 0.46  # of a row from its middle: where disturbances are marked


def save_fleet_loop_figure(log: FleetLog, path: str | Path, *, look: Look | None = None) -> None:
    """Write the picture of a fleet's closed loop that `draw_fleet_loop` makes.

    The file is replaced in one step; its ending chooses the format.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(draw_fleet_loop(log, look=look), path)


def draw_fleet_loop(log: FleetLog, *, look: Look | None = None) -> Figure:
    """The picture of a fleet's closed loop: every vehicle in its colour, in the plane and in time.

    In the plane what each drove, its body at equal times, and dashed the plans that it held; a
    dotted line shows how far a disturbance put it. Who did not arrive is hatched. Over time a bar
    for each, light where it rests, with a ring where its plan was exchanged and a tick where it was
    disturbed; the least distance of any two bodies; what each has left to pay, one upon the other,
    below the sum with what was spent, which falls by what exchanges gain.

    Parameters
    ----------
    log : FleetLog
        What to draw.
    look : Look, optional
        Title, size and style.

    Returns
    -------
    Figure
        It belongs to no window; its axes are the plane, the bars, the distances where two or more
        are there, and the values.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, simulate_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [2, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> log = simulate_fleet(FleetProblem(rows, names=["a", "b"]), step=0.5, first_time_limit=1.0)
    >>> len(draw_fleet_loop(log).axes)
    4
    """
    look, cast = look or Look(), loop_cast_of(log)
    curve = len(cast.members) > 1 and cast.end > cast.begin
    lines = [_headline(log), *_remarks(log), *reasons(cast)]
    entries = _entries(log, cast, curve=curve)
    page = fleet_page(cast, look, lines, entries, curves=int(curve) + 1)
    draw_fleet_plane(page.plane, cast)
    _draw_held(page.plane, log, cast)
    draw_bars(page.bars, cast)
    _mark_bars(page.bars, log, cast)
    if curve:
        draw_nearest(page.curves[0], cast)
    draw_fleet_values(page.curves[-1], log, cast)
    hide_times(page.upper)
    return page.figure


def draw_fleet_values(ax: Axes, log: FleetLog, cast: Cast) -> None:
    """Draw what each vehicle has left to pay, one upon the other, what was spent, and their sum.

    A red cross marks a step that broke a guarantee.
    """
    times, spent = log.times, fleet_costs(log)
    values = np.array([vehicle_values(log, one.name) for one in cast.members])
    known = np.nan_to_num(values)
    ax.stackplot(
        times, known, colors=[shaded(one.color, VALUE) for one in cast.members], linewidth=0.0,
        zorder=2.0,
    )  # fmt: skip
    total = known.sum(axis=0) + spent
    ax.plot(times, spent, color=GREY, linewidth=1.6, zorder=2.6)
    ax.plot(times, total, color=INK, linewidth=1.0, dashes=(4, 2), zorder=2.8)
    broken = [k for k, step in enumerate(log.steps) if step.violations]
    ax.scatter(
        times[broken], total[broken], s=26.0, marker="x", color=[BROKEN], linewidths=1.4, zorder=3.2
    )
    tidy(ax, x=TIME_LABEL, y="cost")
    ax.set_xlim(*time_limits(cast))
    ax.set_ylim(0.0, 1.1 * float(total.max(initial=0.0)) or 1.0)


def _draw_held(ax: Axes, log: FleetLog, cast: Cast) -> None:
    """The plans that were held behind what was driven, and where disturbances put a vehicle."""
    held = [
        (track.pose[:, :2], shaded(one.color, HELD))
        for one in cast.members
        for _, track in held_tracks(log, one.name)
    ]
    jumps = [line for one in cast.members for _, line in jumps_of(log, one.name)]
    plans = LineCollection(
        [places for places, _ in held], colors=[color for _, color in held], linewidths=1.0,
        linestyles=[NEW_STYLE], zorder=1.9,
    )  # fmt: skip
    pushed = LineCollection(
        jumps, colors=[JUMP], linewidths=1.3, linestyles=[JUMP_STYLE], zorder=3.3
    )
    for part in (plans, pushed):
        ax.add_collection(part, autolim=False)


def _mark_bars(ax: Axes, log: FleetLog, cast: Cast) -> None:
    """Rings where plans were exchanged, crosses where they were void, ticks for disturbances."""
    rows = {one.name: k for k, one in enumerate(cast.members)}
    swaps = [(step.time, rows[name]) for step in log.steps for s in step.swaps for name in s.names]
    void = [(step.time, rows[name]) for step in log.steps for name in step.void]
    pushed = [(t, rows[one.name]) for one in cast.members for t, _ in jumps_of(log, one.name)]
    at = np.array(swaps).reshape(-1, 2)
    ax.scatter(at[:, 0], at[:, 1], s=16.0, facecolors="white", edgecolors=[INK], zorder=4.0)
    at = np.array(void).reshape(-1, 2)
    ax.scatter(at[:, 0], at[:, 1], s=18.0, marker="x", color=[INK], linewidths=1.0, zorder=4.0)
    at = np.array(pushed).reshape(-1, 2)
    ax.scatter(
        at[:, 0], at[:, 1] + BESIDE, s=9.0, marker="|", color=[JUMP], linewidths=1.0, zorder=3.5
    )


def _entries(log: FleetLog, cast: Cast, *, curve: bool) -> tuple[list[Artist], list[str]]:
    """Legend handles and names: vehicles and marks, bars, curves, and what happened."""
    handles, names = plane_handles(cast)
    time, time_names = time_handles(cast, distances=curve)
    held = line_handle(shaded(GREY, HELD), width=1.0)
    held.set_linestyle(NEW_STYLE)
    more: list[tuple[Artist, str]] = [(held, "plan held")]
    if any(jumps_of(log, one.name) for one in cast.members):
        jump = line_handle(JUMP, width=1.3)
        jump.set_linestyle(JUMP_STYLE)
        more.append((jump, "disturbance"))
    if any(step.swaps for step in log.steps):
        more.append((_dot("o", face="white"), "plan exchanged"))
    if any(step.void for step in log.steps):
        more.append((_dot("x", face=INK), "plan void"))
    more += [
        (Patch(facecolor=shaded(GREY, VALUE)), "left to pay"),
        (line_handle(GREY, width=1.6), "spent"),
    ]
    both = line_handle(INK, width=1.0)
    both.set_linestyle((0, (4, 2)))
    more.append((both, "sum"))
    if any(step.violations for step in log.steps):
        more.append((_dot("x", face=BROKEN), "guarantee broken"))
    return (
        [*handles, *time, *(handle for handle, _ in more)],
        [*names, *time_names, *(name for _, name in more)],
    )


def _dot(marker: str, *, face: Any) -> Line2D:
    edge = INK if marker == "o" else face
    return Line2D(
        [], [], linestyle="none", marker=marker, markersize=5.0, markerfacecolor=face,
        markeredgecolor=edge, markeredgewidth=1.1,
    )  # fmt: skip


def _headline(log: FleetLog) -> str:
    """How a fleet's loop ended, in a line."""
    count, there = len(log.problem), len(log.arrived_s)
    ended = f"all {count} arrived" if there == count else f"{there} of {count} arrived"
    parts = [ended, f"{len(log.steps)} steps of {log.step:g} s"]
    if there:
        parts += [f"sum {log.sum_s:.5g} s", f"last {log.last_s:.5g} s"]
    parts.append(f"cost {log.cost:.6g}")
    if math.isfinite(log.distance_m):
        parts.append(f"nearest {log.distance_m:.3g} m")
    return " · ".join(parts)


def _remarks(log: FleetLog) -> list[str]:
    """How the loop went, and what was broken, in lines."""
    swaps, asked = len(list(log.swaps)), sum(len(step.asked) for step in log.steps)
    void = sum(len(step.void) for step in log.steps)
    lines = [
        f"{asked} searches for a better plan, {_times(swaps, 'exchange')}"
        + (f", {_times(void, 'void plan')}" if void else "")
    ]
    broken = list(log.violations)
    for number, violation in broken[:MOST_REASONS]:
        text = f"step {number}: {violation}"
        lines.append(textwrap.shorten(text, TEXT_WIDTH, placeholder=" …"))
    if (more := len(broken) - MOST_REASONS) > 0:
        lines.append(f"and {more} more guarantee{'s' if more > 1 else ''} broken")
    return lines


def _times(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"
