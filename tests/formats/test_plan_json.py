"""plan.json: every key of the contract, strict JSON, and the plan back from the file."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.audit import Audit, TerminalError, audit_plan
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.plan_json import load_plan, plan_to_dict, save_plan
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import Alternative, PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.stop_and_steer import extreme_automaton, stop_and_steer
from tests.inertia import CAR, rest_of, resting

KEYS = {
    "schema",
    "version",
    "name",
    "vehicle",
    "automaton_hash",
    "status",
    "reason",
    "notes",
    "cost",
    "duration_s",
    "lower_bound",
    "gap",
    "bound",
    "certificate",
    "primitives",
    "terminal_error",
    "clearance_m",
    "trajectory",
    "audit",
    "alternatives",
    "improvements",
    "timing_s",
    "counts",
}
ROBOT = Automaton.of_controls(
    Unicycle(), {"ahead": (1.5, 0.0), "turn": (-0.25, 1.0), "spin": (0.0, -2.0), "rest": (0.0, 0.0)}
)


def result_of(plan: Plan, **changes: object) -> PlanResult:
    """A result that holds a plan, with made-up numbers."""
    end = plan.end
    values: dict[str, object] = {
        "problem": Problem(ROBOT, plan.start, end),
        "status": PlanStatus.FOUND,
        "reason": "",
        "plan": plan,
        "goal_index": 0,
        "cost": 1.25,
        "terminal_error": TerminalError(position_m=1e-16, heading_rad=0.0),
        "audit": Audit(
            passed=True,
            max_dynamics_defect=1e-12,
            min_clearance_m=None,
            terminal_position_m=1e-16,
            terminal_heading_rad=0.0,
        ),
        "timing_s": {"search": 0.25, "first_plan": 0.125},
        "counts": {"expansions": 7, "words": 3},
    }
    return PlanResult(**(values | changes))  # type: ignore[arg-type]


def word(*pieces: tuple[str, float], start: tuple[float, ...] = (0.5, 1.0, 0.25)) -> Plan:
    """A plan over the robot's trims."""
    trims = tuple(ROBOT[name] for name, _ in pieces)
    return Plan(np.array(start), trims, durations=np.array([time for _, time in pieces]))


def test_every_key_with_a_plan():
    plan = word(("ahead", 2.0), ("turn", 0.5))
    document = plan_to_dict(
        result_of(
            plan,
            lower_bound=-math.inf,
            alternatives=(
                Alternative(
                    plan=word(("turn", 1.0)),
                    cost=3.0,
                    terminal_error=TerminalError(position_m=0.0, heading_rad=0.0),
                ),
            ),
        )
    )
    assert document.keys() == KEYS
    assert document["schema"] == 1
    assert document["automaton_hash"] == automaton_hash(ROBOT)
    assert document["status"] == "found"
    assert document["duration_s"] == 2.5
    assert document["lower_bound"] is None
    assert document["primitives"] == [
        {"kind": "trim", "name": "ahead", "control": [1.5, 0.0], "duration_s": 2.0},
        {"kind": "trim", "name": "turn", "control": [-0.25, 1.0], "duration_s": 0.5},
    ]
    assert document["terminal_error"] == {"position_m": 1e-16, "heading_rad": 0.0}
    assert document["audit"] == {
        "passed": True,
        "max_dynamics_defect": 1e-12,
        "min_clearance_m": None,
        "terminal_position_m": 1e-16,
        "terminal_heading_rad": 0.0,
    }
    assert document["alternatives"] == [
        {
            "cost": 3.0,
            "duration_s": 1.0,
            "word": ["turn"],
            "primitives": [
                {"kind": "trim", "name": "turn", "control": [-0.25, 1.0], "duration_s": 1.0}
            ],
            "terminal_error": {"position_m": 0.0, "heading_rad": 0.0},
        }
    ]
    assert document["timing_s"] == {
        "load": None,
        "automaton": None,
        "search": 0.25,
        "first_plan": 0.125,
        "refine": None,
        "audit": None,
    }
    assert document["counts"] == {"expansions": 7, "collision_queries": 0, "words": 3}
    assert document["trajectory"]["origin"] == [0.0, 0.0]


def test_every_key_without_a_plan(tmp_path):
    result = PlanResult(
        problem=Problem(ROBOT, [0, 0, 0], [1, 0, 0]),
        status=PlanStatus.UNREACHABLE,
        reason="needs at least 0.667 s",
    )
    document = plan_to_dict(result)
    assert document.keys() == KEYS
    assert document["status"] == "unreachable"
    assert document["reason"] == "needs at least 0.667 s"
    for key in ("cost", "duration_s", "lower_bound", "gap", "certificate", "clearance_m"):
        assert document[key] is None
    assert document["primitives"] == document["alternatives"] == []
    assert document["terminal_error"] == {"position_m": None, "heading_rad": None}
    assert set(document["audit"].values()) == {None}
    assert document["trajectory"] == {
        "origin": [],
        "time_s": [],
        "pose": [],
        "reduced_state": [],
        "control": [],
    }
    save_plan(result, tmp_path / "plan.json")
    with pytest.raises(InvalidScenario) as error:
        load_plan(tmp_path / "plan.json")
    path = tmp_path / "plan.json"
    assert str(error.value) == f"{path}: holds no plan, its status is 'unreachable'"


def test_the_file_is_strict_json_and_exact(tmp_path):
    result = result_of(word(("ahead", 0.1 + 0.2), ("turn", 1 / 3)))
    save_plan(result, tmp_path / "plan.json")

    def refuse(word: str) -> None:
        raise AssertionError(word)

    document = json.loads((tmp_path / "plan.json").read_text(), parse_constant=refuse)
    assert document == json.loads(json.dumps(plan_to_dict(result)))


def test_a_number_that_is_none_is_a_bug(tmp_path):
    with pytest.raises(ValueError, match="Out of range float values"):
        save_plan(result_of(word(("ahead", 1.0)), cost=math.nan), tmp_path / "plan.json")
    assert not list(tmp_path.iterdir())


pieces = st.lists(
    st.tuples(st.sampled_from(ROBOT.trim_names), st.floats(1e-6, 20.0)), min_size=0, max_size=5
)


@given(
    pieces=pieces,
    start=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-9.0, 9.0)),
)
def test_samples_are_dense_and_hold_every_switch(pieces, start):
    plan = word(*pieces, start=start)
    trajectory = plan_to_dict(result_of(plan))["trajectory"]
    time, pose = np.array(trajectory["time_s"]), np.array(trajectory["pose"])
    assert set(plan.switching_times) <= set(time)
    assert (np.diff(time) >= 0.0).all()
    steps = np.diff(pose, axis=0)
    assert (np.hypot(steps[:, 0], steps[:, 1]) <= 0.05 * (1 + 1e-9)).all()
    assert (np.abs(steps[:, 2]) <= 0.05 * (1 + 1e-9)).all()
    assert pose[0].tolist() == plan.start.tolist()
    assert pose[-1].tolist() == plan.end.tolist()
    assert len(trajectory["control"]) == len(trajectory["reduced_state"]) == len(time)
    for k, (name, _) in enumerate(pieces):
        inside = (time >= plan.switching_times[k]) & (time < plan.switching_times[k + 1])
        controls = np.array(trajectory["control"])[inside]
        assert (controls == ROBOT[name].control).all()


@given(
    pieces=pieces,
    start=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-9.0, 9.0)),
)
def test_the_plan_comes_back(tmp_path_factory, pieces, start):
    plan = word(*pieces, start=start)
    path = tmp_path_factory.getbasetemp() / "plan.json"
    save_plan(result_of(plan), path)
    read = load_plan(path)
    assert read.word == plan.word
    assert read.durations.tolist() == plan.durations.tolist()
    assert read.start.tolist() == plan.start.tolist()
    assert read.start_time == plan.start_time
    times = np.linspace(0.0, plan.duration, 50)
    assert np.abs(read.pose_at(times) - plan.pose_at(times)).max() <= 1e-9
    if plan.trims:
        assert (read.control_at(times) == plan.control_at(times)).all()


def test_a_plan_with_maneuvers_comes_back(tmp_path):
    """Stop and steer along a path: strokes, coasts and turns of the wheel at rest."""
    kinematic = extreme_automaton(resting(CAR))
    trims = [kinematic.trims[k] for k in (0, 1, 5)]
    path = Plan([1.0, 2.0, 0.5], trims, durations=[1.0, 6.0, 0.25])
    plan = stop_and_steer(CAR, path, first=rest_of(CAR), last=rest_of(CAR))
    problem = Problem(resting(CAR), plan.start, plan.end)
    save_plan(result_of(plan, problem=problem), tmp_path / "plan.json")
    document = json.loads((tmp_path / "plan.json").read_text())
    durations = [one["duration_s"] for one in document["primitives"]]
    assert sum(durations) == pytest.approx(document["duration_s"], abs=1e-12)
    kinds = {one["kind"]: one["control"] for one in document["primitives"]}
    assert kinds == {"maneuver": None, "trim": [0.0, 0.0]}
    read = load_plan(tmp_path / "plan.json", model=CAR)
    assert read.word == plan.word
    times = np.linspace(0.0, plan.duration, 200)
    np.testing.assert_allclose(read.pose_at(times), plan.pose_at(times), atol=1e-9)
    np.testing.assert_allclose(read.end, plan.end, atol=1e-9)
    states = (np.zeros(2), np.zeros(2))
    audit = audit_plan(read, Goal(pose=plan.end), CAR, states=states)
    assert audit.passed, audit.reason


def test_far_from_the_origin_no_digit_is_lost(tmp_path):
    near, far = word(("turn", 3.0)), word(("turn", 3.0), start=(1e8 + 0.5, 2.0, 0.25))
    document = plan_to_dict(result_of(far))
    assert document["trajectory"]["origin"] == [1e8 + 0.5, 2.0]
    shift = np.array([0.5, 1.0, 0.0])
    expected = np.array(plan_to_dict(result_of(near))["trajectory"]["pose"]) - shift
    assert np.abs(np.array(document["trajectory"]["pose"]) - expected).max() <= 1e-14
    save_plan(result_of(far), tmp_path / "plan.json")
    assert load_plan(tmp_path / "plan.json").start.tolist() == far.start.tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("trajectory"), ": is no plan.json, need an object with schema, status, "
                                        "primitives, trajectory"),
        (lambda d: d.update(schema=2), ": schema: got 2, need 1"),
        (lambda d: d["trajectory"].pop("pose"), ": trajectory.pose: is missing, need a list"),
        (lambda d: d["trajectory"]["time_s"].pop(),
         ": trajectory: got 31 times and 32 poses, need one pose per time"),
        (lambda d: d["primitives"].append(dict(d["primitives"][0])),
         ": trajectory: has no sample at a switching time of the primitives"),
        (lambda d: d["primitives"][0].update(kind="dance"),
         ": primitives[0].kind: got 'dance', need 'trim' or 'maneuver'"),
        (lambda d: d["trajectory"].update(pose="abc"),
         ": trajectory.pose: got 'abc', need a list"),
    ],
)  # fmt: skip
def test_files_that_are_no_plan(tmp_path, change, message):
    document = plan_to_dict(result_of(word(("ahead", 1.0))))
    change(document)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InvalidScenario) as error:
        load_plan(path)
    assert str(error.value) == f"{path}{message}"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", ":1: not valid JSON: Expecting property name enclosed in double quotes"),
        ("NaN", ": not valid JSON: NaN is no JSON"),
        ("[]", ": is no plan.json, need an object with schema, status, primitives, trajectory"),
    ],
)
def test_files_that_are_no_json(tmp_path, content, message):
    path = tmp_path / "plan.json"
    path.write_text(content)
    with pytest.raises(InvalidScenario) as error:
        load_plan(path)
    assert str(error.value) == f"{path}{message}"
