"""Draw several plans over each other, the best one on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.colors import SEQUENCE, Color
from maneuver_automaton.plotting.ends import EndArtists, draw_ends
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.labels import word_text
from maneuver_automaton.plotting.limits import LimitArtists, draw_limits
from maneuver_automaton.plotting.obstacles import ObstacleArtists, draw_obstacles, round_times
from maneuver_automaton.plotting.scene import (
    Scene,
    mark_size,
    scene_of,
    scene_points,
    scene_size,
    set_view,
    view_box,
)
from maneuver_automaton.plotting.style import outer_legend
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.problem import Goal, Problem

GOAL_TOLERANCE = 1e-6  # [m, rad] between ends that are one goal
DASHES: tuple[tuple[float, Sequence[float]] | Literal["-"], ...] = (
    "-",
    (0, (4, 1.5)),
    (0, (1.2, 1.2)),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AlternativesArtists:
    """Artists of `draw_alternatives`."""

    paths: tuple[Line2D, ...]  # in the order of the plans
    bodies: tuple[PolyCollection, ...]  # at the switching times, if there is a footprint
    ends: EndArtists
    obstacles: ObstacleArtists
    limits: LimitArtists
    legend: Legend | None


def plan_color(rank: int) -> Color:
    """Colour of the plan at `rank`, 0 for the best; repeats after eight."""
    return SEQUENCE[rank % len(SEQUENCE)]


def draw_alternatives(
    ax: Axes,
    plans: Sequence[Plan],
    *,
    costs: Sequence[float] = (),
    problem: Problem | None = None,
    footprint: Any = None,
    legend: bool = True,
) -> AlternativesArtists:
    """Draw `plans`, best first, in one picture to scale, one colour each, the best on top.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    plans : sequence of Plan
        What to draw, at least one, from a common start.
    costs : sequence of float
        Cost of each, for the legend.
    problem : Problem, optional
        Obstacles, goals and body to draw with them.
    footprint : any form of `footprint_polygons`, optional
        The body, drawn at the switching times; that of the problem if left out.
    legend : bool
        Whether to list words and costs in the emptiest corner.

    Returns
    -------
    AlternativesArtists
        The artists, by what they show.

    Raises
    ------
    ValueError
        If there is no plan, or the costs are not as many as the plans.
    """
    if not plans:
        raise ValueError("alternatives: got no plan, need at least one")
    if costs and len(costs) != len(plans):
        raise ValueError(f"alternatives: got {len(costs)} costs for {len(plans)} plans")
    tracks = [track_of_plan(plan) for plan in plans]
    scene = _scene(plans, problem, footprint)
    size = max(scene_size(scene, track) for track in tracks)
    points = np.concatenate([scene_points(scene, track, size=size) for track in tracks])
    box = view_box(scene, points, size=size)
    paths, bodies = _draw_tracks(ax, tracks, scene)
    artists = AlternativesArtists(
        paths=paths,
        bodies=bodies,
        ends=draw_ends(ax, plans[0].start, scene.goals, size=mark_size(scene, box, size=size)),
        obstacles=draw_obstacles(ax, scene.obstacles, time=scene.times),
        limits=draw_limits(ax, scene.zones, scene.bounds),
        legend=_legend(ax, plans, costs, paths) if legend else None,
    )
    set_view(ax, box, plans[0].start[:2])
    return artists


def _draw_tracks(
    ax: Axes, tracks: Sequence[Track], scene: Scene
) -> tuple[tuple[Line2D, ...], tuple[PolyCollection, ...]]:
    """A path for each track, and the body where it switches; the first on top."""
    paths = tuple(
        ax.plot(
            *track.pose[:, :2].T, color=plan_color(rank), linewidth=3.0 if rank == 0 else 1.8,
            linestyle=DASHES[rank // len(SEQUENCE) % len(DASHES)], zorder=4.0 - rank / len(tracks),
        )[0]
        for rank, track in enumerate(tracks)
    )  # fmt: skip
    bodies = tuple(
        PolyCollection(
            placed(scene.body, track.switching_poses), facecolors="none",
            edgecolors=[(*plan_color(rank), 0.9 if rank == 0 else 0.5)],
            linewidths=1.0 if rank == 0 else 0.7, zorder=2.5 - rank / len(tracks),
        )
        for rank, track in enumerate(tracks)
        if scene.body
    )  # fmt: skip
    for part in bodies:
        ax.add_collection(part)
    return paths, bodies


def alternative_text(plan: Plan, cost: float | None, *, width: int) -> str:
    """Cost and word of a plan in one line of about `width` characters."""
    price = "" if cost is None else f"cost {cost:.5g}   "
    return price + word_text(plan.word, width=width - len(price), lines=1)


def _legend(
    ax: Axes, plans: Sequence[Plan], costs: Sequence[float], paths: Sequence[Line2D]
) -> Legend:
    labels = [
        alternative_text(plan, costs[rank] if costs else None, width=60)
        for rank, plan in enumerate(plans)
    ]
    return outer_legend(ax, paths, labels, length=80, above=True)


def _scene(plans: Sequence[Plan], problem: Problem | None, footprint: Any) -> Scene:
    """The scene of a problem during all plans; without one, their ends are the goals."""
    begin, end = plans[0].start_time, max(plan.switching_times[-1] for plan in plans)
    if problem is not None:
        return scene_of(problem, begin, float(end), footprint=footprint)
    ends: list[Array] = []
    for plan in plans:
        if all(np.abs(plan.end - other).max() > GOAL_TOLERANCE for other in ends):
            ends.append(plan.end)
    return Scene(
        goals=tuple(Goal(pose=pose) for pose in ends),
        body=tuple(footprint_polygons(footprint)),
        times=round_times(begin, float(end)),
    )
