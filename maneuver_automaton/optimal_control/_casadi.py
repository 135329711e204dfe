"""How this room reaches CasADi: imported when used, with one clear error if it is missing."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
from collections.abc import Iterator
from typing import Any

from maneuver_automaton.errors import MissingExtra


@functools.cache
def has_casadi() -> bool:
    """Whether CasADi is installed; it is not imported."""
    return importlib.util.find_spec("casadi") is not None


def load_casadi() -> Any:
    """The module `casadi`; raises MissingExtra (an ImportError) if it is not installed."""
    try:
        import casadi
    except ImportError as error:
        raise MissingExtra(
            "optimal control needs CasADi, which is not installed: "
            "pip install 'maneuver-automaton[optimal-control]'"
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
