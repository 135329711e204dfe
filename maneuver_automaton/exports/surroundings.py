"""A motion among its surroundings, as formats that draw need it: track, bodies, solid regions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Disc, Obstacle, OccupancyMap, Shape
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.collision.rectangles import blocked_rectangles
from maneuver_automaton.exports.driven import Driven
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.footprint import footprint_polygons
from maneuver_automaton.plotting.obstacles import round_times
from maneuver_automaton.plotting.scene import Carried, Scene, bare_scene, scene_of
from maneuver_automaton.plotting.track import Track, joined_track
from maneuver_automaton.roads.scene import presence_of


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shown:
    """What is shown of a plan, a loop or a drive."""

    driven: Driven
    track: Track
    scene: Scene  # goals, obstacles, bodies; the times at which moving obstacles are shown

    @property
    def parts(self) -> list[tuple[str, tuple[Array, ...], Track]]:
        """Name, outlines (n, 2) [m] and track of the vehicle, then of what it carries."""
        scene = self.scene
        carried = [(part.name, part.body, part.track) for part in scene.carried]
        return [("vehicle", scene.body, self.track), *carried]

    @property
    def leaves(self) -> bool:
        """Whether moving obstacles are there for their motion only, as on roads."""
        return self.driven.scene is not None

    def is_there(self, obstacle: Obstacle, time: float) -> bool:
        """Whether an obstacle is there at a time [s]."""
        first, last = presence_of(obstacle) if self.leaves else (-np.inf, np.inf)
        return first <= time <= last


def shown_of(driven: Driven) -> Shown:
    """A motion among its surroundings, as far as these are known."""
    track = joined_track(driven.start, driven.pieces)
    times = round_times(driven.start_time, driven.start_time + driven.duration)
    if driven.scene is not None and driven.vehicle is not None:
        body = tuple(footprint_polygons(driven.vehicle.footprint))
        scene = Scene(goals=(), obstacles=tuple(driven.scene.traffic), body=body, times=times)
        return Shown(driven=driven, track=track, scene=scene)
    if driven.problem is None:
        scene = replace(bare_scene(track, footprint=None), goals=(), times=times)
        return Shown(driven=driven, track=track, scene=scene)
    problem = driven.problem
    scene = scene_of(problem, driven.start_time, driven.start_time + driven.duration)
    carried = tuple(
        Carried(name=name, body=tuple(footprint_polygons(shapes)), track=_carried(driven, name))
        for name, shapes in problem.parts.items()
        if track.pieces
    )
    return Shown(driven=driven, track=track, scene=replace(scene, carried=carried))


def _carried(driven: Driven, part: str) -> Track:
    plans = driven.carried(part)
    return joined_track(plans[0].start, plans)


def solid(shape: Shape) -> Any:
    """A valid geometry of shapely that a shape fills; a disc has 48 corners.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box
    >>> solid(Box([4.0, 2.0])).area
    8.0
    """
    import shapely

    if isinstance(shape, Disc):
        return shapely.Polygon(footprint_polygons(shape)[0])
    return shapely.union_all(outlines(shape))


def solid_map(cells: OccupancyMap) -> Any:
    """The geometry of shapely that the blocked cells of a map fill.

    Examples
    --------
    >>> corner = OccupancyMap(np.array([[1, 1], [1, 0]], dtype=bool), resolution=0.5)
    >>> solid_map(corner).area
    0.75
    """
    import shapely

    low_x, low_y, high_x, high_y = (cells.resolution * blocked_rectangles(cells.blocked)).T
    whole = shapely.union_all(shapely.box(low_x, low_y, high_x, high_y))
    return shapely.transform(whole, SE2(cells.origin).act)


def placed_solids(obstacles: Iterable[Any], shown: Shown) -> Iterator[tuple[Any, Any, float]]:
    """Obstacles with their geometry and a time [s]: each static one once, each moving one often."""
    for one in obstacles:
        if isinstance(one, OccupancyMap):
            if one.blocked.any():
                yield one, solid_map(one), shown.driven.start_time
        elif one.motion is None:
            yield one, solid(one.shape), shown.driven.start_time
        else:
            for time in shown.scene.times.tolist():
                if shown.is_there(one, time):
                    yield one, solid(one.at(time)), time
