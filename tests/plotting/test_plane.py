from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from maneuver_automaton.collision import Box, Disc, Zone
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting import draw_plane, trim_colors
from maneuver_automaton.plotting.colors import GREY, INK
from maneuver_automaton.problem import Bounds, Goal, Problem
from tests.plotting.cases import (
    ROBOT,
    parking_plan,
    plan_of,
    plan_of_trims,
    result_of,
    slalom_problem,
)


def drawn(plan, *, problem=None, footprint=None, legend=True):
    """Axes and artists of a plan, of a problem or of one whose body is the footprint."""
    ax = Figure().add_subplot()
    if footprint is not None:
        problem = Problem(ROBOT, plan.start, plan.end, footprint=footprint)
    result = plan if problem is None else result_of(plan, problem=problem)
    return ax, draw_plane(ax, result, legend=legend)


def outlines(collection):
    return [path.vertices for path in collection.get_paths()]


def names(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_the_path_has_a_segment_per_trim_that_drives():
    plan = parking_plan()
    ax, artists = drawn(plan)
    first, second = artists["path"].get_segments()
    np.testing.assert_allclose(first[[0, -1]], plan.switching_poses[[1, 2], :2], atol=1e-12)
    np.testing.assert_allclose(second[[0, -1]], plan.switching_poses[[2, 3], :2], atol=1e-12)
    np.testing.assert_array_equal(artists["start"].get_offsets()[0], plan.start[:2])
    np.testing.assert_allclose(artists["goal 0"].get_offsets()[0], plan.end[:2])
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")


def test_a_trim_has_its_colour_everywhere():
    plan = plan_of(["spin", "straight", "clockwise", "straight"], [1.0, 1.0, 1.0, 1.0])
    colors = trim_colors({trim.name: trim.body_velocity for trim in plan.trims})
    ax, artists = drawn(plan)
    path = [to_rgb(color) for color in artists["path"].get_colors()]
    assert path == [colors["straight"], colors["clockwise"], colors["straight"]]
    assert to_rgb(artists["spins"].get_colors()[0]) == colors["spin"]
    handles = ax.get_legend().legend_handles
    assert [to_rgb(handle.get_color()) for handle in handles[:3]] == list(colors.values())


def test_the_legend_names_the_trims_of_the_plan_once():
    ax, _ = drawn(plan_of(["straight", "spin", "straight", "rest"], [1.0, 1.0, 1.0, 1.0]))
    assert names(ax) == ["straight", "spin", "rest", "start", "goal"]
    assert drawn(parking_plan(), legend=False)[0].get_legend() is None


def test_turns_on_the_spot_are_arcs_about_their_place():
    plan = plan_of(["straight", "spin", "spin"], [2.0, 1.0, 3.0])
    _, artists = drawn(plan)
    first, second = artists["spins"].get_segments()
    for arc, begin, turn in ((first, 0.0, 1.0), (second, 1.0, 3.0)):
        spokes = arc - plan.end[:2]
        angles = np.unwrap(np.arctan2(spokes[:, 1], spokes[:, 0]))
        assert angles[0] == pytest.approx(begin)
        assert angles[-1] - angles[0] == pytest.approx(turn)
    radii = [np.linalg.norm(arc[0] - plan.end[:2]) for arc in (first, second)]
    assert radii[1] > 1.2 * radii[0]  # they do not cover each other


@given(by=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-3.0, 3.0)))
@settings(max_examples=10)
def test_a_moved_problem_has_a_moved_picture(by):
    plan, move = parking_plan(), SE2(np.array(by))
    problem = slalom_problem(plan)
    problem = replace(problem, obstacles=[o for o in problem.obstacles if not _is_disc(o)])
    _, here = drawn(plan, problem=problem)
    _, there = drawn(plan.moved(move), problem=problem.moved(move))
    pairs = [(here["map 0"], there["map 0"])]
    pairs += [(here["obstacles"], there["obstacles"])]
    pairs += [(here["traffic"], there["traffic"])]
    pairs += [(here["moments"], there["moments"])]
    for before, after in pairs:
        for path, moved in zip(before.get_paths(), after.get_paths(), strict=True):
            np.testing.assert_allclose(move.act(path.vertices), moved.vertices, atol=1e-9)


def _is_disc(obstacle):
    """Its path is round, but its points do not turn with it."""
    return isinstance(getattr(obstacle, "shape", None), Disc)


def test_the_problem_gives_body_goals_and_obstacles():
    plan = plan_of(["straight"], [2.0])
    goals = [
        Goal(pose=[9.0, 9.0, 0.0], tolerance_m=0.5),
        Goal(pose=plan.end),
        Goal(pose=[-3.0, 0.0, 0.0], free_heading=True),
    ]
    ax, artists = drawn(plan, problem=slalom_problem(plan, goal=goals))
    assert len(outlines(artists["bodies"])) == 2
    assert {"any heading 2", "tolerance 0"} <= artists.keys()
    edges = [to_rgb(artists[f"goal {k}"].get_edgecolor()[0]) for k in range(3)]
    assert edges == [GREY, INK, GREY]  # the one that is reached stands out
    assert len(outlines(artists["wanted"])) == 1  # not reached, with a heading
    assert artists["headings"].N == 3  # of the start, and of the goals with a heading
    assert len(artists["obstacles"].get_paths()) == 3
    shown = names(ax)
    for name in ("any heading", "other goal", "goal tolerance", "swept by the body", "obstacle"):
        assert name in shown
    assert shown[-5:] == ["moving, at 0 s", *(f"at {t:g} s" for t in (0.5, 1.0, 1.5, 2.0))]


def test_the_body_and_what_moves_grow_darker_in_colours_of_their_own():
    plan = parking_plan()
    _, artists = drawn(plan, problem=slalom_problem(plan))
    bodies = artists["moments"].get_facecolor()[:, :3]
    moving = artists["traffic"].get_facecolor()[:, :3]
    assert (np.diff(bodies.sum(axis=1)) < 0.0).all()
    assert (np.diff(moving.sum(axis=1)) < 0.0).all()
    assert np.linalg.norm(bodies[:, None] - moving, axis=-1).min() > 0.15
    assert len(np.unique(bodies, axis=0)) == len(bodies) == 5
    middles = [outline[:4].mean(axis=0) for outline in outlines(artists["moments"])]
    np.testing.assert_allclose(middles, plan.pose_at([0, 2, 4, 6, 8])[:, :2], atol=1e-3)


@pytest.mark.parametrize(
    "plan",
    [
        plan_of([], []),
        plan_of(["rest"], [8.0]),
        plan_of(["spin"], [9.0]),
        plan_of(["straight"], [1e-6]),
        plan_of(["straight"], [1e4], start=(5e5, 4e6, 1.0)),
        plan_of(["straight", "rest"], [1.0, 0.0]),
    ],
)
def test_small_and_still_plans_are_drawn(plan):
    ax, artists = drawn(plan)
    ax.figure.canvas.draw()
    limits = np.array([*ax.get_xlim(), *ax.get_ylim()])
    assert np.isfinite(limits).all()
    assert limits[0] < plan.start[0] < limits[1]
    assert limits[2] < plan.start[1] < limits[3]
    assert np.isfinite(artists["goal 0"].get_offsets()).all()


def test_far_away_axes_are_counted_from_a_round_number():
    ax, _ = drawn(plan_of(["straight"], [10.0], start=(5e5, 4000012.0, 1.0)))
    ax.figure.canvas.draw()
    assert ax.get_xlabel() == "x [m] from 500000"
    assert ax.get_ylabel() == "y [m] from 4000000"
    assert all(len(tick.get_text()) < 5 for tick in ax.get_yticklabels())


def test_names_are_shown_as_they_are():
    plan = plan_of_trims(2)
    named = [
        type(trim)(name=name, body_velocity=trim.body_velocity, control=trim.control)
        for trim, name in zip(plan.trims, ["$x_1", "_hidden"], strict=True)
    ]
    ax, _ = drawn(type(plan)(plan.start, tuple(named), durations=plan.durations))
    ax.figure.canvas.draw()
    assert names(ax)[:2] == ["$x_1", "_hidden"]


def test_the_legend_leaves_out_what_takes_next_to_no_time():
    ax, artists = drawn(plan_of(["spin", "straight", "rest"], [1e-3, 4.0, 1e-3]))
    assert names(ax) == ["straight", "start", "goal"]
    assert "still o" not in artists  # no ring for a rest of a millisecond


def test_zones_and_bounds_are_drawn_and_named():
    plan = parking_plan()
    slow = [Zone(shape=Box([0.4, 0.4], [x, 0.0]), max_speed=0.5) for x in (0.0, 0.8)]
    onwards = Zone(shape=Disc(0.3, [0.5, 1.0]), reverse=False)
    bounds = Bounds(x=(-1.2, 1.4), y=(-0.4, 2.2))
    problem = Problem(ROBOT, plan.start, plan.end, zones=[*slow, onwards], bounds=bounds)
    ax, artists = drawn(plan, problem=problem)
    assert [len(artists[f"zone {k}"].get_paths()) for k in range(2)] == [2, 1]
    assert len(artists["bounds"].get_segments()) == 4
    assert names(ax)[-3:] == [
        "zone: at most 0.5 m/s", "zone: forwards only", "bounds of the pose",
    ]  # fmt: skip
    assert ax.get_xlim()[0] <= -1.2
    assert ax.get_ylim()[1] >= 2.2
