from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.analysis.growth import growth_bound, ring_poses
from maneuver_automaton.analysis.stability import certified_horizon
from maneuver_automaton.plotting.stability import (
    CertificateCurve,
    DrivenLoop,
    draw_growth,
    draw_indices,
    draw_loops,
    save_stability_figure,
)
from maneuver_automaton.receding_horizon.unconstrained_loop import simulate_unconstrained
from tests.plotting.cases import assert_picture
from tests.receding_horizon.unconstrained_cases import MIXED, PARKING, QUADRATIC, even, problem_of


@pytest.fixture(scope="module")
def loops():
    problems = {
        name: problem_of(even(5), cost, intervals=4, goal=[5.0, 5.0, 0.0])
        for name, cost in (("mixed", MIXED), ("quadratic", QUADRATIC))
    }
    start = np.array(PARKING) + np.array([5.0, 5.0, 0.0])
    return {
        name: DrivenLoop(problem=p, loop=simulate_unconstrained(p, start, steps=8))
        for name, p in problems.items()
    }


@pytest.fixture(scope="module")
def curves():
    bound = growth_bound(
        even(5),
        MIXED,
        poses=ring_poses(MIXED, levels=[0.5], parts=2),
        times=np.arange(1, 31) / 5.0,
    )
    return {"words": CertificateCurve(certificate=certified_horizon(bound, step=0.5))}


def test_a_track_goes_through_the_poses_of_its_loop(loops):
    times, poses = loops["mixed"].track()
    there = loops["mixed"].loop.poses - [5.0, 5.0, 0.0]
    np.testing.assert_allclose(poses[::12], there, atol=1e-12)
    np.testing.assert_allclose(times[::12], 0.5 * np.arange(len(there)), atol=1e-12)


def test_paths_are_drawn_to_scale(loops):
    ax = Figure().add_subplot()
    lines = draw_loops(ax, loops)
    assert len(lines) == 2
    assert ax.get_aspect() == 1.0
    assert lines[0].get_xydata()[0].tolist() == pytest.approx([0.0, 1.0])


def test_growth_starts_below_resting(curves):
    ax = Figure().add_subplot()
    (line,) = draw_growth(ax, curves)
    x, y = line.get_data()
    assert (np.asarray(y) <= np.asarray(x) * (1 + 1e-9)).all()


def test_the_least_certified_horizon_and_what_was_measured_are_marked(curves):
    ax = Figure().add_subplot()
    draw_indices(ax, curves, {"words": [(2.0, 0.5)]})
    markers = {line.get_marker(): line for line in ax.lines}
    assert markers["o"].get_xdata()[0] == curves["words"].certificate.horizon
    assert markers["x"].get_xydata().tolist() == [[2.0, 0.5]]


def test_the_figure_is_written(loops, curves, tmp_path):
    target = tmp_path / "stability.png"
    save_stability_figure(target, loops, curves, measured={"words": [(2.0, 0.5)]})
    assert_picture(target)


def test_wrong_input_is_named(loops, curves, tmp_path):
    with pytest.raises(ValueError) as caught:
        save_stability_figure(tmp_path / "x.png", {}, curves)
    assert str(caught.value) == "loops: got 0, need 1 to 8"
    with pytest.raises(ValueError) as caught:
        save_stability_figure(tmp_path / "x.png", loops, curves, measured={"word": []})
    assert str(caught.value) == "measured: got 'word', need one of words"
