"""Zones in which not every motion is admitted: the plan keeps to them, the audit sees it."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import plan
from maneuver_automaton.planning.among_zones import admitted_automaton, quickened
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.planning.result import PlanStatus
from maneuver_automaton.problem import Horizon, Problem, SearchSettings
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.result import plan_of
from tests.inertia import unicycle_automaton
from tests.matrix.vehicles import VEHICLES
from tests.search.cases import SLOW_AND_FAST, compiled_only, robot

pytestmark = compiled_only
ROBOT = robot(SLOW_AND_FAST)
ACROSS = Box([2.0, 40.0], [3.0, 0.0])  # from x = 2 to 4, cannot be gone around in passing
ALONG = [6.0, 0.0, 0.0]
WORK = SearchSettings(max_expansions=2000)
LIMIT = 60.0  # [s] a limit that a busy machine does not reach


def posed(goal=ALONG, *zones, **changed) -> Problem:
    settings = {"footprint": Box([0.4, 0.4]), "automaton": ROBOT, "search": WORK} | changed
    automaton = settings.pop("automaton")
    return Problem(automaton, [0.0, 0.0, 0.0], goal, zones=zones, **settings)


def test_a_speed_limit_is_kept_where_it_holds_and_only_there():
    result = plan(posed(ALONG, Zone(shape=ACROSS, max_speed=0.5)), time_limit=LIMIT)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.plan.word == ("fast", "slow", "fast")
    inside = 2.0 + 0.4  # the whole body counts
    assert result.cost == pytest.approx((6.0 - inside) + inside / 0.4, abs=0.2)
    assert result.cost >= (6.0 - inside) + inside / 0.4
    assert result.audit.passed


def test_what_no_zone_stands_in_the_way_of_is_as_before():
    zone = Zone(shape=Box([1.0, 1.0], [3.0, 5.0]), max_speed=0.1)
    free = plan(posed(), time_limit=LIMIT)
    result = plan(posed(ALONG, zone), time_limit=LIMIT)
    assert result.plan.word == free.plan.word
    assert result.cost == free.cost


@pytest.mark.slow
def test_a_zone_that_admits_nothing_is_gone_around():
    zone = Zone(shape=Box([1.0, 1.0], [3.0, 0.0]), max_speed=0.0)
    slow = [Zone(shape=Box([1.0, 1.0], at), max_speed=0.5) for at in ([3, 6], [3, -6], ALONG[:2])]
    for zones in ([zone], [zone, *slow]):  # in the last one it ends
        result = plan(posed(ALONG, *zones), time_limit=LIMIT)
        assert result.status is PlanStatus.FOUND, result.reason
        assert result.audit.passed
        assert result.cost > 6.0


def test_where_reverse_is_not_admitted_the_vehicle_turns_first():
    goal = [-4.0, 0.0, 0.0]
    assert plan(posed(goal), time_limit=LIMIT).plan.word == ("back",)
    everywhere = Zone(shape=Box([60.0, 60.0]), reverse=False)
    result = plan(posed(goal, everywhere), time_limit=LIMIT)
    assert result.status is PlanStatus.FOUND, result.reason
    assert "back" not in result.plan.word


def test_grip_limits_turns_at_speed():
    icy = Zone(shape=Box([60.0, 60.0]), max_lateral_acceleration=0.5)
    result = plan(posed([3.0, 3.0, np.pi / 2], icy), time_limit=LIMIT)
    assert result.status is PlanStatus.FOUND, result.reason
    assert not {"left", "right"} & set(result.plan.word)


@pytest.mark.slow
def test_trims_can_be_named():
    only = Zone(shape=ACROSS, trims=["slow", "rest"])
    result = plan(posed(ALONG, only), time_limit=LIMIT)
    assert result.plan.word == ("fast", "slow", "fast")


def test_both_checks_see_what_is_not_admitted():
    problem = posed(ALONG, Zone(shape=ACROSS, max_speed=0.5, name="the school"))
    through = Plan([0, 0, 0], (ROBOT["fast"],), durations=[6.0])
    checked = check_plan(problem, through, problem.goals[0])
    assert not checked.passed
    assert checked.reason == "the school does not admit trim 0, 'fast'"
    audit = audit_plan(
        through,
        problem.goals[0],
        ROBOT.model,
        footprint=problem.footprint,
        zones=problem.zones,
    )
    assert not audit.passed
    assert audit.reason.endswith("s the vehicle moves as the school does not admit")
    slowly = Plan([0, 0, 0], (ROBOT["slow"],), durations=[15.0])
    assert check_plan(problem, slowly, problem.goals[0]).passed


@pytest.mark.parametrize("half_width", [0.3, 0.1999])
def test_the_whole_body_counts(half_width):
    beside = Zone(shape=Box([6.0, 1.0], [3.0, 0.5 + half_width]), max_speed=0.5)
    problem = posed(ALONG, beside)
    through = Plan([0, 0, 0], (ROBOT["fast"],), durations=[6.0])
    assert check_plan(problem, through, problem.goals[0]).passed is (half_width > 0.2)


def test_maneuvers_keep_to_zones_too():
    automaton = unicycle_automaton()
    slow = Zone(shape=Box([0.6, 4.0], [0.0, 0.0]), max_speed=0.3)  # around the start
    problem = posed([4.0, 0.0, 0.0], slow, automaton=automaton)
    found = plan_of(problem, search_insertion(problem, problem.goals[0]).solutions[0])
    checked = check_plan(problem, found, problem.goals[0])
    assert not checked.passed
    assert "does not admit" in checked.reason
    slow = Zone(shape=Box([0.6, 4.0], [0.0, 0.0]), max_speed=1.0)
    problem = posed([4.0, 0.0, 0.0], slow, automaton=automaton)
    assert check_plan(problem, found, problem.goals[0]).passed


@pytest.mark.parametrize("name", ["hovercraft", "single_track"])
@pytest.mark.parametrize("limits", [{"max_speed": 0.0}, {"max_speed": 1.0}, {"reverse": False}])
def test_a_vehicle_that_no_zone_can_limit_so_far_goes_around(name, limits):
    vehicle = VEHICLES[name]
    zone = Zone(shape=Box([1.0, 1.0], [0.5 * vehicle.reach, 0.3 * vehicle.reach]), **limits)
    search = SearchSettings(max_expansions=200, polish=False)
    assert plan(vehicle.problem(zones=[zone], search=search), time_limit=LIMIT).plan is not None


def test_what_a_zone_admits_of_an_automaton():
    automaton = unicycle_automaton()
    forwards = admitted_automaton(automaton, (Zone(shape=ACROSS, reverse=False),))
    assert set(forwards.trim_names) == set(automaton.trim_names) - {"-0.6, 0"}
    assert all(one.displacement[0] > 0.0 for one in forwards.maneuvers)
    crawling = Zone(shape=ACROSS, max_speed=0.1)
    assert admitted_automaton(ROBOT, (crawling,)) is None


def test_quickening_changes_no_path():
    problem = posed(ALONG, Zone(shape=ACROSS, max_speed=0.5))
    slowly = Plan([0, 0, 0], (ROBOT["slow"],), durations=[15.0])
    quick = quickened(problem, slowly)
    assert np.abs(quick.end - slowly.end).max() < 1e-9
    assert quick.duration < slowly.duration
    assert check_plan(problem, quick, problem.goals[0]).passed


def test_a_moved_problem_has_the_moved_plan():
    problem = posed(ALONG, Zone(shape=ACROSS, max_speed=0.5), horizon=Horizon(max_trims=4))
    here = plan(problem, time_limit=LIMIT)
    there = plan(problem.moved(SE2([3.0, -1.0, 0.8])), time_limit=LIMIT)
    assert there.plan.word == here.plan.word
    assert there.cost == pytest.approx(here.cost, abs=0.05)


def test_a_zone_that_forbids_nothing_is_refused():
    with pytest.raises(ValueError) as error:
        Zone(shape=ACROSS)
    assert str(error.value).startswith("zone: forbids nothing, need max_speed")
    with pytest.raises(ValueError) as error:
        Zone(shape=ACROSS, max_speed=-1.0)
    assert str(error.value) == "zone: max_speed must be at least 0, got -1.0"
    with pytest.raises(LookupError):
        posed(ALONG, Zone(shape=ACROSS, trims=["slw"]))
