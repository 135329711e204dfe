"""Those who move and what is around them, as formats that draw need it: tracks, solid regions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from maneuver_automaton._arrays import Array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import Disc, OccupancyMap, Shape
from maneuver_automaton.collision.outline import blocked_rectangles, outlines, united
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.obstacles import round_times
from maneuver_automaton.plotting.track import (
    Track,
    footprint_polygons,
    joined_track,
    merged,
    swept_region,
)
from maneuver_automaton.recording import Mover, Recording


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """Who moves, with a name, outlines (n, 2) [m] and a track of it and of all that it carries."""

    mover: Mover
    parts: tuple[tuple[str, tuple[Array, ...], Track], ...]

    @property
    def track(self) -> Track:
        """Where the vehicle itself goes."""
        return self.parts[0][2]

    @property
    def body(self) -> tuple[Array, ...]:
        """Outlines of the vehicle itself; none if they are not known."""
        return self.parts[0][1]

    @property
    def swept(self) -> list[Any]:
        """Polygons of shapely that all parts sweep."""
        return merged(
            [one for _, body, track in self.parts if body for one in swept_region(track, body)]
        )


def shown_of(mover: Mover) -> Shown:
    """A mover with its track; one that goes nowhere shows itself alone."""
    carried = mover.parts[1:] if mover.duration > 0.0 else ()
    names = ["vehicle", *(one.name for one in carried)]
    rows = [
        (name, tuple(footprint_polygons(one.bodies.get("", ()))),
         joined_track(one.start, one.pieces))
        for name, one in zip(names, (mover, *carried), strict=True)
    ]  # fmt: skip
    return Shown(mover, tuple(rows))


def solid(shape: Shape) -> Any:
    """A valid geometry of shapely that a shape fills; a disc has 48 corners."""
    if isinstance(shape, Disc):
        return shapely.Polygon(footprint_polygons([shape])[0])
    return united(outlines(shape))


def solid_map(cells: OccupancyMap) -> Any:
    """The geometry of shapely that the blocked cells of a map fill."""
    low_x, low_y, high_x, high_y = (cells.resolution * blocked_rectangles(cells.blocked)).T
    whole = united(shapely.box(low_x, low_y, high_x, high_y))
    return shapely.transform(whole, SE2(cells.origin).act)


def solids_of(recording: Recording) -> Iterator[tuple[Any, Any, float]]:
    """Obstacles with their geometry and a time [s]: each static one once, each moving one often."""
    world, begin = recording.world, recording.begin
    times = round_times(begin, recording.end).tolist()
    for one in world.obstacles:
        if isinstance(one, OccupancyMap):
            if one.blocked.any():
                yield one, solid_map(one), begin
        elif one.motion is None:
            yield one, solid(one.shape), begin
        else:
            for time in (time for time in times if world.is_there(one, time)):
                yield one, solid(one.at(time)), time
