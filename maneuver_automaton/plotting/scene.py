"""What a plan is drawn among, and how much of it a picture shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import AnyObstacle, Obstacle, OccupancyMap
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.limits import limit_boxes, shape_path
from maneuver_automaton.plotting.obstacles import moving_shapes, static_shapes
from maneuver_automaton.plotting.style import count_from_near, tidy
from maneuver_automaton.plotting.track import Track
from maneuver_automaton.problem import Bounds, Goal

STILL_SIZE_M = 1.0  # size of a path that goes nowhere
ROOM = 0.16  # around start and goals where the body is not known, of the size
MARGIN = 0.04  # around all, of the axes
MUCH_LARGER = 2.5  # surroundings so much larger than what happens in them are cropped
KEPT = 0.5  # of them around what happens, of its size
BODIES, LEAST_MARK = 8.0, 0.35  # marks suit a path of so many bodies, or this share of the path
IN_VIEW = 0.5  # or, among obstacles, one that takes this share of the picture


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Carried:
    """What a vehicle carries, say a trailer: its body, and the track of its own frame."""

    name: str
    body: tuple[Array, ...]  # outlines (n, 2) [m]
    track: Track


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scenery:
    """Goals, obstacles, limits and a body."""

    goals: tuple[Goal, ...]
    reached: int | None = None  # which of the goals
    obstacles: tuple[AnyObstacle, ...] = ()
    zones: tuple[Zone, ...] = ()
    bounds: Bounds = field(default_factory=Bounds)
    body: tuple[Array, ...] = ()  # outlines (n, 2) [m]; none: it is not known
    carried: tuple[Carried, ...] = ()
    times: Array  # (n,) at which moving obstacles are shown [s]

    @property
    def reach(self) -> float:
        """No point of the body is further from its pose [m]."""
        return max((float(np.linalg.norm(o, axis=1).max()) for o in self.body), default=0.0)

    @property
    def moves(self) -> bool:
        """Whether an obstacle moves."""
        return any(isinstance(o, Obstacle) and o.motion is not None for o in self.obstacles)


def view_box(scene: Scenery, points: Array, *, size: float) -> Array:
    """Corners (2, 2) of what a picture shows around `points` (n, 2), where something happens.

    All obstacles and limits, unless they are much larger than that: then those that are near.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    around = obstacle_boxes(scene.obstacles, scene.times) + limit_boxes(scene.zones, scene.bounds)
    boxes = np.concatenate([np.zeros((0, 2)), *around])
    if not boxes.size:
        return np.array([low, high])
    all_low, all_high = np.minimum(low, boxes.min(axis=0)), np.maximum(high, boxes.max(axis=0))
    here = max(float((high - low).max()), size)
    if float((all_high - all_low).max()) > MUCH_LARGER * here:
        all_low = np.maximum(all_low, low - KEPT * here)
        all_high = np.minimum(all_high, high + KEPT * here)
    return np.array([all_low, all_high])


def mark_size(scene: Scenery, box: Array, *, size: float) -> float:
    """Size of a path [m] that the marks of a picture suit.

    The path's own, but smaller for a small body on a long path, and larger where obstacles take
    most of the picture.
    """
    if scene.body:
        size = min(size, max(BODIES * scene.reach, LEAST_MARK * size))
    if scene.obstacles:
        size = max(size, IN_VIEW * float((box[1] - box[0]).max()))
    return size


def set_view(ax: Axes, box: Array, place: Array) -> None:
    """Show a `box` (2, 2) in equal scales; numbers far away are counted from near a `place`."""
    both_shared = all(
        len(group.get_siblings(ax)) > 1
        for group in (ax.get_shared_x_axes(), ax.get_shared_y_axes())
    )
    ax.set_aspect("equal", adjustable="box" if both_shared else "datalim")
    ax.update_datalim(box)
    ax.margins(MARGIN)
    ax.autoscale_view()
    tidy(ax, x="x [m]", y="y [m]")
    count_from_near(ax, place)


def obstacle_boxes(obstacles: Sequence[AnyObstacle], times: Array) -> list[Array]:
    """Corners (2, 2) around each obstacle, and around each moving one at each time."""
    paths = [shape_path(one.shape) for one in static_shapes(obstacles)]
    paths += [one.at(t) for one in moving_shapes(obstacles) for t in times.tolist()]
    boxes = [np.asarray(path.get_extents().get_points()) for path in paths]
    maps = [one for one in obstacles if isinstance(one, OccupancyMap) and one.blocked.any()]
    return boxes + [_map_box(one) for one in maps]


def _map_box(cells: OccupancyMap) -> Array:
    """Corners (2, 2) of the box around the blocked cells of a map."""
    rows, columns = (np.flatnonzero(cells.blocked.any(axis=axis)) for axis in (1, 0))
    x = cells.resolution * np.array([columns[0], columns[-1] + 1.0])
    y = cells.resolution * np.array([rows[0], rows[-1] + 1.0])
    corners = SE2(cells.origin).act(np.array([[a, b] for a in x for b in y]))
    return np.array([corners.min(axis=0), corners.max(axis=0)])
