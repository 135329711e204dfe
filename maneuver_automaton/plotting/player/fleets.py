"""What a player shows of a fleet: all vehicles at once, of which one may be picked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet import FleetLog, FleetResult
from maneuver_automaton.plotting.cast import Actor, Cast, cast_of
from maneuver_automaton.plotting.distances import distance_times, nearest_others
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.player.clearances import distance_curve
from maneuver_automaton.plotting.player.composing import Fact, around, played, trim_entries
from maneuver_automaton.plotting.player.local import Local, hex_color, rounded
from maneuver_automaton.plotting.player.motions import motion_entry
from maneuver_automaton.plotting.player.surroundings import body_entries, goal_entries
from maneuver_automaton.plotting.scene import BODIES, LEAST_MARK, scene_of
from maneuver_automaton.plotting.track import track_of_plan
from maneuver_automaton.problem import Problem
from maneuver_automaton.recording import Curve, recording_of


def fleet_content(result: FleetResult) -> dict[str, Any]:
    """Every vehicle's motion with its controls, its clearance and its distance from the others."""
    cast = cast_of(recording_of(result))
    return cast_content(cast, trims_of(cast), title="Fleet", facts=_facts(result))


def loop_content(log: FleetLog) -> dict[str, Any]:
    """What every vehicle drove in closed loop, its value, and the plans that it held."""
    cast = cast_of(recording_of(log))
    values = {one.mover: _curve(one) for one in cast.recording.curves if one.label == "value"}
    trims = trims_of(cast, plans=[plan for step in log.steps for plan in step.driven.items()])
    content = cast_content(cast, trims, title="Closed loop of a fleet", facts=_loop_facts(log))
    local = Local(cast.actors[0].track.start[:2])
    for entry, one in zip(content["motions"], cast.actors, strict=True):
        entry["curves"].append({"label": "value", **values[one.name]})
        entry["held"] = [
            {"t": time, "plan": motion_entry(track, local, trims.numbers[one.name])}
            for time, track in one.held
        ]
        entry["joins"] = bool(np.isfinite(one.mover.there[0]))
    content["fleet"]["value"] = values[""]
    content["fleet"]["steps"] = [
        {
            "t": float(step.time),
            "swaps": [" and ".join(swap.names) for swap in step.swaps],
            "broken": [str(one) for one in step.violations],
        }
        for step in log.steps
    ]
    content["ending"] = "all have arrived" if log.reached else log.reason
    return content


def _curve(curve: Curve) -> dict[str, list[float]]:
    known = np.isfinite(curve.value)
    return {"t": rounded(curve.time[known]), "v": rounded(curve.value[known])}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trims:
    """The trims of all kinds on a page: those of two kinds may have one name."""

    entries: list[dict[str, str]]
    numbers: Mapping[str, dict[str, int]]  # of the trims, by the name of the vehicle


def trims_of(cast: Cast, plans: Sequence[tuple[str, Plan]] = ()) -> Trims:
    """Trims that vehicles drive, in the colours of their own automata, and those of more plans."""
    entries: list[dict[str, str]] = []
    of_kind: dict[int, dict[str, int]] = {}
    planned: dict[str, dict[str, Array]] = {}
    for name, plan in plans:
        planned.setdefault(name, {}).update(track_of_plan(plan).twists)
    for one in cast.actors:
        kind = id(problem_of(one).automaton)
        if kind in of_kind:
            continue
        alike = [other for other in cast.actors if id(problem_of(other).automaton) == kind]
        every: dict[str, Array] = {}
        for other in alike:
            every |= other.track.twists | planned.get(other.name, {})
        colors = track_colors(every)
        of_kind[kind] = {name: len(entries) + k for k, name in enumerate(colors)}
        entries += trim_entries(colors)
    numbers = {one.name: of_kind[id(problem_of(one).automaton)] for one in cast.actors}
    return Trims(entries=entries, numbers=numbers)


def cast_content(cast: Cast, trims: Trims, *, title: str, facts: list[Fact]) -> dict[str, Any]:
    """The page of vehicles that drive at once."""
    local = Local(cast.actors[0].track.start[:2])
    times = distance_times(cast.begin, cast.end)
    nearest = nearest_others(cast.actors, times)
    return {
        "title": title,
        "facts": facts,
        "trims": trims.entries,
        "motions": [
            _vehicle(one, local, trims.numbers[one.name])
            | {"others": distance_curve(times, nearest[:, k])}
            for k, one in enumerate(cast.actors)
        ],
        "bodies": [],
        **around(cast.scene, local, cast.box, size=_mark(cast)),
        "fleet": {
            "begin": cast.begin,
            "end": cast.end,
            "margin": cast.recording.world.margin,
            "distance": distance_curve(times, nearest.min(axis=1)),
        },
    }


def _vehicle(one: Actor, local: Local, names: dict[str, int]) -> dict[str, Any]:
    problem = problem_of(one)
    scene = scene_of(problem, one.begin, one.arrival)
    scene = replace(scene, reached=one.mover.goal_index)
    return {
        **played(one.track, local, names, scene=scene, problem=problem),
        "name": one.name,
        "label": one.label,
        "color": hex_color(one.color),
        "bodies": body_entries(problem.footprint, problem.parts),
        "goals": goal_entries(problem.goals, local, scene.reached),
        "leaves": bool(np.isfinite(one.mover.there[1])),
        "reason": one.mover.reason,
    }


def problem_of(one: Actor) -> Problem:
    """What a vehicle of a fleet was to do."""
    assert one.mover.problem is not None
    return one.mover.problem


def _mark(cast: Cast) -> float:
    """Size of a path [m] that the marks of the page suit."""
    extent = float(np.ptp(cast.box, axis=0).max())
    reach = max(one.reach for one in cast.actors)
    return min(extent, max(BODIES * reach, LEAST_MARK * extent))


def _facts(result: FleetResult) -> list[Fact]:
    """The numbers that head a fleet, those that are known."""
    count, found = len(result.problem), len(result.plans)
    facts = [("vehicles", str(count) if found == count else f"{found} of {count} with a plan")]
    if found:
        facts += [("sum", f"{result.sum_s:.5g} s"), ("last", f"{result.last_s:.5g} s")]
        if np.isfinite(result.clearance_m):
            facts.append(("clearance", f"{result.clearance_m:.3g} m"))
    if result.gap is not None:
        facts.append(("proven", f"at least {result.lower_bound:.6g}" if result.gap else "optimal"))
    if result.problem.margin > 0.0:
        facts.append(("margin", f"{result.problem.margin:g} m"))
    return facts


def _loop_facts(log: FleetLog) -> list[Fact]:
    """The numbers that head a closed loop, those that are known."""
    broken, swaps = len(list(log.violations)), len(list(log.swaps))
    facts = [
        ("vehicles", f"{len(log.arrived_s)} of {len(log.problem)} arrived"),
        ("sum", f"{log.sum_s:.5g} s"),
        ("last", f"{log.last_s:.5g} s"),
        ("cost", f"{log.cost:.6g}"),
        ("steps", f"{len(log.steps)}, {swaps} exchange{'' if swaps == 1 else 's'}"),
    ]
    if np.isfinite(log.distance_m):
        facts.append(("nearest", f"{log.distance_m:.3g} m"))
    if log.problem.margin > 0.0:
        facts.append(("margin", f"{log.problem.margin:g} m"))
    return [*facts, ("guarantees", f"{broken} broken" if broken else "all kept")]
