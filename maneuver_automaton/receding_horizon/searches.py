"""Which search a step uses: the one for the vehicle's trims and the obstacles."""

from __future__ import annotations

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.budget import Budget
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.among_obstacles import AmongObstacles, as_it_stands
from maneuver_automaton.receding_horizon.decision import StepSearch
from maneuver_automaton.receding_horizon.in_free_space import InFreeSpace
from maneuver_automaton.receding_horizon.log import Guarantee, Step
from maneuver_automaton.receding_horizon.over_maneuvers import (
    OverManeuvers,
    needs_maneuvers,
    with_trims_at_ends,
    within_its_margin,
)
from maneuver_automaton.receding_horizon.settings import Settings
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.search.choose import load_search as load_words
from maneuver_automaton.search.cost_to_go import cost_to_go_table


def started(
    settings: Settings,
    here: Problem,
    last: Step | None,
    *,
    passed: float,
    budget: Budget,
    changed: bool,
) -> tuple[Situation, StepSearch]:
    """A step under way, and where its plans come from; the parameters are those of `Situation`."""
    maneuvers, broken = needs_maneuvers(here), ""
    if maneuvers:
        here = with_trims_at_ends(here)
        if here.margin and here.obstacles and here.start.size == 3:
            here, broken = within_its_margin(here)
    elif here.obstacles:
        here, broken = as_it_stands(here)
    now = Situation(settings, here, last, passed=passed, budget=budget, changed=changed)
    if broken:
        now.flag(Guarantee.SAFETY, broken)
    if maneuvers:
        return now, OverManeuvers(now)
    return now, AmongObstacles(now) if here.obstacles else InFreeSpace(now)


def load_search(problem: Problem) -> None:
    """Prepare the search of a step for a problem, before its clock runs."""
    load_kernels("times")
    if needs_maneuvers(problem):
        load_kernels("words")
        if problem.obstacles or problem.zones:
            load_kernels("lattice", "improvement")
        if problem.moves:
            load_kernels("lattice", "fail-safe")
    elif problem.obstacles:
        load_kernels("lattice", "improvement", "fail-safe")
        cost_to_go_table(problem)
    else:
        load_words(problem)
