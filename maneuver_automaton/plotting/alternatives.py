"""Draw several plans over each other, the best one on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.colors import SEQUENCE, Color
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.labels import word_text
from maneuver_automaton.plotting.paths import (
    ARROW_SIZE,
    STILL_SIZE_M,
    draw_goal,
    draw_headings,
    draw_start,
    set_view,
)
from maneuver_automaton.plotting.style import corner_legend
from maneuver_automaton.plotting.track import track_of_plan

DASHES: tuple[tuple[float, Sequence[float]] | Literal["-"], ...] = (
    "-",
    (0, (4, 1.5)),
    (0, (1.2, 1.2)),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AlternativesArtists:
    """What `draw_alternatives` has drawn."""

    paths: tuple[Line2D, ...]  # in the order of the plans
    bodies: tuple[PolyCollection, ...]  # at the switching times, if there is a footprint
    start: PathCollection
    goals: tuple[PathCollection, ...]
    headings: Quiver
    legend: Legend | None


def plan_color(rank: int) -> Color:
    """Colour of the plan at `rank`, 0 for the best; repeats after eight."""
    return SEQUENCE[rank % len(SEQUENCE)]


def draw_alternatives(
    ax: Axes,
    plans: Sequence[Plan],
    *,
    costs: Sequence[float] = (),
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
    footprint : any form of `footprint_polygons`, optional
        The body, drawn at the switching times.
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
    outlines = footprint_polygons(footprint)
    size = max(track.size for track in tracks) or STILL_SIZE_M
    ends = np.array([plans[0].start, *_distinct([track.end for track in tracks], within=1e-6)])
    paths = tuple(
        ax.plot(
            *track.pose[:, :2].T, color=plan_color(rank), linewidth=3.0 if rank == 0 else 1.8,
            linestyle=DASHES[rank // len(SEQUENCE) % len(DASHES)], zorder=4.0 - rank / len(tracks),
        )[0]
        for rank, track in enumerate(tracks)
    )  # fmt: skip
    bodies = tuple(
        PolyCollection(
            placed(outlines, track.switching_poses), facecolors="none",
            edgecolors=[(*plan_color(rank), 0.9 if rank == 0 else 0.5)],
            linewidths=1.0 if rank == 0 else 0.7, zorder=2.5 - rank / len(tracks),
        )
        for rank, track in enumerate(tracks)
        if outlines
    )  # fmt: skip
    for part in bodies:
        ax.add_collection(part)
    artists = AlternativesArtists(
        paths=paths,
        bodies=bodies,
        start=draw_start(ax, plans[0].start),
        goals=tuple(draw_goal(ax, pose) for pose in ends[1:]),
        headings=draw_headings(ax, ends, length=ARROW_SIZE * size),
        legend=_legend(ax, plans, costs, paths) if legend else None,
    )
    set_view(ax, ends, size=size)
    return artists


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
    points = np.concatenate([np.stack(path.get_data(), axis=-1) for path in paths])
    return corner_legend(ax, paths, labels, points=points, length=80)


def _distinct(poses: Sequence[Array], *, within: float) -> list[Array]:
    """The poses that differ by more than `within`."""
    kept: list[Array] = []
    for pose in poses:
        if all(np.abs(pose - other).max() > within for other in kept):
            kept.append(pose)
    return kept
