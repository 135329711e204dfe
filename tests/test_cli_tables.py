"""What the tables say: pieces of polished plans, what is proven, and how wide they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rich.cells import cell_len

from maneuver_automaton import Automaton, Plan, Problem, SecondOrderCar, Unicycle
from maneuver_automaton.audit.judge import TerminalError
from maneuver_automaton.cli import terminal
from maneuver_automaton.collision import Box
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.receding_horizon import Disturbance, simulate
from maneuver_automaton.recording import recording_of, tables_of
from maneuver_automaton.recording.plans import stretches
from tests.plotting.loops import flight_loop, parking_loop, pushed_loop

CAR = SecondOrderCar(
    wheelbase=2.0, max_steering=0.7, max_speed=3.0, max_acceleration=2.0, max_steering_rate=1.0
)


def print_result(result) -> None:
    terminal.print_result("x", tables_of(result), recording_of(result).facts)


def driven(controls: list[tuple[float, float, float]]) -> Maneuver:
    """A maneuver of the car from rest, by duration, acceleration and steering rate."""
    time, pose, state = [0.0], [np.zeros(3)], [np.zeros(2)]
    inputs = []
    for seconds, acceleration, rate in controls:
        for _ in range(50):
            step, control = seconds / 50, np.array([acceleration, rate])
            middle = state[-1] + 0.5 * step * control
            twist = CAR.body_velocity(middle, control)
            pose.append((CAR.group(pose[-1]) @ CAR.group.exp(step * twist)).pose)
            state.append(state[-1] + step * control)
            time.append(time[-1] + step)
            inputs.append(control)
    course = Trajectory(
        time=np.array(time), pose=np.array(pose), reduced_state=np.array(state),
        control=np.array([*inputs, inputs[-1]]),
    )  # fmt: skip
    return Maneuver.along(course, name="polished", source="rest", target="rest")


def test_stretches_have_words_and_add_up():
    maneuver = driven([
        (1.0, 0.0, 0.5), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 0.0, -1.0),
        (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (0.5, 0.0, 1.0), (2.0, 1.0, 0.0),
    ])  # fmt: skip
    found = stretches(maneuver, CAR)
    assert [what for what, _ in found] == ["at rest", "ahead, left", "at rest",
                                           "reverse, right", "at rest", "ahead"]  # fmt: skip
    assert sum(seconds for _, seconds in found) == pytest.approx(maneuver.duration, abs=1e-12)
    assert found[1][1] == pytest.approx(2.0)


def test_between_two_bends_a_moment_of_straight_is_left_out():
    maneuver = driven([(1.0, 1.0, 0.3), (0.6, 0.0, -1.0), (1.0, -1.0, 0.0)])
    assert [what for what, _ in stretches(maneuver, CAR)] == ["ahead, left", "ahead, right"]


def result_of(plan: Plan, cost: float, **more: object) -> PlanResult:
    problem = Problem(
        Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0)}), [0, 0, 0], [2, 0, 0],
        footprint=Box([0.5, 0.5]), obstacles=[Box([1.0, 1.0], [0.0, 1.0])],
    )  # fmt: skip
    return PlanResult(
        problem=problem, status=PlanStatus.FOUND, reason="", plan=plan, cost=cost,
        terminal_error=TerminalError(position_m=0.0, heading_rad=0.0), **more,
    )  # fmt: skip


ON = Trim(name="on", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
STRAIGHT = Plan([0, 0, 0], (ON,), durations=[2.0])


@pytest.mark.parametrize(
    ("bound", "gap", "said"),
    [
        (1.0, 0.5, "2 (proven: at least 1)"),
        (2.0, 0.0, "2 (proven optimal)"),
        (None, None, "2"),
    ],
)
def test_what_is_proven_of_the_cost_is_told(capsys, bound, gap, said):
    known = None if bound is None else LowerBound(value=bound, kind="cells")
    result = result_of(STRAIGHT, 2.0, lower_bound=bound, gap=gap, bound=known)
    print_result(result)
    assert f"  cost:           {said}\n" in capsys.readouterr().out


def test_a_clearance_below_a_millimetre_without_a_margin_is_remarked_on(capsys):
    result = result_of(STRAIGHT, 2.0, clearance_m=1.14e-5)
    print_result(result)
    assert "less than 1 mm, as margin_m is 0" in capsys.readouterr().out
    kept = replace(result, problem=replace(result.problem, margin=1e-6))
    print_result(kept)
    print_result(replace(result, clearance_m=0.2))
    assert "less than 1 mm" not in capsys.readouterr().out


def test_a_polished_plan_shows_its_stretches(capsys):
    rest = Trim(name="rest", body_velocity=[0, 0, 0], control=[0, 0], reduced_state=[0, 0])
    problem = Problem(Automaton(CAR, (rest,)), [0, 0, 0], [1, 0, 0])
    maneuver = driven([(1.0, 1.0, 0.3), (0.6, 0.0, -1.0), (1.0, -1.0, 0.0)])
    plan = Plan([0, 0, 0], (rest, rest), durations=[0.0, 0.0], maneuvers=(maneuver,))
    result = replace(result_of(plan, maneuver.duration), problem=problem)
    print_result(result)
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if "polished" in line]
    assert [row[1:4] for row in rows] == [
        ["polished:", "ahead,", "left"],
        ["polished:", "ahead,", "right"],
    ]
    assert sum(float(row[-1]) for row in rows) == pytest.approx(maneuver.duration, rel=1e-5)


def shaken(seed: int):
    upset = Disturbance(position_m=0.02, heading_rad=0.02, seed=seed)
    return simulate(parking_loop().problem, step=0.5, steps=6, disturbance=upset, audit=False)


@pytest.mark.parametrize(
    "loop",
    [parking_loop, pushed_loop, flight_loop, lambda: shaken(1), lambda: shaken(2)],
    ids=["calm", "pushed", "flight", "noise1", "noise2"],
)
def test_the_table_of_a_loop_fits_80_columns(monkeypatch, capsys, loop):
    monkeypatch.setenv("COLUMNS", "80")
    made = loop()
    print_result(made)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(cell_len, lines)) <= 80
    assert sum(line.split()[:1] == [str(k)] for k, line in enumerate(lines[4:])) == len(made.steps)
