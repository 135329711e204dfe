"""Hash tables of cells: open addressing, their size a power of two, so that a mask finds a row."""

from __future__ import annotations

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel

EMPTY = -1  # no key, in a set of keys


@inlined_kernel
def first_slot(key: int, mask: int) -> int:
    """Row of a hash table, of `mask` + 1 rows, at which the probes for a key begin.

    Source: Knuth (1998), *The art of computer programming 3*, Sec. 6.4, Fibonacci hashing.
    """
    # The high digits of a key (class, time, heading) are folded onto the low ones (place): cells of
    # one place could share a row otherwise. 31 bits times 32 bits stay below the sign.
    mixed = (key ^ (key >> 23) ^ (key >> 41)) & 0x7FFFFFFF
    return ((mixed * 0x9E3779B1) >> 15) & mask


@bare_inner_kernel
def enter(cells: IntArray, key: int) -> bool:
    """Add a key to a set of keys (n,), never full; whether it is new."""
    mask = cells.shape[0] - 1
    slot = first_slot(key, mask)
    while cells[slot] != EMPTY:
        if cells[slot] == key:
            return False
        slot = (slot + 1) & mask
    cells[slot] = key
    return True
