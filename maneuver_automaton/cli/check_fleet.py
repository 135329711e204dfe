"""`check` of several vehicles: each as one alone, and whether starts and goals are apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from maneuver_automaton.cli.check_command import Finding, of_ends, of_vehicle
from maneuver_automaton.cli.progress import announced, waiting
from maneuver_automaton.fleet import FleetProblem, FleetStatus, plan_fleet, verify_fleet
from maneuver_automaton.formats.fleet_json import reason_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario import FleetScenario


def findings(scenario: FleetScenario) -> Iterator[Finding]:
    """What holds of a fleet: a line for what is alike of all, or for each that is not."""
    fleet = scenario.fleet
    kinds = _kinds(fleet)
    for names, problem in kinds:
        for one in of_vehicle(problem):
            yield one if len(kinds) == 1 else replace(one, what=f"{names}: {one.what}")
    yield from _ends(fleet)
    yield _apart("starts", fleet)
    if goals := _at_goals(fleet):
        yield _apart("goals", goals)
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
        what="goals: can be reached",
        holds=True if found else None,
        words=f"plans of all {n} vehicles exist" if found else f"not known: {reason_of(result)}",
    )


def _kinds(fleet: FleetProblem) -> list[tuple[str, Problem]]:
    """Vehicles of one library and cost: their names, and the problem of the first."""
    kinds: dict[tuple[int, int], list[str]] = {}
    first: dict[tuple[int, int], Problem] = {}
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        key = (id(problem.automaton), id(problem.cost))
        kinds.setdefault(key, []).append(name)
        first.setdefault(key, problem)
    return [(_several(names), first[key]) for key, names in kinds.items()]


def _several(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _ends(fleet: FleetProblem) -> Iterator[Finding]:
    """What holds of start and goal: a line for all, or for each vehicle of which it does not."""
    found: dict[str, list[tuple[str, Finding]]] = {}
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        for one in of_ends(problem):
            found.setdefault(one.what, []).append((name, one))
    for what, its in found.items():
        wrong = [(name, one) for name, one in its if one.holds is False]
        for name, one in wrong:
            yield replace(one, what=f"{name}: {what}")
        if not wrong:
            words = {one.words: None for _, one in its}
            yield replace(its[0][1], what=what, words="; ".join(words))


def _apart(what: str, fleet: FleetProblem) -> Finding:
    """Whether all vehicles can stand at their starts at once."""
    verdict = verify_fleet(fleet, {})
    if not verdict.too_near:
        least = min((one.distance_m for one in verdict.closest), default=None)
        return Finding(what=f"{what}: are apart", holds=True, worst=least, words="every pair is")
    said = "; ".join(
        f"{' and '.join(one.pair)} are {one.distance_m:.3g} m apart" for one in verdict.too_near[:5]
    )
    more = f", need more than {fleet.margin:g} m" if fleet.margin else ", which touch"
    return Finding(
        what=f"{what}: are apart",
        holds=False,
        worst=verdict.too_near[0].distance_m,
        words=said + more,
    )


def _at_goals(fleet: FleetProblem) -> FleetProblem | None:
    """Those that stay at one goal of one heading, standing there; None if there are none."""
    stay = [
        (name, problem)
        for name, problem, leaves in zip(fleet.names, fleet.problems, fleet.leaves, strict=True)
        if not leaves and len(problem.goals) == 1 and not problem.goals[0].free_heading
    ]
    if not stay:
        return None
    there = [
        replace(problem, start=problem.goals[0].pose, start_trim=problem.goals[0].trim)
        for _, problem in stay
    ]
    return FleetProblem(there, names=[name for name, _ in stay], margin=fleet.margin)
