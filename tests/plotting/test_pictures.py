"""Pictures of every kind of result, as files and as figures."""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from maneuver_automaton.collision import Box
from maneuver_automaton.fleet import FleetProblem, plan_fleet, simulate_fleet
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting import Look, draw_plane, figure_of, save_picture
from maneuver_automaton.plotting.cast import cast_of
from maneuver_automaton.plotting.pages import DPI, prepare, write_figure
from maneuver_automaton.problem import Problem
from maneuver_automaton.recording import recording_of
from maneuver_automaton.recording.plans import stated
from tests.fleet import robots
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
from tests.plotting.fleets import crossing, fleet_of, no_answer, row_of
from tests.plotting.loops import (
    pushed_loop,
    straight_loop,
)
from tests.quickly import quick_are

CAR = Box([0.9, 0.5], [0.2, 0.0])
NOBODY = fleet_of([no_answer([0, 0, 0], [1, 0, 0])], names=["a"])


def with_body(plan, body):
    return result_of(plan, problem=Problem(ROBOT, plan.start, plan.end, footprint=body))


def of_body(loop, body):
    return dataclasses.replace(loop, problem=dataclasses.replace(loop.problem, footprint=body))


def drawn(result):
    ax = Figure().add_subplot()
    return ax, draw_plane(ax, result)


def legend_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def texts_of(figure):
    return [text.get_text() for text in figure.texts]


def boxes_of(figure):
    """Places of all axes with their labels, and of the legend, once it is laid out [px]."""
    figure.canvas.draw()
    inner = [ax.get_tightbbox() for ax in figure.axes]
    return inner, [legend.get_window_extent() for legend in figure.legends]


class TestFiles:
    @pytest.mark.parametrize(
        "plan",
        [
            parking_plan(),
            plan_of([], []),
            plan_of(["straight", "clockwise"] * 40, [0.5] * 80),
        ],
    )
    def test_plans_are_written(self, plan, tmp_path):
        save_picture(with_body(plan, CAR), tmp_path / "plan.png")
        assert_picture(tmp_path / "plan.png")

    @pytest.mark.parametrize("result", [row_of(30), NOBODY])
    def test_any_number_is_written(self, tmp_path, result):
        save_picture(result, tmp_path / "fleet.png")
        assert_picture(tmp_path / "fleet.png")

    @pytest.mark.parametrize("plan", [plan_of_trims(50), flight_plan()])
    def test_files_are_drawn_without_anything_else(self, plan, tmp_path):
        save_picture(stated(document_of(plan), plan), tmp_path / "plan.png")
        assert_picture(tmp_path / "plan.png")

    def test_a_file_without_a_plan_is_drawn(self, tmp_path):
        document = document_of(parking_plan())
        document |= {"status": "no_plan", "reason": "all tried", "cost": None}
        save_picture(stated(document, None), tmp_path / "plan.png")
        assert_picture(tmp_path / "plan.png")

    @pytest.mark.slow
    def test_the_same_result_gives_the_same_bytes_and_text_stays_text(self, tmp_path):
        result = result_of(parking_plan(), problem=slalom_problem(parking_plan()))
        for name in ("plan.pdf", "again.pdf", "plan.svg", "plan.png", "again.png"):
            save_picture(result, tmp_path / name)
        for ending in ("pdf", "png"):
            one, other = (tmp_path / f"{name}.{ending}" for name in ("plan", "again"))
            assert one.read_bytes() == other.read_bytes()
        pdf = (tmp_path / "plan.pdf").read_bytes()
        assert pdf.startswith(b"%PDF")
        assert b"/CIDFontType2" in pdf  # a Type 42 font, in the words of PDF
        assert b"/Type3" not in pdf
        assert "turn rate [rad/s]</text>" in (tmp_path / "plan.svg").read_text(encoding="utf-8")

    def test_an_old_file_is_replaced_whole_or_not_at_all(self, tmp_path):
        path = tmp_path / "plan.png"
        path.write_bytes(b"old")
        save_picture(result_of(parking_plan()), path)
        assert_picture(path)
        other = tmp_path / "plan.nonsense"
        other.write_bytes(b"old")
        with pytest.raises(ValueError, match="nonsense"):
            save_picture(result_of(parking_plan()), other)
        assert other.read_bytes() == b"old"

    def test_names_in_any_script_raise_no_warning(self, tmp_path):
        plan = parking_plan()
        trims = tuple(
            dataclasses.replace(trim, name=name)
            for trim, name in zip(plan.trims, ["日本語", "$x_1", "_hidden", "a" * 200], strict=True)
        )
        save_picture(result_of(dataclasses.replace(plan, trims=trims)), tmp_path / "plan.png")
        assert_picture(tmp_path / "plan.png")

    def test_what_is_no_result_or_no_view_is_refused(self):
        with pytest.raises(TypeError, match="recording: got int"):
            figure_of(3)
        with pytest.raises(ValueError, match="need one of plane, space, alternatives"):
            figure_of(parking_plan(), view="aside")


class TestPages:
    @pytest.mark.parametrize(
        "look",
        quick_are(
            [Look(size=(3.5, None), style="paper"), Look(size=(9.0, 2.6))],
            [
                Look(size=(3.5, None), style="paper"),
                Look(size=(7.16, 4.0), style="paper"),
                Look(size=(12.0, 6.0), title="Parking"),
                Look(size=(9.0, 2.6)),  # nothing has room but the plane
                Look(),
            ],
        ),
    )
    @pytest.mark.parametrize("make", [pushed_loop, lambda: row_of(20)])
    def test_a_page_has_its_size_and_nothing_overlaps(self, make, look, tmp_path):
        save_picture(make(), tmp_path / "plan.png", look=look)
        assert_picture(tmp_path / "plan.png")
        with Image.open(tmp_path / "plan.png") as image:
            wide, high = image.size
        assert wide == pytest.approx(DPI * look.width, abs=1.0)
        if look.height is not None:
            assert high == pytest.approx(DPI * look.height, abs=2.0)
        figure = figure_of(make(), look=look)
        axes, legends = boxes_of(figure)
        inner = [box.padded(-1.0) for box in (*axes, *legends)]
        assert not any(one.overlaps(other) for one, other in combinations(inner, 2))
        page = figure.bbox
        for box in (*axes, *legends):
            assert page.x0 <= box.x0 < box.x1 <= page.x1
            assert page.y0 <= box.y0 < box.y1 <= page.y1

    @pytest.mark.parametrize("look", [Look(), Look(size=(9.0, 2.6))])  # with panels, and without
    @pytest.mark.parametrize("make", [parking_plan, pushed_loop])
    def test_axes_made_beforehand_change_no_picture(self, make, look, tmp_path):
        pictures = []
        for path in (tmp_path / "plan.png", tmp_path / "prepared.png"):
            save_picture(make(), path, look=look)
            with Image.open(path) as image:
                pictures.append(np.asarray(image, dtype=int))
            prepare()  # for the next one
        figure_of(parking_plan())  # has what was prepared last
        assert np.abs(pictures[0] - pictures[1]).max() <= 2  # of 255, as from run to run

    def test_the_title_comes_first_and_stands_alone_in_a_paper(self):
        def said(look):
            return texts_of(figure_of(result_of(parking_plan()), look=look))

        assert said(Look(title="Parking"))[0] == "Parking"
        assert said(Look(title="Parking"))[1].startswith("cost 9.75")
        assert said(Look(title="Parking", style="paper")) == ["Parking"]
        assert said(Look(style="paper")) == []

    @pytest.mark.parametrize(
        ("wrong", "message"),
        [
            ({"style": "poster"}, "need one of screen, paper"),
            ({"size": (0.5, None)}, "size: got 0.5 in, need from 2.5 to 40 in"),
            ({"size": (5.0, float("nan"))}, "size: got nan in"),
        ],
    )
    def test_a_look_that_cannot_be_is_refused(self, wrong, message):
        with pytest.raises(ValueError, match=message):
            Look(**wrong)

    def test_a_flat_scene_takes_little_height_of_a_column(self):
        look = Look(size=(3.5, None), style="paper")
        figure = figure_of(with_body(plan_of(["straight"], [20.0]), CAR), look=look)
        axes, _ = boxes_of(figure)
        plane, *over_time = (box.height / figure.dpi for box in axes)
        assert plane < 2.0 < plane + min(over_time)

    def test_a_png_has_the_pixels_that_were_drawn_and_their_density(self, tmp_path):
        figure = figure_of(parking_plan())
        write_figure(figure, tmp_path / "plan.png")
        with Image.open(tmp_path / "plan.png") as read:
            assert read.info["dpi"] == pytest.approx((DPI, DPI), abs=0.01)
            assert np.array_equal(read, np.asarray(figure.canvas.buffer_rgba())[..., :3])

    def test_a_polished_motion_is_never_called_polished_alone(self):
        plan = parking_plan()
        trims = tuple(dataclasses.replace(trim, name="polished") for trim in plan.trims)
        figure = figure_of(result_of(dataclasses.replace(plan, trims=trims)))
        words = [*texts_of(figure), *legend_of(figure)]
        assert any("polished motion" in word for word in words)
        assert "polished" not in words


class TestLoops:
    @pytest.mark.parametrize("make", [straight_loop, pushed_loop])
    def test_scales_are_equal_and_nothing_lies_outside(self, make):
        loop = of_body(make(), Box([0.5, 0.3]))
        ax, _ = drawn(loop)
        assert ax.get_aspect() == 1.0
        ax.apply_aspect()
        (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
        for x, y, *_ in [*loop.poses, *(step.plan.end for step in loop.steps)]:
            assert left < x < right
            assert low < y < high


class TestFleets:
    def test_paths_bodies_and_ends_are_where_the_plans_are(self):
        result = crossing()
        ax, artists = drawn(result)
        assert ax.get_aspect() == 1.0
        there, back = result.plans["there"], result.plans["back"]
        lines = artists["paths"].get_segments()
        assert len(lines) == 2
        for line, plan in zip(lines, (there, back), strict=True):
            np.testing.assert_allclose(line[[0, -1]], [plan.start[:2], plan.end[:2]], atol=1e-9)
        for what, pose in (("goals", there.end), ("starts", there.start)):
            corners = artists[what].get_paths()[0].vertices[:4]
            np.testing.assert_allclose(corners, SE2(pose).act(Box([0.6, 0.4]).corners), atol=1e-9)
        assert (artists["starts"].get_facecolor()[:, 3:] == 0.0).all()
        assert (artists["goals"].get_facecolor()[:, 3] == 1.0).all()
        times = cast_of(recording_of(result)).times
        middles = [path.vertices[:-1].mean(axis=0) for path in artists["bodies"].get_paths()]
        expected = [there.pose_at(t)[:2] for t in times if 0.0 < t < 4.0]
        expected += [back.pose_at(t)[:2] for t in times if 0.5 < t < 5.5]
        np.testing.assert_allclose(middles, expected, atol=1e-9)


def fleet_loop(**more):
    fleet = robots.crossing(tolerance=0.1, margin=0.2)
    first = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    return simulate_fleet(fleet, step=0.5, steps=40, first=first, **more)


@pytest.fixture(scope="module")
def broken():
    return fleet_loop(breaks_s={"a": 2.0}, joins_s={"b": 1.0})


class TestFleetLoops:
    def test_values_fall_by_what_is_spent(self):
        recording = recording_of(fleet_loop())
        curves = {(one.label, one.mover): one.value for one in recording.curves}
        values, costs = curves["value", ""], curves["spent", ""]
        assert (np.diff(values + costs) <= 1e-6).all()
        assert values[-1] == 0.0
        np.testing.assert_allclose(curves["value", "a"] + curves["value", "b"], values, atol=1e-9)
        assert not any(one.jumps for one in cast_of(recording).actors)

    def test_who_joins_is_not_there_before(self, broken):
        a, b = cast_of(recording_of(broken)).actors
        assert not b.mover.is_there(0.5)
        assert b.mover.is_there(1.0)
        assert b.bodies_at(0.5) == []
        assert not a.mover.reached

    def test_nobody_comes_in_and_one_alone(self):
        log = fleet_loop(joins_s={"b": 1e6})
        assert "b: it was never let in" in texts_of(figure_of(log))
        fleet = robots.crossing(tolerance=0.1)
        alone = simulate_fleet(FleetProblem(fleet.problems[:1]), step=0.5, first_time_limit=1.0)
        assert "distance [m]" not in [ax.get_ylabel() for ax in figure_of(alone).axes]
