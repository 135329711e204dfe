"""Pictures of studies that the pages show, from studies that are quick."""

from __future__ import annotations

import dataclasses
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.analysis import FeasibleSet, certified_horizon, growth_bound, ring_poses
from maneuver_automaton.optimal_control import solve_uniform_effort_example
from maneuver_automaton.receding_horizon.unconstrained import simulate_unconstrained
from tests.plotting.loops import parking
from tests.receding_horizon.unconstrained_cases import MIXED, PARKING, even, problem_of

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def figures():
    """The modules that draw for the pages."""
    sys.path.insert(0, str(DOCS / "figures"))
    yield {name: importlib.import_module(name) for name in ("symmetry", "studies")}
    sys.path.pop(0)


def test_every_picture_is_on_a_page(figures):
    text = "".join(page.read_text(encoding="utf-8") for page in DOCS.glob("*.md"))
    for module in figures.values():
        for name in module.PICTURES:
            assert f"scenarios/pictures/{name}" in text


def test_the_arrows_of_a_motion_are_tangent_and_of_added_numbers_not(figures):
    ax = figures["symmetry"].moved_and_added().axes[0]
    off = []
    for arrows, line in zip(ax.collections, ax.lines[::2], strict=True):
        (x, y), along = line.get_data(), line.get_xydata()
        steps = np.diff(along, axis=0)[::16]
        heading = np.arctan2(arrows.V, arrows.U)[: len(steps)]
        off.append(np.abs(np.sin(np.arctan2(steps[:, 1], steps[:, 0]) - heading)).max())
        assert len(x) == len(y) == 81
    assert [one < 0.05 for one in off] == [True, True, False, True]


def test_the_edge_of_a_feasible_set_is_where_the_time_is_up(figures):
    x, y = np.linspace(-3.0, 3.0, 25), np.linspace(-2.0, 2.0, 17)
    found = FeasibleSet(
        problem=parking(), within=1.5, x=x, y=y, headings=np.array([0.0]),
        times=np.hypot(x, y[:, None])[None], exhaustive=True,
    )  # fmt: skip
    ax = figures["studies"].feasible_figure(found).axes[0]
    edges = [np.hypot(*one.vertices.T) for one in ax.collections[1].get_paths()]
    np.testing.assert_allclose(np.concatenate(edges), 1.5, atol=0.02)


@pytest.mark.slow
def test_what_was_studied_is_drawn(figures, tmp_path):
    studies = figures["studies"]
    problem = problem_of(even(5), MIXED, intervals=4, goal=[0.0, 0.0, 0.0])
    loop = simulate_unconstrained(problem, PARKING, steps=6)
    poses = ring_poses(MIXED, levels=[0.5], parts=2)
    bound = growth_bound(even(5), MIXED, poses=poses, times=np.arange(1, 31) / 5.0)
    certified = certified_horizon(bound, step=0.5)
    figure = studies.unconstrained_figure({"mixed": loop}, {"mixed": certified})
    path, _, growth, _ = figure.axes
    assert path.lines[0].get_xydata().tolist() == loop.poses[:, :2].tolist()
    assert growth.lines[0].get_ydata().tolist() == bound.bounds.tolist()
    figure.savefig(tmp_path / "loops.png")
    example = solve_uniform_effort_example(20)
    coarse = dataclasses.replace(example, spread=1.0)
    drawn = studies.uniform_effort_figure([example, coarse])
    assert drawn.axes[5].lines[0].get_ydata().tolist() == [100.0 * example.spread, 100.0]
    drawn.savefig(tmp_path / "effort.png")
