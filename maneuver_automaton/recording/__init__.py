"""Recordings: what any result holds, in one form, of which all that is shown or written is made.

`recording_of(result)` is the door; a `Recording` has movers, a world, facts, events and curves.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

from maneuver_automaton.models import Model
from maneuver_automaton.recording.values import Curve as Curve
from maneuver_automaton.recording.values import Environment as Environment
from maneuver_automaton.recording.values import Event as Event
from maneuver_automaton.recording.values import Fact as Fact
from maneuver_automaton.recording.values import Mover as Mover
from maneuver_automaton.recording.values import Recording as Recording
from maneuver_automaton.recording.values import Search as Search
from maneuver_automaton.recording.values import Table as Table
from maneuver_automaton.recording.values import bodies_of as bodies_of
from maneuver_automaton.recording.values import world_of as world_of

ROOMS = {  # of results: who records them, loaded only where there is such a result
    "automaton": "plans",
    "planning": "plans",
    "receding_horizon": "loops",
    "fleet": "fleets",
    "roads": "road_drives",
}


def recording_of(result: Any) -> Recording:
    """Who moved where and when, among what, of any result.

    Parameters
    ----------
    result : Plan, PlanResult, ClosedLoop, FleetResult, FleetLog, RoadPlanResult, \
RoadDrive, RoadFleetResult, RoadFleetDrive or Recording

    Raises
    ------
    TypeError
        If it is none of these.
    """
    if isinstance(result, Recording):
        return result
    room = _room_of(result)
    if room is not None and (record := room.RECORDED.get(type(result))) is not None:
        made: Recording = record(result)
        return made
    raise TypeError(
        f"recording: got {type(result).__name__}, need a Plan, PlanResult, ClosedLoop, "
        "FleetResult, FleetLog, or a plan or drive on roads"
    )


def tables_of(result: Any, *measured: Any) -> list[Table]:
    """The tables of any result; `measured`: what a fleet's loop was judged to be, if known."""
    room = _room_of(result)
    made: list[Table] = [] if room is None else room.tables(result, *measured)
    return made


def _room_of(result: Any) -> Any:
    """The module that records a result, loaded only where there is such a result; or None."""
    package, _, home = type(result).__module__.partition(".")
    room = ROOMS.get(home.partition(".")[0]) if package == "maneuver_automaton" else None
    return None if room is None else importlib.import_module(f"{__name__}.{room}")


def recording_to_write(value: Any, *, model: Model | None = None) -> Recording:
    """The recording of a value with a plan, of this `model` if of a Plan alone; or ValueError."""
    recording = recording_of(value)
    if not recording.drivers:
        raise ValueError(f"the result has no plan to write: {recording.reason}")
    if model is None:
        return recording
    movers = tuple(replace(one, model=one.model or model) for one in recording.movers)
    return replace(recording, movers=movers)
