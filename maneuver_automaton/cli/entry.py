"""Where the command line begins: signals are taken before anything heavy is imported."""

from __future__ import annotations

import dataclasses
import functools
import gc
import os
import signal
import sys
from typing import Any, NoReturn

from maneuver_automaton._interrupts import listening
from maneuver_automaton._lazy import LaterFinder
from maneuver_automaton.cli.streams import open_closed_streams

# Importing and planning make 250,000 objects and hardly any garbage; to look for it takes 30 ms.
COLLECT_EVERY = 1_000_000  # objects more than there were

# Threads of OpenBLAS wait for work in a loop, for 70 ms after the import alone, unless told not to.
IDLE_BLAS = ("OPENBLAS_THREAD_TIMEOUT", "4")
NO_PICTURE = {"--no-plot", "--help", "-h"}


def run(argv: list[str]) -> int:
    """Run the command line with the arguments `argv`, and return the exit code."""
    from maneuver_automaton.cli.app import run as run_app

    return run_app(argv)


def compile_methods_later() -> None:
    """Have `dataclasses` compile a method when it is called first, as few are: a tenth of `plan`.

    From Python 3.13 on it compiles those of a class at once. Others' constructors stay as they are.
    """
    if (create := vars(dataclasses).get("_create_fn")) is None:
        return

    def create_later(name: str, *args: Any, **known: Any) -> Any:
        if name == "__init__" and "maneuver_automaton" not in known["globals"].get("__name__", ""):
            return create(name, *args, **known)
        made = functools.cache(lambda: create(name, *args, **known))

        def method(self: Any, *given: Any, **named: Any) -> Any:
            made().__qualname__ = method.__qualname__
            for home in type(self).__mro__:
                if vars(home).get(name) is method:
                    setattr(home, name, made())
            return made()(self, *given, **named)

        method.__name__ = name
        return method

    vars(dataclasses)["_create_fn"] = create_later


def main() -> NoReturn:
    """Entry point of the console script."""
    with listening():
        open_closed_streams()
        sys.meta_path.insert(0, LaterFinder)
        gc.set_threshold(COLLECT_EVERY)
        compile_methods_later()
        os.environ.setdefault(*IDLE_BLAS)
        from maneuver_automaton.cli.pictures import draughtsman

        with draughtsman(wanted=sys.argv[1:2] == ["plan"] and NO_PICTURE.isdisjoint(sys.argv)):
            code = run(sys.argv[1:])
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, signal.SIG_IGN)  # the rest takes no time
    gc.freeze()  # or the exit would look through every object of every library once more
    sys.exit(code)
