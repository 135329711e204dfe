"""Maneuvers as optimal control problems: known times, limits, prices, and one program for all."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.models import Car, CarWithTrailer, SecondOrderCar
from maneuver_automaton.optimal_control.ipopt import SolverSettings, SolveStatus
from maneuver_automaton.optimal_control.maneuvers import (
    ManeuverObjective,
    TransferSettings,
    ends_of,
    ends_program,
    solve_transfer,
    transfer_program,
)
from maneuver_automaton.primitives.driving import drive
from tests.inertia import HOVERCRAFT

CAR = SecondOrderCar(
    wheelbase=2.5, max_steering=0.75, max_speed=2.5, max_acceleration=1.0, max_steering_rate=0.5
)
NO_INPUT = np.zeros((2, 2))


@pytest.fixture(scope="module")
def program():
    return transfer_program(CAR)


@pytest.mark.parametrize(
    ("start", "end"),
    [((0.0, 0.0), (2.0, 0.3)), ((2.5, -0.75), (1.0, 0.75)), ((-1.0, 0.2), (2.5, 0.0))],
)
def test_least_time_is_that_of_the_slowest_component(program, start, end):
    start, end = np.array(start), np.array(end)
    found = solve_transfer(program, start=start, end=end, controls=NO_INPUT)
    exact = float((np.abs(end - start) / [1.0, 0.5]).max())
    assert found.status is SolveStatus.SOLVED
    assert exact - 1e-6 <= found.duration <= exact * (1.0 + 1e-4)
    assert np.abs(found.control).max(axis=0) == pytest.approx(np.abs(end - start) / exact, rel=0.5)


def test_a_step_in_each_interval_is_enough_for_one_reduced_state():
    """Of a column of one row CasADi makes no empty one, as of others."""
    settings = TransferSettings(intervals=4, steps=1)
    cart = CarWithTrailer(wheelbase=2.5, hitch_length=3.0, max_steering=0.6, max_speed=1.0)
    program = transfer_program(cart, settings=settings)
    found = solve_transfer(
        program, start=np.array([0.2]), end=np.zeros(1), controls=np.array([[1.0, 0.0]] * 2)
    )
    assert found.status is SolveStatus.SOLVED


def test_a_program_keeps_nothing_of_the_pair_before(program):
    ends = [np.array([2.0, 0.3]), np.array([-2.0, 0.7]), np.array([0.5, -0.5])]

    def controls(order):
        return {
            k: solve_transfer(program, start=np.zeros(2), end=ends[k], controls=NO_INPUT).control
            for k in order
        }

    forward, backward = controls((0, 1, 2)), controls((2, 1, 0))
    assert all(np.array_equal(forward[k], backward[k]) for k in range(3))


def test_effort_alone_takes_the_time_it_is_given():
    settings = TransferSettings(duration=(0.1, 4.0))
    objective = ManeuverObjective(time=0.0, effort=1.0, smoothness=0.0)
    program = transfer_program(CAR, objective=objective, settings=settings)
    found = solve_transfer(program, start=np.zeros(2), end=np.array([2.0, 0.0]), controls=NO_INPUT)
    assert found.duration == pytest.approx(4.0, abs=1e-4)
    assert found.control == pytest.approx(np.tile([0.5, 0.0], (20, 1)), abs=1e-4)
    assert found.cost == pytest.approx(1.0, abs=1e-4)  # 0.5^2 for 4 s


def test_a_mix_weighs_time_against_effort():
    objective = ManeuverObjective(time=1.0, effort=4.0, smoothness=0.0)
    program = transfer_program(CAR, objective=objective)
    found = solve_transfer(program, start=np.zeros(2), end=np.array([1.0, 0.0]), controls=NO_INPUT)
    assert found.duration == pytest.approx(2.0, abs=1e-4)  # T + 4 / T is least


def test_limits_hold_and_are_drawn_in(program):
    found = solve_transfer(
        program,
        start=np.zeros(2),
        end=np.array([2.0, 0.7]),
        controls=NO_INPUT,
        control_limits=np.array([[0.0, 0.5], [-0.5, 0.5]]),
        tightening=0.1,
    )
    assert found.status is SolveStatus.SOLVED
    assert found.control[:, 0].max() <= 0.45 + 1e-9
    assert found.duration == pytest.approx(2.0 / 0.45, rel=1e-3)


def test_what_cannot_be_reached_is_said(program):
    found = solve_transfer(
        program,
        start=np.zeros(2),
        end=np.array([2.0, 0.0]),
        controls=NO_INPUT,
        control_limits=np.array([[-1.0, 0.0], [-0.5, 0.5]]),
    )
    assert found.status is SolveStatus.INFEASIBLE


def test_a_coupled_model_slows_down_in_its_own_way():
    craft = HOVERCRAFT  # fmt: skip
    found = solve_transfer(
        transfer_program(craft),
        start=np.zeros(3),
        end=np.array([2.0, 0.0, 0.0]),
        controls=np.array([[0.0, 0.0], [2.0, 0.0]]),
    )
    exact = 2.0 * np.log(2.0)  # v' = 2 - v / 2
    assert found.duration == pytest.approx(exact, rel=1e-4)


def test_brakes_where_a_rate_vanishes_half_way():
    """Guessed by that rate alone it would take 331 s, and no solver comes back from there."""
    craft = load_stock_library("hovercraft").model
    start = np.array([1.4858708905461382, -0.1830846759210547, 0.3718843605171223])
    few = TransferSettings(intervals=8, solver=SolverSettings(tolerance=1e-7, max_iterations=80))
    program = transfer_program(craft, settings=few)
    found = solve_transfer(program, start=start, end=np.zeros(3), controls=NO_INPUT)
    assert found.status is SolveStatus.SOLVED
    assert found.duration < 2.0


def test_ends_are_where_the_vehicle_gets_and_have_its_slopes():
    rng = np.random.default_rng(3)
    start, control = np.array([0.7, 0.1, 0.2]), rng.uniform(-0.2, 0.2, (5, 2))

    def driven(inputs, interval):
        return drive(HOVERCRAFT, start, control=inputs, durations=[interval] * 5).reduced_state[-1]

    program = ends_program(HOVERCRAFT, intervals=5)
    end, gradient, by_factor = ends_of(program, start, control, 0.1)
    np.testing.assert_allclose(end, driven(control, 0.1), atol=1e-12)
    step, shift = 1e-5, np.zeros((5, 2))
    shift[2, 1] = step
    change = driven(control + shift, 0.1) - driven(control - shift, 0.1)
    np.testing.assert_allclose(gradient[:, 2, 1], change / (2.0 * step), rtol=1e-6, atol=1e-9)
    change = driven(control, 0.1 * (1.0 + step)) - driven(control, 0.1 * (1.0 - step))
    np.testing.assert_allclose(by_factor, change / (2.0 * step), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ManeuverObjective(time=-1.0), "objective: time must not be negative, got -1.0"),
        (
            lambda: ManeuverObjective(time=0.0),
            "objective: got no price of time nor of effort, need one of them",
        ),
        (lambda: TransferSettings(intervals=0), "maneuver: intervals must be at least 1, got 0"),
        (
            lambda: TransferSettings(duration=(2.0, 1.0)),
            "maneuver: duration must be 0 < least < greatest, got (2.0, 1.0) s",
        ),
        (
            lambda: transfer_program(Car(wheelbase=2.0)),
            "car: has no reduced state, so its trims need no maneuvers",
        ),
    ],
)
def test_what_is_wrong_is_said(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert str(error.value) == message


def test_without_casadi(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "casadi", None)
    with pytest.raises(MissingExtra):
        transfer_program(CAR)


def test_the_objective_in_words():
    assert dataclasses.replace(ManeuverObjective(), effort=2.0).text == (
        "time 1, effort 2, smoothness 0.001"
    )
