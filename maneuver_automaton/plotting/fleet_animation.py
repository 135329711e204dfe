"""A fleet in motion: all bodies, what each drove in the last two seconds, and the time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Patch

from maneuver_automaton._arrays import Array
from maneuver_automaton.fleet import FleetResult
from maneuver_automaton.plotting.colors import INK, shaded
from maneuver_automaton.plotting.film import Film, check_film_path, picture_times, write_film
from maneuver_automaton.plotting.fleet_cast import Cast, Member, cast_of
from maneuver_automaton.plotting.fleet_plane import (
    HATCH,
    TINY,
    around_handles,
    vehicle_handles,
)
from maneuver_automaton.plotting.limits import draw_limits
from maneuver_automaton.plotting.obstacles import draw_obstacles, moving_shapes
from maneuver_automaton.plotting.pages import axes_at, bottom_legend, legend_rows, new_figure
from maneuver_automaton.plotting.scene import set_view
from maneuver_automaton.plotting.stage import Stage, even_height

TRAIL_S = 2.0  # of what was driven is shown
OUTLINED = 40  # so many vehicles at most have outlines
WIDTH, LEFT, RIGHT, TOP = 6.4, 0.75, 0.2, 0.36  # [in]
LOWEST, HIGHEST = 1.6, 5.2  # [in] of the plane
COLOR_SAMPLES = 6  # pictures that the colours of the film are taken from


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Moving:
    """Lines of a film that are another at every time."""

    artist: LineCollection
    show: Callable[[float], None]  # at a time [s]


Said = Callable[[float], Sequence[str]]


def _nothing(_: float) -> Sequence[str]:
    return ()


def animate_fleet(result: FleetResult, path: str | Path) -> None:
    """Write a film of a fleet: all bodies, trails of two seconds, the time in the corner.

    The file is replaced in one step. More than forty vehicles have no outlines; one without a plan
    stands at its start, hatched, and one that leaves is gone once it has arrived.

    Parameters
    ----------
    result : FleetResult
        What to drive.
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
    write_film(fleet_film(result), target)


def fleet_film(result: FleetResult) -> Film:
    """The figure of a fleet that moves, in no window.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, plan_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [3, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> film = fleet_film(plan_fleet(FleetProblem(rows), max_rounds=0))
    >>> film.show(1.5)
    >>> film.moving[-1].get_text()
    '1.50 s'
    """
    return film_of_cast(cast_of(result))


def film_of_cast(cast: Cast, more: Sequence[Moving] = (), said: Said = _nothing) -> Film:
    """The film of vehicles; `more` moves beside them, and `said` is told beside the time."""
    stage = _stage(cast)
    for one in more:
        stage.ax.add_collection(one.artist, autolim=False)
    outlined = len(cast.members) <= OUTLINED
    trails = LineCollection([], linewidths=2.2 if outlined else 1.4, capstyle="butt", zorder=3.0)
    bodies = PolyCollection([], linewidths=0.9 if outlined else 0.0, zorder=4.0)
    extent = float(np.ptp(cast.box, axis=0).max())
    driving = [one for one in cast.members if one.course is not None]
    small = [one for one in driving if one.reach < TINY * extent]
    dots = stage.ax.scatter([], [], s=18.0, linewidths=0.0, zorder=4.1)
    for part in (trails, bodies):
        stage.ax.add_collection(part, autolim=False)

    def show(time: float) -> None:
        stage.show(time)
        lines = [(line, one) for one in driving for line in _trail(one, time)]
        trails.set_segments([line for line, _ in lines])
        trails.set_color([(*one.color, 0.5) for _, one in lines])
        rings = [(ring, one) for one in driving for ring in one.bodies_at(time)]
        bodies.set_verts([ring for ring, _ in rings])
        bodies.set_facecolor([one.color for _, one in rings])
        bodies.set_edgecolor([shaded(one.color, -0.45) for _, one in rings])
        there = [one for one in small if one.is_there(time)]
        places = [one.parts[0].motion.pose_at(time)[:2] for one in there]
        dots.set_offsets(np.array(places).reshape(-1, 2))
        dots.set_facecolor([one.color for one in there])
        for one in more:
            one.show(time)
        stage.clock.set_text(" · ".join([f"{time:.2f} s", *said(time)]))

    times = picture_times(cast.begin, cast.end)
    beside = [one.artist for one in more]
    moving: list[Artist] = [stage.traffic, *beside, trails, bodies, dots, stage.clock]
    samples = np.linspace(cast.begin, cast.end, COLOR_SAMPLES).tolist()
    return Film(figure=stage.figure, moving=moving, show=show, times=times, samples=samples[::-1])


def _trail(one: Member, time: float) -> list[Array]:
    """Places (n, 2) of the pieces that it drove of late; none once it is gone."""
    if not one.is_there(time):
        return []
    return [places for _, places in one.track.between(time - TRAIL_S, time)]


def _stage(cast: Cast) -> Stage:
    """What does not move: obstacles, faint paths, goals, and vehicles without a plan."""
    handles, names = _entries(cast)
    inner = WIDTH - LEFT - RIGHT
    wide, high = np.ptp(cast.box, axis=0).tolist()
    height = min(max(inner * high / max(wide, 1e-9), LOWEST), HIGHEST)
    bottom = 0.62 + 0.2 * legend_rows(names, inner)
    figure = new_figure(WIDTH, even_height(bottom + height + TOP))
    ax = axes_at(figure, left=LEFT, bottom=bottom, width=inner, height=height)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    driving = [one for one in cast.members if one.course is not None]
    standing = [one for one in cast.members if one.course is None]
    hatched = [(ring, one) for one in standing for ring in one.bodies_at(one.begin)]
    goals = [(ring, one) for one in cast.members for ring in one.goal_outlines]
    ax.add_collection(
        LineCollection(
            [one.track.pose[:, :2] for one in driving], linewidths=0.6, zorder=1.8,
            colors=[(*one.color, 0.35) for one in driving],
        ),
        autolim=False,
    )  # fmt: skip
    ax.add_collection(
        PolyCollection(
            [ring for ring, _ in goals], facecolors="none", linewidths=0.7, zorder=2.2,
            edgecolors=[(*one.color, 0.7) for _, one in goals], linestyles=[(0, (3, 2))],
        ),
        autolim=False,
    )  # fmt: skip
    ax.add_collection(
        PolyCollection(
            [ring for ring, _ in hatched], facecolors="white", linewidths=0.9, hatch=HATCH,
            edgecolors=[one.color for _, one in hatched], zorder=3.9,
        ),
        autolim=False,
    )  # fmt: skip
    obstacles = draw_obstacles(ax, cast.scene.obstacles, time=cast.begin)
    draw_limits(ax, cast.scene.zones, cast.scene.bounds)
    set_view(ax, cast.box, cast.box.mean(axis=0))
    clock = ax.text(
        1.0, 1.01, "", fontsize=10.0, color=INK, ha="right", va="bottom",
        transform=ax.transAxes, parse_math=False,
    )  # fmt: skip
    return Stage(
        figure=figure, ax=ax, traffic=obstacles.moving,
        moving=moving_shapes(cast.scene.obstacles), clock=clock,
    )  # fmt: skip


def _entries(cast: Cast) -> tuple[list[Artist], list[str]]:
    """Legend handles and names: vehicles if they are few, goals, and what is around."""
    vehicles, names = vehicle_handles(cast)
    goal = Patch(facecolor="none", edgecolor=INK, linestyle=(0, (3, 2)), linewidth=0.8)
    around, around_names = around_handles(cast, cast.scene.times[:1])
    return [*vehicles, goal, *around], [*names, "goal", *around_names]
