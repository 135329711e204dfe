"""The journal of a build: every finished maneuver on a line of its own, so that none is lost."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._files import journal_lines
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control.maneuvers import ManeuverObjective, TransferSettings
from maneuver_automaton.primitives import Trim

VERSION = 1  # of what a line says and of how maneuvers are made
SAMPLES = 3  # states at which a model is asked for its rates, to know it again


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Entry:
    """One line: the inputs of a maneuver, from which it can be driven again, or why it failed."""

    key: str
    interval: float  # [s]
    control: Array  # (n, n_u), each for the interval; no row if it failed
    reason: str = ""
    defect: float = math.inf

    def __post_init__(self) -> None:
        freeze(self, "control")

    def line(self) -> str:
        """The entry as JSON; numbers read back to the last bit."""
        numbers = {"interval": self.interval, "defect": self.defect}
        finite = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
        content = {"key": self.key, "reason": self.reason, **finite}
        return json.dumps({**content, "control": self.control.tolist()}, allow_nan=False)


def journal_path(library: Path) -> Path:
    """Where the journal of a library file lies: beside it."""
    return library.with_name(library.name + ".journal")


def build_key(model: Model, objective: ManeuverObjective, settings: TransferSettings) -> str:
    """Hash of all that maneuvers are made from, trims apart.

    A model is known by its names, its limits and its rates at a few states, so that a change of
    a user's formulas is noticed as well.
    """
    rng = np.random.default_rng(0)
    state = rng.uniform(0.1, 0.9, size=(SAMPLES, len(model.reduced_names)))
    control = rng.uniform(0.1, 0.9, size=(SAMPLES, len(model.control_names)))
    state = _within(model.reduced_limits, state)
    control = _within(model.control_limits, control)
    return _hash(
        {
            "version": VERSION,
            "group": model.group.__name__,
            "names": [model.name, *model.control_names, *model.reduced_names],
            "limits": [repr(model.control_limits.tolist()), repr(model.reduced_limits.tolist())],
            "velocity": model.body_velocity(state, control).tolist(),
            "dynamics": model.reduced_dynamics(state, control).tolist(),
            "objective": asdict(objective),
            "settings": asdict(settings),
        }
    )


def pair_key(build: str, source: Trim, target: Trim, *, keep_sign: Sequence[str] = ()) -> str:
    """Hash of all that one maneuver is made from; the names of the trims do not count."""
    ends = [[trim.reduced_state.tolist(), trim.control.tolist()] for trim in (source, target)]
    return _hash([build, *ends, *sorted(keep_sign)])


def read_journal(path: Path) -> dict[str, Entry]:
    """Entries by key; a line that a killed build left unfinished does not count."""
    entries: dict[str, Entry] = {}
    for line in journal_lines(path):
        with contextlib.suppress(ValueError, TypeError, KeyError):
            entry = _entry(json.loads(line))
            entries[entry.key] = entry
    return entries


def _entry(content: Mapping[str, Any]) -> Entry:
    defect = content["defect"]
    interval = content["interval"]
    return Entry(
        key=str(content["key"]),
        reason=str(content["reason"]),
        interval=math.inf if interval is None else float(interval),
        defect=math.inf if defect is None else float(defect),
        control=np.array(content["control"], dtype=np.float64),
    )


def _hash(content: Any) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _within(limits: Array, shares: Array) -> Array:
    low = np.where(np.isfinite(limits[:, 0]), limits[:, 0], 0.0)
    high = np.where(np.isfinite(limits[:, 1]), limits[:, 1], low + 1.0)
    within: Array = low + shares * (high - low)
    return within
