"""`verify_fleet(fleet, plans)`: the checks of plans that somebody else has made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.result import Closest
from maneuver_automaton.fleet.vehicles import vehicles_of
from maneuver_automaton.fleet.verdict import enough_for, measured
from maneuver_automaton.planning.verdict import Verdict, verify


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetVerdict:
    """What the checks say of the plans of a fleet, each alone and every pair."""

    passed: bool
    verdicts: dict[str, Verdict]  # of each that has a plan
    closest: tuple[Closest, ...]  # pairs that come near each other, the nearest first
    too_near: tuple[Closest, ...]  # those of them that do not keep the fleet's margin

    __repr__ = brief


def verify_fleet(fleet: FleetProblem, plans: Mapping[str, Plan]) -> FleetVerdict:
    """Check plans of a fleet, say from a file, as `plan_fleet` checks its own.

    Each plan is verified past static obstacles, and every pair of vehicles is proven apart at all
    times, also after all have arrived. Who has no plan stands at its start.

    Parameters
    ----------
    fleet : FleetProblem
    plans : mapping of str to Plan
        By the names of the vehicles.

    Returns
    -------
    FleetVerdict
        ``passed`` if every vehicle has a plan that passes, and every pair keeps the margin.

    Raises
    ------
    ValueError
        If a plan is of no vehicle of the fleet, or does not live in its group.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Plan, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"on": (1, 0)})
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> back = Problem(robot, [4, 0.5, 3.0], [0, 0.5, 3.0], footprint=Disc(0.3))
    >>> fleet = FleetProblem([there, back], names=["a", "b"])
    >>> verdict = verify_fleet(fleet, {"a": Plan([0, 0, 0], robot.trims, durations=[4.0])})
    >>> verdict.passed, verdict.verdicts["a"].passed, verdict.too_near[0].pair
    (False, True, ('a', 'b'))
    """
    unknown = [name for name in plans if name not in fleet.names]
    if unknown:
        raise ValueError(
            f"plans: there is no vehicle {unknown[0]!r}, need some of {', '.join(fleet.names)}"
        )
    vehicles = vehicles_of(fleet)
    problems = {one.name: one.problem for one in vehicles}
    verdicts = {name: verify(problems[name], plan) for name, plan in plans.items()}
    courses = {
        one.number: one.course_of(plans[one.name]) if one.name in plans else one.standing
        for one in vehicles
    }
    closest = measured(courses, fleet.names, keep=fleet.margin)
    too_near = tuple(row for row in closest if row.distance_m <= enough_for(fleet.margin))
    complete = len(plans) == len(fleet) and all(one.passed for one in verdicts.values())
    return FleetVerdict(
        passed=complete and not too_near, verdicts=verdicts, closest=closest, too_near=too_near
    )
