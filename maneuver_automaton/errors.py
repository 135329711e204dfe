"""Every exception class of the package.

A bad number or shape is a plain `ValueError`; these exist where a caller may want to tell
one kind of wrong input from another.
"""


class ManeuverAutomatonError(Exception):
    """Base of the package's own exceptions."""


class UnknownTrim(ManeuverAutomatonError, LookupError):
    """A trim was asked for by a name that the automaton does not have."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class InvalidAutomaton(ManeuverAutomatonError, ValueError):
    """Trims and maneuvers do not fit together."""


class InvalidScenario(ManeuverAutomatonError, ValueError):
    """An input file cannot be used: says file, line, field, value, and what would be right."""


class InvalidLibrary(ManeuverAutomatonError, ValueError):
    """A library file cannot be read, or its content does not match its hash."""


class BrokenSymmetry(ManeuverAutomatonError, ValueError):
    """Dynamics, cost or constraints are not invariant under the group they claim."""


class NotATrim(ManeuverAutomatonError, ValueError):
    """A reduced state and control are no equilibrium of the reduced dynamics."""


class MissingExtra(ManeuverAutomatonError, ImportError):
    """A library that is needed cannot be imported: the message names it, or its extra."""
