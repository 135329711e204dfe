"""Draw a closed loop in the plane: what was driven, and what had been planned at every step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.plotting.bodies import DART, DART_SIZE
from maneuver_automaton.plotting.closed_loop_track import (
    END_TOLERANCE,
    carried_poses,
    driven_track,
    loop_colors,
    loop_scene,
    loop_view,
    planned_places,
)
from maneuver_automaton.plotting.colors import GREY, INK, Color
from maneuver_automaton.plotting.ends import EndArtists, draw_ends, end_handles
from maneuver_automaton.plotting.footprint import placed
from maneuver_automaton.plotting.limits import LimitArtists, draw_limits, limit_handles
from maneuver_automaton.plotting.obstacles import (
    ObstacleArtists,
    draw_obstacles,
    obstacle_handles,
)
from maneuver_automaton.plotting.paths import (
    draw_still,
    spin_symbols,
    trim_handles,
)
from maneuver_automaton.plotting.scene import set_view
from maneuver_automaton.plotting.style import line_handle, outer_legend
from maneuver_automaton.plotting.track import Track
from maneuver_automaton.receding_horizon import ClosedLoop, Step

APART, APART_RAD = 0.4, 0.3  # between bodies, of their reach; turned further, both are drawn
MOST_SPINS = 12  # whose arrows can be told apart
PALE: tuple[float, ...] = (*GREY, 0.5)
JUMP: Color = (0.85, 0.15, 0.45)
JUMP_STYLE, NEW_STYLE = (0, (1.0, 1.2)), (0, (5.0, 2.0))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClosedLoopArtists:
    """Artists of `draw_closed_loop`; `path` has one segment per trim that drives."""

    path: LineCollection
    plans: LineCollection  # one per step, thin and pale
    new_plans: LineCollection  # one per step that replanned, dashed
    replanned: PathCollection  # where it did
    jumps: LineCollection  # from where a step ended to where the next one began
    bodies: PolyCollection  # at the steps that are apart
    spins: LineCollection
    spin_heads: PolyCollection
    still: tuple[PathCollection, ...]
    ends: EndArtists
    obstacles: ObstacleArtists
    limits: LimitArtists
    legend: Legend | None


def draw_closed_loop(
    ax: Axes,
    loop: ClosedLoop,
    *,
    footprint: Any = None,
    colors: Mapping[str, Color] | None = None,
    legend: bool = True,
) -> ClosedLoopArtists:
    """Draw a closed `loop` in the plane on `ax`, to scale.

    What was driven is drawn in the colours of its trims, with the body at the steps, as
    far as they are apart; behind it,
    pale, the plan of every step up to its goal, dashed where it is a new one. Where the vehicle
    was moved by something else, a dotted line shows how far.

    Parameters
    ----------
    ax : Axes
        Where to draw; its scale is made equal in x and y.
    loop : ClosedLoop
        What to draw.
    footprint : any form of `footprint_polygons`, optional
        The body; that of the problem if left out, where there is none a small dart.
    colors : mapping, optional
        Colour of each trim by name; `loop_colors` if left out.
    legend : bool
        Whether to name the trims and marks in the legend beside the axes.

    Returns
    -------
    ClosedLoopArtists
        The artists, by what they show.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton import Automaton, Problem, Unicycle
    >>> from maneuver_automaton.receding_horizon import simulate
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> loop = simulate(Problem(robot, [0, 0, 0], [2, 0, 0]), step=1.0)
    >>> artists = draw_closed_loop(Figure().add_subplot(), loop)
    >>> artists.path.get_segments()[0][[0, -1]].tolist(), len(artists.plans.get_segments())
    ([[0.0, 0.0], [2.0, 0.0]], 2)
    """
    track = driven_track(loop)
    used = dict(loop_colors(loop) if colors is None else colors)
    plans = planned_places(loop)
    scene = loop_scene(loop, footprint=footprint)
    body = scene.body
    box, size = loop_view(loop, scene)
    new = [step for step in loop.steps if step.replanned]
    spins = [piece for piece in track.pieces if not piece.drives and piece.turn]
    arcs, heads = spin_symbols(spins if len(spins) <= MOST_SPINS else [], size=size)
    spin_colors = [used[piece.name] for piece in spins[: len(arcs)]]
    driving = [piece for piece in track.pieces if piece.drives]
    artists = ClosedLoopArtists(
        path=LineCollection(
            [piece.pose[:, :2] for piece in driving],
            colors=[used[piece.name] for piece in driving],
            linewidths=2.6, capstyle="butt", joinstyle="round", zorder=3.0,
        ),
        plans=LineCollection(plans, colors=[PALE], linewidths=0.8, zorder=1.5),
        new_plans=LineCollection(
            [plan for step, plan in zip(loop.steps, plans, strict=True) if step.replanned],
            colors=[(*INK, 0.6)], linewidths=0.9, linestyles=[NEW_STYLE], zorder=1.8,
        ),
        replanned=_draw_replanned(ax, new),
        jumps=LineCollection(
            _jumps(loop), colors=[JUMP], linewidths=1.5, linestyles=[JUMP_STYLE], zorder=3.4
        ),
        bodies=_bodies(
            body or (DART_SIZE * size * DART,), loop.poses, outlined=bool(body),
            carried=carried_poses(loop),
        ),
        spins=LineCollection(arcs, colors=spin_colors, linewidths=1.8, zorder=4.0),
        spin_heads=PolyCollection(heads, facecolors=spin_colors, linewidths=0.0, zorder=4.0),
        still=draw_still(ax, track, used),
        ends=draw_ends(ax, loop.poses[0], loop.problem.goals, size=size),
        obstacles=draw_obstacles(ax, scene.obstacles, time=scene.times),
        limits=draw_limits(ax, scene.zones, scene.bounds),
        legend=_legend(ax, loop, track, used) if legend else None,
    )  # fmt: skip
    for part in (
        artists.path, artists.plans, artists.new_plans, artists.jumps, artists.bodies,
        artists.spins, artists.spin_heads,
    ):  # fmt: skip
        ax.add_collection(part)
    set_view(ax, box, loop.poses[0, :2])
    return artists


def loop_handles(
    loop: ClosedLoop, track: Track, colors: Mapping[str, Color]
) -> tuple[list[Artist], list[str]]:
    """Legend handles and names: the trims driven, start and goal, plans, and what else there is."""
    handles: list[Artist]
    trims, names = trim_handles(track, colors)
    marks, mark_names = end_handles(loop.problem.goals)
    scene = loop_scene(loop)
    around, around_names = obstacle_handles(scene.obstacles, scene.times)
    limits, limit_names = limit_handles(scene.zones, scene.bounds)
    handles = [*trims, *marks, *around, *limits]
    names = [*names, *mark_names, *around_names, *limit_names]
    if loop.steps:
        handles.append(line_handle(GREY, width=0.9))
        names.append("plan of a step")
    if any(step.replanned for step in loop.steps):
        new = _dot("o", size=5.0, face="white", edge=INK)
        new.set(linestyle=NEW_STYLE, linewidth=0.9, color=INK)
        handles.append(new)
        names.append("replanned")
    if _jumps(loop):
        jump = line_handle(JUMP, width=1.5)
        jump.set_linestyle(JUMP_STYLE)
        handles.append(jump)
        names.append("disturbance")
    return handles, names


def _jumps(loop: ClosedLoop) -> list[Array]:
    """Lines (2, 2) from where each piece ended to where the vehicle then was, if elsewhere."""
    lines = [
        np.array([plan.end[:2], pose[:2]])
        for plan, pose in zip(loop.driven, loop.poses[1:], strict=True)
    ]
    return [line for line in lines if np.abs(line[1] - line[0]).max() > END_TOLERANCE]


def _draw_replanned(ax: Axes, steps: Sequence[Step]) -> PathCollection:
    places = np.array([step.pose[:2] for step in steps]).reshape(-1, 2)
    return ax.scatter(
        places[:, 0],
        places[:, 1],
        s=22.0,
        facecolors="white",
        edgecolors=[INK],
        linewidths=1.0,
        zorder=4.2,
    )


def _bodies(
    body: Sequence[Array], poses: Array, *, outlined: bool,
    carried: Sequence[tuple[Sequence[Array], Array]],
) -> PolyCollection:  # fmt: skip
    """The body at those of the `poses` (n, dof) that are apart, the first and last among them.

    So is what it carries, each with its poses (n, dof).
    """
    reach = max(float(np.linalg.norm(outline, axis=1).max()) for outline in body)
    shown = [0] if len(poses) == 1 else [0, len(poses) - 1]
    for k, pose in enumerate(poses[1:-1], start=1):
        gaps = poses[shown, :3] - pose[:3]
        apart = np.hypot(gaps[:, 0], gaps[:, 1]) > APART * reach
        turned = np.abs(wrapped(gaps[:, 2])) > APART_RAD
        if (apart | turned).all():
            shown.append(k)
    return PolyCollection(
        placed(body, poses[shown])
        + [at for outlines, seen in carried for at in placed(outlines, seen[shown])],
        facecolors=[(*GREY, 0.06 if outlined else 0.35)],
        edgecolors=[(*INK, 0.55)],
        linewidths=0.7,
        zorder=2.0,
    )


def _dot(marker: str, *, size: float, face: Any, edge: Any) -> Line2D:
    return Line2D(
        [], [], linestyle="none", marker=marker, markersize=size, markerfacecolor=face,
        markeredgecolor=edge, markeredgewidth=1.0,
    )  # fmt: skip


def _legend(ax: Axes, loop: ClosedLoop, track: Track, colors: Mapping[str, Color]) -> Legend:
    handles, names = loop_handles(loop, track, colors)
    return outer_legend(ax, handles, names)
