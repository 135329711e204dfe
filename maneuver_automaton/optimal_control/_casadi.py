"""How this room reaches CasADi: imported when used, with one clear error if it is missing."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from typing import Any

from maneuver_automaton.errors import MissingExtra


@functools.cache
def why_no_casadi() -> str:
    """Why optimal control cannot be used: what the import of CasADi says; empty if it works."""
    try:
        load_casadi()
    except MissingExtra as error:
        return str(error)
    return ""


def load_casadi() -> Any:
    """The module `casadi`; raises MissingExtra (an ImportError) if it cannot be imported."""
    try:
        import casadi
    except Exception as error:  # whatever a broken installation raises
        raise MissingExtra(
            f"optimal control needs CasADi, which cannot be imported ({error}): pip install casadi"
        ) from error
    return casadi


@contextlib.contextmanager
def numpy_on_symbols(casadi: Any) -> Iterator[None]:
    """Let ``np.cos(symbol)`` return a symbol, as CasADi before 3.8 did without a remark.

    From 3.8 on this is a mode of the whole process, so it is put back afterwards.
    """
    options = casadi.GlobalOptions
    if not hasattr(options, "setNumpyMode"):
        yield
        return
    before = options.getNumpyMode()
    options.setNumpyMode(-1)
    try:
        yield
    finally:
        options.setNumpyMode(before)
