"""A plan.json as the result that it was, in the world of its scenario."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton.audit import TerminalError
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.bounds import Narrowest
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.plan_json import plan_of_document, read_plan_document
from maneuver_automaton.planning import Alternative, LowerBound, PlanResult, PlanStatus
from maneuver_automaton.problem import Problem


def load_result(path: Path | str, problem: Problem) -> PlanResult:
    """The result of a plan.json; the file states neither body nor obstacles, the `problem` does.

    Alternatives with maneuvers are left out: the file does not say how they move.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or was planned with another library.
    """
    return result_of_document(read_plan_document(path), problem, path=str(path))


def result_of_document(document: Mapping[str, Any], problem: Problem, *, path: str) -> PlanResult:
    """The result of a document that is read already; `path` is its place, for messages.

    Raises
    ------
    InvalidScenario
        If it was planned with another library, or is damaged.
    """
    if document.get("automaton_hash") != automaton_hash(problem.automaton):
        raise InvalidScenario(f"{path}: automaton_hash: this was planned with another library")
    try:
        return _result_of(document, problem)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{path}: {said}") from error


def _result_of(document: Mapping[str, Any], problem: Problem) -> PlanResult:
    status, model = PlanStatus(document["status"]), problem.automaton.model
    narrowest = document.get("narrowest")
    others = (_alternative(one, problem) for one in document.get("alternatives") or ())
    return PlanResult(
        problem=problem,
        status=status,
        reason=str(document.get("reason") or ""),
        plan=plan_of_document(document, model) if status is PlanStatus.FOUND else None,
        cost=document.get("cost"),
        lower_bound=document.get("lower_bound"),
        gap=document.get("gap"),
        bound=_bound(document.get("bound")),
        certificate=document.get("certificate"),
        terminal_error=_error(document.get("terminal_error")),
        clearance_m=document.get("clearance_m"),
        alternatives=tuple(one for one in others if one is not None),
        improvements=_pairs(document.get("improvements")),
        narrowest=None
        if narrowest is None
        else Narrowest(
            place=(float(narrowest["place"][0]), float(narrowest["place"][1])),
            missing=float(narrowest["missing_m"]),
        ),
        notes=tuple(map(str, document.get("notes") or ())),
    )


def _alternative(entry: Mapping[str, Any], problem: Problem) -> Alternative | None:
    """A costlier plan of trims; None where it has maneuvers."""
    plan = _coasted(entry, problem.start, problem.start_time, problem.automaton)
    error = _error(entry.get("terminal_error"))
    if plan is None or error is None:
        return None
    return Alternative(plan=plan, cost=float(entry["cost"]), terminal_error=error)


def _coasted(
    entry: Mapping[str, Any], start: np.ndarray[Any, Any], time: float, automaton: Automaton
) -> Plan | None:
    parts = entry["primitives"]
    if any(part["kind"] != "trim" or part["name"] not in automaton.trim_names for part in parts):
        return None
    trims = [automaton[part["name"]] for part in parts]
    durations = [float(part["duration_s"]) for part in parts]
    return Plan(start, trims, durations=durations, start_time=time)


def _error(entry: Mapping[str, Any] | None) -> TerminalError | None:
    if entry is None or entry["position_m"] is None or entry["heading_rad"] is None:
        return None
    return TerminalError(
        position_m=float(entry["position_m"]), heading_rad=float(entry["heading_rad"])
    )


def _bound(entry: Mapping[str, Any] | None) -> LowerBound | None:
    if entry is None:
        return None
    return LowerBound(
        value=float(entry["value"]), kind=str(entry["kind"]), history=_pairs(entry["history"])
    )


def _pairs(rows: Any) -> tuple[tuple[float, float], ...]:
    return tuple((float(at), float(value)) for at, value in rows or ())
