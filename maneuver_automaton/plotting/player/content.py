"""The page that plays a recording: its content as plain values, which the browser draws."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.plotting.cast import BODIES, LEAST_MARK, Cast, cast_of
from maneuver_automaton.plotting.colors import Color, track_colors
from maneuver_automaton.plotting.over_time import distance_times, nearest_others
from maneuver_automaton.plotting.player.numbers import (
    Local,
    body_entries,
    clearance_entry,
    curve_entries,
    distance_curve,
    goal_entries,
    hex_color,
    limit_entries,
    motion_entry,
    obstacle_entries,
    part_entries,
    rounded,
    sample_times,
)
from maneuver_automaton.plotting.style import shown_name
from maneuver_automaton.plotting.track import Track, footprint_polygons, joined_track, placed
from maneuver_automaton.recording import Curve, Fact, Mover, Recording, Search, recording_of
from maneuver_automaton.recording.plans import stated

SCRIPTS = ("motion.js", "view.js", "stage.js", "space.js", "charts.js", "panels.js", "player.js")
FRAME_HEIGHT = 720  # [px] in a notebook


@dataclass(frozen=True, slots=True, eq=False)
class Player:
    """A plan to play: one HTML page, drawn by the browser from the numbers in it.

    A content with ``back: {href, text}`` has a link to the page that leads here.

    Examples
    --------
    >>> page = Player({"title": "A plan & its <name>"}).html
    >>> page.startswith("<!doctype html>"), "http" in page
    (True, False)
    """

    content: Mapping[str, Any] = field(repr=False)  # what `content_of` makes of a plan, and `back`

    @property
    def html(self) -> str:
        """The whole page."""
        page = _template()
        # no text in the data can end the element that holds it
        data = json.dumps(self.content, separators=(",", ":"), allow_nan=False)
        for mark, text in (
            ("{{title}}", html.escape(str(self.content["title"]))),
            ("{{data}}", data.replace("<", "\\u003c")),
        ):
            page = page.replace(mark, text)
        return page

    def save(self, path: str | Path) -> None:
        """Write the page; the file is replaced in one step.

        Raises
        ------
        ValueError
            If the ending is not .html.
        OSError
            If the file cannot be written; an old one stays as it was.
        """
        target = Path(path)
        if target.suffix.lower() != ".html":
            raise ValueError(f"player: got the file name {target.name}, need one ending in .html")
        write_text_atomically(target, self.html)

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" width="100%" height="{FRAME_HEIGHT}" '
            'style="border:0" title="player"></iframe>'
        )


@cache
def _template() -> str:
    folder = resources.files("maneuver_automaton.plotting.player")

    def text(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    scripts = "\n".join(f"<script>\n{text(name)}</script>" for name in SCRIPTS)
    page = text("player.html").replace("{{style}}", text("player.css"))
    return page.replace("{{scripts}}", scripts)


MOST_NODES = 20_000  # shown of a search
Numbers = Mapping[str, int]  # of the trims on a page, by name


def player_of(value: Any, *, title: str = "") -> Player:
    """The player of any result in which somebody moves.

    Parameters
    ----------
    value : any result, or a Recording
        What to play.
    title : str
        Heads the page; the kind of `value` if left out.

    Raises
    ------
    TypeError
        If it is none of these.

    Examples
    --------
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> player = player_of(Plan([0.0, 0.0, 0.0], (ahead,), durations=[3.0]), title="Ahead")
    >>> player.content["title"], player.content["motions"][0]["times"]
    ('Ahead', [0.0, 3.0])
    """
    recording = recording_of(value)
    return Player(content_of(replace(recording, title=title) if title else recording))


def player_of_file(document: Mapping[str, Any], plan: Plan, *, title: str) -> Player:
    """The player of a loaded plan.json and its `plan`, without the body and the obstacles."""
    recording, bound = stated(document, plan), document.get("bound") or {}
    known = Fact(label="known", value="the motion alone; body and obstacles with the scenario")
    search = Search(
        improvements=tuple(map(tuple, document.get("improvements") or ())),
        bounds=tuple(map(tuple, bound.get("history") or ())),
        cost=document.get("cost"),
        bound=document.get("lower_bound"),
        kind=bound.get("kind") or "",
    )
    facts = (*recording.facts, known)
    return Player(content_of(replace(recording, title=title, facts=facts, search=search)))


def content_of(recording: Recording) -> dict[str, Any]:
    """Title, facts, motions, and what is around them; of several vehicles one may be picked."""
    cast, world = cast_of(recording), recording.world
    first, local = cast.actors[0], Local(cast.actors[0].track.start[:2])
    goals = first.goals if cast.is_alone else ()
    others = {one: joined_track(one.start, one.pieces) for one in recording.alternatives}
    trims, numbers = _trims(cast, list(others.values()))
    motions = [
        _motion(one.mover, one.track, recording, local, its)
        for one, its in zip(cast.actors, numbers, strict=True)
    ]
    motions += [_motion(one, way, recording, local, numbers[0]) for one, way in others.items()]
    content: dict[str, Any] = {
        "title": recording.title,
        "facts": [(fact.label, fact.text) for fact in recording.heading],
        "trims": trims,
        "motions": motions,
        "bodies": [],
        "origin": local.origin.tolist(),
        "box": local.places(_box(cast, [first.track, *others.values()])),
        "mark": rounded([_mark(cast)])[0],
        "goals": goal_entries(goals, local, first.reached),
        "obstacles": obstacle_entries(world.obstacles, local, leave=world.fleeting),
        **limit_entries(world.zones, world.bounds, local),
        "ending": recording.ending,
    }
    if world.lanes:
        content["lanes"] = [local.places(ring) for ring in world.lanes]
        regions = {str(one): Obstacle(one) for mover in recording.movers for one in mover.regions}
        content["regions"] = obstacle_entries(regions.values(), local, leave=False)
    if len(cast.actors) > 1:
        _add_vehicles(content, cast, local, numbers)
        return content
    content["bodies"] = body_entries(first.mover.bodies)
    if recording.search is not None:
        content["search"] = _search(recording.search, local)
    if first.held:
        content["steps"] = _steps(cast, local, numbers[0])
    return content


def _trims(cast: Cast, others: Sequence[Track]) -> tuple[list[dict[str, str]], list[Numbers]]:
    entries: list[dict[str, str]] = []
    of_kind: dict[int, Numbers] = {}
    movers = [one.mover for one in cast.actors]
    kinds = [id(one.model if one.problem is None else one.problem.automaton) for one in movers]
    for kind in dict.fromkeys(kinds):
        alike = [one for one, its in zip(cast.actors, kinds, strict=True) if its == kind]
        tracks = [*others]
        for one in alike:
            tracks += [one.track, *(way for _, way in one.held)]
        every = {name: twist for way in tracks for name, twist in way.twists.items()}
        colors: dict[str, Color] = track_colors(every)
        if len(cast.actors) == 1:
            colors |= track_colors(cast.actors[0].track.twists)  # as in its picture
        of_kind[kind] = {name: len(entries) + k for k, name in enumerate(colors)}
        entries += [
            {"name": shown_name(name), "color": hex_color(color)} for name, color in colors.items()
        ]
    return entries, [of_kind[kind] for kind in kinds]


def _motion(
    mover: Mover, track: Track, recording: Recording, local: Local, numbers: Numbers
) -> dict[str, Any]:
    """What a vehicle drives, with its curves, its clearance, and the parts that it carries."""
    model, names = mover.model, [name for name in mover.bodies if name]
    times = sample_times(track.switching_times)
    poses = track.at(times)
    around = recording.world.obstacles if mover.problem is None else mover.problem.obstacles
    rings = footprint_polygons(mover.bodies.get("", ())) or [np.zeros((1, 2))]
    bodies = [(ring, poses) for ring in rings]
    parts: list[Any] = []
    if model is not None and names and track.pieces:
        carried = [(part.bodies[""], part.pose_at(times)) for part in mover.parts[1:]]
        bodies += [(ring, at) for body, at in carried for ring in footprint_polygons(body)]
        parts = part_entries(track, model, names)
    heights = None
    if mover.problem is not None and track.start.size > 3:
        heights = poses[:, 3:] + np.array(mover.problem.body_height)
    entry = motion_entry(track, local, numbers)
    entry["poses"][-1] = local.poses(np.asarray(mover.end))  # what pushed it at the end included
    leave, alone = recording.world.fleeting, len(recording.movers) == 1
    own = (one for one in recording.curves if one.mover == mover.name and (alone or one.mover))
    values = [_curve(one) for one in own if one.label == "value"]
    return {
        **entry,
        "curves": curve_entries(track, mover) + [{"label": "value", **one} for one in values],
        "clearance": clearance_entry(times, bodies, around, heights=heights, leave=leave),
        "parts": parts,
        "cost": mover.cost,
    }


def _curve(curve: Curve) -> dict[str, list[float]]:
    """Corners of a number that holds until the next, where it is known."""
    known = np.isfinite(curve.value)
    time, value = curve.time[known], curve.value[known]
    return {
        "t": rounded(np.append(np.repeat(time, 2)[1:-1], time[-1:])),
        "v": rounded(np.append(np.repeat(value[:-1], 2), value[-1:])),
    }


def _box(cast: Cast, tracks: Iterable[Track]) -> Array:
    """The box (2, 2) of the picture, and all that the body sweeps along tracks in it."""
    body = cast.actors[0].body if cast.is_alone else []
    bodies = [ring for track in tracks for ring in placed(body, track.pose)]
    places = [*cast.box, *np.concatenate([np.zeros((0, 2)), *bodies])]
    return np.array([np.min(places, axis=0), np.max(places, axis=0)])


def _mark(cast: Cast) -> float:
    """Size of a path [m] that the marks of the page suit."""
    if cast.on_roads:
        return max(float(np.ptp(ring[:, 0])) for one in cast.actors for ring in one.body)
    if len(cast.actors) == 1:
        return cast.size
    extent = float(np.ptp(cast.box, axis=0).max())
    return min(extent, max(BODIES * max(one.reach for one in cast.actors), LEAST_MARK * extent))


def _add_vehicles(
    content: dict[str, Any], cast: Cast, local: Local, numbers: Sequence[Numbers]
) -> None:
    """What tells several vehicles apart, and what all of them do together."""
    times = distance_times(cast.recording.begin, cast.end)
    nearest = nearest_others(cast.actors, times)
    for k, one in enumerate(cast.actors):
        mover = one.mover
        content["motions"][k] |= {
            "name": one.name,
            "label": one.label,
            "color": hex_color(one.color),
            "bodies": body_entries(mover.bodies),
            "goals": goal_entries(mover.goals, local, mover.goal_index),
            "leaves": bool(np.isfinite(mover.there[1])),
            "joins": bool(np.isfinite(mover.there[0])) and mover.there[0] > cast.recording.begin,
            "reason": mover.reason,
            "others": distance_curve(times, nearest[:, k]),
            "held": [
                {"t": time, "plan": motion_entry(track, local, numbers[k])}
                for time, track in one.held
            ],
        }
    recording = cast.recording
    fleet: dict[str, Any] = {
        "begin": cast.recording.begin,
        "end": cast.end,
        "margin": recording.world.margin,
        "distance": distance_curve(times, nearest.min(axis=1)),
    }
    for curve in (one for one in recording.curves if one.label == "value" and not one.mover):
        fleet["value"] = _curve(curve)
        fleet["steps"] = [
            {
                "t": time,
                "swaps": recording.texts("exchanged", time),
                "broken": recording.texts("broken", time),
            }
            for time in curve.time[:-1].tolist()
        ]
    content["fleet"] = fleet


def _steps(cast: Cast, local: Local, numbers: Numbers) -> list[dict[str, Any]]:
    recording, (one,) = cast.recording, cast.actors
    values = next(curve for curve in recording.curves if curve.label == "value").value.tolist()
    return [
        {
            "t": time,
            "value": value,
            "replanned": bool(recording.texts("replanned", time)),
            "broken": recording.texts("broken", time),
            "plan": motion_entry(track, local, numbers),
        }
        for (time, track), value in zip(one.held, values, strict=False)
    ]


def _search(search: Search, local: Local) -> dict[str, Any]:
    """How the search went on, and what it expanded if that was asked for."""
    entry: dict[str, Any] = {
        "costs": [[float(at), float(cost)] for at, cost in search.improvements],
        "bounds": [[float(at), float(value)] for at, value in search.bounds],
        "cost": search.cost,
        "bound": search.bound,
        "kind": search.kind,
    }
    if search.nodes is not None:
        some = search.nodes[:: max(1, -(-len(search.nodes) // MOST_NODES))]
        entry["nodes"] = local.places(some[:, :2])
        entry["node_costs"] = rounded(some[:, 3], 4) if some.shape[1] > 3 else []
    for name in ("reached", "narrowest"):
        if (places := getattr(search, name)) is not None:
            entry[name] = local.places(places)
    return entry
