"""A set of keys in a hash table, against Python's own."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.search._kernels_nodes import EMPTY, enter, first_slot

enter_one = getattr(enter, "py_func", enter)
begin = getattr(first_slot, "py_func", first_slot)


@given(keys=st.lists(st.integers(0, 30) | st.integers(0, 2**56), max_size=60))
def test_a_key_is_new_once(keys):
    cells, known = np.full(64, EMPTY), set()
    for key in keys:
        assert enter_one(cells, key) == (key not in known)
        known.add(key)
    assert sorted(cells[cells != EMPTY].tolist()) == sorted(known)


def test_keys_side_by_side_do_not_crowd():
    slots = {begin(key, 4095) for key in range(1000)}
    assert len(slots) > 800
