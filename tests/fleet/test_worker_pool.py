"""Work on a fleet in processes: the same plans as here, to the last bit."""

from __future__ import annotations

import pytest

from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet import plan_fleet
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.fleet.workers import Done, PoolTask, WorkerPool
from maneuver_automaton.scenario import load_scenario
from tests.fleet import fleets
from tests.scenario.test_vehicles import SCENARIOS


def answers(result):
    """What a fleet's plans are, to the last bit."""
    return {
        name: (plan.word, plan.durations.tolist(), result.results[name].cost)
        for name, plan in result.plans.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    "fleet",
    [
        fleets.random_fleet(5, 1),
        load_scenario(SCENARIOS / "fleets" / "alcove.yaml").fleet,
    ],
)
def test_any_number_of_processes_finds_the_same_plans(fleet):
    runs = [plan_fleet(fleet, time_limit=100.0, max_rounds=6, jobs=jobs) for jobs in (1, 2, 3)]
    assert answers(runs[0])
    assert all(answers(one) == answers(runs[0]) for one in runs)
    assert all(one.counts == runs[0].counts for one in runs)


@pytest.mark.slow
def test_a_cluster_finds_the_same_plans():
    pytest.importorskip("distributed")
    fleet = fleets.random_fleet(4, 2)
    here = plan_fleet(fleet, time_limit=100.0, max_rounds=4)
    there = plan_fleet(fleet, time_limit=100.0, max_rounds=4, jobs=2, scheduler="local")
    assert answers(there) == answers(here)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"jobs": 0}, "jobs must be at least 1, got 0"),
        ({"scheduler": "nowhere"}, "scheduler: got 'nowhere', need an address"),
    ],
)
def test_bad_places_of_work_are_refused(more, message):
    if "scheduler" in more:
        pytest.importorskip("distributed")
    with pytest.raises(ValueError, match=message):
        plan_fleet(fleets.crossing(), **more)


def test_nothing_comes_of_what_a_signal_broke_off():
    fleet = fleets.random_fleet(4, 3)
    pool = WorkerPool(fleet, vehicles_of(fleet), 2, lambda function, pieces: iter(()))
    tasks = [PoolTask((k,), {}, "alone") for k in range(4)]
    assert list(pool.each(tasks, Budget.from_now(1.0))) == [Done(None)] * 4
