"""What a player shows of a plan, a result, a closed loop or a drive, as plain values."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet import FleetLog, FleetResult
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.cast import cast_of
from maneuver_automaton.plotting.labels import stated_labels
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.player.composing import (
    Fact,
    around,
    names_of,
    plan_view,
    played,
    trim_entries,
)
from maneuver_automaton.plotting.player.drives import drive_content
from maneuver_automaton.plotting.player.fleets import fleet_content, loop_content
from maneuver_automaton.plotting.player.local import Local, rounded
from maneuver_automaton.plotting.player.motions import motion_entry
from maneuver_automaton.plotting.player.page import Player
from maneuver_automaton.plotting.player.road_fleets import road_loop_content, road_plans_content
from maneuver_automaton.plotting.player.surroundings import body_entries
from maneuver_automaton.plotting.scene import bare_scene, plan_scene
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.receding_horizon import ClosedLoop, Step
from maneuver_automaton.recording import recording_of
from maneuver_automaton.roads import RoadDrive, RoadFleetDrive, RoadFleetResult, RoadPlanResult

MOST_NODES = 20_000  # shown of a search


def player_of(value: Any, *, title: str = "") -> Player:
    """The player of a plan, an answer for one or a fleet, a closed loop, or a plan on roads.

    Parameters
    ----------
    value : Plan, PlanResult, FleetResult, ClosedLoop, FleetLog, RoadPlanResult, RoadDrive, \
RoadFleetResult or RoadFleetDrive
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
    content = content_of(value)
    return Player({**content, "title": title} if title else content)


def player_of_file(document: Mapping[str, Any], plan: Plan, *, title: str) -> Player:
    """The player of a loaded plan.json and its `plan`, without the body and the obstacles."""
    content = content_of(plan)
    named = stated_labels(document, "reduced_state") + stated_labels(document, "control")
    for curve, label in zip(content["motions"][0]["curves"], named, strict=False):
        curve["label"] = label
    bound, error = document.get("bound") or {}, document.get("terminal_error") or {}
    facts = _plan_facts(
        cost=document.get("cost"),
        duration=plan.duration,
        bound=None if document.get("gap") is None else document.get("lower_bound"),
        clearance=document.get("clearance_m"),
        error=(error.get("position_m"), error.get("heading_rad")),
    )
    search = {
        "costs": document.get("improvements") or [],
        "bounds": bound.get("history") or [],
        "cost": document.get("cost"),
        "bound": document.get("lower_bound"),
        "kind": bound.get("kind") or "",
    }
    facts.append(("known", "the motion alone; body and obstacles with the scenario"))
    return Player({**content, "title": title, "facts": facts, "search": search})


@functools.singledispatch
def content_of(value: Any) -> dict[str, Any]:
    """Title, facts, motions, and what is around them, as plain values."""
    raise TypeError(
        f"player: got {type(value).__name__}, need a Plan, PlanResult, FleetResult, ClosedLoop, "
        "FleetLog, RoadPlanResult, RoadDrive, RoadFleetResult or RoadFleetDrive"
    )


content_of.register(FleetResult, fleet_content)
content_of.register(FleetLog, loop_content)
content_of.register(RoadFleetResult, road_plans_content)
content_of.register(RoadFleetDrive, road_loop_content)


@content_of.register
def _(plan: Plan) -> dict[str, Any]:
    track, local = track_of_plan(plan), Local(plan.start[:2])
    scene, colors = bare_scene(track, footprint=None), track_colors(track.twists)
    box, size = plan_view(scene, [track])
    return {
        "title": "Plan",
        "facts": [("duration", f"{plan.duration:.5g} s")],
        "trims": trim_entries(colors),
        "motions": [played(track, local, names_of(colors), scene=scene, problem=None)],
        "bodies": [],
        **around(scene, local, box, size=size),
    }


@content_of.register
def _(result: PlanResult) -> dict[str, Any]:
    problem, plan = result.problem, result.plan
    local, scene = Local(problem.start[:2]), plan_scene(problem, plan)
    plans = [] if plan is None else [plan, *(one.plan for one in result.alternatives)]
    tracks = [track_of_plan(one) for one in plans] or [Track(problem.start, ())]
    every = {name: twist for track in tracks for name, twist in track.twists.items()}
    # the best plan's as in its picture
    colors = track_colors(every) | track_colors(tracks[0].twists)
    motions = [
        played(track, local, names_of(colors), scene=scene, problem=problem) for track in tracks
    ]
    costs = [result.cost, *(one.cost for one in result.alternatives)]
    for motion, cost in zip(motions, costs, strict=True):
        motion["cost"] = cost
    box, size = plan_view(scene, tracks)
    return {
        "title": "Plan",
        "facts": _result_facts(result),
        "trims": trim_entries(colors),
        "motions": motions,
        "bodies": body_entries(problem.footprint, problem.parts),
        **around(scene, local, box, size=size),
        "search": _search(result, local),
        "ending": result.reason,
    }


@content_of.register
def _(loop: ClosedLoop) -> dict[str, Any]:
    cast = cast_of(recording_of(loop))
    track, colors, scene = cast.actors[0].track, cast.colors, cast.scene
    local, names, problem = Local(loop.poses[0, :2]), names_of(colors), loop.problem
    motion = played(track, local, names, scene=scene, problem=problem)
    motion["poses"][-1] = local.poses(loop.poses[-1])  # what pushed it at the end included
    motion["times"][-1] = float(loop.times[-1])
    motion["curves"].append(_values(loop))
    return {
        "title": "Closed loop",
        "facts": _loop_facts(loop),
        "trims": trim_entries(colors),
        "motions": [motion],
        "bodies": body_entries(problem.footprint, problem.parts),
        **around(scene, local, cast.box, size=cast.size),
        "steps": [_step(step, local, names) for step in loop.steps],
        "ending": "goal reached" if loop.reached else loop.reason,
    }


@content_of.register
def _(result: RoadPlanResult) -> dict[str, Any]:
    verdict, plan = result.verdict, result.plan
    facts: list[Fact] = []
    if plan is not None and verdict is not None:
        facts = [
            ("cost", f"{result.cost:.6g}"),
            ("duration", f"{plan.duration:.5g} s"),
            ("clearance", f"{verdict.clearance_m:.3g} m"),
            ("to the edge of the road", f"{verdict.edge_m:.3g} m"),
        ]
    return drive_content(result.planner, plan, facts, _box(result), ending=result.reason)


@content_of.register
def _(drive: RoadDrive) -> dict[str, Any]:
    verdict = drive.verdict
    facts = [
        ("goal", drive.status.replace("_", " ")),
        ("duration", f"{drive.driven.duration:.5g} s"),
        ("steps", f"{len(drive.steps)}, {sum(one.replanned for one in drive.steps)} replanned"),
        ("clearance", f"{verdict.clearance_m:.3g} m"),
    ]
    ending = "goal reached" if drive.reached else drive.reason
    return drive_content(drive.planner, drive.driven, facts, _box(drive), ending=ending)


def _box(result: RoadPlanResult | RoadDrive) -> Array:
    """The box (2, 2) around a drive and what is beside it."""
    return cast_of(recording_of(result)).box


def _plan_facts(
    *,
    cost: float | None,
    duration: float,
    bound: float | None,
    clearance: float | None,
    error: tuple[float | None, float | None],
) -> list[Fact]:
    """The numbers that head a plan, those that are known."""
    facts = [] if cost is None else [("cost", f"{cost:.6g}")]
    facts.append(("duration", f"{duration:.5g} s"))
    if bound is not None and cost is not None:
        facts.append(("proven", "optimal" if cost <= bound else f"at least {bound:.6g}"))
    if clearance is not None:
        facts.append(("clearance", f"{clearance:.3g} m"))
    apart, turned = error
    if apart is not None and turned is not None:
        facts.append(("terminal error", f"{apart:.2g} m, {turned:.2g} rad"))
    return facts


def _result_facts(result: PlanResult) -> list[Fact]:
    plan, error = result.plan, result.terminal_error
    if plan is None:
        return [("no plan", f"{result.status.value.replace('_', ' ')}: {result.reason}")]
    return _plan_facts(
        cost=result.cost,
        duration=plan.duration,
        bound=None if result.gap is None else result.lower_bound,
        clearance=result.clearance_m,
        error=(None, None) if error is None else (error.position_m, error.heading_rad),
    )


def _loop_facts(loop: ClosedLoop) -> list[Fact]:
    """The numbers that head a closed loop."""
    facts = [
        ("cost", f"{loop.cost:.6g}"),
        ("duration", f"{loop.times[-1] - loop.times[0]:.5g} s"),
        ("steps", f"{len(loop.steps)}, {sum(step.replanned for step in loop.steps)} replanned"),
    ]
    if loop.min_clearance_m is not None:
        facts.append(("clearance", f"{loop.min_clearance_m:.3g} m"))
    broken = sum(1 for _ in loop.violations)
    taken = sum(1 for _ in loop.disturbed)
    kept = f"kept but {taken}, taken by noise" if taken else "all kept"
    return [*facts, ("guarantees", f"{broken} broken" if broken else kept)]


def _values(loop: ClosedLoop) -> dict[str, Any]:
    """The value over time, held from step to step."""
    values = [step.value for step in loop.steps]
    return {
        "label": "value",
        "t": rounded(np.append(np.repeat(loop.times, 2)[1:-1], loop.times[-1])),
        "v": rounded(np.append(np.repeat(values, 2), loop.value)),
    }


def _search(result: PlanResult, local: Local) -> dict[str, Any]:
    """How the search went on, and what it expanded if that was asked for."""
    bound = result.bound
    entry: dict[str, Any] = {
        "costs": [[float(at), float(cost)] for at, cost in result.improvements],
        "bounds": [[float(at), float(value)] for at, value in (bound.history if bound else ())],
        "cost": result.cost,
        "bound": result.lower_bound,
        "kind": bound.kind if bound else "",
    }
    if result.nodes is not None:
        some = result.nodes[:: max(1, -(-len(result.nodes) // MOST_NODES))]
        entry["nodes"] = local.places(some[:, :2])
        entry["node_costs"] = rounded(some[:, 3], 4) if some.shape[1] > 3 else []
    if result.reached is not None:
        entry["reached"] = local.places(result.reached)
    if result.narrowest is not None:
        entry["narrowest"] = local.places(np.array(result.narrowest.place))
    return entry


def _step(step: Step, local: Local, names: dict[str, int]) -> dict[str, Any]:
    """A step of a closed loop: what it planned, and what it decided."""
    return {
        "t": float(step.time),
        "value": float(step.value),
        "decision": step.decision.value,
        "replanned": step.replanned,
        "broken": [str(one) for one in step.violations],
        "solve_s": float(step.solve_s),
        "plan": motion_entry(track_of_plan(step.plan), local, names),
    }
