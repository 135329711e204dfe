"""Lattice primitives of SBPL and Nav2: to automata, to files, and what is wrong with a file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.library import automaton_hash, load_library, save_library
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.formats.lattice import (
    Lattice,
    Move,
    automaton_of_lattice,
    lattice_of_automaton,
)
from maneuver_automaton.formats.nav2_lattice import (
    automaton_of_nav2_lattice,
    nav2_lattice_of_automaton,
    read_nav2_lattice,
    save_nav2_lattice,
)
from maneuver_automaton.formats.sbpl_mprim import (
    automaton_of_mprim,
    end_gap,
    mprim_of_automaton,
    read_mprim,
    save_mprim,
)
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import plan
from maneuver_automaton.primitives.connecting import maneuver_defect
from maneuver_automaton.problem import Problem
from tests.formats.outside import DATA, message_of, needs_data

FOUR_POSES = """\
resolution_m: 0.1
numberofangles: 1
totalnumberofprimitives: 1
primID: 0
startangle_c: 0
endpose_c: 3 0 0
additionalactioncostmult: 1
intermediateposes: 4
0 0 0
0.1 0 0
0.2 0 0
0.3 0 0
"""
MPRIM = """\
resolution_m: 0.5
numberofangles: 4
totalnumberofprimitives: 4
primID: 0
startangle_c: 0
endpose_c: 1 0 0
additionalactioncostmult: 1
intermediateposes: 2
0.0 0.0 0.0
0.5 0.0 0.0
primID: 0
startangle_c: 1
endpose_c: 0 1 1
additionalactioncostmult: 2
intermediateposes: 3
0.0 0.0 1.5708
0.0 0.25 1.5708
0.0 0.5 1.5708
primID: 0
startangle_c: 2
endpose_c: -1 -1 3
additionalactioncostmult: 1
intermediateposes: 2
0.0 0.0 3.1416
-0.5 -0.5 4.7124
primID: 0
startangle_c: 3
endpose_c: 0 0 -4
additionalactioncostmult: 5
intermediateposes: 2
0.0 0.0 4.7124
0.0 0.0 6.2832
"""
ANGLES = [0.0, np.pi / 2, np.pi, 3 * np.pi / 2]


def nav2(**changes):
    entry = {
        "trajectory_id": 0,
        "start_angle_index": 0,
        "end_angle_index": 0,
        "left_turn": True,
        "trajectory_radius": 0.0,
        "trajectory_length": 0.5,
        "arc_length": 0.0,
        "straight_length": 0.5,
        "poses": [[0.5, 0.0, 0.0]],
    }
    rows = [entry | {"start_angle_index": k, "end_angle_index": k} for k in range(4)]
    for k, row in enumerate(rows):
        row["poses"] = [[round(0.5 * np.cos(ANGLES[k]), 9), round(0.5 * np.sin(ANGLES[k]), 9),
                         ANGLES[k]]]  # fmt: skip
    rows[2] |= {"end_angle_index": 3, "poses": [[-0.5, 0.5, ANGLES[3]]]}
    rows[2] |= changes.pop("row", {})
    head = {
        "motion_model": "ackermann",
        "turning_radius": 0.5,
        "grid_resolution": 0.5,
        "num_of_headings": 4,
        "heading_angles": ANGLES,
        "number_of_trajectories": 4,
    }
    return json.dumps({"lattice_metadata": head | changes, "primitives": rows})


def write(folder, name, text):
    path = folder / name
    path.write_text(text)
    return path


def assert_same_automaton(one, other, *, atol=1e-12):
    assert one.trim_names == other.trim_names
    for a, b in zip(one.maneuvers, other.maneuvers, strict=True):
        assert (a.name, a.source, a.target) == (b.name, b.source, b.target)
        np.testing.assert_allclose(a.displacement, b.displacement, atol=atol)
        np.testing.assert_allclose(a.course.pose, b.course.pose, atol=atol)
        np.testing.assert_allclose(a.course.time, b.course.time, atol=atol)


def test_primitives_of_sbpl_keep_their_headings_and_end_on_the_grid(tmp_path):
    file = read_mprim(write(tmp_path, "a.mprim", MPRIM))
    automaton = automaton_of_mprim(file)
    assert automaton.trim_names == tuple(f"heading {k}" for k in range(4))
    assert automaton.trim_classes.tolist() != [0, 0, 0, 0]
    ahead, aside, bent, spin = automaton.maneuvers
    np.testing.assert_allclose(ahead.displacement, [0.5, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(aside.displacement, [0.5, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(bent.displacement, [0.5, 0.5, np.pi / 2], atol=1e-15)
    np.testing.assert_allclose(spin.displacement, [0.0, 0.0, np.pi / 2], atol=1e-15)
    assert (bent.source, bent.target, spin.target) == ("heading 2", "heading 3", "heading 0")
    assert (ahead.duration, spin.duration) == (0.5, pytest.approx(np.pi / 2))
    position, heading = end_gap(file)
    assert position == 0.0
    assert 1e-6 < heading < 1e-4
    for one in automaton.maneuvers:
        ends = {"source": automaton[one.source], "target": automaton[one.target]}
        assert maneuver_defect(automaton.model, one, **ends) < 1e-9


@pytest.mark.parametrize("pace", [{}, {"speed": 2.0, "turn_rate": 0.5}])
def test_mprim_there_and_back(tmp_path, pace):
    file = read_mprim(write(tmp_path, "a.mprim", MPRIM))
    save_mprim(file, tmp_path / "b.mprim")
    again = read_mprim(tmp_path / "b.mprim")
    for one, other in zip(file.primitives, again.primitives, strict=True):
        assert (one.id, one.start, one.end, one.cost_multiplier) == (
            other.id, other.start, other.end, other.cost_multiplier
        )  # fmt: skip
        np.testing.assert_array_equal(one.poses, other.poses)
    automaton = automaton_of_mprim(file, **pace)
    save_mprim(mprim_of_automaton(automaton), tmp_path / "c.mprim")
    assert_same_automaton(automaton_of_mprim(read_mprim(tmp_path / "c.mprim"), **pace), automaton)


def test_cost_multipliers_outlive_a_library_file(tmp_path):
    automaton = automaton_of_mprim(read_mprim(write(tmp_path, "a.mprim", MPRIM)))
    assert [one.cost_multiplier for one in automaton.maneuvers] == [1.0, 2.0, 1.0, 5.0]
    save_library(automaton, tmp_path / "b.json")
    again = load_library(tmp_path / "b.json")
    assert [one.cost_multiplier for one in again.maneuvers] == [1.0, 2.0, 1.0, 5.0]
    assert automaton_hash(again) == automaton_hash(automaton)
    file = mprim_of_automaton(again)
    assert [one.cost_multiplier for one in file.primitives] == [1, 2, 1, 5]
    problem = Problem(again, [0, 0, 0], [0.5, 0, 0], start_trim="heading 0")
    costs = [problem.maneuver_cost(one) / one.duration for one in again.maneuvers]
    np.testing.assert_allclose(costs, [1.0, 2.0, 1.0, 5.0], rtol=1e-12)


@pytest.mark.parametrize("costly", [1, 9])
def test_a_plan_keeps_away_from_costly_primitives(tmp_path, costly):
    """To a cell ahead and one to the left: two steps aside, or a costlier diagonal one."""
    rows = []
    for number, (columns, lines) in enumerate([(1, 0), (0, 1), (1, 1)]):
        multiplier = costly if (columns, lines) == (1, 1) else 1
        rows.append(
            f"primID: {number}\nstartangle_c: 0\nendpose_c: {columns} {lines} 0\n"
            f"additionalactioncostmult: {multiplier}\nintermediateposes: 2\n0.0 0.0 0.0\n"
            f"{0.5 * columns} {0.5 * lines} 0.0\n"
        )
    text = "resolution_m: 0.5\nnumberofangles: 1\ntotalnumberofprimitives: 3\n" + "".join(rows)
    automaton = automaton_of_mprim(read_mprim(write(tmp_path, "a.mprim", text)))
    save_library(automaton, tmp_path / "a.json")
    library = load_library(tmp_path / "a.json")
    result = plan(Problem(library, [0, 0, 0], [0.5, 0.5, 0.0]), time_limit=60.0)
    straight = result.plan.word == ("2 from heading 0",)
    assert straight == (costly == 1)
    assert result.cost == pytest.approx(np.sqrt(0.5) if costly == 1 else 1.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("resolution_m: 0.5", "resolution: 0.5", ":1: got 'resolution:', need resolution_m:"),
        ("resolution_m: 0.5", "resolution_m: x", ":1: resolution_m: got 'x', need a finite number"),
        ("resolution_m: 0.5", "resolution_m: 0",
         ":1: resolution_m: got 0, need a positive number"),
        ("numberofangles: 4", "numberofangles: 2.5",
         ":2: numberofangles: got '2.5', need a whole number of at least 1"),
        ("startangle_c: 3", "startangle_c: 4",
         ":27: startangle_c: got the heading 4, need 0 to 3"),
        ("endpose_c: 1 0 0", "endpose_c: 2 0 0",
         ":10: got the pose (0.5, 0, 0), need it in the cell and at the heading of (1, 0, 0)"),
        ("0.0 0.0 6.2832\n", "0.0 0.0\n", ":32: ends early, need pose 1, yaw"),
        ("totalnumberofprimitives: 4", "totalnumberofprimitives: 3",
         ":26: got 'primID:' after 3 primitives, need the end of the file"),
        ("startangle_c: 1\nendpose_c: 0 1 1", "startangle_c: 0\nendpose_c: 0 1 1",
         ":16: got the pose (0, 0, 1.5708), need it in the cell and at the heading of (0, 0, 0)"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_mprim(tmp_path, old, new, message):
    assert MPRIM.count(old) == 1
    assert message_of(read_mprim, tmp_path / "a.mprim", MPRIM.replace(old, new)) == message


def test_a_first_pose_may_be_left_out(tmp_path):
    """SBPL compares the last pose alone; what is left out is the origin."""
    whole = read_mprim(write(tmp_path, "a.mprim", FOUR_POSES))
    short = FOUR_POSES.replace("poses: 4\n0 0 0\n", "poses: 3\n")
    without = read_mprim(write(tmp_path, "b.mprim", short))
    assert [len(file.primitives[0].poses) for file in (whole, without)] == [4, 3]
    one, other = (automaton_of_mprim(file).maneuvers[0] for file in (whole, without))
    np.testing.assert_array_equal(one.course.pose, other.course.pose)
    np.testing.assert_array_equal(one.course.time, other.course.time)


def test_more_than_the_first_pose_may_not_be_left_out(tmp_path):
    text = FOUR_POSES.replace("poses: 4\n0 0 0\n0.1 0 0\n", "poses: 2\n")
    said = message_of(read_mprim, tmp_path / "a.mprim", text)
    assert (
        said == ":9: got the pose (0.2, 0, 0), need it in the cell and at the heading of (0, 0, 0)"
    )


@needs_data
def test_a_file_whose_first_pose_is_left_out_is_read():
    (maneuver,) = automaton_of_mprim(read_mprim(DATA / "field/small.mprim")).maneuvers
    np.testing.assert_allclose(maneuver.course.pose[:, 0], [0.0, 0.1, 0.2, 0.3], atol=1e-12)
    assert maneuver.duration == pytest.approx(0.3)


def test_numbers_of_primitives_differ(tmp_path):
    second = MPRIM.split("primID: 0\n")[1]
    text = MPRIM.replace("primitives: 4", "primitives: 5") + "primID: 0\n" + second
    said = message_of(read_mprim, tmp_path / "a.mprim", text)
    assert said == ": primID: 0 stands twice for heading 0, need numbers that differ"


def test_listed_headings(tmp_path):
    angles = "".join(f"angle:{k} {angle}\n" for k, angle in enumerate(ANGLES))
    text = MPRIM.replace(
        "numberofangles: 4\n", f"min_turning_radius_m: 0.5\nnumberofangles: 4\n{angles}"
    )
    text = text.replace("intermediateposes:", "turning_radius: 0.0\nintermediateposes:")
    file = read_mprim(write(tmp_path, "a.mprim", text))
    assert file.min_turning_radius == 0.5
    again = mprim_of_automaton(automaton_of_mprim(file))
    assert [round(one.turning_radius, 9) for one in again.primitives] == [0.0, 0.0, 0.5, 0.0]
    wrong = message_of(read_mprim, tmp_path / "a.mprim", text.replace("angle:2 3.1", "angle:2 1.1"))
    assert wrong.startswith(":6: angle:2: got 1.1")


def test_primitives_of_nav2(tmp_path):
    file = read_nav2_lattice(write(tmp_path, "a.json", nav2()))
    automaton = automaton_of_nav2_lattice(file)
    bent = automaton.maneuvers[2]
    np.testing.assert_allclose(bent.displacement, [0.5, -0.5, np.pi / 2], atol=1e-12)
    save_nav2_lattice(file, tmp_path / "b.json")
    assert (
        json.loads((tmp_path / "b.json").read_text())["primitives"]
        == json.loads(nav2())["primitives"]
    )
    with pytest.raises(InvalidLibrary, match="needs as many for each") as error:
        mprim_of_automaton(Automaton(automaton.model, automaton.trims, automaton.maneuvers[:3]))
    assert "heading 3 has 0 maneuvers" in str(error.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"motion_model": "boat"},
         ": lattice_metadata.motion_model: got 'boat', need one of ackermann, diff, omni"),
        ({"num_of_headings": 5},
         ": lattice_metadata.num_of_headings: got 5, but there are 4 heading_angles; need as many"),
        ({"heading_angles": [0.0, 2.0, 1.0, 3.0]},
         ": lattice_metadata.heading_angles[2]: got 1, need rising angles from 0 to less than 2 "
         "pi"),
        ({"number_of_trajectories": 5},
         ": lattice_metadata.number_of_trajectories: got 5, but there are 4 primitives"),
        ({"grid_resolution": 0.3},
         ": primitives[0].poses[0]: got (0.5, 0), need a point of the grid of 0.3 m"),
        ({"grid_resolution": -1}, ": lattice_metadata.grid_resolution: got -1, need a positive "
         "number"),
        ({"row": {"end_angle_index": 1}},
         ": primitives[2].poses[0]: got the yaw 4.71239, need 1.5708, that of end_angle_index 1"),
        ({"row": {"start_angle_index": 0}},
         ": primitives[2].start_angle_index: got 0 after 1, need primitives sorted by it, from 0 "
         "on"),
        ({"row": {"left_turn": 1}}, ": primitives[2].left_turn: got 1, need true or false"),
        ({"row": {"poses": [[0, 0]]}},
         ": primitives[2].poses[0]: got 2 numbers, need 3: x, y, yaw"),
        ({"row": {"poses": []}}, ": primitives[2].poses: is empty, need at least one pose"),
        ({"row": {"poses": [[-0.5, 0.5, ANGLES[3]], [-1.5, 1.5, ANGLES[3]]]}},
         ": primitives[2].poses[1]: is 2.83 cells from the pose before, need at most 2.12 cells as "
         "between others: a pose is missing"),
        ({"row": {"poses": [[0, 0, ANGLES[2]], [0, 0, ANGLES[3]]]}},
         ": primitives[2].poses[1]: is 1.57 rad from the pose before, need at most 0.25 rad as "
         "between others: a pose is missing"),
        ({"turning_radius": "a"},
         ": lattice_metadata.turning_radius: got 'a', need a finite number"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_nav2_lattice(tmp_path, changes, message):
    said = message_of(read_nav2_lattice, tmp_path / "a.json", nav2(**changes))
    assert said == message


def test_a_lattice_of_our_own_goes_to_either_format(tmp_path):
    quarter = np.pi / 2
    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (1.0, 1.0)})
    moves = []
    for k in range(4):
        for trim, seconds in (("ahead", 1.0), ("left", quarter)):
            plan = Plan([0.0, 0.0, k * quarter], (robot[trim],), durations=[seconds])
            poses = plan.pose_at(np.linspace(0.0, seconds, 5))
            end = (k + (trim == "left")) % 4
            moves.append(Move(start=k, end=end, poses=poses))
    grid = Lattice(resolution=1.0, headings=ANGLES, moves=tuple(moves), turning_radius=1.0)
    automaton = automaton_of_lattice(grid)
    for one in automaton.maneuvers:  # it rolls as the unicycle does
        assert np.abs(one.course.control[:, 1]).max() < 1e-12
    file = nav2_lattice_of_automaton(automaton)
    rows = file["primitives"]
    assert file["lattice_metadata"]["motion_model"] == "ackermann"
    assert [one["trajectory_radius"] for one in rows[:2]] == [0.0, 1.0]
    assert rows[1]["arc_length"] == pytest.approx(quarter, abs=1e-5)
    save_nav2_lattice(file, tmp_path / "a.json")
    again = automaton_of_nav2_lattice(read_nav2_lattice(tmp_path / "a.json"))
    assert_same_automaton(again, automaton)
    save_mprim(mprim_of_automaton(automaton), tmp_path / "a.mprim")
    assert_same_automaton(automaton_of_mprim(read_mprim(tmp_path / "a.mprim")), automaton)
    save_library(automaton, tmp_path / "b.json")
    loaded = load_library(tmp_path / "b.json")
    back = lattice_of_automaton(loaded, kind="anything")
    np.testing.assert_allclose(back.headings, ANGLES, atol=1e-12)
    for one, other in zip(automaton.maneuvers, loaded.maneuvers, strict=True):
        np.testing.assert_array_equal(one.displacement, other.displacement)


def test_what_lattices_cannot_state():
    robot = Automaton.of_controls(
        Unicycle(),
        {"ahead": (1.0, 0.0)},
    )
    for write_ in (mprim_of_automaton, nav2_lattice_of_automaton):
        with pytest.raises(InvalidLibrary, match="got an automaton of the unicycle"):
            write_(robot)
    back = Move(start=0, end=0, poses=[[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    reverse = automaton_of_lattice(Lattice(resolution=1.0, headings=[0.0], moves=(back,)))
    with pytest.raises(InvalidLibrary, match="drives in reverse, but a file of Nav2"):
        nav2_lattice_of_automaton(reverse)
    beside = Move(start=0, end=0, poses=[[0.0, 0.0, 0.0], [0.9, 0.0, 0.0]])
    off = automaton_of_lattice(Lattice(resolution=1.0, headings=[0.0], moves=(beside,)))
    with pytest.raises(InvalidLibrary, match=r"ends at \(0.9 m, 0 m, 0 rad\)"):
        mprim_of_automaton(off)
    uneven = Move(start=0, end=0, poses=[[0.0, 0.0, 0.5], [0.0, 0.0, 0.5]])
    turned = automaton_of_lattice(Lattice(resolution=1.0, headings=[0.5], moves=(uneven,)))
    with pytest.raises(InvalidLibrary, match="its headings are not evenly spaced"):
        mprim_of_automaton(turned)
    with pytest.raises(ValueError, match="speed must be positive"):
        automaton_of_lattice(Lattice(resolution=1.0, headings=[0.0], moves=()), speed=0.0)


@needs_data
@pytest.mark.parametrize(
    ("name", "count", "heading_gap"),
    [
        ("non_uniform_res01_rad3_err005", 160, 1e-4),
        ("pr2", 112, 0.121),
        ("unicycle_first_order_0", 80, 1e-5),
        ("unicycle_noturninplace", 80, 0.121),
    ],
)
def test_files_of_sbpl(tmp_path, name, count, heading_gap):
    file = read_mprim(DATA / "sbpl" / "mprim" / f"{name}.mprim")
    assert len(file.primitives) == count
    position, heading = end_gap(file)
    assert position < 2e-6
    assert heading < heading_gap
    save_mprim(file, tmp_path / "a.mprim")
    again = read_mprim(tmp_path / "a.mprim")
    made = mprim_of_automaton(automaton_of_mprim(file))
    for one, other, third in zip(file.primitives, again.primitives, made.primitives, strict=True):
        assert (one.id, one.start, one.end) == (other.id, other.start, other.end)
        assert one.turning_radius == other.turning_radius
        np.testing.assert_array_equal(one.poses, other.poses)
        assert third.end[:2] == one.end[:2]
        assert (third.end[2] - one.end[2]) % file.headings.size == 0
        np.testing.assert_allclose(third.poses[:, :2], one.poses[:, :2], atol=2e-6)
        np.testing.assert_allclose(
            wrapped(third.poses[1:-1, 2] - one.poses[1:-1, 2]), 0.0, atol=1e-4
        )
        if one.turning_radius is not None:
            assert third.turning_radius == pytest.approx(one.turning_radius, abs=1e-4)


@needs_data
@pytest.mark.parametrize(
    ("name", "count"), [("ackermann_5cm_r0.5m", 72), ("diff_5cm_r1m", 88), ("omni_5cm_r0.5m", 136)]
)
def test_files_of_nav2(tmp_path, name, count):
    path = DATA / "nav2-lattice" / f"{name}.json"
    file = read_nav2_lattice(path)
    save_nav2_lattice(file, tmp_path / "a.json")
    assert (tmp_path / "a.json").read_text().strip() == path.read_text().strip()
    made = nav2_lattice_of_automaton(automaton_of_nav2_lattice(file))
    assert len(made["primitives"]) == count
    assert made["lattice_metadata"]["motion_model"] == name.split("_")[0]
    for one, other in zip(file["primitives"], made["primitives"], strict=True):
        for key in ("trajectory_id", "start_angle_index", "end_angle_index", "left_turn"):
            assert one[key] == other[key]
        poses, theirs = np.array(other["poses"]), np.array(one["poses"])
        np.testing.assert_allclose(poses[:, :2], theirs[:, :2], atol=1e-12)
        np.testing.assert_allclose(wrapped(poses - theirs)[:, 2], 0.0, atol=1e-12)
        radius = one["trajectory_radius"]
        assert other["trajectory_radius"] == pytest.approx(radius, abs=1.5e-5)
        if "omni" not in name or radius:  # omni states other lengths than its poses have
            for key in ("trajectory_length", "arc_length"):
                assert other[key] == pytest.approx(one[key], abs=1.5e-5)
