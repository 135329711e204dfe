"""A field: swaths that cover it, turns between them, and one plan of both."""

from maneuver_automaton.field.covering import FieldProblem as FieldProblem
from maneuver_automaton.field.covering import FieldResult as FieldResult
from maneuver_automaton.field.covering import cover as cover
