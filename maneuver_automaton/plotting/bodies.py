"""Draw a body along a path: what it sweeps, and where it is when trims begin."""

from __future__ import annotations

from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import GREY, INK, Color
from maneuver_automaton.plotting.ends import SET
from maneuver_automaton.plotting.footprint import placed
from maneuver_automaton.plotting.obstacles import ROBOT, moment_colors
from maneuver_automaton.plotting.regions import region_path
from maneuver_automaton.plotting.scene import Scene
from maneuver_automaton.plotting.swept import merged, swept_region
from maneuver_automaton.plotting.track import Piece, Track

FAINT_DARTS = 9  # along a path
DART = np.array([[0.6, 0.0], [-0.4, 0.32], [-0.22, 0.0], [-0.4, -0.32]])
DART_SIZE = 0.066  # of the size of the path
DARTS_APART = 2.5  # of their size, at least, between those where trims begin
TURNED_RAD = 0.3  # of two darts in one place, at least
SWEPT: Color = (0.36, 0.60, 0.85)
SWEPT_ALPHA = 0.20
MOST_MOTIONS, INNER_BODIES = 6, 3  # so few motions have bodies within, at most so many each
BODIES_APART = 2.0  # of the reach, at least, between bodies within a motion
FEW_BODIES, LEAST_ALPHA = 8, 0.3  # more bodies than that are fainter, but not more than this


def swept_area(track: Track, scene: Scene) -> PathCollection:
    """Area that the body covers along a track; empty where the body is not known."""
    region = swept_region(track, scene.body) if scene.body and track.pieces else []
    carried = [swept_region(part.track, part.body) for part in scene.carried]
    region = merged([*region, *chain.from_iterable(carried)]) if carried else region
    return PathCollection(
        [region_path(region)] if region else [], facecolors=[(*SWEPT, SWEPT_ALPHA)],
        linewidths=0.0, zorder=1.4,
    )  # fmt: skip


def darts(track: Track, scene: Scene, *, size: float) -> PolyCollection:
    """Where the body is not known: darts along a path, and white ones where trims begin.

    The white ones leave the path between them free.
    """
    if scene.body:
        return PolyCollection([])
    dart = [DART_SIZE * size * DART]
    faint = track.spread(FAINT_DARTS, reach=0.0)
    switches = _between_ends(track, scene, apart=1e-6 * size)
    clear = _spread_out(switches, apart=DARTS_APART * DART_SIZE * size)
    return PolyCollection(
        [*placed(dart, faint), *placed(dart, clear)],
        facecolors=[(*GREY, 0.6)] * len(faint) + [(1.0, 1.0, 1.0, 1.0)] * len(clear),
        edgecolors=[(*INK, 0.0)] * len(faint) + [(*INK, 1.0)] * len(clear),
        linewidths=0.9,
        zorder=3.5,
    )


def switch_bodies(track: Track, scene: Scene) -> PolyCollection:
    """Outlines where trims begin and at the end, which is clear; many others are fainter.

    Those of what it carries stand beside them; a motion by optimal control has a few within.
    """
    times = _shown_times(track, apart=BODIES_APART * scene.reach)
    poses = track.at(times) if len(times) > len(track.switching_times) else track.switching_poses
    outlines = placed(scene.body, poses)
    for part in scene.carried:
        outlines += placed(part.body, part.track.at(times))
    alpha = max(LEAST_ALPHA, 0.8 * min(1.0, FEW_BODIES / len(poses)))
    inner, bodies = len(poses) - 2, len(outlines) // len(poses)
    return PolyCollection(
        outlines,
        facecolors="none",
        edgecolors=[(*INK, 0.95), *[(*INK, alpha)] * inner, (*INK, 0.95)] * bodies,
        linewidths=[1.3, *[0.7] * inner, 1.3] * bodies,
        zorder=2.1,
    )


def moment_bodies(track: Track, scene: Scene) -> PolyCollection:
    """The body at the times at which moving obstacles are shown, the darker the later."""
    times = scene.times if scene.moves and track.pieces else scene.times[:0]
    outlines = placed(scene.body, track.at(times))
    for part in scene.carried:
        outlines += placed(part.body, part.track.at(times))
    bodies = len(outlines) // max(len(times), 1)
    colors = moment_colors(len(times), color=ROBOT) * bodies
    return PolyCollection(
        outlines, facecolors=[(*color, 0.85) for color in colors],
        edgecolors=[INK], linewidths=1.1, zorder=3.7,
    )  # fmt: skip


def goal_bodies(scene: Scene) -> PolyCollection:
    """Dashed outlines at the goals that are not reached and ask for a heading."""
    poses = [
        goal.pose
        for k, goal in enumerate(scene.goals)
        if k != scene.reached and not goal.free_heading
    ]
    return PolyCollection(
        placed(scene.body, np.array(poses)) if poses else [], facecolors="none",
        edgecolors=[SET], linewidths=1.2, linestyles=[(0, (3, 2))], zorder=2.0,
    )  # fmt: skip


def _shown_times(track: Track, *, apart: float) -> Array:
    """Switching times (n,), and a few within motions that are long and not steady [s]."""
    times = track.switching_times
    if not 1 <= len(track.pieces) <= MOST_MOTIONS:
        return times
    inner = [
        np.linspace(piece.time[0], piece.time[-1], bodies_within(piece, apart=apart) + 2)[1:-1]
        for piece in track.pieces
        if np.ptp(piece.control, axis=0).any()
    ]
    return np.sort(np.concatenate([times, *inner]))


def bodies_within(piece: Piece, *, apart: float) -> int:
    """How many bodies have room within a piece, `apart` [m] from each other and from its ends."""
    length = float(np.linalg.norm(np.diff(piece.pose[:, :2], axis=0), axis=1).sum())
    return min(INNER_BODIES, max(0, int(length / apart) - 1)) if apart > 0.0 else 0


def draw_switches(ax: Axes, track: Track, scene: Scene, *, size: float) -> PathCollection:
    """Dots where one trim follows another; darts show it where the body is not known."""
    poses = _between_ends(track, scene, apart=1e-6 * size)[: None if scene.body else 0]
    return ax.scatter(
        poses[:, 0], poses[:, 1], s=8.0, facecolors="white", edgecolors=[INK], linewidths=0.7,
        zorder=3.6,
    )  # fmt: skip


def _spread_out(poses: Array, *, apart: float) -> Array:
    """Those of the poses (n, dof) that are `apart` [m], or turned, from the one before.

    Others would hide the path.
    """
    kept: list[Array] = []
    for pose in poses:
        gap = np.inf if not kept else float(np.linalg.norm(pose[:2] - kept[-1][:2]))
        if gap >= apart or abs(pose[2] - kept[-1][2]) > TURNED_RAD:
            kept.append(pose)
    return np.array(kept).reshape(-1, poses.shape[1])


def _between_ends(track: Track, scene: Scene, *, apart: float) -> Array:
    """Poses where trims begin, but none at the start or a goal, where other marks are."""
    ends = np.array([track.start, *(goal.pose for goal in scene.goals)])
    gaps = np.linalg.norm(track.switching_poses[:, None, :2] - ends[:, :2], axis=-1)
    return np.asarray(track.switching_poses[gaps.min(axis=1) > apart])
