from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.closed_loop_json import (
    closed_loop_to_dict,
    load_steps,
    save_closed_loop,
    statistics_to_dict,
)
from maneuver_automaton.formats.documents import write_document
from maneuver_automaton.receding_horizon import (
    ClosedLoop,
    Disturbance,
    RecedingHorizon,
    simulate,
    simulate_many,
)
from tests.receding_horizon.loops import AHEAD, NEAR, assert_same_steps, parking_loop, straight
from tests.search.cases import REVERSED_SPIN, robot

CONTRACT = {"status", "reached", "cost", "steps"}
OF_A_STEP = {
    "time_s",
    "pose",
    "value",
    "accumulated_cost",
    "control",
    "word",
    "plan",
    "replanned",
    "solve_s",
}


@pytest.fixture(scope="module")
def loop() -> ClosedLoop:
    upset = Disturbance(position_m=0.02, heading_rad=0.02, measured_position_m=0.01, seed=3)
    return simulate(parking_loop(goal=NEAR), step=0.5, disturbance=upset)


@pytest.fixture
def path(loop, tmp_path) -> Path:
    file = tmp_path / "closed_loop.json"
    save_closed_loop(loop, file)
    return file


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")


def strict(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


class TestContract:
    def test_keys(self, loop, path):
        document = strict(path)
        assert set(document) >= CONTRACT
        assert document["status"] == "reached"
        assert document["reached"] is True
        assert document["cost"] == loop.cost
        assert document["schema"] == 1
        assert document["automaton_hash"] == automaton_hash(loop.problem.automaton)
        assert document == json.loads(json.dumps(closed_loop_to_dict(loop)))

    def test_one_entry_per_step_and_one_where_it_ended(self, loop, path):
        *steps, last = strict(path)["steps"]
        assert len(steps) == len(loop.steps)
        spent = 0.0
        for entry, step in zip(steps, loop.steps, strict=True):
            assert set(entry) >= OF_A_STEP
            assert entry["accumulated_cost"] == pytest.approx(spent)
            assert entry["pose"] == step.pose.tolist()
            assert entry["value"] == step.value
            assert entry["control"] == entry["plan"][0]["control"]
            assert entry["word"] == [one["name"] for one in entry["plan"]]
            assert {one["kind"] for one in entry["plan"]} == {"trim"}
            assert sum(one["duration_s"] for one in entry["plan"]) == pytest.approx(8.0)
            assert isinstance(entry["replanned"], bool)
            spent += entry["applied_cost"]
        assert set(last) >= OF_A_STEP
        assert [last[key] for key in ("control", "word", "plan", "replanned", "solve_s")] == (
            [None] * 5
        )
        assert last["value"] == 0.0
        assert last["pose"] == loop.poses[-1].tolist()
        assert last["time_s"] == loop.times[-1]
        assert last["accumulated_cost"] == loop.cost == pytest.approx(spent)

    def test_what_noise_took_stands_with_its_step(self, loop, path):
        document = strict(path)
        taken = [(number, one.guarantee.value, one.reason) for number, one in loop.disturbed]
        assert taken
        rows = document["disturbed"]
        assert [(row["step"], row["guarantee"], row["reason"]) for row in rows] == taken
        assert sum(len(entry.get("disturbed", [])) for entry in document["steps"]) == len(taken)
        assert document["broken_guarantees"] == []

    def test_a_step_is_a_line(self, loop, path):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert sum('"vehicle_pose"' in line for line in lines) == len(loop.steps) + 1

    @pytest.mark.parametrize(
        ("made", "status", "reached", "n_steps"),
        [
            (lambda: simulate(straight(), step=1.0, steps=1), "steps_spent", False, 1),
            (lambda: simulate(parking_loop(AHEAD), step=1.0), "no_plan", False, 0),
            (lambda: simulate(parking_loop(start=(0, 0, 0)), step=1.0), "reached", True, 0),
            (lambda: simulate(straight(9.0), step=4.0), "reached", True, 3),
        ],
        ids=["few steps", "no plan", "nothing to do", "late"],
    )
    def test_whatever_the_end(self, tmp_path, made, status, reached, n_steps):
        save_closed_loop(made(), tmp_path / "x.json")
        document = strict(tmp_path / "x.json")
        assert (document["status"], document["reached"]) == (status, reached)
        assert bool(document["reason"]) is not reached
        assert len(document["steps"]) == n_steps + 1
        assert isinstance(document["steps"][-1]["value"], float)


class TestReading:
    def test_every_step_to_the_last_bit(self, loop, path):
        steps, poses = load_steps(path, loop.problem.automaton)
        assert poses.tolist() == loop.poses.tolist()
        for one, other in zip(steps, loop.steps, strict=True):
            assert_same_steps(one, other)
            assert one.violations == other.violations

    @pytest.mark.slow
    @pytest.mark.parametrize("how", [{}, {"retimed": True}, {"pieces": 8}])
    def test_a_loop_goes_on_from_any_step(self, tmp_path, how):
        problem = parking_loop(goal=NEAR)
        if "pieces" in how:
            problem = replace(problem, horizon=replace(problem.horizon, max_trims=None))
        settings = {
            "step": 0.5,
            "disturbance": Disturbance(position_m=0.02, heading_rad=0.02, seed=3),
            **how,
        }
        whole = simulate(problem, steps=9, **settings)
        save_closed_loop(whole, tmp_path / "x.json")
        steps, poses = load_steps(tmp_path / "x.json", problem.automaton)
        for done, last in enumerate(steps, start=1):
            here = replace(problem, start=poses[done])
            again = simulate(here, steps=max(9 - done, 1), last=last, **settings)
            rest = whole.steps[done:]
            for a, b in zip(rest, again.steps[: len(rest)], strict=True):
                assert_same_steps(a, b)

    def test_a_controller_goes_on_in_another_process(self, loop, path):
        steps, _ = load_steps(path, loop.problem.automaton)
        controller = RecedingHorizon(loop.problem, step=0.5, last=steps[0])
        _, step = controller.step(loop.steps[1].pose)
        assert_same_steps(step, loop.steps[1])

    def test_another_library(self, path):
        with pytest.raises(InvalidScenario) as caught:
            load_steps(path, robot(REVERSED_SPIN))
        assert str(caught.value) == (
            f"{path}: automaton_hash: this loop was planned with another library"
        )

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (
                lambda d: d.pop("automaton_hash"),
                "this loop was planned with another",
            ),
            (lambda d: d.pop("steps"), "is no closed_loop.json, need an object with"),
            (lambda d: d.update(schema=2), "schema: got 2, need 1"),
            (lambda d: d.update(steps=3), ""),
            (lambda d: d.update(steps={}), ""),
            (lambda d: d["steps"][0].pop("pose"), "steps[0].pose: is missing, need a list"),
            (lambda d: d["steps"][0].update(pose=[0.0, 1.0]), "steps[0].pose: need 3 numbers"),
            (lambda d: d["steps"][1].update(pose="here"), "steps[1].pose: got 'here'"),
            (lambda d: d["steps"][0].update(value="costly"), "costly"),
            (lambda d: d["steps"][0].update(value=None), ""),
            (lambda d: d["steps"][0].update(value=10**400), ""),
            (lambda d: d["steps"][0].update(origin="heaven"), "heaven"),
            (lambda d: d["steps"][0].update(plan=None), ""),
            (
                lambda d: d["steps"][0].update(plan=[{"kind": "trim", "name": "cw"}]),
                "duration_s: is missing, need a finite number",
            ),
            (lambda d: d["steps"][0]["plan"][0].update(duration_s=-1.0), "must not be negative"),
            (lambda d: d["steps"][0]["plan"][0].update(control=[1.0]), ""),
            (lambda d: d["steps"][0]["plan"][0].update(control="no"), ""),
            (
                lambda d: d["steps"][-1].pop("vehicle_pose"),
                "steps[7].vehicle_pose: is missing, need a list",
            ),
            (lambda d: d["steps"][-1].update(vehicle_pose=[0.0]), ""),
            (lambda d: [s.update(vehicle_pose=[0.0]) for s in d["steps"]], "vehicle_pose"),
            (lambda d: d["steps"][2].pop("time_s"), "steps[2].time_s: is missing"),
            (lambda d: d["steps"][2].update(time_s=0.0), "steps[2].time_s: got 0, need at least"),
            (lambda d: d["steps"][2].pop("control"), "steps[2].control: is missing, need a list"),
            (lambda d: d["steps"][2].update(control=None), "steps[2].control: got nothing"),
            (
                lambda d: d["steps"][2].update(control=[1.0]),
                "steps[2].control: need speed, turn_rate",
            ),
            (lambda d: d["steps"][-1].pop("time_s"), "steps[7].time_s: is missing"),
            (lambda d: d["steps"][0].update(number=10**40), "steps[0].number: got 1"),
            (lambda d: d["steps"][0]["plan"][0].update(name=7), "plan[0].name: got 7, need a text"),
            (lambda d: d["steps"].append(None), ""),
            (lambda d: d["steps"].insert(0, 5), ""),
        ],
    )
    def test_what_is_garbled_is_said_in_one_line(self, loop, path, change, message):
        document = strict(path)
        change(document)
        path.write_text(json.dumps(document))
        with pytest.raises(InvalidScenario) as caught:
            load_steps(path, loop.problem.automaton)
        assert str(caught.value).startswith(f"{path}: ")
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("", ":1: not valid JSON: Expecting value"),
            ('{"schema": 1,\n"steps": [}', ":2: not valid JSON: Expecting value"),
            ("[]", ": is no closed_loop.json, need an object with"),
            ('{"schema": NaN}', ": not valid JSON"),
        ],
    )
    def test_no_such_file(self, loop, tmp_path, text, message):
        path = tmp_path / "x.json"
        path.write_text(text)
        with pytest.raises(InvalidScenario) as caught:
            load_steps(path, loop.problem.automaton)
        assert str(caught.value).startswith(f"{path}{message}")

    def test_nowhere(self, loop, tmp_path):
        with pytest.raises(InvalidScenario, match=r"nowhere\.json: no such file$"):
            load_steps(tmp_path / "nowhere.json", loop.problem.automaton)
        with pytest.raises(InvalidScenario, match=r"is a folder, need a closed_loop\.json"):
            load_steps(tmp_path, loop.problem.automaton)


def test_statistics_are_strict_json(tmp_path):
    starts = [[-2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    statistics = simulate_many(straight(), starts=starts, step=1.0)
    write_document(statistics_to_dict(statistics), tmp_path / "statistics.json")
    document = strict(tmp_path / "statistics.json")
    assert document["loops_run"] == 2
    assert document["reached"] == 0.5
    assert [row["reached"] for row in document["loops"]] == [True, False]
    assert [row["start"] for row in document["loops"]] == starts
    assert document["loops"][0]["cost"] == 2.0
