"""Where the command line begins: signals are taken before anything heavy is imported."""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import NoReturn

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


def main() -> NoReturn:
    """Entry point of the console script."""
    with listening():
        open_closed_streams()
        sys.meta_path.insert(0, LaterFinder)
        gc.set_threshold(COLLECT_EVERY)
        os.environ.setdefault(*IDLE_BLAS)
        from maneuver_automaton.cli.pictures import draughtsman

        with draughtsman(wanted=sys.argv[1:2] == ["plan"] and NO_PICTURE.isdisjoint(sys.argv)):
            code = run(sys.argv[1:])
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, signal.SIG_IGN)  # the rest takes no time
    gc.freeze()  # or the exit would look through every object of every library once more
    sys.exit(code)
