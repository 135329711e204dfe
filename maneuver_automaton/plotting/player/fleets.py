"""What a player shows of a fleet: all vehicles at once, of which one may be picked."""

from __future__ import annotations

from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.fleet import FleetResult
from maneuver_automaton.plotting.fleet_cast import Cast, Member, cast_of
from maneuver_automaton.plotting.fleet_distances import distance_times, nearest_others, thinned
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.player.clearances import MOST_SAMPLES
from maneuver_automaton.plotting.player.composing import Fact, around, played, trim_entries
from maneuver_automaton.plotting.player.local import POSE_DIGITS, Local, hex_color, rounded
from maneuver_automaton.plotting.player.surroundings import body_entries, goal_entries
from maneuver_automaton.plotting.scene import BODIES, LEAST_MARK, plan_scene


def fleet_content(result: FleetResult) -> dict[str, Any]:
    """Every vehicle's motion with its controls, its clearance and its distance from the others.

    Trims have the colours of their vehicle's own automaton: two kinds may name theirs alike.
    """
    cast = cast_of(result)
    local = Local(cast.members[0].track.start[:2])
    times = distance_times(cast)
    nearest = nearest_others(cast.members, times)
    trims: list[dict[str, str]] = []
    names_of_kind: dict[int, dict[str, int]] = {}
    for one in cast.members:
        kind = id(one.problem.automaton)
        if kind not in names_of_kind:
            alike = [other for other in cast.members if id(other.problem.automaton) == kind]
            every = {name: xi for other in alike for name, xi in other.track.twists.items()}
            colors = track_colors(every)
            names_of_kind[kind] = {name: len(trims) + k for k, name in enumerate(colors)}
            trims += trim_entries(colors)
    return {
        "title": "Fleet",
        "facts": _facts(result),
        "trims": trims,
        "motions": [
            _vehicle(one, local, names_of_kind[id(one.problem.automaton)])
            | {"others": _curve(times, nearest[:, k])}
            for k, one in enumerate(cast.members)
        ],
        "bodies": [],
        **around(cast.scene, local, cast.box, size=_mark(cast)),
        "fleet": {
            "begin": cast.begin,
            "end": cast.end,
            "margin": cast.margin,
            "distance": _curve(times, nearest.min(axis=1)),
        },
    }


def _vehicle(one: Member, local: Local, names: dict[str, int]) -> dict[str, Any]:
    scene = plan_scene(one.problem, one.plan)
    return {
        **played(one.track, local, names, scene=scene, problem=one.problem),
        "name": one.name,
        "label": one.label,
        "color": hex_color(one.color),
        "bodies": body_entries(one.problem.footprint, one.problem.parts),
        "goals": goal_entries(one.problem.goals, local, scene.reached),
        "leaves": one.leaves and one.plan is not None,
        "reason": one.reason,
    }


def _curve(times: Array, distances: Array) -> dict[str, Any] | None:
    """Least distances over time; None if there never is another."""
    known = np.isfinite(distances)
    if not known.any():
        return None
    at, least = thinned(times[known], distances[known], most=MOST_SAMPLES)
    return {"t": rounded(at, POSE_DIGITS), "v": rounded(least, 4)}


def _mark(cast: Cast) -> float:
    """Size of a path [m] that the marks of the page suit."""
    extent = float(np.ptp(cast.box, axis=0).max())
    reach = max(one.reach for one in cast.members)
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
        facts.append(("gap", f"{100.0 * result.gap:.3g} %" if result.gap else "proven optimal"))
    if result.problem.margin > 0.0:
        facts.append(("margin", f"{result.problem.margin:g} m"))
    return facts
