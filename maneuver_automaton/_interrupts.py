"""A signal ends every time limit: a search returns the best it has, instead of being torn down."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

BASE = 128  # exit code of a process that a signal ended, less the number of the signal


class _State:
    """What came; no dataclass, since a signal may come before that module is imported."""

    signal: int | None = None
    listening: bool = False
    patient: int = 0  # blocks that end by themselves once `stopped`
    compiling: int = 0  # functions that the compiler is at work on: it asks nobody
    tells: tuple[Callable[[], None], ...] = ()  # what to call when the first signal comes
    watches: tuple[Callable[[bool], None], ...] = ()  # what to call as the compiler begins and ends


_STATE = _State()


def stopped() -> bool:
    """Whether a signal has asked to come to an end."""
    return _STATE.signal is not None


def is_main_program() -> bool:
    """Whether this process is the command line's own, rather than somebody else's program."""
    return _STATE.listening


def clock() -> float:
    """Seconds as `time.monotonic` counts them; inf once `stopped`: every deadline is over."""
    return math.inf if stopped() else time.monotonic()


def exit_code() -> int:
    """Exit code of a process that was `stopped`, as shells count: 130 for Ctrl-C."""
    return BASE + (_STATE.signal or signal.SIGINT)


@contextlib.contextmanager
def patient(tell: Callable[[], None] | None = None) -> Iterator[None]:
    """A block that asks `stopped`, or a time limit, often: the first signal does not break it off.

    That signal calls `tell`, for those that work for this process.
    """
    if stopped() and not _STATE.patient:
        raise KeyboardInterrupt
    before = _STATE.tells
    _STATE.patient += 1
    _STATE.tells = before if tell is None else (*before, tell)
    try:
        yield
    finally:
        _STATE.tells = before
        _STATE.patient -= 1


def serving() -> None:
    """In a process that works for another one: only note a signal, for whoever asks `stopped`."""
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, _note)


@contextlib.contextmanager
def children_ignore_signals() -> Iterator[None]:
    """A block whose child processes ignore Ctrl-C: this process tells them to stop."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


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
    _STATE.listening = True
    try:
        yield
    finally:
        _STATE.listening = False
        sys.unraisablehook = hook
        for one, handler in before.items():
            signal.signal(one, handler)
        _STATE.signal = None


@contextlib.contextmanager
def compiler_watched(watch: Callable[[bool], None]) -> Iterator[None]:
    """Call `watch` as the compiler starts to work inside, with True, and as it is done."""
    before = _STATE.watches
    _STATE.watches = (*before, watch)
    try:
        yield
    finally:
        _STATE.watches = before


def compiler_works(begins: bool) -> None:
    """Note that the compiler begins with a function, or is done with it."""
    _STATE.compiling += 1 if begins else -1
    for watch in _STATE.watches:
        watch(begins)


def _note(number: int, _frame: FrameType | None) -> None:
    _STATE.signal = number


def _take(number: int, frame: FrameType | None) -> None:
    """Ask the block to end, if it is patient; otherwise break off."""
    again, _STATE.signal = stopped(), number
    if _STATE.patient and not _STATE.compiling and not again:
        for tell in _STATE.tells:
            tell()
        return
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            os._exit(BASE + number)  # libraries are being loaded, which may swallow what is raised
        frame = frame.f_back
    raise KeyboardInterrupt
