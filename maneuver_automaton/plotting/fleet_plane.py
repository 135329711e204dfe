"""Draw a fleet in the plane: paths, bodies along them at equal times, starts and goals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.fleet_cast import Cast, Member
from maneuver_automaton.plotting.limits import LimitArtists, draw_limits, limit_handles
from maneuver_automaton.plotting.obstacles import (
    ObstacleArtists,
    draw_obstacles,
    obstacle_handles,
)
from maneuver_automaton.plotting.scene import set_view
from maneuver_automaton.plotting.style import line_handle

TINY = 0.008  # of the picture: smaller bodies are marks at starts and goals
HATCH = "/////"
FRONT = 0.8  # of the reach of a body, a line from its pose on shows where it looks
DIM = {12: (2.0, 0.30), 40: (1.4, 0.22)}  # width [pt] of paths, alpha of bodies, for up to so many
THIN = (0.9, 0.16)  # ... and for more
NUMBER_PT, STEP_PT = 6.5, 6.0
CASING = [withStroke(linewidth=3.0, foreground="white")]  # others may end where one starts


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FleetArtists:
    """Artists of `draw_fleet_plane`; those without a plan are in none but their own."""

    paths: LineCollection  # one line a vehicle
    bodies: PolyCollection  # along the paths at equal times
    starts: PolyCollection  # hollow
    goals: PolyCollection  # filled, where plans end
    marks: tuple[PathCollection, PathCollection]  # starts and goals of those too small to be seen
    fronts: LineCollection  # where bodies look at starts and goals
    missing: (
        PolyCollection  # hatched, where those end that do not arrive: without a plan, at starts
    )
    missing_marks: PathCollection  # crosses for those of them that are too small
    wanted: PolyCollection  # dashed, at their goals
    wanted_marks: PathCollection  # the same for those that are too small
    numbers: tuple[Text, ...]  # at the starts, if there are too many for a legend
    steps: tuple[Text, ...]  # at the bodies, on request
    obstacles: ObstacleArtists
    limits: LimitArtists


def draw_fleet_plane(ax: Axes, cast: Cast, *, numbered: bool = False) -> FleetArtists:
    """Draw all vehicles on `ax`, in equal scales.

    Bodies stand along the paths at the times of the scene, `numbered` in their order on request.
    """
    extent = float(np.ptp(cast.box, axis=0).max())
    driving = [one for one in cast.members if one.course is not None]
    standing = [one for one in cast.members if one.course is None]
    lost = [one for one in standing if one.reach < TINY * extent]
    stuck = [one for one in standing if one.reach >= TINY * extent]
    seen = [one for one in driving if one.reach >= TINY * extent]
    small = [one for one in driving if one.reach < TINY * extent]
    width, alpha = _weights(len(cast.members))
    along = [(one, time) for one in driving for time in _between(one, cast.scene.times)]
    bodies, body_colors = _bodies([(one, [time]) for one, time in along])
    starts, start_colors = _bodies([(one, [one.begin]) for one in seen])
    goals, goal_colors = _bodies([(one, [one.arrival]) for one in seen if one.arrives])
    missed = [*stuck, *(one for one in seen if not one.arrives)]
    missing, missing_colors = _bodies([(one, [one.arrival]) for one in missed])
    wanted = [(ring, one) for one in missed for ring in one.goal_outlines]
    fronts = [_front(one, time) for one in seen for time in (one.begin, one.arrival)]
    artists = FleetArtists(
        paths=LineCollection(
            [one.track.pose[:, :2] for one in driving], colors=[one.color for one in driving],
            linewidths=width, capstyle="round", joinstyle="round", zorder=3.0,
        ),
        bodies=PolyCollection(
            bodies, facecolors=[(*color, 0.4 * alpha) for color in body_colors],
            edgecolors=[(*color, 2.2 * alpha) for color in body_colors], linewidths=0.6, zorder=2.4,
        ),
        starts=PolyCollection(
            starts, facecolors="none", edgecolors=start_colors, linewidths=1.5, zorder=3.8,
            path_effects=CASING,
        ),
        goals=PolyCollection(
            goals, facecolors=goal_colors, edgecolors=[shaded(c, -0.4) for c in goal_colors],
            linewidths=0.8, zorder=3.6,
        ),
        marks=(
            _scattered(ax, [one.track.start for one in small], small, filled=False),
            _scattered(ax, [one.track.end for one in small], small, filled=True),
        ),
        fronts=LineCollection(
            fronts, linewidths=1.2, zorder=3.7,
            colors=[
                color for one in seen
                for color in (one.color, (1.0, 1.0, 1.0) if one.arrives else one.color)
            ],
        ),
        missing=PolyCollection(
            missing, facecolors="white", edgecolors=missing_colors, linewidths=1.0, hatch=HATCH,
            zorder=3.6,
        ),
        missing_marks=ax.scatter(
            [one.track.start[0] for one in lost], [one.track.start[1] for one in lost],
            s=34.0, marker="X", color=[one.color for one in lost], edgecolors="white",
            linewidths=0.7, zorder=3.9,
        ),
        wanted=PolyCollection(
            [ring for ring, _ in wanted], facecolors="none",
            edgecolors=[one.color for _, one in wanted], linewidths=1.0, linestyles=[(0, (3, 2))],
            zorder=2.2,
        ),
        wanted_marks=ax.scatter(
            [goal.pose[0] for one in lost for goal in one.problem.goals],
            [goal.pose[1] for one in lost for goal in one.problem.goals],
            s=24.0, marker="o", facecolors="none", linewidths=1.0, linestyles=[(0, (2, 1.5))],
            edgecolors=[one.color for one in lost for _ in one.problem.goals], zorder=3.6,
        ),
        numbers=tuple(_number(ax, one) for one in cast.members) if cast.many else (),
        steps=_steps(ax, along, cast.scene.times) if numbered else (),
        obstacles=draw_obstacles(ax, cast.scene.obstacles, time=cast.scene.times),
        limits=draw_limits(ax, cast.scene.zones, cast.scene.bounds),
    )  # fmt: skip
    for part in (
        artists.paths, artists.bodies, artists.starts, artists.goals, artists.fronts,
        artists.missing, artists.wanted,
    ):  # fmt: skip
        ax.add_collection(part, autolim=False)
    set_view(ax, cast.box, cast.box.mean(axis=0))
    return artists


def vehicle_handles(cast: Cast) -> tuple[list[Artist], list[str]]:
    """Legend handles and names of the vehicles, if they are few, and of those without a plan."""
    named = () if cast.many else cast.members
    handles: list[Artist] = [line_handle(one.color, width=3.4) for one in named]
    names = [one.name for one in named]
    if any(one.course is None for one in cast.members):
        handles.append(_hatched())
        names.append("no plan")
    return handles, names


def around_handles(cast: Cast, times: Array) -> tuple[list[Artist], list[str]]:
    """Legend handles and names of obstacles, moving ones at times (n,) [s], and of limits."""
    around, names = obstacle_handles(cast.scene.obstacles, times)
    limits, limit_names = limit_handles(cast.scene.zones, cast.scene.bounds)
    return [*around, *limits], [*names, *limit_names]


def plane_handles(cast: Cast) -> tuple[list[Artist], list[str]]:
    """Legend handles and names: the vehicles if they are few, and what the marks say."""
    handles, names = vehicle_handles(cast)
    if "no plan" not in names and not all(one.arrives for one in cast.members):
        handles.append(_hatched())
        names.append("not arrived")
    handles += [_square(face="white"), _square(face=INK)]
    names += ["start", "goal"]
    times = cast.scene.times
    if len(times) > 2 and any(one.outlines for one in cast.members):
        handles.append(Patch(facecolor=(*GREY, 0.15), edgecolor=GREY, linewidth=0.8))
        names.append(f"body every {float(np.median(np.diff(times))):.3g} s")
    around, around_names = around_handles(cast, times)
    return [*handles, *around], [*names, *around_names]


def _weights(count: int) -> tuple[float, float]:
    return next((weights for most, weights in DIM.items() if count <= most), THIN)


def _between(one: Member, times: Array) -> list[float]:
    """Those of the times at which it is under way [s]."""
    slack = 1e-6
    under_way = (times > one.begin + slack) & (times < one.arrival - slack)
    found: list[float] = times[under_way].tolist()
    return found


def _bodies(at: Sequence[tuple[Member, list[float]]]) -> tuple[list[Array], list[Color]]:
    """Outlines of vehicles at times, and their colours."""
    rows = [(ring, one.color) for one, times in at for t in times for ring in one.bodies_at(t)]
    return [ring for ring, _ in rows], [color for _, color in rows]


def _front(one: Member, time: float) -> Array:
    """The line (2, 2) from its pose to its front."""
    pose = one.parts[0].motion.pose_at(np.array([time]))[0]
    ahead = max(float(ring[:, 0].max()) for ring in one.outlines)
    return np.asarray(SE2(pose[:3]).act(np.array([[0.0, 0.0], [FRONT * ahead, 0.0]])))


def _scattered(
    ax: Axes, poses: Sequence[Array], members: Sequence[Member], *, filled: bool
) -> PathCollection:
    colors = [one.color for one in members]
    at = np.array([pose[:2] for pose in poses]).reshape(-1, 2)
    return ax.scatter(
        at[:, 0], at[:, 1], s=20.0 if filled else 26.0, marker="o", linewidths=1.3,
        facecolors=colors if filled else "none", edgecolors=colors, zorder=3.6 if filled else 3.8,
    )  # fmt: skip


def _number(ax: Axes, one: Member) -> Text:
    x, y = one.track.start[:2].tolist()
    return ax.annotate(
        one.label, (x, y), xytext=(3.5, 3.5), textcoords="offset points",
        fontsize=NUMBER_PT, color=shaded(one.color, -0.35), fontweight="bold", zorder=6.0,
        parse_math=False, path_effects=[withStroke(linewidth=1.6, foreground="white")],
        annotation_clip=True,
    )  # fmt: skip


def _steps(ax: Axes, along: Sequence[tuple[Member, float]], times: Array) -> tuple[Text, ...]:
    """The number of each time at the bodies that stand there at that time."""
    numbers = {time: str(k) for k, time in enumerate(times.tolist())}
    found = []
    for one, time in along:
        x, y = one.parts[0].motion.pose_at(np.array([time]))[0, :2]
        found.append(
            ax.text(
                x, y, numbers[time], fontsize=STEP_PT, color=shaded(one.color, -0.35),
                ha="center", va="center", zorder=5.0, clip_on=True, parse_math=False,
                path_effects=[withStroke(linewidth=1.4, foreground="white")],
            )
        )  # fmt: skip
    return tuple(found)


def _hatched() -> Patch:
    return Patch(facecolor="white", edgecolor=INK, hatch=HATCH, linewidth=0.8)


def _square(*, face: Any) -> Line2D:
    return Line2D(
        [], [], linestyle="none", marker="s", markersize=6.5, markeredgecolor=INK,
        markerfacecolor=face, markeredgewidth=1.2,
    )  # fmt: skip
