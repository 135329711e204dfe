"""The player in a browser: it shows what the plan says, and nothing goes wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.bounds import Narrowest
from maneuver_automaton.cli import run
from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.fleet import simulate_fleet
from maneuver_automaton.planning import LowerBound, PlanResult, PlanStatus
from maneuver_automaton.problem import Bounds
from tests.fleet.robots import crossing as robots
from tests.plotting.cases import flight_plan, parking_plan, plan_of, result_of, slalom_problem
from tests.plotting.fleets import crossing
from tests.plotting.loops import pushed_loop
from tests.plotting.player.browser import browser, opened, poses

SCENARIOS = Path(__file__).parents[3] / "scenarios"
MILLIMETRE = 1e-3


def parking_result():
    plan = parking_plan()
    other = plan_of(["straight", "spin"], [1.0, 2.0])
    return replace(
        result_of(plan, others=[other]),
        problem=slalom_problem(
            plan,
            footprint=Box([0.5, 0.3]),
            zones=[Zone(shape=Box([1.0, 1.0], [1.0, 0.0]), max_speed=1.0)],
            bounds=Bounds(x=(-3.0, 3.0)),
        ),
        improvements=((0.01, 12.0), (0.2, 9.75)),
        lower_bound=8.0,
        gap=0.18,
        bound=LowerBound(value=8.0, kind="cells", history=((0.005, 5.0), (0.3, 8.0))),
        nodes=np.array([[-1.0, 0.5, 0.0, 1.0], [0.5, 0.5, 1.0, 3.0]]),
    )


def unreachable():
    squares = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]]) + np.zeros((3, 1, 2))
    return PlanResult(
        problem=slalom_problem(parking_plan()),
        status=PlanStatus.UNREACHABLE,
        reason="too narrow",
        reached=squares,
        narrowest=Narrowest(place=(0.5, 0.2), missing=0.1),
    )


def test_the_page_plays_what_was_planned(tmp_path):
    result, loop, flight = parking_result(), pushed_loop(), flight_plan()
    values = {"plan": result, "loop": loop, "flight": flight, "none": unreachable()}
    for name, value in values.items():
        value.player().save(tmp_path / f"{name}.html")
    with browser() as running:
        with opened(running, tmp_path / "plan.html") as page:
            _follows(page, result.plan)
            _is_scrubbed(page, result.plan)
            _has_layers(page)
        with opened(running, tmp_path / "loop.html") as page:
            middle = 0.5 * (loop.times[:-1] + loop.times[1:])
            there = [plan.pose_at(at) for plan, at in zip(loop.driven, middle, strict=True)]
            np.testing.assert_allclose(poses(page, middle), there, atol=MILLIMETRE)
            page.evaluate("player.seek(player.end)")
            assert page.inner_text("#clock").endswith("goal reached")
        with opened(running, tmp_path / "flight.html") as page:
            _follows(page, flight)
            assert page.is_visible("#space")
        with opened(running, tmp_path / "none.html") as page:
            assert "unreachable: too narrow" in page.inner_text("#facts")
            assert page.is_hidden("#transport")
            assert page.locator("#layers input").count() == 1


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_page_of_a_fleet_plays_all_and_picks_one(tmp_path):
    result = crossing()
    result.player(title="Crossing").save(tmp_path / "fleet.html")
    with browser() as running, opened(running, tmp_path / "fleet.html") as page:
        for time in (0.0, 1.2, 3.0, 5.5):
            there = [plan.pose_at(time) for plan in result.plans.values()]
            shown = page.evaluate("time => player.posesAt(time)", time)
            np.testing.assert_allclose(shown[:2], there, atol=MILLIMETRE)
            np.testing.assert_allclose(shown[2], [5.0, 3.0, 0.0], atol=MILLIMETRE)
        assert (page.evaluate("player.begin"), page.evaluate("player.end")) == (0.0, 5.5)
        assert page.evaluate("player.choice") == -1
        assert page.locator("#bar .row").count() == 2
        assert page.locator("#vehicles button").count() == 3
        page.evaluate("player.seek(3)")
        assert page.inner_text("#clock") == "3.00 s · 0 of 3 arrived"
        assert [row[0] for row in page.evaluate("player.valuesAt(3)")] == ["time", "nearest two"]
        _click_on(page, result.plans["back"].pose_at(3.0))
        assert page.evaluate("player.choice") == 1
        box = page.locator("#bar").bounding_box()
        begins = [one.bounding_box()["x"] for one in page.locator("#bar .trim").all()]
        expected = box["x"] + box["width"] * np.array([0.5, 1.5]) / 5.5
        np.testing.assert_allclose(begins, expected, atol=1.0)
        named = {row[0]: row[1] for row in page.evaluate("player.valuesAt(3)")}
        assert (named["vehicle"], named["trim"]) == ("back", "straight")
        assert named.keys() >= {"speed", "turn rate", "clearance", "nearest other"}
        assert dict(page.evaluate("player.valuesAt(0.2)"))["state"] == "has not left"
        _click_on(page, [5.0, 3.0])
        assert dict(page.evaluate("player.valuesAt(3)"))["state"] == "walls enclose the start"
        _click_on(page, [3.5, 4.0])  # nobody
        assert page.evaluate("player.choice") == -1
        for key in ("2", "]", "Escape", "]", "?", "?", "w", "b", "p", "d"):
            page.keyboard.press(key)
        assert "a vehicle; or click it" in page.inner_html("#keys")
        assert "alternatives" not in page.inner_html("#keys")
        page.evaluate("player.seek(player.end)")
        assert page.inner_text("#clock") == "5.50 s · 2 of 3 arrived"


def _click_on(page, pose):
    """Click at a place of the plane."""
    x, y = page.evaluate(
        "([x, y]) => stage.view.toPage([x - data.origin[0], y - data.origin[1]])",
        list(map(float, pose[:2])),
    )
    box = page.locator("#stage").bounding_box()
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.click(box["x"] + x, box["y"] + y)


def _follows(page, plan):
    times = plan.start_time + plan.duration * np.array([0.2, 0.5, 0.9])
    np.testing.assert_allclose(poses(page, times), plan.pose_at(times), rtol=0.0, atol=MILLIMETRE)


def _is_scrubbed(page, plan):
    """Keys, the bar and a script set the time, and what is drawn changes with it."""
    box = page.locator("#bar").bounding_box()
    begins = [one.bounding_box()["x"] for one in page.locator("#bar .trim").all()]
    shares = plan.switching_times[:-1] / plan.duration
    np.testing.assert_allclose(begins, box["x"] + box["width"] * shares, atol=1.0)
    page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 10)
    assert page.evaluate("player.time") == pytest.approx(0.25 * plan.duration, rel=0.01)
    assert page.is_visible("#tip")
    for name in ("trim", "speed", "turn rate", "clearance"):
        assert name in page.inner_text("#tip")
    page.keyboard.press("]")
    assert page.evaluate("player.time") == pytest.approx(plan.switching_times[3])
    page.keyboard.press("Home")
    assert page.evaluate("player.time") == 0.0
    before = page.evaluate("document.getElementById('stage').toDataURL()")
    page.evaluate("player.seek(3.0)")
    assert page.inner_text("#clock") == "3.00 s"
    assert page.evaluate("document.getElementById('stage').toDataURL()") != before
    page.keyboard.press(" ")
    page.wait_for_function("player.time > 3.05")
    page.keyboard.press(" ")


def _has_layers(page):
    """Alternatives, search, theme and zoom do what they say."""
    page.keyboard.press("2")
    assert page.evaluate("player.end") == pytest.approx(3.0)
    page.keyboard.press("1")
    assert page.locator(".card").count() == 2
    page.hover("#search canvas")
    assert "at least" in page.inner_text("#tip")
    theme = page.evaluate("document.documentElement.dataset.theme")
    page.keyboard.press("d")
    assert page.evaluate("document.documentElement.dataset.theme") != theme
    for key in ("+", "f", "w", "b", "?", "?"):
        page.keyboard.press(key)
    assert page.locator("#layers input").count() == 5
    assert page.locator("#limits li").all_inner_texts() == [
        "zone: at most 1 m/s", "bounds of the pose",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_closed_loop_is_played_as_its_file_says(tmp_path):
    file, options = SCENARIOS / "parking_noise.yaml", ["--html", "--no-plot", "--quiet"]
    run(["mpc", str(file), "--out", str(tmp_path), *options])
    steps = json.loads((tmp_path / "closed_loop.json").read_text())["steps"]
    with browser() as running, opened(running, tmp_path / "closed_loop.html") as page:
        shown = poses(page, [step["time_s"] for step in steps])
        np.testing.assert_allclose(shown, [step["pose"] for step in steps], atol=MILLIMETRE)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_page_of_a_fleets_loop_plays_what_was_driven(tmp_path):
    log = simulate_fleet(
        robots(tolerance=0.1), step=0.5, steps=40, first_time_limit=1.0, joins_s={"b": 1.0}
    )
    log.player(title="Loop").save(tmp_path / "loop.html")
    with browser() as running, opened(running, tmp_path / "loop.html") as page:
        for step in (3, 7):
            pieces = [log.pieces_of(name)[step] for name in log.problem.names]
            time = float(log.times[step]) + 0.2
            shown = page.evaluate("time => player.posesAt(time)", time)
            np.testing.assert_allclose(
                shown, [piece.pose_at(time) for piece in pieces], atol=MILLIMETRE
            )
        page.evaluate("player.seek(1.7)")
        clock = page.inner_text("#clock")
        assert clock.startswith("1.70 s · 0 of 2 arrived · step 3 · value ")
        assert [row[0] for row in page.evaluate("player.valuesAt(1.7)")] == ["time", "nearest two"]
