"""Simpler questions in turn: a first plan is offered as it is found, whichever question has it."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.result import PlanStatus, workspace_of
from maneuver_automaton.problem import Problem, SearchSettings
from tests.search.cases import compiled_only

pytestmark = compiled_only
ROBOT = Automaton.of_controls(Unicycle(), {"fast": (1.0, 0.0), "slow": (0.5, 0.0)})
PROBLEM = Problem(ROBOT, [0, 0, 0], [2, 0, 0])
SECONDS, LOOK = 10.0, 0.001  # of the budget, and between two looks at its clock


def ahead(trim: str) -> Plan:
    (one,) = (trim_ for trim_ in ROBOT.trims if trim_.name == trim)
    return Plan(PROBLEM.start, (one,), durations=[2.0 / float(one.body_velocity[0])])


def asked(n, good, *, counted=None, improve=True, seconds=SECONDS):
    """When [s] each of `n` questions was asked, and when the plan of the `good` one was there.

    All others find none, and look for one until their time is over.
    """
    looks = itertools.count()
    budget = Budget(began=0.0, deadline=seconds, clock=lambda: LOOK * next(looks))
    search = SearchSettings(max_expansions=counted, improve=improve)
    problem = replace(PROBLEM, search=search)
    questions = [replace(problem) for _ in range(n)]
    found = Incumbents(problem, budget, workspace_of(()))
    begins, there = [], []

    def answer(question, part, workspace, /, *, alternatives):
        del alternatives
        begins.append((questions.index(question), budget.elapsed))
        inner = Incumbents(question, part, workspace)
        if good is not None and question is questions[good]:
            inner.offer(ahead("slow"), 0)
            there.append((budget.elapsed, len(found.plans)))
        while not part.is_over and not (counted and part.elapsed > seconds / n / 2):
            pass
        return inner.none(PlanStatus.OUT_OF_BUDGET, "no time")

    def offer(result):
        found.offer(result.plan, result.goal_index)

    turns = list(found.ask(questions, answer, offer, budget=budget, alternatives=0))
    assert len(turns) == len(begins)
    return begins, there, found


@pytest.mark.parametrize("n", [2, 3, 4, 10])
def test_the_last_question_is_asked_soon(n):
    _, there, found = asked(n, n - 1)
    assert there[0][0] < 0.1 * SECONDS  # with shares of the time alone it was 1 - 1 / n
    assert found.improvements[0][0] <= there[0][0]


def test_a_plan_is_offered_while_its_question_goes_on():
    begins, there, found = asked(3, 0)
    assert there[0][1] == 1
    assert [k for k, _ in begins] == [0, 1, 2]  # nobody waits once there is a plan
    assert begins[1][1] > SECONDS / 4.0
    assert found.cost == pytest.approx(4.0)


def test_without_a_plan_they_take_turns_and_then_their_shares():
    begins, _, found = asked(3, None)
    assert not found.plans
    assert [k for k, _ in begins] == [0, 1, 2] * 3
    assert begins[6][1] < 0.3 * SECONDS
    assert begins[7][1] == pytest.approx(0.5 * SECONDS, abs=0.05 * SECONDS)


def test_no_turns_are_taken_where_time_is_short():
    begins, _, _ = asked(3, None, seconds=0.5)
    assert [k for k, _ in begins] == [0, 1, 2]


def test_counted_questions_are_asked_once_each():
    begins, _, _ = asked(4, 3, counted=100)
    assert [k for k, _ in begins] == [0, 1, 2, 3]


def test_no_better_plan_is_looked_for_if_none_is_asked_for():
    begins, _, _ = asked(4, 1, improve=False)
    assert [k for k, _ in begins] == [0, 1]
