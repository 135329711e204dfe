"""Say why nothing happens for a while: kernels are compiled when they are used first."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from maneuver_automaton._interrupts import compiler_began, compiler_ended
from maneuver_automaton.cli.guard import complain
from maneuver_automaton.cli.progress import come_back, make_room

COMPILING = "compiling kernels, once after installation: this may take a minute ..."


@contextlib.contextmanager
def announced(*, quiet: bool = False) -> Iterator[None]:
    """Print one line when the compiler starts to work inside; loading from the cache is silent.

    The compiler asks for no time limit: while it is at work a signal breaks off. It may show a bar
    of its own: that of the command is gone meanwhile.
    """
    from numba.core import event

    class Announcement(event.Listener):  # type: ignore[misc]
        said = quiet
        depth = 0

        def on_start(self, event: Any) -> None:
            compiler_began()
            self.depth += 1
            if self.depth == 1:
                make_room()
            if not self.said:
                complain(COMPILING)
            self.said = True

        def on_end(self, event: Any) -> None:
            compiler_ended()
            self.depth -= 1
            if self.depth == 0:
                come_back()

    with event.install_listener("numba:compile", Announcement()):
        yield
