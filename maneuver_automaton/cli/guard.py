"""No traceback ever reaches a user: every error is told in one line, with an exit code."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from typing import ParamSpec

import typer

from maneuver_automaton._interrupts import exit_code, stopped
from maneuver_automaton.errors import ManeuverAutomatonError

DEBUG = "MANEUVER_AUTOMATON_DEBUG"
FOUND, NO_PLAN, BAD_INPUT = 0, 1, 2

P = ParamSpec("P")


def complain(line: str) -> None:
    """Print one line to stderr."""
    sys.stderr.write(" ".join(line.splitlines()) + "\n")


def explained(error: Exception) -> str:
    """One line for whatever a command raised."""
    if isinstance(error, ManeuverAutomatonError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{str(error.filename or 'a file')[:200]}: {error.strerror}"
    if isinstance(error, MemoryError):
        return f"out of memory: {error}; need sizes, or distances, that are smaller"
    if os.environ.get(DEBUG):
        import traceback

        traceback.print_exception(error)
    return (
        f"internal error: {type(error).__name__}: {error}; this is a bug of the program, "
        f"{DEBUG}=1 shows where"
    )


def exits(command: Callable[P, int]) -> Callable[P, None]:
    """Make a command end with the exit code that it returns, and with words if it raises."""

    @functools.wraps(command)
    def safe(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            code = command(*args, **kwargs)
        except KeyboardInterrupt:
            code = exit_code()
        except Exception as error:  # noqa: BLE001, the last resort
            complain(explained(error))
            code = BAD_INPUT
        raise typer.Exit(exit_code() if stopped() else code)

    return safe
