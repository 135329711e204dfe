"""`check`: what holds of a scenario, of one vehicle or several, as a table; no plan is shown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from maneuver_automaton import analysis, planning
from maneuver_automaton._arrays import Array
from maneuver_automaton.analysis import SymmetryReport
from maneuver_automaton.analysis.examine import listed
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.cli.automaton_command import report_lines
from maneuver_automaton.cli.check_plans import Finding
from maneuver_automaton.cli.check_plans import findings as findings_of_plans
from maneuver_automaton.cli.guard import FOUND, NO_PLAN
from maneuver_automaton.cli.inputs import Parts, problem_of
from maneuver_automaton.cli.terminal import announced, console, table, waiting
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.fleet import FleetProblem, FleetStatus, plan_fleet, verify_fleet
from maneuver_automaton.formats.fleet_json import reason_of
from maneuver_automaton.models import as_stated, rollout, vector_field
from maneuver_automaton.planning import PlanStatus
from maneuver_automaton.planning.blocked import where_touched
from maneuver_automaton.problem import Problem
from maneuver_automaton.recording.values import few
from maneuver_automaton.scenario import FleetScenario, Scenario

TRIM_SECONDS = 2.0  # how long every trim is driven by the ODE solver
TRIM_TOLERANCE = 1e-7  # [m, rad] between trim and ODE solver
UNDECIDED = (PlanStatus.NO_PLAN, PlanStatus.OUT_OF_BUDGET)


def check_file(file: Path, *, parts: Parts, leave: bool) -> int:
    """Print the report of a problem, of a fleet, or of plans, and return the exit code."""
    if (proven := findings_of_plans(file, parts, leave=leave)) is not None:
        return reported(*proven)
    scenario = problem_of(file, parts)
    if not isinstance(scenario, Scenario):
        return reported(scenario.name, _of_fleet(scenario))
    problem = scenario.problem
    return reported(
        scenario.name,
        [*of_vehicle(problem), *of_ends(problem), _feasibility(problem, scenario.time_limit_s)],
    )


def reported(name: str, findings: Iterable[Finding]) -> int:
    """Print findings, and return the exit code."""
    findings = list(findings)
    signs = {True: "yes", False: "NO", None: "note"}
    rows = [
        [
            finding.what,
            signs[finding.holds],
            "" if finding.worst is None else f"{finding.worst:.2g}",
            finding.words,
        ]
        for finding in findings
    ]
    console().print(table(name, ["check", "holds", "worst", "where, why"], rows))
    return NO_PLAN if any(finding.holds is False for finding in findings) else FOUND


def of_vehicle(problem: Problem) -> Iterator[Finding]:
    """What holds of a vehicle, its library and its cost."""
    yield from _symmetry(problem)
    yield from _automaton(problem.automaton)
    twists = problem.automaton.body_velocities[:, :3]
    report = analysis.check_library(twists, max_trims=problem.horizon.max_trims)
    missing = f"sufficient, not necessary, to reach every pose: {'; '.join(report.missing)}"
    yield Finding(
        "library: turn, move, turn",
        str(report) if report.holds else missing,
        holds=True if report.holds else None,
    )


def _symmetry(problem: Problem) -> Iterator[Finding]:
    model = as_stated(problem.automaton.model)
    region = analysis.Region.of_model(model)
    yield _found("vector field", analysis.check_vector_field(model))
    yield _found("flow", analysis.check_flow(model))
    yield _found("stage cost", analysis.check_stage_cost(_stage_cost(problem), region=region))
    for kind in dict.fromkeys(type(cost).__name__ for cost in problem.place_costs):
        yield Finding(
            "symmetry: place cost",
            f"{kind} depends on the place; the vehicle and the rest of its cost do not",
        )
    bounds = problem.bounds
    named = (("x", bounds.x), ("y", bounds.y), ("z", bounds.z))
    pairs = [(model.group.coordinates.index(name), pair) for name, pair in named if pair]

    def excess(state: Array, control: Array) -> Array:
        return np.array([(low - state[k], state[k] - high) for k, (low, high) in pairs]).ravel()

    if pairs:
        report = analysis.check_constraint(excess, region=region)
        yield _of_given("bounds", report, hint="they do not move with the problem")
    stated = np.isin(problem.automaton.model.group.coordinates, model.group.coordinates)
    start, goal = problem.start[stated], problem.goals[0].pose[stated]

    def ends(first: Array, last: Array) -> Array:
        return np.concatenate([first[: start.size] - start, last[: goal.size] - goal])

    report = analysis.check_boundary_condition(ends, region=region)
    yield _of_given(
        "start and goal",
        report,
        hint="fixed ends never are; moving both gives an equivalent problem",
    )


def _found(what: str, report: SymmetryReport) -> Finding:
    return Finding(
        f"symmetry: {what}",
        f"invariant under {listed(report.intact)}" if report.holds else report.message,
        holds=report.holds,
        worst=report.worst_violation,
    )


def _of_given(what: str, report: SymmetryReport, *, hint: str) -> Finding:
    if report.holds:
        return _found(what, report)
    return Finding(
        f"symmetry: {what}",
        f"not invariant under {listed(report.broken)}: {hint}",
        worst=report.worst_violation,
    )


def _stage_cost(problem: Problem) -> Callable[[Array, Array], float]:
    """The cost as a function of state and control, the body velocity taken from the dynamics."""
    model = as_stated(problem.automaton.model)
    field = vector_field(model)

    def cost(state: Array, control: Array) -> float:
        pose = state[: model.group.dof]
        twist = model.group(pose).body_twist(field(state, control)[: model.group.dof])
        return float(problem.cost.rates(control[None], twist[None])[0])

    return cost


def _automaton(automaton: Automaton) -> Iterator[Finding]:
    yield _trims(automaton)
    report = validate(automaton)
    sound = report.connected and not (report.dead_ends or report.unused)
    lines = report_lines(report)
    yield Finding(
        "automaton: connected",
        "every trim can be reached from every trim" if sound else "; ".join(lines[1:]),
        holds=sound,
    )
    if report.duplicates:
        words = "; ".join(few(names, 8) for names in report.duplicates[:5])
        yield Finding("automaton: no trim twice", f"equal twists: {words}")
    yield Finding(
        "automaton: reaches every pose of free space",
        lines[0],
        holds=True if report.controllable else None,
    )


def _trims(automaton: Automaton) -> Finding:
    """Every trim, driven by an ODE solver, is where its closed form says."""
    model, trims = automaton.model, automaton.trims
    start = np.array([0.3, -0.2, 0.7, 0.1][: model.group.dof])
    states = np.array([np.concatenate([start, trim.reduced_state]) for trim in trims])
    field, controls = vector_field(model), automaton.controls

    def rates(state: Array, control: Array) -> Array:  # of all side by side, as one large system
        return field(state.reshape(states.shape), control.reshape(controls.shape)).ravel()

    ends = rollout(rates, states.ravel(), control=controls.ravel(), times=[0.0, TRIM_SECONDS])
    driven = ends[-1].reshape(states.shape)
    coasted = model.group.exp(TRIM_SECONDS * automaton.body_velocities)
    expected = (model.group(start) @ coasted).pose
    reduced = states[:, model.group.dof :]
    defect = np.abs(driven - np.concatenate([expected, reduced], axis=1)).max(axis=1)
    worst = int(defect.round(12).argmax())  # of equal ones the first: rounding is the machine's
    return Finding(
        "automaton: trims follow the model",
        f"{len(trims)} trims driven for {TRIM_SECONDS:g} s by an ODE solver, "
        f"worst {trims[worst].name!r}",
        holds=bool(defect.max() <= TRIM_TOLERANCE),
        worst=float(defect.max()),
    )


def of_ends(problem: Problem) -> Iterator[Finding]:
    """Whether start and goals are where a vehicle can be."""
    ends = [("start", problem.start), *(("goal", goal.pose) for goal in problem.goals)]
    bounds = problem.bounds
    limits = [("x", 0, bounds.x), ("y", 1, bounds.y), ("z", 3, bounds.z)]
    known = [(name, k, pair) for name, k, pair in limits if pair is not None]
    for what, pose in ends:
        excess = {name: max(low - pose[k], pose[k] - high) for name, k, (low, high) in known}
        outside = {name: float(value) for name, value in excess.items() if value > 0.0}
        words = "outside in " + ", ".join(outside) if outside else "inside"
        yield Finding(
            f"{what}: inside the bounds",
            words if known else "there are none",
            holds=not outside,
            worst=max(outside.values()) if outside else None,
        )
    if problem.footprint:  # how far it reaches shows a reference that is on the wrong side
        parts = parts_of(problem.footprint)
        low = np.min([np.array(part.core.bounds[:2]) - part.radius for part in parts], axis=0)
        high = np.max([np.array(part.core.bounds[2:]) + part.radius for part in parts], axis=0)
        yield Finding(
            "body: seen from the pose",
            f"{-low[0]:.6g} m behind to {high[0]:.6g} m ahead, "
            f"{-low[1]:.6g} m right to {high[1]:.6g} m left",
        )
    touched = [("start", problem.start, problem.start_time)]
    touched += [("goal", one.pose, math.inf) for one in problem.goals if not one.free_heading]
    for what, pose, time in touched if problem.obstacles else ():
        words = where_touched(problem, pose, time)
        yield Finding(f"{what}: keeps clear of obstacles", words or "it does", holds=not words)


def _feasibility(problem: Problem, time_limit: float) -> Finding:
    """What is known of the goal: that it is reached, that it is not, or nothing."""
    with announced(), waiting(f"planning, at most {time_limit:g} s", quiet=False):
        result = planning.plan(problem, time_limit=time_limit)
    words = f"{result.status.value}: {result.reason}"
    if result.status is PlanStatus.FOUND:
        words = "a plan exists"
    elif result.status is PlanStatus.OUT_OF_BUDGET:
        words = f"not known: {result.reason}, which does not prove that there is none"
    found = None if result.status in UNDECIDED else result.status is PlanStatus.FOUND
    return Finding("goal: can be reached", words, holds=found)


# -- several vehicles


def _of_fleet(scenario: FleetScenario) -> Iterator[Finding]:
    """What holds of a fleet: a line for what is alike of all, or for each that is not."""
    fleet = scenario.fleet
    kinds: dict[tuple[int, int], dict[str, Problem]] = {}  # those of one library and cost
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        kinds.setdefault((id(problem.automaton), id(problem.cost)), {})[name] = problem
    for alike in kinds.values():
        names = few([*alike], 3)
        for one in of_vehicle(next(iter(alike.values()))):
            yield one if len(kinds) == 1 else one._replace(what=f"{names}: {one.what}")
    yield from _ends(fleet)
    yield _apart("starts", fleet)
    at_goals = [  # those that stay at one goal of one heading, standing there
        (name, replace(one, start=one.goals[0].pose, start_trim=one.goals[0].trim))
        for name, one, leaves in zip(fleet.names, fleet.problems, fleet.leaves, strict=True)
        if not leaves and len(one.goals) == 1 and not one.goals[0].free_heading
    ]
    if at_goals:
        there = FleetProblem(
            [one for _, one in at_goals], names=[name for name, _ in at_goals], margin=fleet.margin
        )
        yield _apart("goals", there)
    limit = scenario.time_limit_s
    with announced(), waiting(f"planning, at most {limit:g} s", quiet=False):
        result = plan_fleet(
            fleet,
            time_limit=limit,
            objective=scenario.settings.objective,
            orders=scenario.settings.orders,
            max_rounds=0,
        )
    found = result.status is FleetStatus.FOUND
    n = len(fleet)
    yield Finding(
        "goals: can be reached",
        f"plans of all {n} vehicles exist" if found else f"not known: {reason_of(result)}",
        holds=True if found else None,
    )


def _ends(fleet: FleetProblem) -> Iterator[Finding]:
    """What holds of start and goal: a line for all, or for each vehicle of which it does not."""
    found: dict[str, list[tuple[str, Finding]]] = {}
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        for one in of_ends(problem):
            found.setdefault(one.what, []).append((name, one))
    for what, its in found.items():
        wrong = [(name, one) for name, one in its if one.holds is False]
        for name, one in wrong:
            yield one._replace(what=f"{name}: {what}")
        if not wrong:
            words = {one.words: None for _, one in its}
            yield its[0][1]._replace(what=what, words="; ".join(words))


def _apart(what: str, fleet: FleetProblem) -> Finding:
    """Whether all vehicles can stand at their starts at once."""
    verdict = verify_fleet(fleet, {})
    if not verdict.too_near:
        least = min((one.distance_m for one in verdict.closest), default=None)
        return Finding(f"{what}: are apart", "every pair is", holds=True, worst=least)
    said = "; ".join(
        f"{' and '.join(one.pair)} are {one.distance_m:.3g} m apart" for one in verdict.too_near[:5]
    )
    more = f", need more than {fleet.margin:g} m" if fleet.margin else ", which touch"
    return Finding(
        f"{what}: are apart", said + more, holds=False, worst=verdict.too_near[0].distance_m
    )
