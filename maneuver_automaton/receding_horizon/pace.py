"""Continuous controls: the trims of a library at whatever pace costs least."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import StageCost, terms_of
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.effort import effort_report
from maneuver_automaton.refinement.retiming import retime
from maneuver_automaton.refinement.shooting import least_effort

PACE = re.compile(r"( x[-+.e0-9]+)+$")
UNIFORM = 1e-9  # relative spread of an effort that counts as uniform


def at_best_pace(problem: Problem, plan: Plan) -> Plan:
    """A plan retimed to uniform effort in the same time, as far as limits allow.

    Source: the paper, Prop. 15 and Cor. 19.
    """
    moving = [bool(trim.body_velocity.any()) for trim in plan.trims]
    cost = terms_of(problem.cost)
    if not any(moving) or cost is None:
        return plan
    better = retime(plan, problem.automaton.model, cost=cost)
    if not better.saving > 0.0:
        return plan
    trims = tuple(_named(problem.automaton, trim) for trim in better.after.trims)
    return replace(better.after, trims=trims)


def between_trims(problem: Problem, plan: Plan, pieces: int) -> Plan:
    """A plan with controls between those of the library, in the same time, where it costs less."""
    cost = terms_of(problem.cost)
    if not any(trim.body_velocity.any() for trim in plan.trims) or cost is None:
        return plan
    model = problem.automaton.model
    known = np.array([trim.control for trim in problem.automaton.trims])
    most = np.asarray(model.control_limits, dtype=np.float64)
    limits = np.stack(
        [np.maximum(known.min(axis=0), most[:, 0]), np.minimum(known.max(axis=0), most[:, 1])],
        axis=-1,
    )
    return least_effort(plan, model, cost=cost, limits=limits, pieces=pieces)


def base_name(name: str) -> str:
    """Name of the trim of the library that a trim at another pace comes from.

    Examples
    --------
    >>> base_name("spin x0.5 x0.25"), base_name("ahead")
    ('spin', 'ahead')
    """
    return PACE.sub("", name) if " x" in name else name


def _named(automaton: Automaton, trim: Trim) -> Trim:
    """The trim, named after the one of the library and how much faster it is."""
    base = base_name(trim.name)
    own = automaton.trims[automaton.index_of(base)].body_velocity
    pace = float(trim.body_velocity @ own) / float(own @ own)
    return replace(trim, name=base if pace == 1.0 else f"{base} x{pace:.6g}")


def is_uniform(plan: Plan, cost: StageCost) -> bool:
    """Whether a plan has the same quadratic effort all along."""
    terms = terms_of(cost)
    if terms is None or not plan.trims:
        return False
    report = effort_report(plan, terms.effort_matrix)
    return bool(report.spread <= UNIFORM) and bool(np.isfinite(report.mean))
