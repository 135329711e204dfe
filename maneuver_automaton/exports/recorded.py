"""What is to be exported, whatever it is: its recording, and those in it who drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from maneuver_automaton.models import Model
from maneuver_automaton.recording import Mover, Recording, recording_of

KINDS = ("Plan", "Closed loop", "Fleet", "Closed loop of a fleet")  # titles that name nothing


def exported(value: Any, *, model: Model | None = None) -> Recording:
    """The recording of a value that somebody moves in; `model` is that of a Plan alone.

    Raises
    ------
    TypeError
        If nobody moves in it.
    ValueError
        If nobody has a plan.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> exported(Plan([1.0, 2.0, 0.5], (), durations=[])).movers[0].end.tolist()
    [1.0, 2.0, 0.5]
    """
    try:
        recording = recording_of(value)
    except TypeError:
        raise TypeError(
            f"export: got {type(value).__name__}, in which nobody moves; need a plan or its result,"
            " a closed loop, a fleet or its loop, or a plan or drive on roads"
        ) from None
    if not drivers(recording):
        raise ValueError(f"the result has no plan to write: {recording.reason}")
    if model is None:
        return recording
    movers = tuple(replace(one, model=one.model or model) for one in recording.movers)
    return replace(recording, movers=movers)


def drivers(recording: Recording) -> tuple[Mover, ...]:
    """Those who have a plan."""
    return tuple(one for one in recording.movers if one.has_plan)


def title_of(recording: Recording, path: Path | str) -> str:
    """What a file calls its content: the scenario, or the file's own name."""
    return Path(path).stem if recording.title in ("", *KINDS) else recording.title
