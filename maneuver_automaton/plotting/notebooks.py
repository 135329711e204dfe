"""What notebooks show of a value: its player, and its picture where no page can be shown."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.fleet import FleetLog, FleetResult
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.automata import save_automaton_figure
from maneuver_automaton.plotting.closed_loop import save_closed_loop_figure
from maneuver_automaton.plotting.fleet import save_fleet_figure
from maneuver_automaton.plotting.fleet_loop import save_fleet_loop_figure
from maneuver_automaton.plotting.pages import axes_at, new_figure, write_figure
from maneuver_automaton.plotting.paths import draw_plan
from maneuver_automaton.plotting.plan_figures import save_plan_figure
from maneuver_automaton.plotting.player import player_of as player_of
from maneuver_automaton.plotting.road_fleets import save_road_fleet_figure
from maneuver_automaton.plotting.roads import save_road_figure
from maneuver_automaton.receding_horizon import ClosedLoop
from maneuver_automaton.roads import RoadDrive, RoadFleetDrive, RoadFleetResult, RoadPlanResult


def picture_of(value: Any) -> bytes | None:
    """The picture of a value as a PNG; None if it holds nothing to draw.

    Examples
    --------
    >>> picture_of(Plan([0.0, 0.0, 0.0], (), durations=[]))[1:4]
    b'PNG'
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.png"
        _save(value, file)
        return file.read_bytes() if file.exists() else None


@functools.singledispatch
def _save(value: Any, path: Path) -> None:
    raise TypeError(f"picture: got {type(value).__name__}, need a plan, a loop or an automaton")


@_save.register
def _(plan: Plan, path: Path) -> None:
    figure = new_figure(6.4, 4.4)
    draw_plan(axes_at(figure, left=0.75, bottom=0.6, width=5.4, height=3.6), plan)
    write_figure(figure, path)


@_save.register
def _(drive: RoadDrive, path: Path) -> None:
    save_road_figure(drive.planner.scene, drive.planner.vehicle, drive.driven, path)


@_save.register
def _(result: RoadPlanResult, path: Path) -> None:
    if result.plan is not None:
        save_road_figure(result.planner.scene, result.planner.vehicle, result.plan, path)


@_save.register
def _(what: RoadFleetResult | RoadFleetDrive, path: Path) -> None:
    if what.plans:
        planners = [one.planner for one in what.results.values()]
        save_road_fleet_figure(what, planners[0].vehicle, path)


_save.register(PlanResult, save_plan_figure)
_save.register(FleetResult, save_fleet_figure)
_save.register(FleetLog, save_fleet_loop_figure)
_save.register(ClosedLoop, save_closed_loop_figure)
_save.register(Automaton, save_automaton_figure)
