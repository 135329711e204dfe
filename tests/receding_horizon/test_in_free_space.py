"""Steps in free space: which words are searched for a cheaper plan."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.receding_horizon import RecedingHorizon, Step
from maneuver_automaton.receding_horizon.at_will import InFreeSpace
from maneuver_automaton.search import free_insertion
from tests.receding_horizon.loops import EFFORT
from tests.search.cases import compiled_only

AXIS = np.linspace(-2.0, 2.0, 21)
STARTS = [[1.5, -0.8, 2.0], [-1.2, 1.6, -0.7], [0.3, 1.9, 3.0]]


def of_a_grid(start) -> Problem:
    robot = Automaton.of_grid(Unicycle(), [AXIS, AXIS])
    return Problem(robot, start, [0.0, 0.0, 0.0], cost=EFFORT, horizon=Horizon(time=8.0))


def driven(problem: Problem, steps: int) -> list[Step]:
    controller = RecedingHorizon(problem, step=1.0)
    log, pose = [], problem.start
    for _ in range(steps):
        log.append(controller.step(pose)[1])
        pose = log[-1].predicted
    return log


@compiled_only
@pytest.mark.parametrize("start", STARTS)
def test_going_on_from_the_plan_alone_it_drives_as_if_it_tried_other_words(start, monkeypatch):
    alone = driven(of_a_grid(start), 10)
    monkeypatch.setattr(InFreeSpace, "_goes_on", lambda *_: False)
    for one, other in zip(alone, driven(of_a_grid(start), 10), strict=True):
        assert one.plan.word == other.plan.word
        assert one.value == pytest.approx(other.value, rel=1e-9, abs=1e-9)


@compiled_only
def test_other_words_are_tried_at_first_and_off_the_plan(monkeypatch):
    searched: list[int] = []
    seeds = free_insertion._words_of_few

    def counted(*asked):
        searched.append(1)
        return seeds(*asked)

    monkeypatch.setattr(free_insertion, "_words_of_few", counted)
    controller = RecedingHorizon(of_a_grid(STARTS[0]), step=1.0)
    _, first = controller.step(STARTS[0])
    assert len(searched) == 1
    _, second = controller.step(first.predicted)
    assert len(searched) == 1
    controller.step(np.add(second.predicted, [0.01, 0.0, 0.0]))
    assert len(searched) == 2
