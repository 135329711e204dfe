"""`compile`: have every kernel ready before it is used."""

from __future__ import annotations

import time

from maneuver_automaton._compile_all import compile_missing
from maneuver_automaton._kernel_folders import kernel_folder
from maneuver_automaton._kernel_list import listed
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, complain
from maneuver_automaton.cli.tables import console

CACHE = "MANEUVER_AUTOMATON_CACHE_DIR"


def run(*, jobs: int | None) -> int:
    """Compile what is missing in the user's cache, and say where it lies."""
    began = time.perf_counter()
    failed = compile_missing(jobs=jobs)
    if failed is None:
        complain(f"compile: no folder can be written; {CACHE} names another one")
        return BAD_INPUT
    for failure in failed:
        complain(failure)
    took = time.perf_counter() - began
    line = f"{len(listed()) - len(failed)} kernels are compiled, after {took:.1f} s: "
    console().print(f"{line}{kernel_folder()}", soft_wrap=True)
    return BAD_INPUT if failed else FOUND
