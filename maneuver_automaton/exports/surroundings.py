"""Those who move and what is around them, as formats that draw need it: tracks, solid regions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

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

Part: TypeAlias = tuple[str, list[Array], Track]
"""A vehicle, or what it carries: its name, outlines (n, 2) [m], none if not known, and track."""


def parts_of(mover: Mover) -> list[Part]:
    """A mover, then all that it carries; one that goes nowhere shows itself alone."""
    carried = mover.parts[1:] if mover.duration > 0.0 else ()
    names = ["vehicle", *(one.name for one in carried)]
    return [
        (name, footprint_polygons(one.bodies.get("", ())), joined_track(one.start, one.pieces))
        for name, one in zip(names, (mover, *carried), strict=True)
    ]


def swept_by(parts: Sequence[Part]) -> list[Any]:
    """Polygons of shapely that all parts sweep."""
    return merged([one for _, body, track in parts if body for one in swept_region(track, body)])


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
            first, last = one.lasts(fleeting=world.fleeting)
            seen = [time for time in times if world.is_there(one, time)]
            brief = [max(first, begin)] if max(first, begin) <= min(last, recording.end) else []
            for time in seen or brief:  # at least once, where it is there between two times alone
                yield one, solid(one.at(time)), time
