"""Loops that prove how near the optimum their plans are, and use it at later steps."""

from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.budget import Budget
from maneuver_automaton.receding_horizon import RecedingHorizon, guarantees
from tests import scenes

SLOT = replace(scenes.parallel_slot(6.5), cost=ma.Cost(length=1.0))


def driven(controller, steps, *, beside=0.0):
    """Steps of a loop, pushed aside after the first one."""
    pose, log = controller.problem.start, []
    for _ in range(steps):
        _, step = controller.step(pose)
        log.append(step)
        pose = step.plan.pose_at(step.time + step.applied)
        if beside and len(log) == 1:
            pose = np.add(pose, [0.0, beside, 0.0])
    return log


def test_what_a_step_has_proven_serves_the_next(monkeypatch):
    proofs = []

    class Counted(guarantees.Proving):
        def run(self, **more):
            proofs.append(self.problem)
            super().run(**more)

    monkeypatch.setattr(guarantees, "Proving", Counted)
    log = driven(RecedingHorizon(SLOT, step=0.3, gap=0.15, time_limit=30.0), 3)
    assert len(proofs) == 1
    for step in log:
        assert step.value - step.lower_bound <= 0.15 * step.value
        rest = ma.plan(replace(SLOT, start=step.pose), time_limit=0.5)
        assert step.lower_bound <= rest.cost * (1.0 + 1e-9)
    assert log[1].plan.word == log[0].plan.word  # it is near enough: nothing is searched


def test_off_the_plan_the_way_proves_nothing():
    controller = RecedingHorizon(SLOT, step=0.3, gap=0.9, time_limit=30.0)
    log = driven(controller, 2, beside=0.02)
    assert log[1].off_plan > 0.0
    rest = ma.plan(replace(SLOT, start=log[1].pose), time_limit=0.5)
    assert 0.0 < log[1].lower_bound <= rest.cost * (1.0 + 1e-9)


@pytest.mark.parametrize("price", ["switch", "direction_change"])
def test_what_is_priced_between_two_steps_is_not_taken_for_driven(price):
    """Neither step counts it, so a bound less what was driven would be too high."""
    for more, kept in ({price: 0.1}, False), ({}, True):
        bounds = guarantees.LoopBounds(gap=0.9)
        problem = replace(SLOT, cost=ma.Cost(length=1.0, **more))
        assert bounds.prove(problem, 9.0, 0.0, Budget.from_now(30.0)) > 6.0
        assert (bounds.least > 0.0) is kept


def test_a_gap_of_a_loop_is_a_share():
    with pytest.raises(ValueError) as caught:
        RecedingHorizon(SLOT, step=0.3, gap=1.0)
    assert str(caught.value) == ("receding horizon: gap must be a share from 0 to below 1, got 1.0")
