"""Features of what is saved of a plan: its picture and its file."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from maneuver_automaton.formats.plan_json import load_plan, save_plan
from maneuver_automaton.planning import PlanResult
from tests.matrix import outside
from tests.matrix.measuring import close, found
from tests.matrix.rows import Engine, feature
from tests.matrix.scenes import base
from tests.matrix.vehicles import Vehicle


def _draw(result: PlanResult, path: Path) -> None:
    from maneuver_automaton import plotting

    plotting.save_plan_figure(result, path)


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
        again, document = load_plan(path), json.loads(path.read_text())
    assert outside.apart(motion, again) <= 1e-6, "the file holds another motion"
    lasting = sum(one["duration_s"] for one in document["primitives"])
    close(lasting, document["duration_s"], "duration")
    close(motion.duration, document["duration_s"], "duration")
    close(document["trajectory"]["time_s"][-1], document["duration_s"], "last time")
    last = np.array(document["trajectory"]["pose"][-1])
    way, turn = outside.off_goal(last, vehicle.target())
    assert max(way, turn) <= 1e-8, "the trajectory misses the goal"
