"""A signal ends every time limit: a search returns the best it has, instead of being torn down."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import time
from collections.abc import Iterator
from types import FrameType

BASE = 128  # exit code of a process that a signal ended, less the number of the signal


class _State:
    """What came; no dataclass, since a signal may come before that module is imported."""

    signal: int | None = None
    patient: int = 0  # blocks that end by themselves once `stopped`
    compiling: int = 0  # functions that the compiler is at work on: it asks nobody


_STATE = _State()


def stopped() -> bool:
    """Whether a signal has asked to come to an end."""
    return _STATE.signal is not None


def clock() -> float:
    """Seconds as `time.monotonic` counts them; inf once `stopped`: every deadline is over."""
    return math.inf if stopped() else time.monotonic()


def exit_code() -> int:
    """Exit code of a process that was `stopped`, as shells count: 130 for Ctrl-C."""
    return BASE + (_STATE.signal or signal.SIGINT)


@contextlib.contextmanager
def patient() -> Iterator[None]:
    """A block that asks `stopped`, or a time limit, often: the first signal does not break it off.

    Raises
    ------
    KeyboardInterrupt
        If a signal came before, comes again, or while a kernel is compiled.
    """
    if stopped():
        raise KeyboardInterrupt
    _STATE.patient += 1
    try:
        yield
    finally:
        _STATE.patient -= 1


@contextlib.contextmanager
def listening() -> Iterator[None]:
    """Take Ctrl-C and a request to end for the time of a block, in the main program."""
    names = [signal.SIGINT, signal.SIGTERM]
    before = {one: signal.getsignal(one) for one in names}
    hook = sys.unraisablehook
    for one in names:
        if before[one] is not signal.SIG_IGN:  # as of a process in the background
            signal.signal(one, _take)
    sys.unraisablehook = lambda lost: None if lost.exc_type is KeyboardInterrupt else hook(lost)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for one, handler in before.items():
            signal.signal(one, handler)
        _STATE.signal = None


def compiler_began() -> None:
    """Note that the compiler begins with a function."""
    _STATE.compiling += 1


def compiler_ended() -> None:
    """Note that the compiler is done with a function."""
    _STATE.compiling -= 1


def _take(number: int, frame: FrameType | None) -> None:
    """Ask the block to end, if it is patient; otherwise break off."""
    again, _STATE.signal = stopped(), number
    if _STATE.patient and not _STATE.compiling and not again:
        return
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            os._exit(BASE + number)  # libraries are being loaded, which may swallow what is raised
        frame = frame.f_back
    raise KeyboardInterrupt
