"""Arrays of one lattice search: they grow when they are full, and are used again."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._kept import kept_with
from maneuver_automaton.search import _kernels_nodes as kernels
from maneuver_automaton.search.arrays import SearchArrays
from maneuver_automaton.search.lattice_arrays import LatticeLibrary
from maneuver_automaton.search.prepared import Prepared
from maneuver_automaton.words.library import LibraryArrays, scratch_of

SMALLEST = 2048  # nodes
MOST_SPARE = 4  # searches of one library whose arrays are kept
LARGEST_SPARE = 1 << 15  # nodes of such a search, some 5 MB
GROWN_S = 2.5e-7  # [s] that room for one node takes, what there is moved there


def search_arrays(library: LibraryArrays) -> SearchArrays:
    """Room for a small search."""
    n = SMALLEST
    return SearchArrays(
        nodes=np.empty((n, 9)),
        links=np.empty((n, 7), dtype=np.int32),
        table=np.zeros((4 * n, 2), dtype=np.int64),
        heap_key=np.empty(n),
        heap_node=np.empty(n, dtype=np.int64),
        state=np.zeros(13, dtype=np.int64),
        found=np.zeros(5),
        scratch=scratch_of(library),
    )


def arrays_for(
    prepared: Prepared, library: LatticeLibrary, nodes: int, known: SearchArrays | None = None
) -> SearchArrays:
    """Arrays in which nothing is searched, with room: `known` ones, or an earlier search's."""
    if known is None:
        try:
            known = _spare(prepared, library).pop()
        except IndexError:  # asked for before, another thread might take the last one
            known = search_arrays(library.arrays.library)
    search = with_room(known, nodes)
    generation = search.state[kernels.GENERATION] + 1  # frees all rows of the hash table at once
    search.state[:] = 0
    search.state[kernels.GENERATION] = generation
    search.found[0] = math.inf
    return search


def give_back(prepared: Prepared, library: LatticeLibrary, arrays: SearchArrays) -> None:
    """Leave the arrays of a search that is over to the next one: fresh memory costs more."""
    spare = _spare(prepared, library)
    if len(spare) < MOST_SPARE and len(arrays.nodes) <= LARGEST_SPARE:
        spare.append(arrays)


def _spare(prepared: Prepared, library: LatticeLibrary) -> list[SearchArrays]:
    return kept_with(library, prepared, list)


def with_room(search: SearchArrays, nodes: int) -> SearchArrays:
    """A copy of a search in arrays that hold at least so many nodes; itself if it has room."""
    n = len(search.nodes)
    if nodes <= n:
        return search
    while n < nodes:
        n *= 2
    used = int(search.state[kernels.N_NODES])
    wide_nodes = np.empty((n, search.nodes.shape[1]))
    wide_links = np.empty((n, search.links.shape[1]), dtype=np.int32)
    wide_nodes[:used], wide_links[:used] = search.nodes[:used], search.links[:used]
    queued = int(search.state[kernels.HEAP])
    heap_key, heap_node = np.empty(n), np.empty(n, dtype=np.int64)
    heap_key[:queued], heap_node[:queued] = search.heap_key[:queued], search.heap_node[:queued]
    table = np.zeros((4 * n, 2), dtype=np.int64)
    kernels.rehash(search.table, int(search.state[kernels.GENERATION]), table)
    return search._replace(
        nodes=wide_nodes,
        links=wide_links,
        table=table,
        heap_key=heap_key,
        heap_node=heap_node,
    )
