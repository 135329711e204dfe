"""A fleet's closed loop in motion: all bodies, what each drove of late, and the plans they hold."""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection

from maneuver_automaton._arrays import Array
from maneuver_automaton.fleet import FleetLog
from maneuver_automaton.plotting.closed_loop_plane import NEW_STYLE
from maneuver_automaton.plotting.film import Film, check_film_path, write_film
from maneuver_automaton.plotting.fleet_animation import Moving, film_of_cast
from maneuver_automaton.plotting.fleet_cast import Cast
from maneuver_automaton.plotting.fleet_loop_cast import fleet_values, held_tracks, loop_cast_of
from maneuver_automaton.plotting.track import Track

MOST_SWAPS = 2  # of a step that are named


def animate_fleet_loop(log: FleetLog, path: str | Path) -> None:
    """Write a film of a fleet's closed loop; dashed ahead of each vehicle the plan it holds.

    The file is replaced in one step. Beside the time stand the number of the step, the value of
    all, and who exchanges a plan.

    Parameters
    ----------
    log : FleetLog
        What to show.
    path : str or Path
        Where to write; the ending must be .gif, or .mp4 where Matplotlib finds ffmpeg.

    Raises
    ------
    ValueError
        If the ending is another one.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target = check_film_path(path)
    write_film(fleet_loop_film(log), target)


def fleet_loop_film(log: FleetLog) -> Film:
    """The figure of a fleet's closed loop that moves, in no window.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, simulate_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [2, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> log = simulate_fleet(FleetProblem(rows), step=0.5, first_time_limit=1.0)
    >>> film = fleet_loop_film(log)
    >>> film.show(0.75)
    >>> film.moving[-1].get_text()
    '0.75 s · step 1 · V = 3'
    """
    cast, values, times = loop_cast_of(log), fleet_values(log), log.times.tolist()

    def said(time: float) -> list[str]:
        if not log.steps or time >= min(times[-1], cast.end):
            return [log.status.replace("_", " ")]
        k = max(bisect_right(times, time) - 1, 0)
        step, parts = log.steps[k], [f"step {log.steps[k].number}"]
        if np.isfinite(values[k]):
            parts.append(f"V = {values[k]:.4g}")
        swaps = [" and ".join(swap.names) for swap in step.swaps]
        if swaps:
            more = f" and {len(swaps) - MOST_SWAPS} more" if len(swaps) > MOST_SWAPS else ""
            parts.append(f"exchanged: {', '.join(swaps[:MOST_SWAPS])}{more}")
        if step.violations:
            parts.append("guarantee broken")
        return parts

    return film_of_cast(cast, [_ahead(log, cast)], said)


def _ahead(log: FleetLog, cast: Cast) -> Moving:
    """What is left of the plan that each vehicle holds."""
    held = [(one, held_tracks(log, one.name)) for one in cast.members]
    lines = LineCollection([], linewidths=1.4, linestyles=[NEW_STYLE], zorder=2.8)

    def show(time: float) -> None:
        shown = [
            (places, one.color)
            for one, rows in held
            if one.is_there(time)
            for places in _left(rows, time)
        ]
        lines.set_segments([places for places, _ in shown])
        lines.set_color([(*color, 0.9) for _, color in shown])

    return Moving(artist=lines, show=show)


def _left(rows: list[tuple[float, Track]], time: float) -> list[Array]:
    """Places (n, 2) of the pieces that are left of the plan held at a time [s]."""
    k = bisect_right([begin for begin, _ in rows], time) - 1
    if k < 0:
        return []
    return [places for _, places in rows[k][1].between(time, np.inf)]
