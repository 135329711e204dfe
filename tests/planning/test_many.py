"""Many queries have the answers of each one alone, in this process and in others."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import Planner, PlanStatus, plan, plan_many
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from tests import scenes
from tests.search.cases import compiled_only

FIRST = SearchSettings(improve=False)
WALLS = [ma.Box([1.0, 4.0], [3.0, 0.5]), ma.Disc(0.5, [6.0, -1.0])]
STARTS = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.5], [-1.0, -2.0, 1.0], [3.0, 0.5, 0.0]])
GOALS = np.array([[7.0, 2.0, 0.0], [6.0, 1.5, 2.0], [8.0, -3.0, -1.0], [7.0, 2.0, 0.0]])


def planner(**more):
    return Planner(
        scenes.differential_robot(),
        **{"obstacles": WALLS, "footprint": ma.Box([0.5, 0.3]), "search": FIRST, **more},
    )


def facts(result):
    """What must not differ, to the last bit."""
    plan = result.plan
    word = None if plan is None else (plan.word, plan.durations.tobytes(), plan.start.tobytes())
    return result.status, result.reason, result.cost, result.clearance_m, word


def one_by_one(by):
    return [facts(by.plan(*query)) for query in zip(STARTS, GOALS, strict=True)]


def test_many_have_the_answers_of_each():
    by = planner()
    assert [facts(one) for one in by.plan_many(STARTS, GOALS)] == one_by_one(by)


@compiled_only
@pytest.mark.parametrize("how", [{"jobs": 2}, {"jobs": 2, "scheduler": "local"}])
def test_other_processes_have_the_same_answers(how):
    if "scheduler" in how:
        pytest.importorskip("distributed")
    by = planner()
    found = list(by.plan_many(STARTS, GOALS, **how))
    assert [facts(one) for one in found] == one_by_one(by)
    for one in found[:3]:  # what all queries share is the planner's own, not a copy
        assert one.problem.automaton is by.automaton
        assert one.problem.obstacles is by.obstacles
        assert all(trim is by.automaton[trim.name] for trim in one.plan.trims)
        assert not one.plan.durations.flags.writeable
        assert ma.verify(one.problem, one.plan).passed
    assert found[3].status is PlanStatus.START_BLOCKED


def test_moved_queries_have_the_moved_plans():
    shift = SE2([3.0, -2.0, 1.1])
    there = planner(obstacles=[one.moved(shift) for one in ma.planning.planner.as_obstacles(WALLS)])
    moved = [(shift @ SE2(poses)).pose for poses in (STARTS, GOALS)]
    for one, other in zip(planner().plan_many(STARTS, GOALS), there.plan_many(*moved), strict=True):
        assert other.status is one.status
        if one.plan is not None:
            assert other.plan.word == one.plan.word
            assert other.cost == pytest.approx(one.cost, abs=1e-9)


def test_one_start_serves_all_goals_and_one_goal_all_starts():
    by = planner()
    costs = [one.cost for one in by.plan_many(STARTS[0], GOALS)]
    assert costs == [by.plan(STARTS[0], goal).cost for goal in GOALS]
    goal = Goal(pose=GOALS[0], free_heading=True)
    assert [one.cost for one in by.plan_many(STARTS, goal)] == [
        by.plan(start, goal).cost for start in STARTS
    ]


def cost_of(result):
    return result.cost


def test_what_is_taken_comes_back_and_progress_is_told():
    told = []
    by = planner()
    costs = list(
        by.plan_many(STARTS, GOALS, take=cost_of, progress=lambda k, n: told.append((k, n)))
    )
    assert costs == [fact[2] for fact in one_by_one(by)]
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_an_interrupted_run_goes_on(tmp_path):
    journal = tmp_path / "costs" / "all.jsonl"
    by = planner()
    run = by.plan_many(STARTS, GOALS, take=cost_of, journal=journal)
    first = [next(run), next(run)]
    run.close()
    with journal.open("a") as file:
        file.write("12.3")  # the end of a line that was never written
    done = []

    def counted(result):
        done.append(result)
        return result.cost

    rest = list(by.plan_many(STARTS, GOALS, take=counted, journal=journal))
    assert rest[:2] == first
    assert rest == [fact[2] for fact in one_by_one(by)]
    assert len(done) == 2
    assert list(by.plan_many(STARTS, GOALS, take=counted, journal=journal)) == rest
    assert len(done) == 2
    journal.write_text(journal.read_text()[:7])  # cut off within its first line
    assert list(by.plan_many(STARTS, GOALS, take=cost_of, journal=journal)) == rest
    with pytest.raises(ValueError, match="is not JSON serializable; need numbers, texts"):
        list(
            by.plan_many(
                STARTS, GOALS, take=lambda result: result.status, journal=tmp_path / "no.jsonl"
            )
        )
    with pytest.raises(ValueError, match="is the journal of other queries"):
        list(by.plan_many(STARTS, GOALS + 0.1, take=cost_of, journal=journal))


def test_problems_of_any_kind_have_the_answers_of_each():
    robot = scenes.differential_robot()
    problems = [
        Problem(robot, [0, 0, 0], [4, 1, 0.5]),
        Problem(robot, [0, 0, 0], [7, 2, 0], obstacles=WALLS, search=FIRST),
        replace(scenes.parallel_slot(6.5), search=replace(FIRST, max_expansions=2000)),
    ]
    expected = [facts(plan(one)) for one in problems]
    assert [facts(one) for one in plan_many(problems)] == expected
    assert [facts(one) for one in plan_many(problems, jobs=2)] == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"starts": STARTS[:3]}, "got 3 and 4, need as many of each"),
        ({"starts": [[0.0, 0.0]]}, "starts: got shape"),
        ({"time_limit": 0.0}, "time_limit must be positive"),
        ({"jobs": 0}, "jobs must be at least 1"),
        ({"scheduler": "nowhere"}, "need an address such as tcp"),
        ({"journal": "some.jsonl"}, "need take="),
    ],
)
def test_wrong_queries_are_refused_at_once(change, message, folder):
    if "scheduler" in change:
        pytest.importorskip("distributed")
    call = functools.partial(planner().plan_many, **{"starts": STARTS, "goals": GOALS, **change})
    with pytest.raises(ValueError, match=message):
        call()


def test_the_first_plan_is_returned_where_none_is_improved():
    quick, better = planner(), planner(search=SearchSettings(max_expansions=2000))
    for start, goal in zip(STARTS[:3], GOALS[:3], strict=True):
        first, best = quick.plan(start, goal), better.plan(start, goal)
        assert first.audit.passed
        assert first.lower_bound <= best.lower_bound
        assert len(first.improvements) == 1
        assert best.cost <= first.cost
