"""The design file: a build file that says how its trims are to be chosen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.design import DesignedLibrary, design_library
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.scenario.build_file import build_file_of_text
from maneuver_automaton.scenario.places import at
from maneuver_automaton.scenario.prices import cost_of


def design_of_file(
    path: Path | str, *, instead: Mapping[str, float] | None = None
) -> DesignedLibrary:
    """The library that a design file asks for.

    Parameters
    ----------
    path : Path or str
        A build file with the key `design`.
    instead : mapping, optional
        Values of `within`, `most`, `max_trims` and `radius_m` that hold instead of those stated.

    Raises
    ------
    InvalidScenario
        If the file cannot be read or used: one line with file, line, field, the value met, and
        what would be right.
    """
    return design_of_text(read_text(Path(path)), name=str(path), instead=instead)


def design_of_text(
    text: str, *, name: str, instead: Mapping[str, float] | None = None
) -> DesignedLibrary:
    """The library that the text of a design file asks for; see `design_of_file`.

    Examples
    --------
    >>> designed = design_of_text(
    ...     "{schema: 1, library: robots, vehicle: {model: unicycle}, "
    ...     "trims: {speed: [-1, 1], turn_rate: [-1, -0.5, 0, 0.5, 1]}, design: {within: 1.2}}",
    ...     name="robots.yaml")
    >>> len(designed.automaton), designed.factor
    (6, 1.0)
    """
    asked = build_file_of_text(text, name=name)
    document = parse(text, name=name, what="a design file")
    part = asked.design
    if part is None:
        raise document.error(
            (), "misses the key design: how the trims are chosen, such as {within: 1.05}"
        )
    with at(document, ("trims",)):
        candidates = Automaton(asked.model, asked.trims, name=asked.name)
    cost = cost_of(document, part.cost, candidates, within=("design",))
    values: dict[str, Any] = {
        key: getattr(part, key) for key in ("within", "most", "max_trims", "radius_m")
    }
    values.update(instead or {})
    with at(document, ("design",)):
        return design_library(
            candidates,
            cost=cost,
            within=values["within"],
            most=values["most"],
            max_trims=values["max_trims"],
            radius=values["radius_m"],
            tasks=part.tasks,
            least=part.least_m,
            tolerance=part.tolerance,
        )
