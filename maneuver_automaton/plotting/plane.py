"""Draw any result in the plane: lanes, obstacles and limits, and those who drive among them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.patches import Patch

from maneuver_automaton.plotting.cast import Cast, cast_of, set_view
from maneuver_automaton.plotting.colors import INK, LANE, SEQUENCE
from maneuver_automaton.plotting.limits import (
    draw_ground,
    draw_limits,
    ground_entries,
    limit_entries,
    shape_path,
)
from maneuver_automaton.plotting.obstacles import draw_obstacles, obstacle_entries
from maneuver_automaton.plotting.paths import draw_path, end_entries, path_entries
from maneuver_automaton.plotting.searches import draw_nodes
from maneuver_automaton.plotting.style import SMALL_PT, Entries, outer_legend
from maneuver_automaton.plotting.together import draw_vehicles, vehicle_entries
from maneuver_automaton.recording import Search, recording_of

REACHED = (0.82, 0.89, 0.95)  # not through: squares of several sizes lie upon each other
RING_PT = 16.0  # size of the ring around a passage


def draw_plane(ax: Axes, result: Any, *, legend: bool = True) -> dict[str, Any]:
    """Draw any `result` in the plane on `ax`, to scale.

    One vehicle is drawn in the colours of its trims, with its body where trims begin and what it
    sweeps; a closed loop with the plan of each step, pale. Several have a colour each, and bodies
    at equal times; who does not arrive is hatched. Moving obstacles are shown at a few times, the
    darker the later.

    Parameters
    ----------
    ax : Axes
        Where to draw; its scale is made equal in x and y.
    result : any result, or Recording
        What to draw: a plan, an answer, a closed loop, a fleet, a drive on roads.
    legend : bool
        Whether to name what is drawn beside the axes.

    Returns
    -------
    dict of str to Artist
        The artists, by what they show; "path" has one segment per trim that drives.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    >>> artists = draw_plane(Figure().add_subplot(), plan)
    >>> artists["path"].get_segments()[0].tolist()
    [[0.0, 0.0], [2.0, 0.0]]
    """
    cast = cast_of(recording_of(result))
    artists = draw_cast(ax, cast)
    if legend:
        outer_legend(ax, plane_entries(cast))
    return artists


def draw_cast(ax: Axes, cast: Cast, *, numbered: bool = False) -> dict[str, Any]:
    """Draw a cast in the plane; see `draw_plane`; bodies may have numbers of their times."""
    artists = draw_world(ax, cast, cast.scene.times)
    if cast.is_alone:
        artists |= draw_path(ax, cast)
    else:
        artists |= draw_vehicles(ax, cast, numbered=numbered)
    if (search := cast.recording.search) is not None:
        artists |= _draw_search(ax, search)
    see(ax, cast)
    return artists


def see(ax: Axes, cast: Cast) -> None:
    """Show all that is around a cast, in equal scales."""
    place = cast.actors[0].track.start[:2] if cast.is_alone else cast.box.mean(axis=0)
    set_view(ax, cast.box, place)


def draw_world(ax: Axes, cast: Cast, times: Any) -> dict[str, Any]:
    """Draw lanes, obstacles, those that move at `times` [s], zones and bounds."""
    scene = cast.scene
    lanes = PolyCollection(
        list(cast.recording.world.lanes), facecolors=[LANE], edgecolors=["white"], linewidths=0.8,
        zorder=0.5,
    )  # fmt: skip
    regions = [(shape_path(place), one) for one in cast.actors for place in one.mover.regions]
    goals = PathCollection(
        [path for path, _ in regions], facecolors=[(*one.color, 0.06) for _, one in regions],
        edgecolors=[one.color for _, one in regions], linewidths=1.0, linestyles=[(0, (4, 3))],
        zorder=1.2,
    )  # fmt: skip
    for part in (lanes, goals):
        ax.add_collection(part, autolim=False)
    fleeting = cast.recording.world.fleeting
    around = draw_obstacles(ax, scene.obstacles, time=times, fleeting=fleeting)
    limits = draw_limits(ax, scene.zones, scene.bounds)
    ground = draw_ground(ax, cast.recording.world.ground)
    parts: dict[str, Any] = {
        "lanes": lanes, "obstacles": around.static, "traffic": around.moving,
        "tracks": around.tracks, "bounds": limits.bounds,
    }  # fmt: skip
    parts |= {f"map {k}": one for k, one in enumerate(around.maps)}
    parts |= {f"ground {k}": one for k, one in enumerate(ground)}
    return parts | {f"zone {k}": one for k, one in enumerate(limits.zones)}


def plane_entries(cast: Cast, *, moving: bool = False) -> Entries:
    """Legend entries of all that is in the plane, or in a film of it: `moving`."""
    scene, world, search = cast.scene, cast.recording.world, cast.recording.search
    if cast.is_alone:
        driven, ends = path_entries(cast, moving=moving), end_entries(scene.goals, scene.via)
    else:
        driven, ends = vehicle_entries(cast, moving=moving), []
    reached = not moving and search is not None and search.reached is not None
    return [
        *driven,
        *ends,
        *([(Patch(facecolor=LANE), "lane")] if world.lanes else []),
        *obstacle_entries(scene.obstacles, scene.times[:1] if moving else scene.times),
        *ground_entries(world.ground),
        *limit_entries(scene.zones, scene.bounds),
        *([(Patch(color=REACHED), "may be reached")] if reached else []),
    ]


def _draw_search(ax: Axes, search: Search) -> dict[str, Any]:
    """What a search expanded, the places that a vehicle may get to, and the passage it cannot."""
    artists: dict[str, Any] = {}
    if search.nodes is not None:
        costs = search.nodes[:, 3] if search.nodes.shape[-1] == 4 else None
        artists["nodes"] = draw_nodes(ax, search.nodes[:, :3], cost=costs)
    if search.reached is not None:
        artists["reached"] = PolyCollection(
            list(np.asarray(search.reached)), facecolors=[REACHED], edgecolors=[REACHED],
            linewidths=0.4, zorder=0.6,
        )  # fmt: skip
        ax.add_collection(artists["reached"], autolim=False)
    if search.narrowest is not None:
        x, y = search.narrowest
        (artists["narrowest"],) = ax.plot(
            [x], [y], marker="o", markersize=RING_PT, markerfacecolor="none",
            markeredgecolor=SEQUENCE[1], markeredgewidth=1.6, linestyle="none",
            scalex=False, scaley=False, zorder=6.0,
        )  # fmt: skip
        ax.annotate(
            f"{search.missing_m:.2g} m too narrow", (x, y), xytext=(12.0, 10.0),
            textcoords="offset points", fontsize=SMALL_PT, color=INK, zorder=6.0,
        )  # fmt: skip
    return artists
