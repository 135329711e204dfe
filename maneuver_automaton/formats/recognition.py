"""Which format a file is in, by its ending, and a YAML file by its keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.yaml_source import Document

YAML_ENDINGS = (".yaml", ".yml")
SBPL_ENDINGS = (".cfg", ".env", ".nav2d", ".nav3d")
PRIMITIVES = "motion primitives, need a file that states a problem (see automaton show, convert)"
NOT_READ: Mapping[str, str] = {
    ".mprim": f"holds {PRIMITIVES}",
    ".pb": "is a scenario of CommonRoad as protobuf, need it as XML (commonroad-io writes both)",
    ".pgm": "is the image of a map, need the YAML file that states its resolution",
}

Reader: TypeAlias = Callable[[Path], tuple[Statement, ...]]


def reader_of(path: Path) -> Reader | None:
    """What reads a file with this ending; None for scenarios and all that is YAML.

    Raises
    ------
    InvalidScenario
        If the ending is that of a format that is not read.
    """
    ending = path.suffix.lower()
    if ending == ".xml" and _holds_primitives(path):
        raise InvalidScenario(f"{path}: holds {PRIMITIVES}")
    if said := NOT_READ.get(ending):
        raise InvalidScenario(f"{path}: {said}")
    if ending == ".csv":
        from maneuver_automaton.formats import benchmr_svg, tpcap

        return (
            benchmr_svg.read_benchmr_queries if benchmr_svg.is_queries(path) else tpcap.read_tpcap
        )
    if ending in (".map", ".scen"):
        from maneuver_automaton.formats import movingai

        is_map = ending == ".map"
        return movingai.read_movingai_map if is_map else movingai.read_movingai_scenario
    if ending in SBPL_ENDINGS:
        from maneuver_automaton.formats.sbpl_cfg import read_sbpl

        return read_sbpl
    if ending == ".xml":
        from maneuver_automaton.formats.commonroad import read_commonroad

        return read_commonroad
    if ending == ".svg":
        from maneuver_automaton.formats.benchmr_svg import read_benchmr

        return read_benchmr
    if ending in (".png", ".bmp"):
        from maneuver_automaton.formats.benchmr_image import read_benchmr_image

        return read_benchmr_image
    return None


def _holds_primitives(path: Path) -> bool:
    """Whether an XML file holds motion primitives of CommonRoad; not if it cannot be read."""
    from maneuver_automaton.formats.commonroad_primitives import is_commonroad_primitives

    try:
        return is_commonroad_primitives(path)
    except (OSError, ValueError):
        return False


def yaml_statements(document: Document, path: Path) -> tuple[Statement, ...] | None:
    """What a YAML file of another format states; None for a scenario.

    Raises
    ------
    InvalidScenario
        If the file belongs to a problem and states none, or cannot be used.
    """
    from maneuver_automaton.formats import cl_cbs, dynobench, nav2_map

    if dynobench.is_dynobench(document):
        return dynobench.read_dynobench(path, document)
    if cl_cbs.is_cl_cbs(document):
        return cl_cbs.read_cl_cbs(path, document)
    if nav2_map.is_nav2_map(document):
        return nav2_map.read_nav2_map(path, document)
    if dynobench.belongs_to_dynobench(document):
        what = "is a model or a solution of dynobench, need the problem (environment, robots)"
        raise document.error((), what)
    if cl_cbs.belongs_to_cl_cbs(document):
        raise document.error((), "is a solution of CL-CBS, need the problem (agents, map)")
    return None
