"""A word as arrays of which the first `n` entries count: the edge to a trim, the trim, its time.

An edge is a maneuver of the lattice library; -1 stands for a switch at will, as all transitions of
a kinematic vehicle are. The state is known while a trim is coasted, so that a word is cut there.

The arrays are those of `work.Work`. `trims`, `durations` and `edges` (n,) are the word. `poses`
(n, 4), `times` (n + 1,) and `ends` (n,) follow from it, by `unroll`: where and when each coast
begins, and when it ends; `times[n]` is the duration of the word. `new_trims`, `new_durations` and
`new_edges` are the word that may take its place. `state` (1,) holds the length of the word.
"""

from __future__ import annotations

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.refinement.arrays import ImproveTask, Work
from maneuver_automaton.search._kernels_coast import coast_free, coasted, is_still, may_stay
from maneuver_automaton.search._kernels_maneuver import edge_end, edge_proven
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words._kernels_library import class_of

AT_WILL = -1  # edge of a switch
GAIN = 1e-9  # relative; a word that is cheaper by less is no gain
LENGTH = 0  # place of the word's length in `state`


@bare_inner_kernel
def word_cost(
    lib: LatticeArrays, trims: IntArray, durations: Array, edges: IntArray, n: int
) -> float:
    """Cost of a word with the prices of its switches and maneuvers."""
    # `gear` is the sign of the last forward speed: trims without one do not change direction.
    cost, gear = 0.0, 0
    for k in range(n):
        trim = trims[k]
        cost += lib.library.rates[trim] * durations[k]
        if edges[k] >= 0:
            cost += lib.edge_cost[edges[k]]
        elif k > 0:
            cost += lib.library.switch
        if lib.library.gears[trim] != 0:
            if gear * lib.library.gears[trim] < 0:
                cost += lib.library.direction_change
            gear = lib.library.gears[trim]
    return cost


@bare_inner_kernel
def unroll(lib: LatticeArrays, work: Work, n: int) -> None:
    """Fill the poses where coasts begin, and the times where they begin and end."""
    pose = (work.start[0], work.start[1], work.start[2], work.start[3])
    time = 0.0
    for k in range(n):
        if work.edges[k] >= 0:
            pose = edge_end(lib, work.edges[k], pose)
            time += lib.edge_time[work.edges[k]]
        work.poses[k, 0], work.poses[k, 1], work.poses[k, 2], work.poses[k, 3] = pose
        work.times[k] = time
        pose = coasted(lib, work.trims[k], pose, work.durations[k])
        time += work.durations[k]
        work.ends[k] = time
    work.times[n] = time


@inlined_kernel
def owner(work: Work, n: int, time: float) -> int:
    """Number of the last trim that has begun at a time: its coast, or the maneuver after it."""
    # By halving: `times` rise, and times[low] <= time < times[high], the ends aside.
    low, high = 0, n
    while high - low > 1:
        middle = (low + high) // 2
        if work.times[middle] <= time:
            low = middle
        else:
            high = middle
    return low


@inlined_kernel
def pose_at(
    lib: LatticeArrays, work: Work, k: int, time: float
) -> tuple[float, float, float, float]:
    """Pose (x, y, heading, z) at a time within trim `k`."""
    t = time - work.times[k]
    begin = (work.poses[k, 0], work.poses[k, 1], work.poses[k, 2], work.poses[k, 3])
    return coasted(lib, work.trims[k], begin, t)


@inlined_kernel
def price_of_transition(lib: LatticeArrays, work: Work, k: int) -> float:
    """Price of what leads to trim `k` from the trim before."""
    if work.edges[k] >= 0:
        return lib.edge_cost[work.edges[k]]
    return lib.library.switch


@inlined_kernel
def gear_before(lib: LatticeArrays, work: Work, k: int) -> int:
    """Sign of the last forward speed up to trim `k`, that included."""
    gear = 0
    while k >= 0 and gear == 0:
        gear = lib.library.gears[work.trims[k]]
        k -= 1
    return gear


@inlined_kernel
def gear_after(lib: LatticeArrays, work: Work, n: int, k: int) -> int:
    """Sign of the first forward speed from trim `k` on."""
    gear = 0
    while k < n and gear == 0:
        gear = lib.library.gears[work.trims[k]]
        k += 1
    return gear


# The functions that follow write the new word, `work.new_*`, from its begin to its end. They return
# its new length; where there is no room for it, one that `admitted` refuses.


@inlined_kernel
def begun(task: ImproveTask, work: Work) -> int:
    """Begin the new word: in the trim of the old one, where a word has to begin in a given trim."""
    if not task.given_ends:
        return 0
    work.new_trims[0], work.new_durations[0], work.new_edges[0] = work.trims[0], 0.0, AT_WILL
    return 1


@bare_inner_kernel
def put(work: Work, size: int, edge: int, trim: int, t: float) -> int:
    """Append a trim, whatever stands before it."""
    if size >= work.new_trims.shape[0] - 1:
        return work.new_trims.shape[0]
    work.new_trims[size], work.new_durations[size], work.new_edges[size] = trim, t, edge
    return size + 1


@bare_inner_kernel
def put_edge(lib: LatticeArrays, work: Work, size: int, edge: int) -> int:
    """Append a maneuver, and the trim that it begins in where the word is in another one."""
    if edge < 0 or size >= work.new_trims.shape[0]:
        return work.new_trims.shape[0]
    source = lib.edge_source[edge]
    if size == 0 or work.new_trims[size - 1] != source:
        size = put(work, size, AT_WILL, source, 0.0)
    return put(work, size, edge, lib.edge_target[edge], 0.0)


@bare_inner_kernel
def append(lib: LatticeArrays, work: Work, size: int, trim: int, t: float) -> int:
    """Append a coast of the class that the word is in, joined with the last one of its trim."""
    if t < lib.library.rounding.shortest or size >= work.new_trims.shape[0]:
        return size
    if size > 0 and work.new_trims[size - 1] == trim:
        work.new_durations[size - 1] += t
        return size
    return put(work, size, AT_WILL, trim, t)


@bare_inner_kernel
def append_through(lib: LatticeArrays, work: Work, size: int, trim: int, t: float) -> int:
    """Append a coast, after the maneuvers that lead to its class."""
    # `via_edge` is the first maneuver of the cheapest chain, so each round is nearer to the class.
    goal = class_of(lib.library, trim)
    while 0 < size < work.new_trims.shape[0]:
        at = class_of(lib.library, work.new_trims[size - 1])
        if at == goal:
            break
        size = put_edge(lib, work, size, lib.via_edge[at, goal])
    return append(lib, work, size, trim, t)


@bare_inner_kernel
def append_after(lib: LatticeArrays, work: Work, size: int, k: int, t: float) -> int:
    """Append trim `k` of the old word, for a time, and the maneuver that leads to it there."""
    if work.edges[k] >= 0:
        size = put_edge(lib, work, size, work.edges[k])
    return append(lib, work, size, work.trims[k], t)


@inlined_kernel
def ended(task: ImproveTask, work: Work, n: int, size: int) -> int:
    """End the new word: in the trim of the old one, of `n` trims, where that is given."""
    if not task.given_ends or size >= work.new_trims.shape[0]:
        return size
    if size > 0 and work.new_trims[size - 1] == work.trims[n - 1]:
        return size
    return put(work, size, AT_WILL, work.trims[n - 1], 0.0)


@bare_inner_kernel
def admitted(lib: LatticeArrays, task: ImproveTask, work: Work, size: int) -> bool:
    """Whether the word in `work.new_*` keeps the limits of words."""
    if size > work.new_trims.shape[0] - 1 or (task.most_trims > 0 and size > task.most_trims):
        return False
    duration = 0.0
    for k in range(size):
        t = work.new_durations[k]
        if 0.0 < t < task.least_coast and not is_still(lib, work.new_trims[k]):
            return False
        duration += t
        if work.new_edges[k] >= 0:
            duration += lib.edge_time[work.new_edges[k]]
    return duration <= task.most_time


@bare_inner_kernel
def still_free(
    lib: LatticeArrays, task: ImproveTask, scene: Scene, work: Work, size: int, begin: float
) -> bool:
    """Whether the word in `work.new_*` is free after `begin` [s], where obstacles move."""
    # What ends before `begin` is driven as before, and was proven then.
    pose = (work.start[0], work.start[1], work.start[2], work.start[3])
    time = 0.0
    for k in range(size):
        edge, trim, t = work.new_edges[k], work.new_trims[k], work.new_durations[k]
        if edge >= 0:
            later = time + lib.edge_time[edge] > begin
            if later and edge_proven(scene, lib, edge, pose, task.clock + time) < 0.0:
                return False
            pose = edge_end(lib, edge, pose)
            time += lib.edge_time[edge]
        if time + t > begin and not coast_free(scene, lib, trim, pose, t, task.clock + time):
            return False
        pose = coasted(lib, trim, pose, t)
        time += t
    last = work.new_trims[max(size - 1, 0)]
    return may_stay(scene, lib, last, pose, task.clock + time, task.stay_until)


@bare_inner_kernel
def take(work: Work, state: IntArray, size: int) -> None:
    """Make the word in `work.new_*` the word."""
    for k in range(size):
        work.trims[k], work.durations[k] = work.new_trims[k], work.new_durations[k]
        work.edges[k] = work.new_edges[k]
    state[LENGTH] = size
