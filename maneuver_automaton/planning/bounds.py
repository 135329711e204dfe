"""Lower bounds of plans among obstacles, and what they cover."""

from __future__ import annotations

from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.limits import closed_bound
from maneuver_automaton.search.plane_bound import plane_bound
from maneuver_automaton.words.library import moving_trims


def lattice_bound(query: LatticeQuery) -> float:
    """No plan is cheaper, whatever its word: the largest of the bounds that hold.

    The closed bounds hold without obstacles too; the way in the plane knows those that stand still.
    """
    problem = query.problem
    closed = min(closed_bound(problem, problem.goals[k]) for k in query.goal_index)
    library = moving_trims(problem.automaton, problem.cost)
    pads = problem.horizon.time is not None and library.rest is not None
    rates = library.rates - (library.rest_rate if pads else 0.0)
    drives = library.speeds > 0.0
    if not drives.any() or (rates < 0.0).any():
        return closed
    per_metre = float((rates[drives] / library.speeds[drives]).min())
    fixed = library.rest_rate * (problem.horizon.time or 0.0) if pads else 0.0
    return max(closed, fixed + per_metre * plane_bound(query))
