"""Draw one vehicle in the plane: its path, where its body is, where it starts and is to end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.patches import Circle, Patch
from matplotlib.quiver import Quiver

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.plotting.cast import Actor, Cast
from maneuver_automaton.plotting.colors import GREY, INK, MOST_TRIMS, SWEPT, Color, motion_names
from maneuver_automaton.plotting.obstacles import ROBOT, moment_colors, region_path
from maneuver_automaton.plotting.style import (
    SMALL_PT,
    Entries,
    dashed_handle,
    line_handle,
    mark_handle,
    shown_name,
)
from maneuver_automaton.plotting.track import (
    Track,
    TrackPiece,
    footprint_polygons,
    merged,
    placed,
    swept_region,
)
from maneuver_automaton.problem import Goal, Via

ARROW_SIZE = 0.13  # of the size of the path
SET: Color = (0.00, 0.62, 0.45)
WAY: Color = (0.00, 0.35, 0.60)


def draw_ends(
    ax: Axes,
    start: Array,
    goals: Sequence[Goal],
    *,
    size: float,
    reached: int | None = None,
    via: Sequence[Via] = (),
) -> dict[str, Any]:
    """Draw a start pose (dof,), what is on the way, and all goals: others than `reached` pale."""
    pale = [reached is not None and k != reached for k in range(len(goals))]
    colors = [GREY if others else INK for others in pale]
    headed = [k for k, goal in enumerate(goals) if not goal.free_heading]
    artists: dict[str, Any] = {
        "start": ax.scatter(start[0], start[1], s=26.0, color=[INK], linewidths=0.0, zorder=5.1)
    }
    for k, (goal, color) in enumerate(zip(goals, colors, strict=True)):
        artists[f"goal {k}"] = draw_goal(ax, goal.pose, color=color)
        if goal.free_heading:
            artists[f"any heading {k}"] = ax.scatter(
                goal.pose[0], goal.pose[1], s=210.0, facecolors="none", edgecolors=[color],
                linewidths=1.1, zorder=4.9,
            )  # fmt: skip
        if goal.tolerance_m > 0.0:
            artists[f"tolerance {k}"] = ax.add_patch(
                Circle(
                    (float(goal.pose[0]), float(goal.pose[1])), goal.tolerance_m,
                    facecolor=(*SET, 0.15), edgecolor=SET, linewidth=0.9, zorder=1.6,
                )
            )  # fmt: skip
    faced = [one.pose for one in via if not one.free_heading]
    artists["headings"] = draw_headings(
        ax,
        np.array([start, *faced, *(goals[k].pose for k in headed)]),
        length=ARROW_SIZE * size,
        color=[INK, *(WAY for _ in faced), *(colors[k] for k in headed)],
    )
    return artists | _draw_via(ax, via)


def _draw_via(ax: Axes, via: Sequence[Via]) -> dict[str, Any]:
    """Numbers in circles at poses on the way; gates as lines, tolerances as discs."""
    artists: dict[str, Any] = {}
    for k, one in enumerate(via, 1):
        x, y = one.place[:2].tolist()
        if one.gate is not None:
            (artists[f"gate {k}"],) = ax.plot(
                one.gate[:, 0], one.gate[:, 1], color=WAY, linewidth=1.4, linestyle=(0, (3, 2)),
                marker="|", markersize=6.0, zorder=4.6,
            )  # fmt: skip
            x, y = one.gate[1, :2].tolist()
        if one.tolerance_m > 0.0 and one.gate is None:
            disc = Circle((x, y), one.tolerance_m, facecolor=(*WAY, 0.12), edgecolor=WAY)
            disc.set(linewidth=0.9, zorder=1.6)
            artists[f"near {k}"] = ax.add_patch(disc)
        artists[f"via {k}"] = ax.scatter(
            x, y, s=105.0, facecolors=["white"], edgecolors=[WAY], linewidths=1.2, zorder=5.2,
        )  # fmt: skip
        artists[f"number {k}"] = ax.annotate(
            str(k), (x, y), ha="center", va="center_baseline", fontsize=SMALL_PT, color=WAY,
            zorder=5.3, annotation_clip=True,
        )  # fmt: skip
    return artists


def draw_goal(ax: Axes, pose: Array, *, color: Color = INK) -> PathCollection:
    """A diamond for a goal; a start in the same place shows inside."""
    return ax.scatter(
        pose[0], pose[1], s=58.0, marker="D", facecolors=["white"], edgecolors=[color],
        linewidths=1.3, zorder=5.0 if color == INK else 4.9,
    )  # fmt: skip


def draw_headings(
    ax: Axes, poses: Array, *, length: float, color: Color | Sequence[Color] = INK
) -> Quiver:
    """Arrows of `length` [m] for the headings of poses (n, dof)."""
    arrows = length * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
    ax.update_datalim(poses[:, :2] + arrows)
    return ax.quiver(
        *poses[:, :2].T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, units="inches",
        width=0.018, headwidth=5.0, headlength=6.0, headaxislength=5.2, color=color, zorder=4.8,
    )  # fmt: skip


def end_entries(goals: Sequence[Goal] = (), via: Sequence[Via] = ()) -> Entries:
    """Legend entries of start and goals, what else there is of goals, and poses on the way."""
    free = [goal.free_heading for goal in goals]
    goal_name = "goal, any heading" if free and all(free) else "goal"
    entries: list[tuple[Artist, str]] = [
        (mark_handle("o", size=5.5, face=INK, edge=INK), "start"),
        (mark_handle("D", size=6.0, edge=INK), goal_name),
    ]
    if any(free) and not all(free):
        entries.append((mark_handle("o", size=9.0, edge=INK), "any heading"))
    if len(goals) > 1:
        entries.append((mark_handle("D", size=6.0, edge=GREY), "other goal"))
    if any(goal.tolerance_m > 0.0 for goal in goals):
        entries.append((mark_handle("o", size=9.0, face=(*SET, 0.15), edge=SET), "goal tolerance"))
    if any(one.gate is None for one in via):
        entries.append((mark_handle("o", size=9.0, edge=WAY), "on the way"))
    if any(one.gate is not None for one in via):
        entries.append((dashed_handle(WAY, (0, (3, 2)), width=1.4), "gate"))
    return entries


SPIN_RADIUS, ARC_POINTS, MOST_SPINS = 0.09, 61, 12  # of the size; more cannot be told apart
RING, CLIMB, SINK = "o", "^", "v"
FAINT_DARTS = 9  # along a path
DART = np.array([[0.6, 0.0], [-0.4, 0.32], [-0.22, 0.0], [-0.4, -0.32]])
DART_SIZE = 0.066  # of the size of the path
DARTS_APART = 2.5  # of their size, at least, between those where trims begin
TURNED_RAD = 0.3  # of two bodies in one place, at least
SWEPT_ALPHA = 0.20
MOST_MOTIONS, INNER_BODIES = 6, 3  # so few motions have bodies within, at most so many each
BODIES_APART = 2.0  # of the reach, at least, between bodies within a motion
STEPS_APART = 0.4  # of the reach, between the bodies at two steps of a loop
FEW_BODIES, LEAST_ALPHA = 8, 0.3  # more bodies than that are fainter, but not more than this
JUMP: Color = (0.85, 0.15, 0.45)
JUMP_STYLE, HELD_STYLE = (0, (1.0, 1.2)), (0, (5.0, 2.0))


def draw_path(ax: Axes, cast: Cast) -> dict[str, Any]:
    """Draw the only vehicle of a cast; the artists by what they show.

    A plan has its body where trims begin and what it sweeps, a closed loop its body at steps that
    are apart, the plan of each step, pale, and a dotted line for each disturbance.
    """
    (one,), colors, size = cast.actors, cast.colors, cast.size
    track = one.track
    driving = [piece for piece in track.pieces if piece.drives]
    lines = [piece.pose[:, :2] for piece in driving]
    spins = [piece for piece in track.pieces if not piece.drives and piece.turn]
    arcs, heads = _spin_symbols(spins if len(spins) <= MOST_SPINS else [], size=size)
    spin_colors = [colors[piece.name] for piece in spins[: len(arcs)]]
    still = [p for p in track.pieces if _symbol(p) and p.name in track.seen]
    others = [goal for k, goal in enumerate(one.goals) if k != one.reached]
    missed = [goal.pose for goal in others if not goal.free_heading]
    loop = bool(one.held) or len(one.mover.pieces) > 1
    artists: dict[str, Any] = {
        "path": LineCollection(
            lines, colors=[colors[piece.name] for piece in driving],
            linewidths=2.6, capstyle="butt", joinstyle="round", zorder=3.0,
        ),
        "halo": LineCollection(
            lines, colors=["white"], linewidths=4.0, capstyle="butt", joinstyle="round", zorder=2.9
        ),
        "swept": swept_area(one),
        "spins": LineCollection(arcs, colors=spin_colors, linewidths=1.8, zorder=4.0),
        "spin_heads": PolyCollection(heads, facecolors=spin_colors, linewidths=0.0, zorder=4.0),
        "moments": _moment_bodies(one, cast),
        "wanted": PolyCollection(  # at goals that are not reached and ask for a heading
            placed(one.body, np.array(missed)) if missed else [], facecolors="none",
            edgecolors=[SET], linewidths=1.2, linestyles=[(0, (3, 2))], zorder=2.0,
        ),
    }  # fmt: skip
    if loop:
        artists |= _steps_of(ax, cast, one)
    else:
        artists |= {"darts": _darts(one, size=size), "bodies": _switch_bodies(one)}
        if one.body:
            x, y = _between_ends(one, apart=1e-6 * size)[:, :2].T
            artists["switches"] = ax.scatter(
                x, y, s=8.0, facecolors="white", edgecolors=[INK], linewidths=0.7, zorder=3.6
            )
    for kind in sorted({_symbol(piece) for piece in still}, key=(RING, CLIMB, SINK).index):
        some = [piece for piece in still if _symbol(piece) == kind]
        at = np.array([piece.pose[0, :2] for piece in some])
        artists[f"still {kind}"] = ax.scatter(
            at[:, 0], at[:, 1], s=150.0, marker=kind, facecolors="none",
            edgecolors=[colors[piece.name] for piece in some], linewidths=1.8, zorder=4.5,
        )  # fmt: skip
    for part in artists.values():
        if part.axes is None and len(part.get_paths()):
            ax.add_collection(part)
    return artists | draw_ends(
        ax, track.start, one.goals, size=size, reached=one.reached, via=one.mover.via
    )


def _steps_of(ax: Axes, cast: Cast, one: Actor) -> dict[str, Any]:
    """The plan of every step, where it replanned, bodies at steps, and what pushed it."""
    again = {event.time for event in cast.recording.events if event.kind == "replanned"}
    plans = [(track.pose[:, :2], time in again) for time, track in one.held]
    places = np.array([path[0] for path, new in plans if new]).reshape(-1, 2)
    return {
        "held": LineCollection(
            [path for path, _ in plans], colors=[(*GREY, 0.5)], linewidths=0.8, zorder=1.5
        ),
        "held anew": LineCollection(
            [path for path, new in plans if new], colors=[(*INK, 0.6)], linewidths=0.9,
            linestyles=[HELD_STYLE], zorder=1.8,
        ),
        "replanned": ax.scatter(
            places[:, 0], places[:, 1], s=22.0, facecolors="white", edgecolors=[INK],
            linewidths=1.0, zorder=4.2,
        ),
        "jumps": LineCollection(
            [line for _, line in one.jumps], colors=[JUMP], linewidths=1.5,
            linestyles=[JUMP_STYLE], zorder=3.4,
        ),
        "bodies": _step_bodies(one, size=cast.size),
    }  # fmt: skip


def path_entries(cast: Cast, *, moving: bool = False) -> Entries:
    """Legend entries of a vehicle alone: trims, body, steps; in a film trims, if few."""
    one = cast.actors[0]
    entries = [*trim_entries(one.track, cast.colors)]
    if moving:
        return entries if len(entries) <= MOST_TRIMS else []
    swept = bool(one.body and one.track.pieces)
    if swept:
        names_of_parts = [part.name.replace("_", " ") for part in one.parts[1:]]
        by = f" and the {names_of_parts[0]}" if names_of_parts else ""
        by = " and all that it pulls" if len(names_of_parts) > 1 else by
        entries.append((Patch(facecolor=(*SWEPT, SWEPT_ALPHA)), f"swept by the body{by}"))
    if swept and cast.obstacles_move:
        entries.append((Patch(facecolor=(*ROBOT, 0.85), edgecolor=INK), "body at the same times"))
    if one.held:
        entries.append((line_handle(GREY, width=0.9), "plan of a step"))
    if any(event.kind == "replanned" for event in cast.recording.events):
        ring = mark_handle("o", size=5.0)
        ring.set(linestyle=HELD_STYLE, linewidth=0.9, color=INK)
        entries.append((ring, "replanned"))
    if one.jumps:
        entries.append((dashed_handle(JUMP, JUMP_STYLE, width=1.5), "disturbance"))
    return entries


def trim_entries(track: Track, colors: Mapping[str, Color]) -> Entries:
    """Legend entries of the trims of a `track` that can be seen, or of how they move if many."""
    symbols = {piece.name: _symbol(piece) for piece in reversed(track.pieces)}
    seen = {name: twist for name, twist in track.twists.items() if name in track.seen}
    return [
        (line_handle(colors[name], marker=symbols[name]), shown_name(said))
        for said, name in motion_names(seen, many=len(colors) > MOST_TRIMS).items()
    ]


def _symbol(piece: TrackPiece) -> str:
    """Marker of a piece that stays where it is, empty if a line shows it."""
    if piece.drives or piece.turn:
        return ""
    return RING if not piece.climb else CLIMB if piece.climb > 0.0 else SINK


def _spin_symbols(spins: list[TrackPiece], *, size: float) -> tuple[list[Array], list[Array]]:
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


def swept_area(one: Actor) -> PathCollection:
    """Area that the body covers along its track; empty where the body is not known."""
    region = swept_region(one.track, one.body) if one.body and one.track.pieces else []
    carried = [swept_region(track, body) for body, track in one.carried]
    region = merged([*region, *chain.from_iterable(carried)]) if carried else region
    return PathCollection(
        [region_path(region)] if region else [], facecolors=[(*SWEPT, SWEPT_ALPHA)],
        linewidths=0.0, zorder=1.4,
    )  # fmt: skip


def _darts(one: Actor, *, size: float) -> PolyCollection:
    """Where the body is not known: darts along a path, and white ones where trims begin."""
    if one.body:
        return PolyCollection([])
    dart = [DART_SIZE * size * DART]
    faint = one.track.spread(FAINT_DARTS, reach=0.0)
    switches = _between_ends(one, apart=1e-6 * size)
    clear = switches[_apart(switches, DARTS_APART * DART_SIZE * size)]
    return PolyCollection(
        [*placed(dart, faint), *placed(dart, clear)],
        facecolors=[(*GREY, 0.6)] * len(faint) + [(1.0, 1.0, 1.0, 1.0)] * len(clear),
        edgecolors=[(*INK, 0.0)] * len(faint) + [(*INK, 1.0)] * len(clear),
        linewidths=0.9,
        zorder=3.5,
    )


def _apart(poses: Array, apart: float) -> list[int]:
    """Which of the poses (n, dof) are `apart` [m], or turned, from the one kept before."""
    kept: list[int] = []
    for k, pose in enumerate(poses):
        gap = np.inf if not kept else float(np.linalg.norm(pose[:2] - poses[kept[-1], :2]))
        if gap >= apart or abs(pose[2] - poses[kept[-1], 2]) > TURNED_RAD:
            kept.append(k)
    return kept


def _switch_bodies(one: Actor) -> PolyCollection:
    """Outlines where trims begin and at the end, which is clear; many others are fainter."""
    track = one.track
    times = _shown_times(track, apart=BODIES_APART * one.reach)
    poses = track.at(times) if len(times) > len(track.switching_times) else track.switching_poses
    outlines = placed(one.body, poses)
    for body, its in one.carried:
        outlines += placed(body, its.at(times))
    alpha = max(LEAST_ALPHA, 0.8 * min(1.0, FEW_BODIES / len(poses)))
    inner, bodies = len(poses) - 2, len(outlines) // len(poses)
    return PolyCollection(
        outlines,
        facecolors="none",
        edgecolors=[(*INK, 0.95), *[(*INK, alpha)] * inner, (*INK, 0.95)] * bodies,
        linewidths=[1.3, *[0.7] * inner, 1.3] * bodies,
        zorder=2.1,
    )


def _shown_times(track: Track, *, apart: float) -> Array:
    """Switching times (n,), and a few within motions that are long and not steady [s]."""
    times = track.switching_times
    if not 1 <= len(track.pieces) <= MOST_MOTIONS:
        return times
    if apart > 0.0:
        for piece in (one for one in track.pieces if np.ptp(one.control, axis=0).any()):
            length = float(np.linalg.norm(np.diff(piece.pose[:, :2], axis=0), axis=1).sum())
            within = min(INNER_BODIES, max(0, int(length / apart) - 1))
            inner = np.linspace(piece.time[0], piece.time[-1], within + 2)[1:-1]
            times = np.concatenate([times, inner])
    return np.sort(times)


def _step_bodies(one: Actor, *, size: float) -> PolyCollection:
    """The body, a dart if it has none, at those steps that are apart, and all that it carries."""
    body, poses = one.body or [DART_SIZE * size * DART], one.decisions
    reach = one.reach or DART_SIZE * size
    shown = [0] if len(poses) == 1 else [0, len(poses) - 1]
    for k, pose in enumerate(poses[1:-1], start=1):
        gaps = poses[shown, :3] - pose[:3]
        apart = np.hypot(gaps[:, 0], gaps[:, 1]) > STEPS_APART * reach
        if (apart | (np.abs(wrapped(gaps[:, 2])) > TURNED_RAD)).all():
            shown.append(k)
    outlines = placed(body, poses[shown])
    for part in one.parts[1:]:
        at = np.array([*(piece.start for piece in part.pieces), part.end])
        outlines += placed(footprint_polygons(part.bodies[""]), at[shown])
    return PolyCollection(
        outlines, facecolors=[(*GREY, 0.06 if one.body else 0.35)], edgecolors=[(*INK, 0.55)],
        linewidths=0.7, zorder=2.0,
    )  # fmt: skip


def _moment_bodies(one: Actor, cast: Cast) -> PolyCollection:
    """The body at the times at which moving obstacles are shown, the darker the later."""
    times = cast.times if cast.obstacles_move and one.track.pieces else cast.times[:0]
    outlines = placed(one.body, one.track.at(times))
    for body, track in one.carried:
        outlines += placed(body, track.at(times))
    colors = moment_colors(len(times), color=ROBOT) * (len(outlines) // max(len(times), 1))
    return PolyCollection(
        outlines, facecolors=[(*color, 0.85) for color in colors],
        edgecolors=[INK], linewidths=1.1, zorder=3.7,
    )  # fmt: skip


def _between_ends(one: Actor, *, apart: float) -> Array:
    """Poses where trims begin, but none at the start or a goal, where other marks are."""
    ends = np.array([one.track.start, *(goal.pose for goal in one.goals)])
    poses = one.track.switching_poses
    gaps = np.linalg.norm(poses[:, None, :2] - ends[:, :2], axis=-1)
    return np.asarray(poses[gaps.min(axis=1) > apart])
