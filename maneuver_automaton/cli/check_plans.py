"""`check PLAN.json`: the plans of a file proven again, each alone and every pair; loops too."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from maneuver_automaton.cli import check_loops
from maneuver_automaton.cli.check_command import Finding
from maneuver_automaton.cli.compiling import announced
from maneuver_automaton.cli.inputs import Parts, scenario_of
from maneuver_automaton.cli.planned import fleet_planned
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import Closest, verify_fleet
from maneuver_automaton.formats.driven_json import read_closed_loop_document
from maneuver_automaton.formats.fleet_loop_reading import read_fleet_loop_document
from maneuver_automaton.formats.plan_json import (
    load_plan,
    load_plans,
    read_fleet_document,
    read_plan_document,
)
from maneuver_automaton.planning.verdict import Verdict, verify

ENDING = ".json"
AGREES = 1e-9  # share by which a cost may differ from that of the file


def findings(path: Path, parts: Parts) -> tuple[str, Iterator[Finding]] | None:
    """The name of what was planned, and what holds of the plans of a file; None of no plans.

    The plan of one vehicle needs the file of --with; plans of several name theirs.

    Raises
    ------
    InvalidScenario
        If the file holds no plans, or the scenario of `parts` is not theirs.
    """
    if path.suffix.lower() != ENDING:
        return None
    if (driven := read_fleet_loop_document(path)) is not None:
        return check_loops.findings(path, driven, parts)
    document = read_fleet_document(path)
    if document is not None:
        return _of_fleet(path, document, parts)
    if read_closed_loop_document(path) is not None:
        raise InvalidScenario(
            f"{path}: is a closed loop of one vehicle, which is audited while it is driven; need "
            "a plan, or a closed loop of several vehicles"
        )
    if parts.beside is None:
        try:
            read_plan_document(path)
        except InvalidScenario:
            return None  # told by who reads scenarios
        raise InvalidScenario(
            f"{path}: is a plan, which does not state its problem; need --with FILE, the scenario "
            "that it was planned from"
        )
    plan, stated = load_plan(path), read_plan_document(path)
    scenario = scenario_of(parts.beside, replace(parts, beside=None))
    with announced(), _of_this(path):
        verdict = verify(scenario.problem, plan)
    return scenario.name, iter([_plan("plan", verdict, stated.get("cost"))])


def _of_fleet(
    path: Path, document: Mapping[str, Any], parts: Parts
) -> tuple[str, Iterator[Finding]]:
    scenario = fleet_planned(path, document, parts)
    plans = load_plans(path)
    with announced(), _of_this(path):
        verdict = verify_fleet(scenario.fleet, plans)
    stated = document["vehicles"]
    rows = [
        _plan(f"{name}: plan", verdict.verdicts[name], stated[name].get("cost"))
        if name in verdict.verdicts
        else Finding(what=f"{name}: plan", holds=False, words=_why_none(stated.get(name)))
        for name in scenario.fleet.names
    ]
    return scenario.name, iter([*rows, *_pairs(verdict.closest, verdict.too_near)])


def _pairs(closest: tuple[Closest, ...], too_near: tuple[Closest, ...]) -> list[Finding]:
    """Those that come too near, or one line for all."""
    if not too_near:
        words = "there is none that comes near"
        if closest:
            one = closest[0]
            words = f"nearest are {' and '.join(one.pair)} at {one.time_s:.4g} s"
        least = closest[0].distance_m if closest else None
        return [Finding(what="every pair: apart", holds=True, worst=least, words=words)]
    return [
        Finding(
            what=f"{' and '.join(one.pair)}: apart",
            holds=False,
            worst=one.distance_m,
            words=f"{one.distance_m:.3g} m at {one.time_s:.4g} s",
        )
        for one in too_near
    ]


def _plan(what: str, verdict: Verdict, stated: Any) -> Finding:
    """What holds of a plan, and whether it costs what its file says."""
    if not verdict.passed:
        return Finding(what=what, holds=False, words=verdict.reason)
    same = isinstance(stated, int | float) and (
        abs(stated - verdict.cost) <= AGREES * max(1.0, abs(verdict.cost))
    )
    clearance = None if verdict.audit is None else verdict.audit.min_clearance_m
    words = f"cost {verdict.cost:.9g}" + ("" if same else f", but the file says {stated}")
    return Finding(what=what, holds=same, worst=clearance, words=words)


def _why_none(stated: Any) -> str:
    reason = stated.get("reason") if isinstance(stated, dict) else None
    return f"there is none: {reason}" if reason else "there is none"


@contextlib.contextmanager
def _of_this(path: Path) -> Iterator[None]:
    """Name the file where plans do not belong to the problem."""
    try:
        yield
    except ValueError as error:
        raise InvalidScenario(f"{path}: {error}") from error
