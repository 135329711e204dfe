"""What is compiled before the clock runs is what searches use."""

from __future__ import annotations

import os

import pytest

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.refinement import _kernels_improve as attempts
from maneuver_automaton.refinement import _kernels_points as points
from maneuver_automaton.search import _kernels_lattice as lattice
from tests.refinement.test_incumbent_words import query
from tests.search.maneuver_searches import search_maneuvers

KERNELS = (
    lattice.expand,
    attempts.attempt_all,
    points.begin_program,
    points.join_points,
    points.take_program,
)


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_every_kernel_is_ready():
    load_kernels("lattice", "improvement")
    before = [len(kernel.signatures) for kernel in KERNELS]
    assert min(before) >= 1
    search_maneuvers(query(), max_expansions=300)
    assert [len(kernel.signatures) for kernel in KERNELS] == before
