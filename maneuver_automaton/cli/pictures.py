"""Pictures of the command line: what draws is loaded beside the planning, and reads no docs."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator
from typing import Any

from maneuver_automaton._interrupts import is_main_program


def skip_documentation() -> None:
    """Have Matplotlib write none for its classes, which is a fifth of its import."""
    from matplotlib import artist

    artist.kwdoc = _nothing  # type: ignore[assignment]


def _nothing(_: object) -> str:
    return ""


class Draughtsman:
    """A process that draws: it loads Matplotlib while this one plans, and draws while it prints."""

    def __init__(self, process: int, pipe: int) -> None:
        self.process = process
        self.pipe = pipe  # -1 once it is closed

    def begin(self, draw: Callable[..., None], *args: Any) -> bool:
        """Have it draw; False where it cannot be told what."""
        try:
            order = pickle.dumps((draw, args))
        except Exception:  # noqa: BLE001, a model may hold functions that have no name
            return False
        try:
            with os.fdopen(self.pipe, "wb") as pipe:
                self.pipe = -1
                pipe.write(order)
        except OSError:  # it is gone
            return False
        return True

    def is_done(self) -> bool:
        """Wait for its pictures; False if something went wrong with them."""
        _, status = os.waitpid(self.process, 0)
        self.process = -1
        return status == 0

    def dismiss(self) -> None:
        """Have it end, if it has not yet."""
        if self.pipe >= 0:
            os.close(self.pipe)
        if self.process >= 0:
            os.kill(self.process, signal.SIGKILL)
            os.waitpid(self.process, 0)


@contextlib.contextmanager
def draughtsman(*, wanted: bool) -> Iterator[Draughtsman | None]:
    """A process that draws, if one is wanted and there is a processor for it; or none."""
    if not (wanted and is_main_program() and sys.platform == "linux" and _processors() > 1):
        yield None
        return
    read, write = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(write)
        _serve(read)
    os.close(read)
    one = Draughtsman(process, write)
    try:
        yield one
    finally:
        one.dismiss()


def _processors() -> int:
    return len(os.sched_getaffinity(0))


def _serve(read: int) -> None:
    """Load what draws, wait for an order, carry it out and end; who asked does what fails."""
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        skip_documentation()
        from maneuver_automaton.plotting import plan_figures  # noqa: F401

        with os.fdopen(read, "rb") as pipe:
            order = pipe.read()
        if order:
            draw, args = pickle.loads(order)
            draw(*args)
            code = 0
    finally:
        os._exit(code)
