"""Plans with a proof beside the search: how near the optimum they are, and the same each time."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.budget import Watch
from maneuver_automaton.cli import run
from tests import scenes
from tests.bounds.test_cell_bound import WALL, among

SLOT = replace(scenes.parallel_slot(6.5), cost=ma.Cost(length=1.0))


@pytest.mark.slow
def test_a_search_ends_once_its_gap_is_proven():
    watch = Watch(gap=0.0)
    result = ma.plan(SLOT, time_limit=60.0, gap=0.08, watch=watch)
    assert result.gap <= 0.08
    assert result.audit.passed
    assert (result.bound.kind, result.lower_bound) == ("cells", result.bound.value)
    assert watch.cost == pytest.approx(result.cost)
    assert watch.bound == pytest.approx(result.lower_bound)
    assert watch.is_closed
    values = [value for _, value in result.bound.history]
    assert values == sorted(values)
    assert values[-1] == result.lower_bound


@pytest.mark.exhaustive
@pytest.mark.slow
def test_counted_work_proves_the_same_and_leaves_the_plan_as_it_is():
    counted = replace(SLOT, search=ma.SearchSettings(max_expansions=1_000))
    alone = ma.plan(counted, time_limit=600.0)
    first, second = (ma.plan(counted, time_limit=600.0, gap=0.01) for _ in range(2))
    assert first.cost == second.cost == alone.cost
    assert (first.bound.work, first.lower_bound) == (second.bound.work, second.lower_bound)
    assert first.lower_bound > alone.lower_bound


def test_the_command_line_says_and_draws_what_is_proven(folder, capsys):
    scenario = Path(__file__).parents[2] / "scenarios" / "car_slot.yaml"
    assert run(["plan", str(scenario), "--gap", "0.05", "--time-limit", "30"]) == 0
    assert "proven optimal" in capsys.readouterr().out
    document = json.loads(Path("out/plan.json").read_text())
    assert document["bound"]["value"] == document["lower_bound"]
    assert document["improvements"][-1][1] == pytest.approx(document["cost"])
    assert Path("out/progress.png").stat().st_size > 10_000
    assert run(["plan", str(scenario), "--gap", "1.5"]) == 2
    assert "--gap: got 1.5, need a share" in capsys.readouterr().err


def test_a_gap_is_a_share():
    with pytest.raises(ValueError) as caught:
        ma.plan(SLOT, gap=1.0)
    assert str(caught.value) == "gap must be a share from 0 to below 1, got 1.0"


@pytest.mark.slow
def test_a_planner_knows_at_once_what_it_has_proven_of_other_starts():
    planner = ma.Planner(
        SLOT.automaton, cost=SLOT.cost, obstacles=SLOT.obstacles, footprint=SLOT.footprint
    )
    # With a tolerance, for which a shortest path says nothing.
    goal, other = replace(SLOT.goals[0], tolerance_m=1e-3), np.add(SLOT.start, [-0.5, -0.1, 0.0])
    first = planner.plan(SLOT.start, goal, gap=0.115, time_limit=60.0)
    again = planner.plan(SLOT.start, goal, gap=0.115, time_limit=60.0)
    assert first.bound.kind == "cells"
    assert again.bound.history[1][1] >= first.lower_bound * (1.0 - 1e-9)  # before any work
    assert again.gap <= 0.115
    second = planner.plan(other, goal, gap=0.5, time_limit=60.0)
    alone = ma.plan(replace(SLOT, start=other, goals=goal), time_limit=0.5)
    assert second.lower_bound <= alone.cost


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_bound_alone_is_as_good_as_beside_a_plan():
    """It looks for a plan first, and then only at poses that a cheaper one may visit."""
    problem = among(WALL, cost=ma.Cost(time=1.0))
    cost = ma.plan(replace(problem, search=ma.SearchSettings(max_expansions=500))).cost
    alone, beside = (
        ma.lower_bound(problem, incumbent=known, time_limit=60.0, max_work=1_000_000)
        for known in (math.inf, cost)
    )
    assert beside.value * 0.995 <= alone.value <= cost
