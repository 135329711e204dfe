"""Where CasADi cannot be imported planning goes on, and says everywhere what it did without."""

from __future__ import annotations

import json
import sys

import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.cli.terminal import print_result
from maneuver_automaton.fleet import FleetProblem, plan_fleet
from maneuver_automaton.formats.fleet_json import fleet_to_dict
from maneuver_automaton.formats.plan_json import load_plan, load_result, plan_to_dict, save_plan
from maneuver_automaton.optimal_control.ipopt import why_no_casadi
from maneuver_automaton.planning import plan, plans
from maneuver_automaton.problem import Problem, SearchSettings
from maneuver_automaton.recording import recording_of
from tests.inertia import CAR, resting, unicycle_automaton

SAID = (
    "plans are not polished, and may cost much more: optimal control needs CasADi, which cannot "
    "be imported ("
)
FEW = SearchSettings(max_expansions=50)


class Broken:
    """Finds CasADi, whose import fails."""

    def find_spec(self, name, path=None, target=None):
        if name == "casadi":
            raise OSError("libipopt.so: cannot open shared object file")


@pytest.fixture(params=["missing", "broken"])
def without_casadi(request, monkeypatch):
    if request.param == "missing":
        monkeypatch.setitem(sys.modules, "casadi", None)
    else:
        monkeypatch.delitem(sys.modules, "casadi", raising=False)
        monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    why_no_casadi.cache_clear()
    yield
    why_no_casadi.cache_clear()


def posed(**changes):
    return Problem(resting(CAR), [0.0, 0.0, 0.0], [6.0, 0.0, 0.0], search=FEW, **changes)


def assert_said(notes):
    (note,) = notes
    assert note.startswith(SAID)
    assert note.endswith("pip install casadi")


def test_a_result_says_so_and_so_do_files_and_tables(without_casadi, tmp_path, capsys):
    result = plan(posed(), time_limit=60.0)
    assert result.audit.passed
    assert_said(result.notes)
    save_plan(result, tmp_path / "plan.json")
    assert_said(json.loads((tmp_path / "plan.json").read_text())["notes"])
    assert load_plan(tmp_path / "plan.json").notes == result.notes
    assert load_result(tmp_path / "plan.json", result.problem).notes == result.notes
    print_result("a car", [], recording_of(result).facts)
    assert " ".join(capsys.readouterr().out.split()).count(SAID) == 1


def test_better_plans_say_so_as_they_come(without_casadi):
    for better in plans(posed(), time_limit=60.0):
        assert_said(better.notes)


def test_a_fleet_says_so_once(without_casadi):
    robot = unicycle_automaton()
    ways = [Problem(robot, [0, y, 0], [3, y, 0], search=FEW) for y in (0.0, 3.0)]
    result = plan_fleet(FleetProblem(ways), time_limit=60.0)
    assert_said(result.notes)
    assert fleet_to_dict(result)["notes"] == list(result.notes)


def test_the_command_says_so_where_there_is_no_plan(without_casadi, tmp_path, capsys):
    scenario = tmp_path / "far.yaml"
    scenario.write_text(
        "schema: 1\n"
        "vehicle: {model: second_order_unicycle, max_speed_m_s: 1, max_turn_rate_rad_s: 1,\n"
        "  max_acceleration_m_s2: 1, max_angular_acceleration_rad_s2: 1}\n"
        "automaton: {grid: {speed_m_s: {min: 0, max: 1, count: 2}, "
        "turn_rate_rad_s: {min: -1, max: 1, count: 3}}}\n"
        "start: {pose: [0, 0, 0]}\n"
        "goal: {pose: [4, 0, 0]}\n"
        "horizon: {max_time_s: 1.0}\n"
        "search: {max_expansions: 20}\n"
    )
    assert run(["plan", str(scenario), "--no-plot", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.count(SAID) == 1
    assert_said(json.loads((tmp_path / "plan.json").read_text())["notes"])


def test_nothing_is_said_where_nothing_is_left_out():
    unasked = SearchSettings(max_expansions=50, polish=False)
    result = plan(Problem(resting(CAR), [0, 0, 0], [6, 0, 0], search=unasked), time_limit=60.0)
    assert result.notes == ()
    assert plan_to_dict(result)["notes"] == []
