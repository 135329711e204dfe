"""Draw a plan in the plane: its path, what its body sweeps, and what it is among."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.bodies import (
    SWEPT,
    SWEPT_ALPHA,
    darts,
    draw_switches,
    goal_bodies,
    moment_bodies,
    swept_area,
    switch_bodies,
)
from maneuver_automaton.plotting.colors import INK, Color
from maneuver_automaton.plotting.ends import EndArtists, draw_ends, end_handles
from maneuver_automaton.plotting.footprint import footprint_polygons
from maneuver_automaton.plotting.labels import shown_name
from maneuver_automaton.plotting.limits import LimitArtists, draw_limits, limit_handles
from maneuver_automaton.plotting.motions import MOST_TRIMS, motion_names, track_colors
from maneuver_automaton.plotting.obstacles import (
    ROBOT,
    ObstacleArtists,
    draw_obstacles,
    obstacle_handles,
)
from maneuver_automaton.plotting.scene import (
    Scene,
    mark_size,
    plan_scene,
    scene_points,
    scene_size,
    set_view,
    view_box,
)
from maneuver_automaton.plotting.style import line_handle, outer_legend
from maneuver_automaton.plotting.track import Piece, Track, track_of_plan
from maneuver_automaton.problem import Goal, Problem

SPIN_RADIUS = 0.09  # of the size of the path
ARC_POINTS = 61  # of a turn on the spot
RING, CLIMB, SINK = "o", "^", "v"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanArtists:
    """Artists of `draw_plan`; `path` has one segment per trim that drives."""

    path: LineCollection
    halo: LineCollection  # white, below the path
    swept: PathCollection  # what the body covers; empty if it is not known
    darts: PolyCollection  # along the path, where the body is not known
    bodies: PolyCollection  # at the switching times
    moment_bodies: PolyCollection  # at the times at which moving obstacles are shown
    goal_bodies: PolyCollection  # at the goals that are not reached
    switches: PathCollection  # dots where one trim follows another
    spins: LineCollection  # arcs for turns on the spot
    spin_heads: PolyCollection
    still: tuple[PathCollection, ...]  # a ring for each rest, a triangle for a climb on the spot
    ends: EndArtists
    obstacles: ObstacleArtists
    limits: LimitArtists
    legend: Legend | None


def draw_plan(
    ax: Axes,
    plan: Plan,
    *,
    problem: Problem | None = None,
    footprint: Any = None,
    goal: ArrayLike | None = None,
    colors: Mapping[str, Color] | None = None,
    legend: bool = True,
) -> PlanArtists:
    """Draw a `plan` in the plane on `ax`, to scale, each trim in its colour.

    Moving obstacles are shown at a few times, and the body at the same times in the same colours.

    Parameters
    ----------
    ax : Axes
        Where to draw; its scale is made equal in x and y.
    plan : Plan
        What to draw.
    problem : Problem, optional
        Obstacles, goals and body to draw with it.
    footprint : any form of `footprint_polygons`, optional
        The body, drawn at the switching times, and what it sweeps; that of the problem if left
        out. Where there is none, small darts stand for it.
    goal : (dof,) array_like, optional
        Pose of the goal [m, m, rad(, m)]; those of the problem, or else the end of the plan, if
        left out.
    colors : mapping, optional
        Colour of each trim by name; `track_colors` of the plan's trims if left out.
    legend : bool
        Whether to name the trims beside the axes.

    Returns
    -------
    PlanArtists
        The artists, by what they show.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    >>> artists = draw_plan(Figure().add_subplot(), plan)
    >>> artists.path.get_segments()[0].tolist()
    [[0.0, 0.0], [2.0, 0.0]]
    """
    track = track_of_plan(plan)
    used = dict(track_colors(track.twists) if colors is None else colors)
    if problem is None:
        scene = bare_scene(track, footprint=footprint)
    else:
        scene = plan_scene(problem, plan, footprint=footprint)
    if goal is not None:
        at = Goal(pose=as_array("goal", goal, last=plan.start.size))
        scene = replace(scene, goals=(at,), reached=0)
    return draw_track(ax, track, scene, colors=used, legend=legend)


def bare_scene(track: Track, *, footprint: Any) -> Scene:
    """A scene of which nothing is known but the end of the track, and a body."""
    body = tuple(footprint_polygons(footprint))
    return Scene(goals=(Goal(pose=track.end),), reached=0, body=body, times=np.zeros(1))


def draw_track(
    ax: Axes, track: Track, scene: Scene, *, colors: Mapping[str, Color], legend: bool
) -> PlanArtists:
    """Draw a `track` in a `scene`; see `draw_plan`."""
    size = scene_size(scene, track)
    box = view_box(scene, scene_points(scene, track, size=size), size=size)
    size = mark_size(scene, box, size=size)
    driving = [piece for piece in track.pieces if piece.drives]
    lines = [piece.pose[:, :2] for piece in driving]
    spins = [piece for piece in track.pieces if not piece.drives and piece.turn]
    arcs, heads = spin_symbols(spins, size=size)
    spin_colors = [colors[piece.name] for piece in spins]
    artists = PlanArtists(
        path=LineCollection(
            lines, colors=[colors[piece.name] for piece in driving],
            linewidths=2.6, capstyle="butt", joinstyle="round", zorder=3.0,
        ),
        halo=LineCollection(
            lines, colors=["white"], linewidths=4.0, capstyle="butt", joinstyle="round", zorder=2.9
        ),
        swept=swept_area(track, scene),
        darts=darts(track, scene, size=size),
        bodies=switch_bodies(track, scene),
        moment_bodies=moment_bodies(track, scene),
        goal_bodies=goal_bodies(scene),
        switches=draw_switches(ax, track, scene, size=size),
        spins=LineCollection(arcs, colors=spin_colors, linewidths=1.8, zorder=4.0),
        spin_heads=PolyCollection(heads, facecolors=spin_colors, linewidths=0.0, zorder=4.0),
        still=draw_still(ax, track, colors),
        ends=draw_ends(ax, track.start, scene.goals, size=size, reached=scene.reached),
        obstacles=draw_obstacles(ax, scene.obstacles, time=scene.times),
        limits=draw_limits(ax, scene.zones, scene.bounds),
        legend=_legend(ax, track, scene, colors) if legend else None,
    )  # fmt: skip
    for part in (
        artists.path, artists.halo, artists.swept, artists.darts, artists.bodies,
        artists.moment_bodies, artists.goal_bodies, artists.spins, artists.spin_heads,
    ):  # fmt: skip
        ax.add_collection(part)
    set_view(ax, box, track.start[:2])
    return artists


def trim_handles(track: Track, colors: Mapping[str, Color]) -> tuple[list[Line2D], list[str]]:
    """Legend handles and names of the trims of a `track` that can be seen, in order.

    Of how they move, if they are many.
    """
    symbols = {piece.name: _symbol(piece) for piece in reversed(track.pieces)}
    seen = {name: twist for name, twist in track.twists.items() if name in track.seen}
    entries = motion_names(seen, many=len(colors) > MOST_TRIMS)
    handles = [line_handle(colors[name], marker=symbols[name]) for name in entries.values()]
    return handles, [shown_name(name) for name in entries]


def scene_handles(track: Track, scene: Scene) -> tuple[list[Artist], list[str]]:
    """Legend handles and names of start, goals, obstacles, limits, and what the body sweeps."""
    ends, names = end_handles(scene.goals)
    around, around_names = obstacle_handles(scene.obstacles, scene.times)
    swept = bool(scene.body and track.pieces)
    patches = [Patch(facecolor=(*SWEPT, SWEPT_ALPHA))] if swept else []
    by = " and the ".join(["swept by the body", *(part.name for part in scene.carried)])
    said = [by] if swept else []
    if swept and scene.moves:
        patches.append(Patch(facecolor=(*ROBOT, 0.85), edgecolor=INK))
        said.append("body at the same times")
    limits, limit_names = limit_handles(scene.zones, scene.bounds)
    return [*ends, *patches, *around, *limits], [*names, *said, *around_names, *limit_names]


def _symbol(piece: Piece) -> str:
    """Marker of a piece that stays where it is, empty if a line shows it."""
    if piece.drives or piece.turn:
        return ""
    return RING if not piece.climb else CLIMB if piece.climb > 0.0 else SINK


def spin_symbols(spins: list[Piece], *, size: float) -> tuple[list[Array], list[Array]]:
    """Arcs about the place of each turn and their arrow heads; later turns there lie outside."""
    arcs, heads, places = [], [], np.zeros((0, 2))
    for piece in spins:
        x, y, heading = piece.pose[0, :3]
        here = np.linalg.norm(places - (x, y), axis=1) < 1e-6 * size
        places = np.concatenate([places, [[x, y]]])
        radius = SPIN_RADIUS * size * (1.0 + 0.3 * np.count_nonzero(here))
        turn = float(np.clip(piece.turn, -1.93 * np.pi, 1.93 * np.pi))
        angle = heading + np.linspace(0.0, turn, ARC_POINTS)
        spokes = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        arcs.append((x, y) + radius * spokes)
        along = np.sign(turn) * np.array([-spokes[-1, 1], spokes[-1, 0]])
        tip, wing = 0.042 * size * along, 0.018 * size * spokes[-1]
        heads.append(arcs[-1][-1] + np.array([tip, wing, -wing]))
    return arcs, heads


def draw_still(ax: Axes, track: Track, colors: Mapping[str, Color]) -> tuple[PathCollection, ...]:
    """A marker for every piece that stays where it is."""
    return tuple(
        ax.scatter(
            piece.pose[0, 0], piece.pose[0, 1], s=150.0, marker=_symbol(piece), facecolors="none",
            edgecolors=[colors[piece.name]], linewidths=1.8, zorder=4.5,
        )
        for piece in track.pieces
        if _symbol(piece) and piece.name in track.seen
    )  # fmt: skip


def _legend(ax: Axes, track: Track, scene: Scene, colors: Mapping[str, Color]) -> Legend:
    handles, labels = trim_handles(track, colors)
    marks, names = scene_handles(track, scene)
    return outer_legend(ax, [*handles, *marks], [*labels, *names])
