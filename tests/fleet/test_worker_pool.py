"""Work on a fleet in processes: the same plans as here, to the last bit."""

from __future__ import annotations

import pickle

import pytest

from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet import plan_fleet, workers
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.fleet.workers import Done, PoolTask, WorkerPool
from maneuver_automaton.scenario import load_scenario
from tests.fleet import fleets
from tests.scenario.test_vehicles import SCENARIOS


def in_this_process(function, pieces):
    """As processes do it, each piece as bytes of its own."""
    for piece in pieces:
        yield pickle.loads(pickle.dumps(function(pickle.loads(pickle.dumps(piece)))))


def answers(result):
    """What a fleet's plans are, to the last bit."""
    return {
        name: (plan.word, plan.durations.tolist(), result.results[name].cost)
        for name, plan in result.plans.items()
    }


def planned(pool):
    """Ways alone, then plans in an order, then better ones of two groups and of one by itself."""
    n, budget = len(pool.vehicles), Budget.from_now(100.0)
    list(pool.each([PoolTask((k,), {}, "alone") for k in range(n)], budget))
    orders = [tuple(range(n)), tuple(reversed(range(n)))]
    (one, other) = pool.each([PoolTask(order, {}, "in order") for order in orders], budget)
    groups = [(0, 1), (2,)]
    tasks = [
        PoolTask(group, {k: found for k, found in one.held.items() if k not in group})
        for group in groups
    ]
    better = list(pool.each([*tasks, PoolTask((3,), {}, "better alone")], budget))
    return [one, other, *better], [vehicle.ways for vehicle in pool.vehicles]


def test_what_travels_comes_back_the_same():
    fleet = fleets.random_fleet(4, 3)
    here = planned(WorkerPool(fleet, vehicles_of(fleet)))
    away = WorkerPool(fleet, vehicles_of(fleet), 2, in_this_process)
    there = planned(away)  # not prepared: whoever does not know the fleet is told of it
    assert [one.queries for one in here[0]] == [one.queries for one in there[0]]
    for one, other in zip(here[0], there[0], strict=True):
        assert (one.held is None) is (other.held is None)
        for k, found in (one.held or {}).items():
            assert other.held[k].cost == found.cost
            assert other.held[k].plan.durations.tolist() == found.plan.durations.tolist()
            trims = away.vehicles[k].problem.automaton.trims
            assert all(any(trim is own for own in trims) for trim in other.held[k].plan.trims)
    for ways, others in zip(here[1], there[1], strict=True):
        assert [way.cost for way in ways] == [way.cost for way in others]
        assert [way.trims.tolist() for way in ways] == [way.trims.tolist() for way in others]
    assert len(workers._FLEETS) <= workers.KEPT


def test_nothing_comes_of_what_a_signal_broke_off():
    fleet = fleets.random_fleet(4, 3)
    pool = WorkerPool(fleet, vehicles_of(fleet), 2, lambda function, pieces: iter(()))
    tasks = [PoolTask((k,), {}, "alone") for k in range(4)]
    assert list(pool.each(tasks, Budget.from_now(1.0))) == [Done(None)] * 4


def test_expansions_are_counted_wherever_they_are():
    fleet = fleets.random_fleet(4, 3)
    counts = []
    for run in (None, in_this_process):
        pool = WorkerPool(fleet, vehicles_of(fleet), 2, run)
        planned(pool)
        counts.append([one.expansions for one in pool.vehicles])
    assert counts[0] == counts[1]
    assert min(counts[0]) > 0


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
