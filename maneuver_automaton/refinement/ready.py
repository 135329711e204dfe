"""Load or compile the kernels that improve plans before the clock runs."""

from __future__ import annotations

import functools
import math

from maneuver_automaton.refinement.improve import Patience, improve
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.ready import smallest_lattice_query
from maneuver_automaton.search.waiting import with_waits


@functools.cache
def load_lattice() -> None:
    """Have the kernels of the lattice ready, and those that improve its plans."""
    query = smallest_lattice_query()
    found = first_plan(query, deadline=math.inf)
    assert found.word is not None
    with_waits(query, found.word)
    improve(query, found.word, deadline=math.inf, patience=Patience(attempts=1, passes=1))
