"""The picture of a fleet: all vehicles in the plane, and beside it what they do over time."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from maneuver_automaton.fleet import FleetResult
from maneuver_automaton.plotting.fleet_cast import Cast, cast_of
from maneuver_automaton.plotting.fleet_page import fleet_page
from maneuver_automaton.plotting.fleet_plane import draw_fleet_plane, plane_handles
from maneuver_automaton.plotting.fleet_time import draw_bars, draw_nearest, time_handles
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import hide_times, write_figure

MOST_REASONS = 4  # above the picture, and names of vehicles for each


def save_fleet_figure(
    result: FleetResult, path: str | Path, *, numbered: bool = False, look: Look | None = None
) -> None:
    """Write the picture of a fleet that `draw_fleet` makes; the ending chooses the format.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(draw_fleet(result, numbered=numbered, look=look), path)


def draw_fleet(result: FleetResult, *, numbered: bool = False, look: Look | None = None) -> Figure:
    """The picture of a fleet: every vehicle in its colour, in the plane and over time.

    In the plane paths, bodies along them at equal times, starts hollow, goals filled; vehicles
    without a plan are hatched at their starts. Up to twelve are named in the legend, more are
    numbered at their starts. Over time there is a bar for each, light where it rests, and the least
    distance of any two bodies, measured by shapely every 0.05 s.

    Parameters
    ----------
    result : FleetResult
        What to draw.
    numbered : bool
        Whether to number the bodies by their times.
    look : Look, optional
        Title, size and style.

    Returns
    -------
    Figure
        It belongs to no window; its axes are the plane, the bars and, where two or more move, the
        distances.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, plan_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [3, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> figure = draw_fleet(plan_fleet(FleetProblem(rows, names=["a", "b"]), max_rounds=0))
    >>> [text.get_text() for text in figure.legends[0].get_texts()][:4], len(figure.axes)
    (['a', 'b', 'start', 'goal'], 3)
    """
    look, cast = look or Look(), cast_of(result)
    curve = len(cast.members) > 1 and cast.end > cast.begin
    page = fleet_page(
        cast,
        look,
        [headline(result), *reasons(cast)],
        _entries(cast, curve=curve),
        curves=int(curve),
    )
    draw_fleet_plane(page.plane, cast, numbered=numbered)
    draw_bars(page.bars, cast)
    if curve:
        draw_nearest(page.curves[0], cast)
    hide_times(page.upper)
    return page.figure


def headline(result: FleetResult) -> str:
    """The numbers of a fleet in a line."""
    with_plan, count = len(result.plans), len(result.problem)
    parts = [f"{count} vehicle{'s' if count > 1 else ''}"]
    if with_plan < count:
        parts.append(f"{with_plan} with a plan" if with_plan else "none has a plan")
    if with_plan:
        parts += [f"sum {result.sum_s:.5g} s", f"last {result.last_s:.5g} s"]
    if result.gap is not None:
        parts.append(f"at least {result.lower_bound:.5g}" if result.gap else "proven optimal")
    if with_plan and math.isfinite(result.clearance_m):
        parts.append(f"clearance {result.clearance_m:.3g} m")
    return " · ".join(parts)


def reasons(cast: Cast) -> list[str]:
    """Why some do not arrive: a line for each reason, with the names that it holds for."""
    named: dict[str, list[str]] = {}
    for one in cast.members:
        if one.reason or one.course is None:
            named.setdefault(one.reason or "no plan", []).append(one.name)
    lines = []
    for reason, names in named.items():
        more = len(names) - MOST_REASONS
        rest = f" and {more} more" if more > 0 else ""
        lines.append(f"{', '.join(names[:MOST_REASONS])}{rest}: {reason}")
    more = len(lines) - MOST_REASONS
    return lines if more <= 0 else [*lines[:MOST_REASONS], f"and {more} more reasons"]


def _entries(cast: Cast, *, curve: bool) -> tuple[list[Artist], list[str]]:
    plane, plane_names = plane_handles(cast)
    time, time_names = time_handles(cast, distances=curve)
    return [*plane, *time], [*plane_names, *time_names]
