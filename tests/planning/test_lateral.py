"""Cars within a lateral acceleration: as a limit of their own, and of a zone."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.errors import InvalidAutomaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Car, CarWithTrailer, SecondOrderCar
from maneuver_automaton.planning import plan
from maneuver_automaton.primitives import trims_of
from maneuver_automaton.problem import Problem, SearchSettings
from maneuver_automaton.scenario.automata import preset_automaton
from maneuver_automaton.scenario.scenario import scenario_of_text
from tests.search.cases import compiled_only

CAR = SecondOrderCar(
    wheelbase=2.8, max_steering=0.6, max_speed=8.0, max_acceleration=2.0, max_steering_rate=0.5
)
GOAL = [30.0, 30.0, 3.0]
MOST = 3.0  # [m/s^2]
WORK = SearchSettings(max_expansions=60)
PLANE = Box([400.0, 400.0])
BEYOND = Box([200.0, 400.0], [115.0, 0.0])  # from x = 15 m on


def posed(model=CAR, **changes):
    values = {"search": WORK, "goals": GOAL} | changes
    return Problem(preset_automaton("parking", model), [0.0, 0.0, 0.0], **values)


def driven(model, found):
    """Poses, speeds and steering angles (n, 5), by an integration of the controls of a plan."""
    samples = found.sample()
    state = np.array([*found.start, *samples.reduced_state[0]])
    rows = [state]
    for h, control in zip(np.diff(samples.time), samples.control, strict=False):
        if h > 0.0:

            def rates(_, x, u=control):
                turn = x[3] * math.tan(x[4]) / model.wheelbase
                return [x[3] * math.cos(x[2]), x[3] * math.sin(x[2]), turn, *u]

            at = np.linspace(0.0, h, 4)
            run = solve_ivp(rates, (0.0, h), state, t_eval=at, rtol=1e-9, atol=1e-11)
            rows += list(run.y.T)
            state = run.y[:, -1]
    return np.array(rows)


def across(model, rows):
    return rows[:, 3] ** 2 * np.abs(np.tan(rows[:, 4])) / model.wheelbase


def reference(model, most, *, nodes=80):
    """The quickest motion to the goal by a transcription of its own, from several starts."""
    x, u, duration = (
        casadi.MX.sym("x", 5, nodes + 1),
        casadi.MX.sym("u", 2, nodes),
        casadi.MX.sym("T"),
    )
    z, w = casadi.SX.sym("z", 5), casadi.SX.sym("w", 2)
    turn = z[3] * casadi.tan(z[4]) / model.wheelbase
    rates = casadi.vertcat(z[3] * casadi.cos(z[2]), z[3] * casadi.sin(z[2]), turn, w)
    f = casadi.Function("f", [z, w], [rates]).map(nodes)
    h, begin = duration / nodes, x[:, :-1]
    one = f(begin, u)
    two = f(begin + h / 2 * one, u)
    three = f(begin + h / 2 * two, u)
    end = begin + h / 6 * (one + 2 * two + 2 * three + f(begin + h * three, u))
    aside = x[3, :] ** 2 * casadi.tan(x[4, :]) / model.wheelbase
    solver = casadi.nlpsol(
        "reference",
        "ipopt",
        {
            "x": casadi.vertcat(casadi.vec(x), casadi.vec(u), duration),
            "f": duration,
            "g": casadi.vertcat(casadi.vec(end - x[:, 1:]), casadi.vec(aside)),
        },
        {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 300},
    )
    limit = np.concatenate([np.zeros(5 * nodes), np.full(nodes + 1, most)])
    states = np.tile([np.inf, np.inf, np.inf, model.max_speed, model.max_steering], (nodes + 1, 1))
    inputs = np.tile([model.max_acceleration, model.max_steering_rate], nodes)
    share, best = np.linspace(0.0, 1.0, nodes + 1), math.inf
    for turns, seconds in ((0.0, 10.0), (0.0, 16.0), (-2.0 * math.pi, 12.0)):
        aim = np.array([*GOAL[:2], GOAL[2] + turns, 0.0, 0.0])
        low, high = -states, states.copy()
        low[0] = high[0] = 0.0
        low[-1] = high[-1] = aim
        guess = share[:, None] * aim + np.array([0.0, 0.0, 0.0, 3.0, 0.0])
        found = solver(
            x0=np.concatenate([guess.ravel(), np.zeros(2 * nodes), [seconds]]),
            lbx=np.concatenate([low.ravel(), -inputs, [1.0]]),
            ubx=np.concatenate([high.ravel(), inputs, [90.0]]),
            lbg=-limit,
            ubg=limit,
        )
        if solver.stats()["success"]:
            best = min(best, float(found["f"]))
    return best


@pytest.fixture(scope="module")
def limited():
    return plan(posed(replace(CAR, max_lateral_acceleration=MOST)), time_limit=200.0)


@pytest.mark.slow
@compiled_only
def test_a_limit_costs_what_optimal_control_says(limited):
    rows = driven(CAR, limited.plan)
    assert across(CAR, rows).max() <= MOST
    assert rows[:, 3].min() >= -1e-6  # it does not go back
    assert limited.cost == pytest.approx(reference(CAR, MOST), rel=5e-3)


@pytest.mark.exhaustive
@pytest.mark.slow
@compiled_only
def test_who_cannot_reverse_pays_for_it_where_the_way_back_is_shorter():
    """A car of one speed both ways drives to this goal in reverse, past a box in the way ahead."""
    car = replace(CAR, max_lateral_acceleration=MOST)
    conditions = {"obstacles": [Box([3.0, 3.0], [25.0, 15.0])], "footprint": Box([4.5, 1.9])}
    either, ahead = (
        plan(posed(model, **conditions), time_limit=200.0)
        for model in (car, replace(car, min_speed=0.0))
    )
    assert ahead.plan.sample().reduced_state[:, 0].min() >= -1e-12  # the sum of its last steps
    assert either.cost < ahead.cost < 1.01 * either.cost


@compiled_only
@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_zone_over_the_plane_is_a_limit_of_the_car(limited):
    zone = Zone(shape=PLANE, max_lateral_acceleration=MOST)
    found = plan(posed(zones=[zone]), time_limit=200.0)
    rows = driven(CAR, found.plan)
    assert across(CAR, rows).max() <= MOST * (1.0 + 1e-9)
    assert rows[:, 3].min() >= -1e-6
    assert found.cost == pytest.approx(limited.cost, rel=5e-3)


@compiled_only
@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_limit_leads_the_same_way_round_as_a_zone():
    """Backwards in wide turns, past a box: paths that turn as tightly as can be lead elsewhere."""
    car = SecondOrderCar(
        wheelbase=2.61,
        max_steering=0.69,
        max_speed=5.0,
        max_acceleration=2.64,
        max_steering_rate=0.58,
    )
    conditions = {
        "goals": [27.1, -48.4, 2.7],
        "footprint": Box([4.0, 1.8], [1.4, 0.0]),
        "obstacles": [Box([5.0, 5.0], [10.5, -20.4])],
    }
    zone = Zone(shape=PLANE, max_lateral_acceleration=3.3)
    limited = plan(
        posed(replace(car, max_lateral_acceleration=3.3), **conditions), time_limit=200.0
    )
    among = plan(posed(car, zones=[zone], **conditions), time_limit=200.0)
    assert limited.cost == pytest.approx(among.cost, rel=1e-3)
    assert limited.plan.sample().reduced_state[:, 0].max() <= 1e-6


@pytest.mark.exhaustive
@pytest.mark.slow
@compiled_only
def test_a_moved_problem_has_the_moved_plan():
    zone = Zone(shape=BEYOND, max_speed=4.0)
    here = plan(posed(zones=[zone]), time_limit=200.0)
    by = SE2([5.0, -7.0, 2.0])
    moved = Problem(
        preset_automaton("parking", CAR),
        by.pose,
        (by @ SE2(GOAL)).pose,
        zones=[zone.moved(by)],
        search=WORK,
    )
    there = plan(moved, time_limit=200.0)
    assert there.cost == pytest.approx(here.cost, rel=1e-6)
    there_seen = (by.inverse() @ SE2(there.plan.pose_at(0.5 * there.cost))).pose
    assert there_seen == pytest.approx(here.plan.pose_at(0.5 * here.cost), abs=1e-3)


@pytest.mark.exhaustive
@compiled_only
@pytest.mark.slow
def test_a_car_with_a_trailer_keeps_the_limit_too():
    truck = CarWithTrailer(
        wheelbase=3.0, hitch_length=4.0, max_steering=0.6, max_speed=4.0, max_hitch=0.9
    )
    gripped = replace(truck, max_lateral_acceleration=1.0)
    zone = Zone(shape=PLANE, max_lateral_acceleration=1.0)
    still = {"speed": [0.0], "hitch": [0.0], "steering": [0.0]}
    costs = []
    for model, zones in ((gripped, ()), (truck, (zone,))):
        library = Automaton(model, trims_of(model, still).trims)
        aim = Problem(library, [0, 0, 0], [15.0, 10.0, 1.5], zones=zones, search=WORK)
        found = plan(aim, time_limit=200.0)
        speed, steering = found.plan.sample().control.T
        assert (speed**2 * np.abs(np.tan(steering)) / 3.0).max() <= 1.0
        costs.append(found.cost)
    assert costs == pytest.approx([7.691, 7.691], rel=1e-3)


def test_a_stock_library_serves_less_what_breaks_the_limit():
    scenario = scenario_of_text(
        "schema: 1\n"
        "vehicle: {model: single_track, max_acceleration_m_s2: 6, max_lateral_speed_m_s: 3,\n"
        "  max_turn_rate_rad_s: 1, max_lateral_acceleration_m_s2: 3}\n"
        "automaton: {preset: single_track}\n"
        "start: {pose: [0, 0, 0], trim: 'speed 15, turn_rate 0'}\n"
        "goal: {pose: [80, 0, 0], trim: 'speed 15, turn_rate 0'}\n",
        name="bmw",
    )
    automaton = scenario.problem.automaton
    assert automaton.model.max_lateral_acceleration == 3.0
    assert 0 < len(automaton) < 23
    assert 0 < len(automaton.maneuvers) < 252


@pytest.mark.parametrize("preset", ["parking", "road"])
@pytest.mark.parametrize("seed", range(2))
def test_libraries_keep_the_limit(preset, seed):
    rng = np.random.default_rng(seed)
    model = SecondOrderCar(
        wheelbase=rng.uniform(1.5, 4.0),
        max_steering=rng.uniform(0.3, 0.8),
        max_speed=rng.uniform(3.0, 15.0),
        max_acceleration=rng.uniform(1.0, 4.0),
        max_steering_rate=rng.uniform(0.2, 1.0),
        max_lateral_acceleration=rng.uniform(1.0, 5.0),
    )
    keeps_the_limit(preset_automaton(preset, model), model)


def keeps_the_limit(library, model):
    assert library.maneuvers
    for maneuver in library.maneuvers:
        begin, end = maneuver.course.reduced_state[:-1], maneuver.course.reduced_state[1:]
        for share in np.linspace(0.0, 1.0, 5):
            speed, steering = ((1.0 - share) * begin + share * end).T
            aside = speed**2 * np.abs(np.tan(steering)) / model.wheelbase
            assert aside.max() <= model.max_lateral_acceleration * (1.0 + 1e-9)


def test_trims_beyond_the_limit_are_refused_or_left_out():
    car = Car(wheelbase=2.5, max_steering=0.6, max_lateral_acceleration=0.2)
    with pytest.raises(InvalidAutomaton) as error:
        Automaton.of_controls(car, {"swift": (2.0, 0.5)})
    assert str(error.value) == (
        "trim 'swift': has a lateral acceleration of 0.8741 m/s^2, need at most the vehicle's "
        "max_lateral_acceleration 0.2 m/s^2"
    )
    grid = Automaton.of_grid(car, [[0.5, 2.0], [0.0, 0.5]])
    assert grid.controls.tolist() == [[0.5, 0.0], [0.5, 0.5], [2.0, 0.0]]
    left, ahead, right = preset_automaton("dubins", car).controls
    assert ahead.tolist() == [1.0, 0.0]
    assert left[0] == right[0] == pytest.approx(math.sqrt(0.2 * car.turning_radius))
    inertial = replace(CAR, max_lateral_acceleration=2.0)
    (missing,) = trims_of(inertial, {"speed": [4.0], "steering": [0.6]}).missing
    assert missing.reason.endswith("beyond max_lateral_acceleration 2 m/s^2")
    points = {"speed": [0.0, 4.0], "steering": [0.0, 0.6]}
    assert len(Automaton.of_model(inertial, points)) == 3


def test_the_audit_sees_what_exceeds_the_limit():
    swift = preset_automaton("road", replace(CAR, max_lateral_acceleration=3.0))
    problem = Problem(
        swift, [0, 0, 0], GOAL, search=SearchSettings(max_expansions=50, polish=False)
    )
    found = plan(problem, time_limit=200.0)
    assert found.audit.passed
    slower = replace(CAR, max_lateral_acceleration=0.05)
    audit = audit_plan(found.plan, problem.goals[0], slower)
    assert not audit.passed
    assert "the lateral acceleration is" in audit.reason
