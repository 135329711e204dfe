"""The picture of any result: the plane, what happens over time, a heading and a legend."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.quiver import Quiver

from maneuver_automaton.plotting.cast import MARGIN, Cast, cast_of, cast_of_alternatives, set_view
from maneuver_automaton.plotting.colors import GREY, INK, LANE, SEQUENCE
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.obstacles import (
    draw_ground,
    draw_limits,
    draw_obstacles,
    ground_entries,
    limit_entries,
    obstacle_entries,
    shape_path,
)
from maneuver_automaton.plotting.over_time import panels_of
from maneuver_automaton.plotting.pages import EDGE, page_of, write_figure
from maneuver_automaton.plotting.paths import draw_path, end_entries, path_entries
from maneuver_automaton.plotting.style import SMALL_PT, Entries, outer_legend, word_text
from maneuver_automaton.plotting.together import draw_vehicles, vehicle_entries
from maneuver_automaton.recording import Recording, Search, recording_of
from maneuver_automaton.recording.values import few

REACHED = (0.82, 0.89, 0.95)  # not through: squares of several sizes lie upon each other
COLORMAP = "viridis_r"  # pale for cheap, dark for costly; made for colour-blind readers too
TICK_IN = 0.05  # [in] length of a tick
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
    artists = draw_world(ax, cast, cast.times)
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
    world = cast.recording.world
    lanes = PolyCollection(
        list(world.lanes), facecolors=[LANE], edgecolors=["white"], linewidths=0.8,
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
    parts = draw_obstacles(ax, world.obstacles, time=times, fleeting=world.fleeting)
    parts |= draw_limits(ax, world.zones, world.bounds) | {"lanes": lanes}
    return parts | {f"ground {k}": one for k, one in enumerate(draw_ground(ax, world.ground))}


def plane_entries(cast: Cast, *, moving: bool = False) -> Entries:
    """Legend entries of all that is in the plane, or in a film of it: `moving`."""
    world, search = cast.recording.world, cast.recording.search
    if cast.is_alone:
        (one,) = cast.actors
        driven, ends = path_entries(cast, moving=moving), end_entries(one.goals, one.mover.via)
    else:
        driven, ends = vehicle_entries(cast, moving=moving), []
    reached = not moving and search is not None and search.reached is not None
    return [
        *driven,
        *ends,
        *([(Patch(facecolor=LANE), "lane")] if world.lanes else []),
        *obstacle_entries(world.obstacles, cast.times[:1] if moving else cast.times),
        *ground_entries(world.ground),
        *limit_entries(world.zones, world.bounds),
        *([(Patch(color=REACHED), "may be reached")] if reached else []),
    ]


def _draw_search(ax: Axes, search: Search) -> dict[str, Any]:
    """What a search expanded, the places that a vehicle may get to, and the passage it cannot."""
    artists: dict[str, Any] = {}
    if search.nodes is not None:
        x, y, heading = search.nodes[:, :3].T
        artists["nodes"] = ticks = Quiver(  # they point where each heads
            ax, x, y, np.cos(heading), np.sin(heading), color=[GREY], units="inches",
            scale_units="inches", scale=1.0 / TICK_IN, width=0.011, headwidth=1.0, headlength=0.0,
            headaxislength=0.0, minlength=0.0, alpha=0.8, zorder=1.5,
        )  # fmt: skip
        if search.nodes.shape[-1] == 4:
            ticks.set_array(search.nodes[:, 3])
            ticks.set_cmap(COLORMAP)
            ticks.autoscale()
        ax.add_collection(ticks, autolim=False)
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


VIEWS = ("plane", "space", "alternatives")
WORD_LINES, CHARACTER = 2, 0.08  # lines of the word, and [in] of each character
MOST_REASONS = 4  # above a picture
MOST_BROKEN, TEXT_WIDTH = 2, 132


def save_picture(
    result: Any, path: str | Path, *, look: Look | None = None, view: str = "plane"
) -> None:
    """Write the picture of any `result` that `figure_of` makes.

    The file is replaced in one step; its ending chooses the format.

    Raises
    ------
    TypeError
        If it is no result.
    ValueError
        If there is no such view of it, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(figure_of(result, look=look, view=view), path)


def figure_of(result: Any, *, look: Look | None = None, view: str = "plane") -> Figure:
    """The picture of any `result`: those who drive among what is around them, and over time.

    Parameters
    ----------
    result : Plan, PlanResult, ClosedLoop, FleetResult, FleetLog, a drive on roads, or Recording
        What to draw. Without a plan it shows start and goals, and says why there is none.
    look : Look, optional
        Title, size and style.
    view : str
        "plane"; "space", in space, from above and from the side, if all fly; or "alternatives",
        all plans of one result over each other.

    Returns
    -------
    Figure
        It belongs to no window; its axes are the plane, then what is over time.

    Raises
    ------
    TypeError
        If it is no result.
    ValueError
        If there is no such view of it.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Problem, Unicycle, plan
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> figure = figure_of(plan(Problem(robot, [0, 0, 0], [2, 0, 0])), look=Look(title="Ahead"))
    >>> figure.texts[0].get_text(), len(figure.axes)
    ('Ahead', 3)
    """
    recording, look = recording_of(result), look or Look()
    if recording.world.lanes and not look.title:
        look = replace(look, title=recording.title)
    if view not in VIEWS:
        raise ValueError(f"view: got {view!r}, need one of {', '.join(VIEWS)}")
    if view == "space":
        from maneuver_automaton.plotting.space import space_figure

        return space_figure(cast_of(recording), heading_of(recording, look), look)
    if view == "alternatives":
        if not recording.movers[0].has_plan:
            raise ValueError(f"alternatives: the result holds no plan: {recording.reason}")
        count = 1 + len(recording.alternatives)
        said = "1 plan" if count == 1 else f"{count} locally optimal plans, best first"
        return _figure(cast_of_alternatives(recording, width=60), [said], look)
    if recording.alternatives:
        recording = replace(recording, alternatives=())
    return _figure(cast_of(recording), heading_of(recording, look), look)


def _figure(cast: Cast, lines: Sequence[str], look: Look) -> Figure:
    panels = panels_of(cast)
    wide, high = np.ptp(cast.box, axis=0) * (1.0 + 2.0 * MARGIN)
    entries = [*plane_entries(cast)]
    known = {name for _, name in entries}
    entries += [row for panel in panels for row in panel.entries if row[1] not in known]
    page = page_of(
        look,
        lines,
        entries,
        shape=max(float(wide), 1e-9) / max(float(high), 1e-9),
        panels=[panel.height for panel in panels],
    )
    artists = draw_cast(page.plane, cast, numbered=look.numbered)
    for ax, panel in zip(page.panels, panels, strict=False):
        panel.draw(ax)
    for ax in page.panels[:-1] if page.is_stacked else ():  # times stand below the lowest
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False)
    if (ticks := artists.get("nodes")) is not None and ticks.get_array() is not None:
        bar = page.figure.colorbar(
            ticks, ax=page.plane, location="top", shrink=0.5, aspect=30, pad=0.02, anchor=(1, 0)
        )
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=SMALL_PT - 1.0, length=2.0, width=0.5, pad=1.5, labelcolor=INK)
        bar.set_label("cost of expanded nodes", fontsize=SMALL_PT, color=INK)
    return page.figure


def heading_of(recording: Recording, look: Look) -> list[str]:
    """Lines that say how it ended and what is known of it, the word of a plan, what went wrong."""
    first = recording.movers[0]
    facts = [f"{one.label} {one.text}" for one in recording.heading]
    if recording.kind == "plan" and not first.has_plan:
        return [one.text for one in recording.heading]
    tells = recording.kind == "closed_loop" or bool(recording.reason)  # more than the facts do
    lines = [recording.ending] if tells and recording.kind != "plan" else []
    lines += [" · ".join(facts), recording.world.source]
    if recording.kind == "plan":
        width = int((look.width - 2.0 * EDGE) / CHARACTER)
        lines.append(word_text(first.pieces[0].word, width=width, lines=WORD_LINES))
    broken = [one.text for one in recording.events if one.kind == "broken"]
    lines += [textwrap.shorten(text, TEXT_WIDTH, placeholder=" …") for text in broken[:MOST_BROKEN]]
    if (more := len(broken) - MOST_BROKEN) > 0:
        lines.append(f"and {more} more guarantee{'s' if more > 1 else ''} broken")
    named: dict[str, list[str]] = {}  # why some do not arrive: whom each reason holds for
    for one in recording.movers:
        if one.name and not (one.has_plan and one.reached):
            named.setdefault(one.reason or "no plan", []).append(one.name)
    lines += [f"{few(names)}: {reason}" for reason, names in list(named.items())[:MOST_REASONS]]
    more = len(named) - MOST_REASONS
    return lines if more <= 0 else [*lines, f"and {more} more reasons"]
