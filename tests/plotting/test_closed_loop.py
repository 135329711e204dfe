from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting import (
    draw_closed_loop,
    draw_solve_times,
    draw_value,
    save_closed_loop_figure,
)
from maneuver_automaton.plotting.closed_loop import _figure, loop_text
from maneuver_automaton.plotting.closed_loop_track import driven_track, loop_colors
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import simulate
from tests.inertia import unicycle_automaton
from tests.plotting.cases import assert_picture
from tests.plotting.loops import (
    LOOPS,
    empty_loop,
    flight_loop,
    helpless_loop,
    parking_loop,
    pushed_loop,
    straight_loop,
    unfinished_loop,
)
from tests.quickly import quick_are
from tests.search.cases import compiled_only

CAR = {"rectangle_m": [0.5, 0.3]}


def axes():
    return Figure().add_subplot()


@pytest.mark.parametrize("name", quick_are(["parking", "empty", "straight"], LOOPS))
def test_a_page_of_every_kind_of_loop(name, tmp_path):
    save_closed_loop_figure(LOOPS[name](), tmp_path / "loop.png", footprint=CAR)
    assert_picture(tmp_path / "loop.png")


def test_a_trim_that_goes_on_is_drawn_once():
    loop = parking_loop()
    assert len(loop.driven) == 4
    track = driven_track(loop)
    assert [piece.name for piece in track.pieces] == ["clockwise", "straight", "spin", "rest"]
    assert np.allclose(track.end, loop.poses[-1], atol=1e-9)
    assert np.isclose(track.switching_times[-1], loop.times[-1])
    artists = draw_closed_loop(axes(), loop)
    assert len(artists.path.get_segments()) == 2
    assert len(artists.spins.get_segments()) == 1


def test_the_path_is_where_the_vehicle_was():
    loop = straight_loop()
    artists = draw_closed_loop(axes(), loop)
    corners = np.concatenate(artists.path.get_segments())
    assert np.allclose(corners[[0, -1]], loop.poses[[0, -1], :2], atol=1e-9)
    assert len(artists.plans.get_segments()) == len(loop.steps) == 35
    new = [step for step in loop.steps if step.replanned]
    assert len(artists.new_plans.get_segments()) == len(new)
    assert np.allclose(artists.replanned.get_offsets(), [step.pose[:2] for step in new])
    assert artists.jumps.get_segments() == []


def test_scales_are_equal_and_nothing_lies_outside():
    for loop in (straight_loop(), pushed_loop()):
        ax = axes()
        draw_closed_loop(ax, loop, footprint=CAR)
        assert ax.get_aspect() == 1.0
        ax.apply_aspect()
        (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
        for x, y, *_ in [*loop.poses, *(step.plan.end for step in loop.steps)]:
            assert left < x < right
            assert low < y < high


def test_disturbances_are_dotted_and_the_tolerance_is_a_disc():
    loop = pushed_loop()
    artists = draw_closed_loop(axes(), loop)
    assert len(artists.jumps.get_segments()) == len(loop.steps)
    first = artists.jumps.get_segments()[0]
    assert np.allclose(first, [loop.driven[0].end[:2], loop.poses[1, :2]])
    (disc,) = artists.ends.sets
    assert disc.radius == 0.1
    assert artists.legend is not None
    names = [text.get_text() for text in artists.legend.get_texts()]
    assert {"goal tolerance", "disturbance", "replanned", "plan of a step"} <= set(names)


def test_bodies_on_top_of_each_other_are_drawn_once():
    loop = straight_loop()
    crowded = draw_closed_loop(axes(), loop, footprint={"disc_m": 1.0})
    assert len(crowded.bodies.get_paths()) < 10
    sparse = draw_closed_loop(axes(), loop, footprint={"disc_m": 0.001})
    assert len(sparse.bodies.get_paths()) == len(loop.poses)


def test_the_value_falls_by_what_is_spent():
    loop = parking_loop()
    artists = draw_value(axes(), loop)
    both = np.asarray(artists.both.get_ydata())
    assert np.allclose(both, loop.cost)
    assert np.allclose(artists.value.get_ydata(), [*(s.value for s in loop.steps), 0.0])
    assert np.allclose(artists.value.get_xdata(), loop.times)
    assert len(artists.broken.get_offsets()) == 0


def test_replanned_and_disturbed_steps_are_marked():
    loop = pushed_loop()
    artists = draw_value(axes(), loop)
    assert not any(step.violations for step in loop.steps)
    broken = [step for step in loop.steps if step.disturbed]
    assert broken
    assert np.allclose(artists.broken.get_offsets(), [[s.time, s.value] for s in broken])
    new = [step for step in loop.steps if step.replanned]
    assert np.allclose(artists.replanned.get_offsets(), [[s.time, s.value] for s in new])


def test_without_a_plan_the_last_value_is_left_out():
    loop = helpless_loop()
    assert loop.status == "no_plan"
    artists = draw_value(axes(), loop)
    values = np.asarray(artists.value.get_ydata())
    assert np.isnan(values[-1])
    assert np.isfinite(values[:-1]).all()


def test_times_per_step_are_on_whole_decades():
    loop = straight_loop()
    ax = axes()
    artists = draw_solve_times(ax, loop)
    assert ax.get_yscale() == "log"
    assert np.allclose(artists.times.get_ydata(), loop.solve_s)
    assert np.allclose(np.log10(ax.get_ylim()), np.round(np.log10(ax.get_ylim())))


def test_nothing_to_draw_over_time():
    draw_value(axes(), empty_loop())
    draw_solve_times(axes(), empty_loop())


def test_how_a_loop_ended():
    assert loop_text(parking_loop()).startswith("goal reached after 4 steps · 4 s · cost 4.66")
    assert loop_text(unfinished_loop()).startswith("the goal is not reached after 2 steps · 1 s")
    assert loop_text(empty_loop()) == "the start is the goal: no step is needed"
    assert loop_text(helpless_loop()).startswith("recursive feasibility: ")
    inside = (False, False, True, True, True)
    stayed = dataclasses.replace(parking_loop(), inside=inside)
    assert loop_text(stayed).startswith("goal reached after 2 of 4 steps")


def test_names_that_look_like_mathematics_and_many_trims(tmp_path):
    loop = parking_loop()
    trims = tuple(
        Trim(name=f"_$x{k}", body_velocity=[1.0, 0.0, 0.01 * k], control=[1.0, 0.01 * k])
        for k in range(60)
    )
    plan = Plan(loop.poses[0], trims, durations=np.full(60, 1.0 / 60))
    odd = dataclasses.replace(loop, driven=(plan, *loop.driven[1:]))
    save_closed_loop_figure(odd, tmp_path / "loop.png")
    assert_picture(tmp_path / "loop.png")


def test_a_flight_shows_its_altitude():
    loop = flight_loop()
    assert loop.reached
    assert driven_track(loop).climbs
    labels = [ax.get_ylabel() for ax in _figure(loop, footprint=None, look=Look()).axes]
    assert labels == [
        "y [m]",
        "cost",
        "speed [m/s]",
        "turn",
        "climb [m/s]",
        "z [m]",
        "to decide [s]",
    ]


@pytest.mark.slow
@compiled_only
def test_a_loop_with_maneuvers_is_drawn_with_all_it_drove(tmp_path):
    problem = Problem(unicycle_automaton(), [0.0, 0.0, 0.0], [3.0, 0.5, 0.2])
    loop = simulate(problem, step=0.5, time_limit=1.0)
    names = set(driven_track(loop).twists)
    assert names <= set(loop_colors(loop))
    save_closed_loop_figure(loop, tmp_path / "loop.png")
    assert (tmp_path / "loop.png").stat().st_size > 0
