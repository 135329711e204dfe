"""Features of what is saved of a plan: its picture, its file, and what other programs read."""

from __future__ import annotations

import csv
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from maneuver_automaton.exports import ros_messages, save_csv, save_geojson
from maneuver_automaton.formats.plan_json import load_plan, save_plan
from maneuver_automaton.planning import PlanResult
from tests.matrix import outside
from tests.matrix.measuring import close, found
from tests.matrix.rows import Engine, feature
from tests.matrix.scenes import base
from tests.matrix.vehicles import Vehicle


def _draw(result: PlanResult, path: Path) -> None:
    from maneuver_automaton import plotting

    plotting.save_picture(result, path)


def _blank(_: PlanResult, path: Path) -> None:
    from matplotlib.figure import Figure

    Figure().savefig(path)


@feature(Engine(save_figure=_blank), says="nothing is drawn")
def pictures(vehicle: Vehicle, engine: Engine) -> None:
    import matplotlib.image

    draw = engine.save_figure or _draw
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.png"
        draw(base(vehicle), path)
        pixels = matplotlib.image.imread(path)
    assert len(np.unique(pixels.reshape(-1, pixels.shape[-1]), axis=0)) > 10, "nothing is drawn"


def _moved_file(result: PlanResult, path: Path) -> None:
    assert result.plan is not None
    save_plan(replace(result, plan=replace(result.plan, start=result.plan.start + 0.01)), path)


@feature(Engine(save_plan=_moved_file), says="another motion")
def plan_file(vehicle: Vehicle, engine: Engine) -> None:
    """plan.json holds the plan: read back it is the same motion, and its numbers agree."""
    result = base(vehicle)
    motion = found(result)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.json"
        engine.save_plan(result, path)
        model = result.problem.automaton.model
        again, document = load_plan(path, model=model), json.loads(path.read_text())
    assert outside.apart(motion, again) <= 1e-6, "the file holds another motion"
    lasting = sum(one["duration_s"] for one in document["primitives"])
    close(lasting, document["duration_s"], "duration")
    close(motion.duration, document["duration_s"], "duration")
    close(document["trajectory"]["time_s"][-1], document["duration_s"], "last time")
    last = np.array(document["trajectory"]["pose"][-1])
    way, turn = outside.off_goal(last, vehicle.target())
    assert max(way, turn) <= 1e-8, "the trajectory misses the goal"


def _moved_table(result: PlanResult, path: Path, **options: float) -> None:
    assert result.plan is not None
    moved = replace(result.plan, start=result.plan.start + 0.01)
    save_csv(replace(result, plan=moved), path, **options)


@feature(Engine(save_table=_moved_table), says="the table holds another motion")
def exports(vehicle: Vehicle, engine: Engine) -> None:
    """A table, GeoJSON and messages of ROS hold the plan: its poses at its times."""
    result = base(vehicle)
    plan = found(result)
    with tempfile.TemporaryDirectory() as folder:
        table, places = Path(folder) / "plan.csv", Path(folder) / "plan.geojson"
        engine.save_table(result, table, step=0.1)
        save_geojson(result, places)
        with table.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        features = json.loads(places.read_text())["features"]
    times = np.array([float(row["time_s"]) for row in rows])
    names = ["x_m", "y_m", "heading_rad", "z_m"][: plan.start.size]
    poses = np.array([[float(row[name]) for name in names] for row in rows])
    there = plan.pose_at(times)
    assert np.abs(poses - there).max() <= 1e-9, "the table holds another motion"
    (line,) = (one["geometry"] for one in features if one["properties"]["kind"] == "path")
    end = plan.end[[0, 1, 3][: plan.end.size - 1]]
    assert np.abs(np.array(line["coordinates"])[-1] - end).max() <= 1e-9, "the path ends elsewhere"
    message = ros_messages(result, step=0.1)["path"]["poses"][-1]["pose"]
    place = np.array(list(message["position"].values()))[: end.size]
    assert np.abs(place - end).max() <= 1e-9, "the message ends elsewhere"
