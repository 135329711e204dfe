"""Several planning problems of one CommonRoad file, planned together."""

from __future__ import annotations

import contextlib
import functools
import io
import itertools
import json
import math
import shutil
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from maneuver_automaton.exports import open_result
from maneuver_automaton.formats.commonroad import n_problems, read_commonroad
from maneuver_automaton.formats.plan_json import load_plans
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import RoadVehicle, drive_roads, judged, plan_roads
from maneuver_automaton.roads.several import driving
from tests.quickly import quick_are
from tests.roads.files import GOAL, LANES, car, commonroad, problem

LEFT, RIGHT = GOAL, GOAL.replace('lanelet ref="2"', 'lanelet ref="1"')
PROBLEMS = (
    problem(100, x=10.0, y=2.0, speed=14.0),
    problem(101, x=30.0, y=2.0, speed=9.0),
    problem(102, x=12.0, y=6.0, speed=10.0, goal=RIGHT),
)
SLOW = car(7, x=60.0, y=2.0, speed=6.0, steps=60)
ROAD = commonroad(*LANES, SLOW, *PROBLEMS).replace("TST_Lanes", "ZAM_Lanes")  # an official name
quiet = pytest.mark.filterwarnings("ignore")  # of the library that writes solutions
FILES = {"road.xml": ROAD}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder of what a command writes of the road, and what it prints."""

    @functools.cache
    def of(command):
        folder, out, err = tmp_path_factory.mktemp(command), io.StringIO(), io.StringIO()
        (folder / "road.xml").write_text(ROAD)
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                assert run([command, "road.xml"]) == 0
        return folder, out.getvalue(), err.getvalue()

    return of


@pytest.fixture
def planned(folder, made):
    """The road and all that was planned and written of it in the current folder."""
    shutil.copytree(made("plan")[0], folder, dirs_exist_ok=True)


@pytest.fixture
def driven(folder, made):
    """The road and all that was driven and written of it in the current folder."""
    shutil.copytree(made("mpc")[0], folder, dirs_exist_ok=True)


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    path = tmp_path_factory.mktemp("road") / "road.xml"
    path.write_text(ROAD)
    return scenes_of(path)


@pytest.fixture(scope="module")
def plans(scenes):
    return plan_roads(scenes, name="road")


@pytest.fixture(scope="module")
def drive(scenes):
    return drive_roads(scenes)


def scenes_of(path):
    return {str(one.road.benchmark.problem): one.road for one in read_commonroad(Path(path))}


def least_by_shapely(plans, step=0.005):
    """Least distance of any two while both are there."""
    body, least = RoadVehicle().footprint.corners, math.inf
    for one, other in itertools.combinations(plans, 2):
        begin = max(one.start_time, other.start_time)
        end = min(p.start_time + p.duration for p in (one, other))
        times = np.arange(begin, end, step)
        solids = [
            shapely.polygons(SE2(plan.pose_at(times)[:, None, :3]).act(body))
            for plan in (one, other)
        ]
        least = min(least, float(shapely.distance(*solids).min()))
    return least


def test_plans_keep_apart(plans):
    result = plans
    assert result.found
    assert list(result.plans) == ["100", "101", "102"]
    assert sorted(result.order) == ["100", "101", "102"]
    slow = least_by_shapely(result.plans.values())
    assert 0.0 < result.distance_m <= slow
    assert slow <= result.distance_m + 0.05
    vehicle = RoadVehicle()
    for name, one in result.results.items():
        others = [driving(vehicle, plan, n) for n, plan in result.plans.items() if n != name]
        verdict = judged(one.planner.scene, vehicle, one.plan)
        assert verdict.clean
        assert one.verdict.clearance_m >= result.distance_m - 1e-3
        assert len(others) == 2


def test_a_moved_road_has_the_moved_plans(scenes, plans):
    by, one = SE2(np.array([30.0, -20.0, 1.1])), plans
    other = plan_roads({name: scene.moved(by) for name, scene in scenes.items()})
    assert other.order == one.order
    for name, plan in one.plans.items():
        there = (by @ SE2(plan.switching_poses)).pose
        np.testing.assert_allclose(
            other.plans[name].switching_poses[:, :2], there[:, :2], atol=1e-6
        )


def test_alone_is_as_one_vehicle(scenes):
    several = plan_roads({"100": scenes["100"]})
    alone = ma.plan_road(scenes["100"])
    assert several.results["100"].cost == alone.cost
    assert several.distance_m == math.inf


def test_who_has_no_plan_is_told(folder, capsys):
    """Two at one place: whoever is planned later hits the other at the start."""
    both = (problem(100, x=10.0), problem(101, x=11.0))
    Path("road.xml").write_text(commonroad(*LANES, *both))
    assert run(["plan", "road.xml", "--quiet", "--no-plot", "--time-limit", "2"]) == 1
    document = json.loads(Path("out/plan.json").read_text())
    assert document["status"] == "partial"
    assert sum(one["status"] == "found" for one in document["vehicles"].values()) == 1
    assert capsys.readouterr().err.startswith("road.xml: partial: 10")


class TestLoop:
    def test_nobody_comes_near_another(self, scenes, drive):
        vehicle = RoadVehicle()
        assert drive.reached
        assert not drive.reason
        slow = least_by_shapely(drive.plans.values())
        assert 0.15 < drive.distance_m <= slow <= drive.distance_m + 0.05
        for name, one in drive.results.items():
            assert one.verdict.clean
            others = [driving(vehicle, p, n) for n, p in drive.plans.items() if n != name]
            past = replace(scenes[name], traffic=(*scenes[name].traffic, *others))
            assert judged(past, vehicle, one.driven).clean

    @pytest.mark.slow
    def test_a_moved_road_has_the_moved_loop(self, scenes, drive):
        by, one = SE2(np.array([30.0, -20.0, 1.1])), drive
        other = drive_roads({name: scene.moved(by) for name, scene in scenes.items()})
        for name, plan in one.plans.items():
            np.testing.assert_allclose(
                (by @ SE2(plan.end)).pose[:2], other.plans[name].end[:2], atol=1e-6
            )

    def test_who_touches_another_at_the_start_is_not_driven(self, folder):
        Path("road.xml").write_text(
            commonroad(*LANES, problem(100, x=10.0), problem(101, x=11.0), problem(102, x=60.0))
        )
        drive = drive_roads(scenes_of("road.xml"), time_limit=10.0)
        for name, other in (("100", "101"), ("101", "100")):
            one = drive.results[name]
            assert (one.status, len(one.steps)) == ("touched", 0)
            assert one.reason == f"collision with {other} at the start"
            assert one.verdict.hit == (other,)
        assert drive.status == "touched"
        assert drive.results["102"].reached

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", quick_are([1], range(4), exhaustive=True))
    def test_who_has_a_plan_at_first_reaches_its_goal(self, folder, seed):
        rng, starts = np.random.default_rng(seed), []
        for k in range(4):
            lane = int(rng.integers(2))
            x = 8.0 + 14.0 * k + rng.uniform(0.0, 6.0)
            goal = GOAL if lane == 0 else RIGHT
            speed = float(np.round(rng.uniform(6.0, 14.0), 2))
            starts.append(problem(100 + k, x=x, y=2.0 + 4.0 * lane, speed=speed, goal=goal))
        Path("road.xml").write_text(commonroad(*LANES, *starts))
        drive = drive_roads(scenes_of("road.xml"), time_limit=5.0)
        planned = set(drive.before.plans)
        assert len(planned) >= 3
        assert {name for name, one in drive.results.items() if one.reached} >= planned
        assert all(drive.results[name].verdict.clean for name in planned)
        assert least_by_shapely([drive.plans[name] for name in planned]) > 0.1

    def test_one_that_begins_later_is_not_there_before(self, folder):
        later = problem(101, x=10.0, speed=12.0).replace(
            "<time><exact>0</exact></time>", "<time><exact>12</exact></time>"
        )
        later = later.replace("<intervalStart>20<", "<intervalStart>32<").replace(">40<", ">60<")
        Path("road.xml").write_text(commonroad(*LANES, problem(100), later))
        drive = drive_roads(scenes_of("road.xml"))
        assert drive.reached
        assert drive.plans["101"].start_time == pytest.approx(1.2)
        assert all(one.verdict.clean for one in drive.results.values())

    def test_a_file_of_it_is_checked(self, driven, capsys):
        loop = "out/closed_loop.json"
        assert run(["check", loop]) == 0
        said = capsys.readouterr().out
        assert all(f"{name}: goal" in said for name in ("100", "101", "102"))
        assert "every pair: apart" in said
        read = open_result(loop, beside="road.xml").result()
        assert all(one.verdict.clean for one in read.results.values())
        # A file that says what was not driven is told.
        document = json.loads(Path(loop).read_text())
        for step in document["vehicles"]["101"]["steps"][:-1]:
            step["control"] = [-4.0, 0.0] if step["reduced_state"][0] > 1.0 else [0.0, 0.0]
        Path(loop).write_text(json.dumps(document))
        assert run(["check", loop]) == 1
        assert "NO" in capsys.readouterr().out


def test_nothing_to_plan():
    with pytest.raises(ValueError, match="there is no vehicle"):
        plan_roads({})


class TestCommands:
    def test_plan(self, planned, made):
        assert n_problems(Path("road.xml")) == 3
        _, out, err = made("plan")
        assert err == ""
        assert "plans:          3 of 3" in out
        document = json.loads(Path("out/plan.json").read_text())
        assert (document["kind"], document["status"]) == ("fleet", "found")
        assert list(document["vehicles"]) == ["100", "101", "102"]
        assert document["source"]["file"] == "../road.xml"
        assert document["clearance_m"]["between"] > 0.0
        assert Path("out/plan.png").stat().st_size > 10_000
        assert list(load_plans("out/plan.json")) == ["100", "101", "102"]

    def test_mpc(self, driven, made):
        _, out, err = made("mpc")
        assert err == ""
        assert "reached:        3 of 3" in out
        document = json.loads(Path("out/closed_loop.json").read_text())
        assert (document["kind"], document["status"]) == ("fleet", "reached")
        assert list(document["vehicles"]) == ["100", "101", "102"]
        assert document["collisions"] == 0
        assert document["clearance_m"]["between"] > 0.0
        for one in document["vehicles"].values():
            assert one["reached"]
            assert len(one["steps"]) > 10
        assert Path("out/closed_loop.png").stat().st_size > 10_000

    @pytest.mark.parametrize(
        "options", ["plan --model car", "mpc --seeds 2", "mpc --resume road.xml"]
    )
    def test_what_is_for_one(self, folder, capsys, options):
        command, option, *value = options.split()
        assert run([command, "road.xml", option, *value]) == 2
        assert capsys.readouterr().err == (
            f"{option}: is not for several vehicles on roads; leave it out, or pick one with "
            "--case\n"
        )

    def test_ids_are_distinct(self, folder, capsys):
        Path("road.xml").write_text(commonroad(*LANES, problem(5), problem(5, x=30.0)))
        assert run(["plan", "road.xml"]) == 2
        said = "road.xml: two planning problems have one id, need distinct ids\n"
        assert capsys.readouterr().err == said

    @quiet
    def test_a_solution_of_all(self, planned):
        pytest.importorskip("commonroad.common.solution")
        assert run(["export", "out/plan.json", "--to", "commonroad"]) == 0
        root = ElementTree.parse("out/plan_commonroad.xml").getroot()
        assert [one.get("planningProblem") for one in root] == ["100", "101", "102"]
        plans = load_plans("out/plan.json")
        for one, plan in zip(root, plans.values(), strict=True):
            x, y = (float(one[0].find(tag).text) for tag in ("x", "y"))
            np.testing.assert_allclose([x, y], RoadVehicle().middle_of(plan.start)[:2], atol=1e-9)

    def test_a_solution_of_others(self, planned, capsys):
        Path("road.xml").write_text(commonroad(*LANES, problem(100), problem(200, x=30.0)))
        assert run(["export", "out/plan.json", "--to", "commonroad"]) == 2
        assert "need a planning problem of" in capsys.readouterr().err
