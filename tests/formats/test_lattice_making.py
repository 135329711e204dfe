"""Primitives that are made keep the radius, stay on the grid, and are what Nav2 takes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from maneuver_automaton.formats.lattice import lattice_of_arcs
from maneuver_automaton.formats.nav2_lattice import read_nav2_lattice
from tests.formats.outside import DATA, needs_data

NAV2 = DATA / "nav2-lattice"
SCENARIO = """schema: 1
vehicle: {model: lattice_body, resolution_m: 0.1, turning_radius_m: 0.7}
automaton: {preset: NAME}
start: {pose: [0, 0, 0]}
goal: {pose: [3, 1, 0]}
"""


def moving(lattice):
    return [move for move in lattice.moves if move.poses[-1, :2].any()]


@pytest.mark.parametrize(("resolution", "radius"), [(0.05, 0.5), (0.1, 0.05), (0.025, 1.3), (1, 5)])
def test_they_keep_the_radius_and_end_on_the_grid(resolution, radius):
    lattice = lattice_of_arcs(resolution=resolution, turning_radius=radius)
    assert {(move.start, move.end) for move in lattice.moves} >= {
        (a, (a + k) % 16) for a in range(16) for k in (-1, 0, 1)
    }
    for move in lattice.moves:
        poses = ma.SE2(move.poses)
        twists = (ma.SE2(poses.pose[:-1]).inverse() @ ma.SE2(poses.pose[1:])).log()
        np.testing.assert_allclose(twists[:, 1], 0.0, atol=1e-9 * resolution)  # none aside
        assert (twists[:, 0] > 0.0).all()
        assert (np.abs(twists[:, 2]) * radius <= twists[:, 0] * (1 + 1e-9)).all()
        assert twists[:, 0].max() <= resolution * (1 + 1e-9)
        cells = move.poses[-1, :2] / resolution
        np.testing.assert_allclose(cells, cells.round(), atol=1e-9)
        off = (move.poses[-1, 2] - lattice.headings[move.end]) / (2.0 * math.pi)
        assert off == pytest.approx(round(off), abs=1e-12)


def test_they_look_the_same_from_every_side():
    lattice = lattice_of_arcs(resolution=0.05, turning_radius=0.5)
    ends = {(m.start, m.end): m.poses[-1, :2] for m in lattice.moves}
    for (a, b), (x, y) in ends.items():
        np.testing.assert_allclose(ends[(a + 4) % 16, (b + 4) % 16], [-y, x], atol=1e-12)
        np.testing.assert_allclose(ends[-a % 16, -b % 16], [x, -y], atol=1e-12)


@needs_data
@pytest.mark.parametrize("name", ["ackermann_5cm_r0.5m", "diff_5cm_r1m"])
def test_none_is_longer_than_that_of_nav2(name):
    """For the turns that its generator keeps; most end at the very same cell."""
    given = read_nav2_lattice(NAV2 / f"{name}.json")
    head = given["lattice_metadata"]
    lattice = lattice_of_arcs(
        resolution=head["grid_resolution"],
        turning_radius=head["turning_radius"],
        spins=head["motion_model"] == "diff",
    )
    np.testing.assert_array_equal(lattice.headings, head["heading_angles"])
    ours = {(m.start, m.end): m.poses for m in moving(lattice)}
    same = []
    ends = [(row["start_angle_index"], row["end_angle_index"]) for row in given["primitives"]]
    for (start, end), row in zip(ends, given["primitives"], strict=True):
        if row["trajectory_length"] and start != end:
            poses = ours[start, end]
            steps = (ma.SE2(poses[:-1]).inverse() @ ma.SE2(poses[1:])).log()
            assert steps[:, 0].sum() <= row["trajectory_length"] + 1e-5  # its digits
            same.append(np.allclose(poses[-1, :2], row["poses"][-1][:2], atol=1e-9))
    assert np.mean(same) >= 0.8
    spins = [(m.start, m.end) for m in lattice.moves if not m.poses[-1, :2].any()]
    lengths = [row["trajectory_length"] for row in given["primitives"]]
    theirs = [pair for pair, length in zip(ends, lengths, strict=True) if not length]
    assert sorted(spins) == sorted(theirs)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"resolution": 0.0, "turning_radius": 1.0}, "resolution must be positive, got 0.0 m"),
        ({"resolution": 0.01, "turning_radius": 3.0}, "are 300 cells of 0.01 m, need at most 200"),
    ],
)
def test_what_cannot_be_made_is_told(given, said):
    with pytest.raises(ValueError, match=said):
        lattice_of_arcs(**given)


@pytest.mark.parametrize(
    ("preset", "motion"), [("lattice_ackermann", "ackermann"), ("lattice_diff", "diff")]
)
def test_a_preset_becomes_a_file_of_nav2_and_is_planned_with(preset, motion, tmp_path):
    path = tmp_path / "made.yaml"
    path.write_text(SCENARIO.replace("NAME", preset))
    assert run(["convert", str(path), str(tmp_path / "made.nav2.json")]) == 0
    made = read_nav2_lattice(tmp_path / "made.nav2.json")
    head = made["lattice_metadata"]
    known = [head[key] for key in ("motion_model", "turning_radius", "grid_resolution")]
    assert known == [motion, 0.7, 0.1]
    path.write_text(SCENARIO.replace("preset: NAME", "file: made.nav2.json"))
    result = ma.plan(ma.load_scenario(path).problem, time_limit=2.0)
    assert result.status is ma.PlanStatus.FOUND
    assert result.terminal_error.position_m < 1e-9


@pytest.mark.parametrize(
    ("was", "now", "said"),
    [
        (", turning_radius_m: 0.7", "", "state vehicle.turning_radius_m"),
        ("lattice_body, resolution_m: 0.1, turning_radius_m: 0.7", "unicycle",
         "which is for a lattice_body, not the unicycle"),
        ("resolution_m: 0.1", "resolution_m: 0.001", "need at most 200"),
    ],
)  # fmt: skip
def test_a_vehicle_that_has_none_is_told_why(was, now, said, tmp_path, capsys):
    path = tmp_path / "made.yaml"
    path.write_text(SCENARIO.replace("NAME", "lattice_ackermann").replace(was, now))
    assert run(["plan", str(path)]) == 2
    error = capsys.readouterr().err
    assert "automaton.preset: " in error
    assert said in error
