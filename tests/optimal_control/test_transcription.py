"""Problems with known answers, both rules, and what is said when something does not fit."""

from __future__ import annotations

import builtins
import dataclasses

import casadi
import numpy as np
import pytest

from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.groups import SE2, SE2xR, translations
from maneuver_automaton.models import Car, Unicycle, UserModel, rollout
from maneuver_automaton.optimal_control import (
    Guess,
    OptimalControlProblem,
    SolverSettings,
    SolveStatus,
    TimeGrid,
    moving_frame,
    solve,
    transcribe,
)
from tests.reference_dynamics import dynamics_defect

RULES = ("trapezoidal", "rk4")


def cart(**changes):
    """One metre from rest to rest in two seconds, with the least squared push."""
    problem = OptimalControlProblem(
        state_names=("position", "speed"),
        control_names=("push",),
        dynamics=lambda x, u: [x[1], u[0]],
        start=(0.0, 0.0),
        end=(1.0, 0.0),
        duration=(2.0, 2.0),
        stage_cost=lambda x, u: u[0] ** 2,
    )
    return dataclasses.replace(problem, **changes)


def unicycle_problem(**changes):
    problem = OptimalControlProblem(
        state_names=SE2.coordinates,
        control_names=("speed", "turn_rate"),
        dynamics=moving_frame(SE2, velocity=lambda z, u: [u[0], 0.0, u[1]]),
        start=(0.0, 1.0, 0.0),
        end=(0.0, 0.0, 0.0),
        duration=(8.0, 8.0),
        stage_cost=lambda x, u: u[0] ** 2 + u[1] ** 2,
    )
    return dataclasses.replace(problem, **changes)


@pytest.mark.parametrize("rule", RULES)
def test_least_push_is_a_straight_line_in_time(rule):
    # u = 1.5 (1 - t), cost 12 d^2 / T^3 = 1.5
    found = solve(cart(), TimeGrid(n_nodes=201, rule=rule))
    assert found.status is SolveStatus.SOLVED
    assert found.cost == pytest.approx(1.5, abs=1e-3)
    assert found.worst_defect < 1e-9
    assert found.worst_violation == 0.0
    at = found.time if rule == "trapezoidal" else (found.time[1:] + found.time[:-1]) / 2.0
    inner = slice(2, -2)  # the trapezoidal rule spoils the controls at the ends
    np.testing.assert_allclose(found.control[inner, 0], 1.5 * (1.0 - at[inner]), atol=2e-3)


def test_least_time_with_a_limited_push():
    problem = cart(duration=(0.1, 10.0), stage_cost=lambda x, u: 1.0, control_limits=[[-1.0, 0.5]])
    found = solve(problem, TimeGrid(n_nodes=61, rule="rk4"))
    # accelerate at 1/2, brake at 1: peak speed sqrt(2 / 3), T = 2 / peak
    assert found.cost == pytest.approx(found.duration, rel=1e-13)
    assert found.duration == pytest.approx(2.0 / np.sqrt(2.0 / 3.0), abs=1e-6)
    assert found.control.min() >= -1.0
    assert found.control.max() <= 0.5


def test_state_limits_hold_at_every_node():
    problem = cart(state_limits=[[-np.inf, np.inf], [-np.inf, 0.6]])
    found = solve(problem, TimeGrid(n_nodes=81, rule="rk4"))
    assert found.state[:, 1].max() <= 0.6
    assert found.state[:, 1].max() == pytest.approx(0.6, abs=1e-6)
    assert found.cost > 1.5


def test_free_components_are_chosen():
    # to 1 m in 2 s without braking: cost 3 d^2 / T^3
    found = solve(cart(end=(1.0, None)), TimeGrid(n_nodes=201, rule="rk4"))
    assert found.cost == pytest.approx(3.0 / 8.0, abs=1e-4)
    assert found.state[-1, 1] == pytest.approx(0.75, abs=1e-4)
    start = solve(cart(start=(None, 0.0)), TimeGrid(n_nodes=21, rule="rk4"))
    assert start.cost == pytest.approx(0.0, abs=1e-9)
    assert start.state[0, 0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("rule", RULES)
def test_a_cost_that_is_a_state_is_the_same_as_an_integral(rule):
    grid = TimeGrid(n_nodes=30, rule=rule)
    as_cost = solve(cart(integrals={"push": lambda x, u: u[0] ** 2}), grid)
    as_state = solve(
        cart(
            state_names=("position", "speed", "spent"),
            dynamics=lambda x, u: [x[1], u[0], u[0] ** 2],
            start=(0.0, 0.0, 0.0),
            end=(1.0, 0.0, None),
            stage_cost=None,
            terminal_cost=lambda x: x[2],
        ),
        grid,
    )
    assert as_state.cost == pytest.approx(as_cost.cost, abs=1e-9)
    np.testing.assert_allclose(as_state.state[:, 2], as_cost.integrals["push"], atol=1e-8)
    np.testing.assert_allclose(as_cost.integrals["push"][-1], as_cost.cost, atol=1e-12)


def test_rk4_controls_drive_the_model_where_they_say():
    found = solve(unicycle_problem(), TimeGrid(n_nodes=41, rule="rk4"), guess=sideways_guess())
    state = found.state[0]
    for k, control in enumerate(found.control):
        state = rollout(Unicycle(), state, control=control, times=found.time[k : k + 2])[-1]
    np.testing.assert_allclose(state, found.state[-1], atol=1e-6)


def sideways_guess():
    state = [[0.0, 1.0, 0.0], [0.5, 0.5, -1.0], [0.0, 0.0, 0.0]]
    return Guess(state=np.array(state), control=np.array([[0.2, -0.1]]), duration=8.0)


def test_a_moved_problem_has_the_moved_solution():
    by = SE2([3.0, -2.0, 1.1])
    grid, guess = TimeGrid(n_nodes=30, rule="rk4"), sideways_guess()
    here = solve(unicycle_problem(), grid, guess=guess)
    ends = {
        name: tuple((by @ SE2(getattr(unicycle_problem(), name))).pose) for name in ("start", "end")
    }
    there = solve(
        unicycle_problem(**ends),
        grid,
        guess=dataclasses.replace(guess, state=(by @ SE2(guess.state)).pose),
    )
    assert here.status is there.status is SolveStatus.SOLVED
    assert there.cost == pytest.approx(here.cost, abs=1e-9)
    np.testing.assert_allclose(there.state, (by @ SE2(here.state)).pose, atol=1e-6)
    np.testing.assert_allclose(there.control, here.control, atol=1e-6)


def test_a_coarse_solution_is_a_guess_for_a_fine_grid():
    coarse = solve(unicycle_problem(), TimeGrid(n_nodes=20, rule="rk4"), guess=sideways_guess())
    fine = solve(unicycle_problem(), TimeGrid(n_nodes=80, rule="rk4"), guess=coarse.as_guess)
    assert fine.status is SolveStatus.SOLVED
    assert fine.cost <= coarse.cost
    assert fine.cost == pytest.approx(coarse.cost, rel=1e-2)


def test_the_formulas_for_the_solver_are_those_of_the_models():
    rng = np.random.default_rng(3)
    states, controls = rng.normal(size=(20, 4)), 0.5 * rng.normal(size=(20, 3))
    car = unicycle_problem(
        dynamics=moving_frame(SE2, velocity=lambda z, u: [u[0], 0.0, u[0] * np.tan(u[1]) / 2.5])
    )
    model = Car(wheelbase=2.5)
    assert dynamics_defect(car, model, states=states[:, :3], controls=controls[:, :2]) < 1e-12
    boat = UserModel(
        name="boat", group=SE2, control_names=("push", "turn"), reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.1 * z[0], u[1]], dynamics=lambda z, u: [u[0] - z[0]],
    )  # fmt: skip
    own = unicycle_problem(
        state_names=(*SE2.coordinates, "speed"),
        start=(0.0,) * 4,
        end=(1.0,) * 4,
        dynamics=moving_frame(SE2, velocity=boat.velocity, reduced=boat.dynamics),
    )
    assert dynamics_defect(own, boat, states=states, controls=controls[:, :2]) < 1e-12
    plane = UserModel(
        name="plane", group=SE2xR, control_names=("speed", "turn", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )  # fmt: skip
    flying = unicycle_problem(
        state_names=SE2xR.coordinates,
        control_names=plane.control_names,
        start=(0.0,) * 4,
        end=(1.0,) * 4,
        dynamics=moving_frame(SE2xR, velocity=plane.velocity),
    )
    assert dynamics_defect(flying, plane, states=states, controls=controls) < 1e-12


def test_what_cannot_be_is_a_status():
    hopeless = cart(control_limits=[[-0.1, 0.1]])
    found = solve(hopeless, TimeGrid(n_nodes=20, rule="rk4"))
    assert found.status is SolveStatus.INFEASIBLE
    assert found.worst_defect > 1e-3


def test_a_budget_is_a_status():
    settings = SolverSettings(max_iterations=1)
    grid = TimeGrid(n_nodes=30, rule="rk4")
    found = solve(unicycle_problem(), grid, guess=sideways_guess(), settings=settings)
    assert found.status is SolveStatus.OUT_OF_BUDGET
    assert found.reason == "Maximum_Iterations_Exceeded"


def test_success_of_the_solver_is_not_believed():
    # the symbols see another equation than the numbers do
    def liar(x, u):
        return [x[1], u[0] if isinstance(u[0], casadi.SX) else u[0] + 0.1]

    found = solve(cart(dynamics=liar), TimeGrid(n_nodes=20))
    assert found.status is SolveStatus.FAILED
    assert found.reason.startswith("Solve_Succeeded, but the numbers do not hold: defect 0.01")


def test_without_casadi_it_is_named(monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **named):
        if name == "casadi":
            raise ImportError(name)
        return real(name, *arguments, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtra) as error:
        solve(cart(), TimeGrid(n_nodes=5))
    assert str(error.value) == (
        "optimal control needs CasADi, which cannot be imported (casadi): pip install casadi"
    )
    assert isinstance(error.value, ImportError)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": (0.0,)}, "start has 1 components, need 2 (position, speed)"),
        (
            {"state_limits": [[0.0, 0.5], [0.0, 1.0]]},
            "end: position = 1 is outside [0, 0.5]",
        ),
        ({"duration": (2.0, 1.0)}, "duration must be 0 < least <= greatest, got (2.0, 1.0) s"),
        ({"stage_cost": None}, "got no cost, need stage_cost or terminal_cost"),
        (
            {"control_limits": [[1.0, 0.0]]},
            "control_limits: push needs least <= greatest, got (1, 0)",
        ),
        (
            {"control_limits": [0.0, 1.0]},
            "control_limits: got shape (2,), need (1, 2): least and greatest push",
        ),
    ],
)
def test_a_wrong_problem_is_refused(changes, message):
    with pytest.raises(ValueError) as error:
        cart(**changes)
    assert str(error.value) == f"optimal control: {message}"


def test_wrong_grids_settings_and_guesses_are_refused():
    with pytest.raises(ValueError) as error:
        TimeGrid(n_nodes=1)
    assert str(error.value) == "grid: n_nodes must be at least 2, got 1"
    with pytest.raises(ValueError) as error:
        TimeGrid(n_nodes=5, rule="euler")
    assert str(error.value) == "grid: rule must be trapezoidal or rk4, got 'euler'"
    with pytest.raises(ValueError) as error:
        SolverSettings(tolerance=0.0)
    assert str(error.value) == "solver: tolerance must be positive, got 0.0"
    with pytest.raises(ValueError) as error:
        Guess(state=np.zeros((0, 2)), control=np.zeros((1, 1)), duration=1.0)
    assert str(error.value).startswith("guess: state has shape (0, 2), need at least one row")
    wide = Guess(state=np.zeros((2, 3)), control=np.zeros((1, 1)), duration=1.0)
    with pytest.raises(ValueError) as error:
        solve(cart(), TimeGrid(n_nodes=5), guess=wide)
    assert str(error.value) == "guess: state has 3 columns, need 2 (position, speed)"


def test_the_number_of_rates_is_checked():
    with pytest.raises(ValueError) as error:
        transcribe(cart(dynamics=lambda x, u: [x[1]]), TimeGrid(n_nodes=5))
    assert str(error.value) == (
        "optimal control: the dynamics return 1 rates, need 2 (position, speed)"
    )


def test_other_groups_are_refused():
    with pytest.raises(ValueError, match=r"with poses \(x, y\), need SE2 or SE2xR"):
        moving_frame(translations(2), velocity=lambda z, u: u)
