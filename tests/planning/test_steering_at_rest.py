"""Cars that turn their wheels at rest at will, at a price, or never."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models.speeds import standing_price
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.primitives.on_the_spot import maneuvers_between, trim_at
from maneuver_automaton.scenario.scenario import scenario_of_text
from maneuver_automaton.scenario.writing import to_yaml
from tests.inertia import CAR

GRID = {"speed": [-1.0, 0.0, 1.0], "steering": [-0.7, 0.0, 0.7]}
FILE = """
schema: 1
vehicle:
  model: second_order_car
  wheelbase_m: 2.8
  max_steering_rad: 0.75
  max_speed_m_s: 2.5
  max_acceleration_m_s2: 1.0
  max_steering_rate_rad_s: 0.5
  steering_at_rest: {}
automaton: {{preset: second_order_car}}
start: {{pose: [0, 0, 0]}}
goal: {{pose: [1, 3, 0]}}
cost: {{time: 1.0}}
"""


def priced_turns(car: ma.SecondOrderCar, maneuver: ma.Maneuver) -> float:
    """What steering at rest costs along a maneuver."""
    return standing_price(car, maneuver.course.reduced_state, maneuver.course.control)


def turned(plan: ma.Plan) -> float:
    """How far the wheels turn while the car stands [rad], counted by itself."""
    angle = 0.0
    for maneuver in filter(None, plan.maneuvers):
        speed, steering = maneuver.course.reduced_state.T
        stands = np.maximum(np.abs(speed[1:]), np.abs(speed[:-1])) <= 1e-3
        angle += float(np.abs(np.diff(steering))[stands].sum())
    return angle


def test_who_never_does_has_no_such_maneuver() -> None:
    strokes, other = [-0.5, 0.5], replace(CAR, steering_at_rest=math.inf)
    free, never = (ma.Automaton.of_model(one, GRID, strokes=strokes) for one in (CAR, other))
    plain = replace(CAR, steering_at_rest=1.0)
    assert any(priced_turns(plain, one) for one in free.maneuvers)
    assert never.maneuvers
    assert not any(priced_turns(plain, one) for one in never.maneuvers)


@pytest.mark.parametrize("polish", [False, True])
def test_plans_keep_to_it(polish: bool) -> None:
    never = replace(CAR, steering_at_rest=math.inf)
    library = ma.Automaton.of_model(never, GRID, strokes=[-0.5, 0.5])
    search = ma.SearchSettings(max_expansions=300, polish=polish)
    result = ma.plan(
        ma.Problem(library, [0, 0, 0], [1.0, 3.0, 0.0], search=search), time_limit=60.0
    )
    assert result.plan is not None, result.reason
    assert result.audit.passed
    assert turned(result.plan) < 1e-6


def test_a_price_counts_what_is_turned() -> None:
    problem = ma.Problem(ma.Automaton.of_model(CAR, GRID), [0, 0, 0], [1.0, 3.0, 0.0])
    library = ma.Automaton.of_model(replace(CAR, steering_at_rest=2.0), GRID)
    priced = replace(problem, automaton=library)
    rests = [trim for trim in library.trims if trim.is_rest]
    turn = next(
        one for one in library.maneuvers if {one.source, one.target} == {t.name for t in rests[:2]}
    )
    same = next(one for one in problem.automaton.maneuvers if one.name == turn.name)
    assert priced.maneuver_cost(turn) == pytest.approx(problem.maneuver_cost(same) + 2.0 * 0.7)


def angles_at_cusps(plan: ma.Plan) -> list[float]:
    """Where the wheels are when the car begins to go the other way [rad], counted by itself."""
    states = np.vstack([one.course.reduced_state for one in filter(None, plan.maneuvers)])
    moving = states[np.abs(states[:, 0]) > 1e-3]
    turns = np.flatnonzero(np.diff(np.sign(moving[:, 0])))
    return [float(angle) for angle in moving[turns, 1]]


def test_in_a_tight_slot_it_costs_what_free_steering_costs_with_its_price() -> None:
    levels = {"speed": [-1.0, 0.0, 1.0], "steering": [-0.7, -0.35, 0.0, 0.35, 0.7]}
    street = [
        *(ma.Box([4.2, 1.8], [x, 2.975]) for x in (-4.701, 7.604)),
        *(ma.Box([30.0, 0.3], [0.0, y]) for y in (-3.2, 4.475)),
    ]
    found = []
    for price in (0.0, 0.5):
        car = replace(CAR, wheelbase=2.97, max_steering_rate=0.36, steering_at_rest=price)
        library = ma.Automaton.of_model(car, levels, strokes=[-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])
        search = ma.SearchSettings(polish=False, max_expansions=1500)
        goal, body = [0.05, 2.975, 0.0], ma.Box([4.2, 1.8], [1.4, 0.0])
        problem = ma.Problem(
            library, [0, 0, 0], goal, footprint=body, obstacles=street, search=search
        )
        found.append(ma.plan(problem, time_limit=60.0))
    free, priced = found
    assert priced.cost <= 1.01 * (free.cost + 0.5 * turned(free.plan))


@pytest.mark.exhaustive
@pytest.mark.slow
def test_it_changes_how_a_car_parks() -> None:
    levels = {"speed": [-1.0, 0.0, 1.0], "steering": [-0.7, -0.35, 0.0, 0.35, 0.7]}
    strokes = [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0]
    street = [
        *(ma.Box([4.2, 1.8], [x, 3.2]) for x in (-6.0, 7.4)),
        *(ma.Box([30.0, 0.3], [0.0, y]) for y in (-3.2, 4.7)),
    ]
    found = {}
    for price in (0.0, 2.0, math.inf):
        library = ma.Automaton.of_model(
            replace(CAR, steering_at_rest=price), levels, strokes=strokes
        )
        problem = ma.Problem(
            library,
            [0, 0, 0],
            [0.0, 3.2, 0.0],
            footprint=ma.Box([4.2, 1.8], [1.4, 0.0]),
            obstacles=street,
            search=ma.SearchSettings(polish=False, max_expansions=20_000),
        )
        found[price] = ma.plan(problem, time_limit=60.0)
        assert found[price].audit.passed
    free, priced, never = (found[price] for price in (0.0, 2.0, math.inf))
    known = free.cost + 2.0 * turned(free.plan)  # who may not, and who need not pay, show its cost
    assert free.cost < priced.cost <= min(known, never.cost) + 1e-9
    assert turned(free.plan) > 0.3
    assert turned(priced.plan) <= turned(free.plan)
    assert turned(never.plan) < 1e-6
    assert max(map(abs, angles_at_cusps(free.plan))) < 0.1  # straight, and turned while it stands
    assert max(map(abs, angles_at_cusps(never.plan))) > 0.3  # turned on the way there


def test_a_loader_bends_at_rest_at_a_price() -> None:
    loader = ma.ArticulatedVehicle(
        front=1.675, rear=1.675, max_articulation=0.7, max_articulation_rate=0.35, max_speed=2.0
    )
    bends = drive(loader, [0.0], control=[[0.0, 0.35], [1.0, 0.35]], durations=[1.0, 0.5])
    prices = [
        standing_price(replace(loader, steering_at_rest=price), bends.reduced_state, bends.control)
        for price in (0.0, 2.0, math.inf)
    ]
    assert prices == pytest.approx([0.0, 2.0 * 0.35, math.inf])
    with pytest.raises(ValueError, match="steering_at_rest must be at least 0"):
        replace(loader, steering_at_rest=-1.0)
    never = replace(loader, steering_at_rest=math.inf)
    stock = ma.load_stock_library("articulated_vehicle")
    still = trim_at(never, np.array([0.1]), "here"), trim_at(never, np.array([0.3]), "there")
    for one in maneuvers_between(never, *still):
        assert standing_price(never, one.course.reduced_state, one.course.control) == 0.0
    for one in stock.maneuvers:  # they bend while they go, so nobody is refused any
        assert standing_price(never, one.course.reduced_state, one.course.control) == 0.0


def test_files_state_it(tmp_path) -> None:
    prices = {"free": 0.0, "2.5": 2.5, "forbidden": math.inf}
    for word, price in prices.items():
        scenario = scenario_of_text(FILE.format(word), name="car")
        assert scenario.problem.automaton.model.steering_at_rest == price
        again = scenario_of_text(to_yaml(scenario), name="again")
        assert again.problem.automaton.model.steering_at_rest == price
    never = scenario.problem.automaton
    ma.save_library(never, tmp_path / "never.json")
    assert ma.load_library(tmp_path / "never.json").model == never.model


@pytest.mark.parametrize("word", ["never", "-1.0", "[1]", ".inf"])
def test_what_is_no_price_is_told(word: str) -> None:
    with pytest.raises(InvalidScenario, match="need free, forbidden, or a price of at least 0"):
        scenario_of_text(FILE.format(word), name="car")


def test_states_in_files_are_told_by_their_keys() -> None:
    file = FILE.format("free")
    stated = file.replace(
        "start: {pose: [0, 0, 0]}", "start: {pose: [0, 0, 0], state: {speed_m_s: 1.37}}"
    )
    scenario = scenario_of_text(stated, name="car")
    assert scenario.problem.start_state.tolist() == [1.37, 0.0]
    again = scenario_of_text(to_yaml(scenario), name="again")
    assert again.problem.start_state.tolist() == [1.37, 0.0]
    for wrong, said in (
        ("{speed: 1.0}", "need some of speed_m_s, steering_rad"),
        ("{speed_m_s: 9.0}", "speed is 9, need one of the second_order_car within"),
        ("[1.0, 0.0]", "need a mapping of numbers"),
    ):
        with pytest.raises(InvalidScenario, match=said):
            scenario_of_text(stated.replace("{speed_m_s: 1.37}", wrong), name="car")
