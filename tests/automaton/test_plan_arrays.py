"""A plan as arrays and as CSV: the rows are those of the plan, whatever the vehicle."""

from __future__ import annotations

import csv
import itertools
import sys

import numpy as np
import pytest

import maneuver_automaton as ma

CAR = ma.SecondOrderCar(wheelbase=2.5, max_speed=4.0, max_acceleration=2.0, max_steering=0.6,
                        max_steering_rate=0.8)  # fmt: skip
LIBRARY = ma.Automaton.of_model(CAR, {"speed": [0.0, 2.0], "steering": [-0.3, 0.0, 0.3]})


def drive():
    """From rest around a bend, in the words of a plan: maneuvers and trims by turns."""
    course = {(m.source, m.target): m for m in LIBRARY.maneuvers}
    trims = [
        LIBRARY.trims[LIBRARY.rest],
        LIBRARY["speed 2, steering 0"],
        LIBRARY["speed 2, steering 0.3"],
    ]
    between = [course[a.name, b.name] for a, b in itertools.pairwise(trims)]
    return ma.Plan([1.0, 2.0, 0.5], trims, durations=[0.0, 1.5, 2.0], maneuvers=between,
                   start_time=10.0)  # fmt: skip


PLAN = drive()


@pytest.mark.parametrize("step", [None, 0.1, 7.0])
def test_rows_are_those_of_the_plan(step):
    rows = PLAN.as_arrays(step=step, model=CAR)
    assert rows.time[0] == 10.0
    assert rows.time[-1] == PLAN.switching_times[-1]
    np.testing.assert_allclose(rows.pose, PLAN.pose_at(rows.time), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(rows.control[:-1], PLAN.control_at(rows.time[:-1]))
    np.testing.assert_allclose(
        rows.twist, CAR.body_velocity(rows.reduced_state, rows.control), rtol=0, atol=1e-9
    )
    if step is not None:
        np.testing.assert_allclose(np.diff(rows.time)[:-1], step)
    assert set(rows.primitive) <= set(PLAN.word)
    assert rows.primitive[0] == PLAN.word[0]
    assert rows.primitive[-1] == PLAN.word[-1]


def test_twists_without_a_model_are_the_mean_from_row_to_row():
    mean = PLAN.as_arrays(step=0.01).twist
    exact = PLAN.as_arrays(step=0.01, model=CAR).twist
    np.testing.assert_allclose(mean, exact, atol=0.05)


def test_a_plan_of_nothing_is_one_row():
    rows = ma.Plan([1, 2, 3], (), durations=[]).as_arrays(step=1.0)
    assert rows.pose.tolist() == [[1.0, 2.0, 3.0]]
    assert rows.primitive.tolist() == [""]


def test_csv_reads_back_to_the_last_bit(tmp_path):
    ma.save_csv(PLAN, tmp_path / "plan.csv", step=0.5, model=CAR)
    with (tmp_path / "plan.csv").open(newline="") as stream:
        header, *lines = csv.reader(stream)
    assert header == [
        "time_s", "x_m", "y_m", "heading_rad", "v_x_m_s", "v_y_m_s", "turn_rate_rad_s",
        *(f"state_{name}" for name in CAR.reduced_names),
        *(f"control_{name}" for name in CAR.control_names), "arc_length_m", "curvature_1_m",
        "steering_rad", "acceleration_m_s2", "lateral_acceleration_m_s2", "jerk_m_s3",
        "lateral_jerk_m_s3", "primitive",
    ]  # fmt: skip
    rows = PLAN.as_arrays(step=0.5, model=CAR)
    numbers = np.array([[float(cell) for cell in line[:-1]] for line in lines])
    np.testing.assert_array_equal(numbers[:, 1:4], rows.pose)
    assert [line[-1] for line in lines] == rows.primitive.tolist()  # names hold commas


def test_a_result_brings_its_model_to_the_csv(tmp_path):
    robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    result = ma.plan(ma.Problem(robot, [0, 0, 0], [1, 0, 0]))
    ma.save_csv(result, tmp_path / "plan.csv")
    assert (
        (tmp_path / "plan.csv")
        .read_text()
        .splitlines()[0]
        .endswith(
            ",control_speed,control_turn_rate,arc_length_m,curvature_1_m,"
            "lateral_acceleration_m_s2,primitive"
        )
    )
    blocked = ma.plan(ma.Problem(robot, [0, 0, 0], [1, 0, 0], obstacles=ma.Disc(0.2)))
    with pytest.raises(ValueError, match="the result has no plan to write: at the start "):
        ma.save_csv(blocked, tmp_path / "none.csv")


def test_frames_are_of_pandas_where_it_is(monkeypatch):
    class Pandas:
        DataFrame = dict

    monkeypatch.setitem(sys.modules, "pandas", Pandas)
    assert list(PLAN.to_frame(step=1.0))[:4] == ["time_s", "x_m", "y_m", "heading_rad"]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError) as error:
        PLAN.to_frame()
    assert str(error.value) == (
        "to_frame: pandas is not installed; need `pip install 'maneuver-automaton[pandas]'`, or "
        "as_arrays or save_csv, which do without"
    )


def test_a_step_is_positive():
    with pytest.raises(ValueError) as error:
        PLAN.as_arrays(step=0.0)
    assert str(error.value) == "as_arrays: step must be positive, got 0.0 s"
