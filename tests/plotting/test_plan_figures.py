from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.plotting import (
    save_alternatives_figure,
    save_plan_figure,
    save_plan_file_figure,
)
from maneuver_automaton.plotting.labels import word_text
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.plan_figures import plan_figure
from maneuver_automaton.problem import Goal, Problem
from tests.plotting.cases import (
    ROBOT,
    assert_picture,
    document_of,
    flight_plan,
    parking_plan,
    plan_of,
    plan_of_trims,
    result_of,
    slalom_problem,
)
from tests.quickly import quick_are

CAR = {"rectangle_m": [0.9, 0.5], "reference_m": [-0.2, 0.0]}


@pytest.mark.parametrize("footprint", quick_are([CAR], [None, CAR, [{"disc_m": 0.2}, CAR]]))
@pytest.mark.parametrize(
    "plan",
    [
        parking_plan(),
        plan_of([], []),
        plan_of(["rest"], [8.0]),
        plan_of(["spin"], [2.0]),
        plan_of_trims(12),
        plan_of(["straight", "clockwise"] * 40, [0.5] * 80),
    ],
)
def test_plans_are_written(plan, footprint, tmp_path):
    save_plan_figure(result_of(plan), tmp_path / "plan.png", footprint=footprint)
    assert_picture(tmp_path / "plan.png")


def test_a_result_without_a_plan_is_written(tmp_path):
    result = PlanResult(
        problem=Problem(ROBOT, [0, 0, 0], [3, 1, 0]),
        status=PlanStatus.OUT_OF_BUDGET,
        reason="no plan within 5 s",
    )
    save_plan_figure(result, tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")
    with pytest.raises(ValueError, match="holds no plan: no plan within 5 s"):
        save_alternatives_figure(result, tmp_path / "alternatives.png")


def test_a_goal_of_free_heading_is_written(tmp_path):
    plan = parking_plan()
    goal = Goal(pose=np.array([*plan.end[:2], 99.0]), free_heading=True)
    problem = Problem(ROBOT, plan.start, goal)
    result = dataclasses.replace(result_of(plan), problem=problem)
    save_plan_figure(result, tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")


@pytest.mark.parametrize("goal", ["reached", "several", "free heading"])
def test_scenes_are_written(goal, tmp_path):
    plan = parking_plan()
    goals = {
        "reached": plan.end,
        "several": [Goal(pose=plan.end, tolerance_m=0.1), Goal(pose=[2.0, 0.0, 1.0])],
        "free heading": Goal(pose=plan.end, free_heading=True),
    }
    problem = slalom_problem(plan, goal=goals[goal])
    result = dataclasses.replace(result_of(plan), problem=problem, clearance_m=0.25)
    save_plan_figure(result, tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")


def test_a_scene_without_a_plan_is_written(tmp_path):
    result = PlanResult(
        problem=slalom_problem(parking_plan()),
        status=PlanStatus.GOAL_BLOCKED,
        reason="at the goal the vehicle touches obstacle 1",
    )
    save_plan_figure(result, tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")


@pytest.mark.slow
@pytest.mark.parametrize("columns", [3, 4])
def test_expanded_nodes_are_drawn_on_request(columns, tmp_path):
    nodes = np.random.default_rng(1).normal(size=(200, columns))
    save_plan_figure(result_of(parking_plan()), tmp_path / "plan.png", nodes=nodes)
    assert_picture(tmp_path / "plan.png")
    with pytest.raises(ValueError, match=r"nodes: got shape \(200, 2\), need 3 or 4 components"):
        save_plan_figure(result_of(parking_plan()), tmp_path / "plan.png", nodes=nodes[:, :2])


@pytest.mark.slow
def test_the_same_result_gives_the_same_bytes(tmp_path):
    plan = parking_plan()
    result = dataclasses.replace(result_of(plan), problem=slalom_problem(plan))
    for name in ("one.png", "two.png"):
        save_plan_figure(result, tmp_path / name)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()


@pytest.mark.parametrize("plan", [parking_plan(), plan_of_trims(50), flight_plan()])
def test_files_are_drawn_without_anything_else(plan, tmp_path):
    save_plan_file_figure(document_of(plan), tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")


def test_a_file_without_a_plan_is_drawn(tmp_path):
    document = document_of(parking_plan())
    document |= {"status": "no_plan", "reason": "all tried", "cost": None, "terminal_error": None}
    document["trajectory"] = {key: [] for key in document["trajectory"]}
    save_plan_file_figure(document, tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")


@pytest.mark.slow
@pytest.mark.parametrize("count", [0, 1, 12])
def test_alternatives_are_written(count, tmp_path):
    others = [plan_of(["spin", "straight", "spin"], [0.5 + 0.2 * k, 1, 1]) for k in range(count)]
    result = result_of(parking_plan(), others=others)
    save_alternatives_figure(result, tmp_path / "alternatives.png", footprint={"disc_m": 0.1})
    assert_picture(tmp_path / "alternatives.png")


@pytest.mark.slow
def test_the_ending_chooses_the_format_and_text_stays_text(tmp_path):
    for name in ("plan.pdf", "again.pdf", "plan.svg"):
        save_plan_figure(result_of(parking_plan()), tmp_path / name)
    pdf = (tmp_path / "plan.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/CIDFontType2" in pdf  # a Type 42 font, in the words of PDF
    assert b"/Type3" not in pdf
    assert pdf == (tmp_path / "again.pdf").read_bytes()
    assert "turn rate [rad/s]</text>" in (tmp_path / "plan.svg").read_text(encoding="utf-8")


def test_a_polished_motion_is_never_called_polished_alone():
    plan = parking_plan()
    trims = tuple(dataclasses.replace(trim, name="polished") for trim in plan.trims)
    figure = plan_figure(result_of(dataclasses.replace(plan, trims=trims)))
    words = [text.get_text() for text in (*figure.texts, *figure.legends[0].get_texts())]
    assert any("polished motion" in word for word in words)
    assert "polished" not in words


def test_an_old_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "plan.png"
    path.write_bytes(b"old")
    save_plan_figure(result_of(parking_plan()), path)
    assert_picture(path)
    other = tmp_path / "plan.nonsense"
    other.write_bytes(b"old")
    with pytest.raises(ValueError, match="nonsense"):
        save_plan_figure(result_of(parking_plan()), other)
    assert other.read_bytes() == b"old"


def test_names_in_any_script_raise_no_warning(tmp_path):
    plan = parking_plan()
    trims = tuple(
        dataclasses.replace(trim, name=name)
        for trim, name in zip(plan.trims, ["日本語", "$x_1", "_hidden", "a" * 200], strict=True)
    )
    save_plan_figure(result_of(dataclasses.replace(plan, trims=trims)), tmp_path / "plan.png")
    assert_picture(tmp_path / "plan.png")


@pytest.mark.parametrize("length", [1, 4, 12, 200])
def test_words_keep_within_their_lines(length):
    text = word_text(["anticlockwise", "straight"] * length, width=100, lines=2)
    assert text.count("\n") <= 1
    assert all(len(line) <= 100 for line in text.split("\n"))


def test_a_flat_scene_takes_little_height_of_a_column():
    look = Look(size=(3.5, None), style="paper")
    figure = plan_figure(result_of(plan_of(["straight"], [20.0])), footprint=CAR, look=look)
    width, height = figure.get_size_inches()
    plane, *over_time = (ax.get_position().height * height for ax in figure.axes)
    assert width == 3.5
    assert plane < 1.1 < min(over_time)
    (legend,) = figure.legends
    box = legend.get_window_extent().transformed(figure.transFigure.inverted())
    lowest = min(
        ax.get_tightbbox().transformed(figure.transFigure.inverted()).y0 for ax in figure.axes
    )
    assert 0.0 <= box.x0 < box.x1 <= 1.0
    assert 0.0 <= box.y0 < box.y1 <= lowest
