"""The cost of a scenario or of a design, as a value."""

from __future__ import annotations

import math

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.formats.yaml_source import Document, Where
from maneuver_automaton.scenario.places import at
from maneuver_automaton.scenario.schema import CostPart


def cost_of(
    document: Document, part: CostPart, automaton: Automaton, *, within: Where = ()
) -> Cost:
    """The cost that a part of a document states, `within` another part of it."""
    matrix = part.effort_matrix
    where = (*within, "cost") if matrix is None else (*within, "cost", "effort_matrix")
    if matrix is not None and len({len(row) for row in matrix} | {len(matrix)}) > 1:
        rows = ", ".join(str(len(row)) for row in matrix)
        raise document.error(
            where, f"got {len(matrix)} rows of {rows} numbers, need a square matrix"
        )
    order = math.inf if part.norm_order == "inf" else float(part.norm_order)
    with at(document, where):
        cost = Cost(
            effort=part.effort,
            norm=part.norm,
            time=part.time,
            effort_matrix=matrix,  # type: ignore[arg-type]
            norm_order=order,
            length=part.length,
            switch=part.switch,
            direction_change=part.direction_change,
        )
        cost.rates(automaton.controls[:1], automaton.body_velocities[:1])
    return cost
