"""A word as arrays of which the first `n` entries count: the edge to a trim, the trim, its time.

An edge is a maneuver of the lattice library; -1 stands for a switch at will, as all transitions of
a kinematic vehicle are. The state is known while a trim is coasted, so that a word is cut there.

The arrays are those of `arrays.WordArrays`. `now` is the word; `poses` (n, 4), `times` (n + 1,) and
`ends` (n,) follow from it, by `unroll`: where and when each coast begins, and when it ends;
`times[n]` is the duration of the word. `new` is the word that may take its place.
"""

from __future__ import annotations

from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel
from maneuver_automaton.refinement.arrays import ImproveTask, Improving, WordArrays, WordSteps
from maneuver_automaton.search._kernels_coast import (
    coast_free,
    coasted,
    edge_end,
    is_still,
    may_stay,
)
from maneuver_automaton.search._kernels_connection import edge_proven
from maneuver_automaton.search._kernels_place import (
    coast_place,
    edge_place,
    places_cost,
    steps_place,
)
from maneuver_automaton.search.arrays import LatticeArrays
from maneuver_automaton.words._kernels_library import class_of

AT_WILL = -1  # edge of a switch
GAIN = 1e-9  # relative; a word that is cheaper by less is no gain


@bare_inner_kernel
def word_cost(lib: LatticeArrays, steps: WordSteps, n: int) -> float:
    """Cost of a word with the prices of its switches and maneuvers."""
    # `gear` is the sign of the last forward speed: trims without one do not change direction.
    trims, durations, edges = steps.trims, steps.durations, steps.edges
    cost, gear = 0.0, 0
    for k in range(n):
        trim = trims[k]
        cost += lib.library.rates[trim] * durations[k]
        if edges[k] >= 0:
            cost += lib.edges.cost[edges[k]]
        elif k > 0:
            cost += lib.library.switch
        if lib.library.gears[trim] != 0:
            if gear * lib.library.gears[trim] < 0:
                cost += lib.library.direction_change
            gear = lib.library.gears[trim]
    return cost


@bare_inner_kernel
def whole_cost(one: Improving, steps: WordSteps, n: int) -> float:
    """Cost of a word with what its places cost."""
    cost = word_cost(one.library, steps, n)
    if places_cost(one.scene):
        start, lib = one.word.start, one.library
        trims, durations, edges = steps.trims, steps.durations, steps.edges
        cost += steps_place(one.scene, lib, start, trims, durations, edges, n)
    return cost


@bare_inner_kernel
def place_between(one: Improving, begin: float, end: float, first: int, last: int) -> float:
    """Price of the places along the word between two times, within the trims `first` and `last`."""
    scene, lib, word = one.scene, one.library, one.word
    total = 0.0
    if not places_cost(scene):
        return total
    for k in range(first, last + 1):
        low, high = max(word.times[k], begin), min(word.ends[k], end)
        if k > first and word.now.edges[k] >= 0:
            before = pose_at(lib, word, k - 1, word.ends[k - 1])
            total += edge_place(scene, lib, word.now.edges[k], before)
        if high > low:
            at = pose_at(lib, word, k, low)
            total += coast_place(scene, lib, word.now.trims[k], at, high - low)
    return total


@bare_inner_kernel
def unroll(lib: LatticeArrays, word: WordArrays, n: int) -> None:
    """Fill the poses where coasts begin, and the times where they begin and end."""
    pose = (word.start[0], word.start[1], word.start[2], word.start[3])
    time = 0.0
    for k in range(n):
        if word.now.edges[k] >= 0:
            pose = edge_end(lib, word.now.edges[k], pose)
            time += lib.edges.time[word.now.edges[k]]
        word.poses[k, 0], word.poses[k, 1], word.poses[k, 2], word.poses[k, 3] = pose
        word.times[k] = time
        pose = coasted(lib, word.now.trims[k], pose, word.now.durations[k])
        time += word.now.durations[k]
        word.ends[k] = time
    word.times[n] = time


@bare_inner_kernel
def owner(word: WordArrays, n: int, time: float) -> int:
    """Number of the last trim that has begun at a time: its coast, or the maneuver after it."""
    # By halving: `times` rise, and times[low] <= time < times[high], the ends aside.
    low, high = 0, n
    while high - low > 1:
        middle = (low + high) // 2
        if word.times[middle] <= time:
            low = middle
        else:
            high = middle
    return low


@bare_inner_kernel
def pose_at(
    lib: LatticeArrays, word: WordArrays, k: int, time: float
) -> tuple[float, float, float, float]:
    """Pose (x, y, heading, z) at a time within trim `k`."""
    t = time - word.times[k]
    begin = (word.poses[k, 0], word.poses[k, 1], word.poses[k, 2], word.poses[k, 3])
    return coasted(lib, word.now.trims[k], begin, t)


@bare_inner_kernel
def price_of_transition(lib: LatticeArrays, word: WordArrays, k: int) -> float:
    """Price of what leads to trim `k` from the trim before."""
    if word.now.edges[k] >= 0:
        return lib.edges.cost[word.now.edges[k]]
    return lib.library.switch


@bare_inner_kernel
def gear_before(lib: LatticeArrays, word: WordArrays, k: int) -> int:
    """Sign of the last forward speed up to trim `k`, that included."""
    gear = 0
    while k >= 0 and gear == 0:
        gear = lib.library.gears[word.now.trims[k]]
        k -= 1
    return gear


@bare_inner_kernel
def gear_after(lib: LatticeArrays, word: WordArrays, n: int, k: int) -> int:
    """Sign of the first forward speed from trim `k` on."""
    gear = 0
    while k < n and gear == 0:
        gear = lib.library.gears[word.now.trims[k]]
        k += 1
    return gear


# The functions that follow write the new word, `word.new`, from its begin to its end. They return
# its new length; where there is no room for it, one that `admitted` refuses.


@bare_inner_kernel
def begun(task: ImproveTask, word: WordArrays) -> int:
    """Begin the new word: in the trim of the old one, where a word has to begin in a given trim."""
    if not task.given_ends:
        return 0
    word.new.trims[0], word.new.durations[0], word.new.edges[0] = word.now.trims[0], 0.0, AT_WILL
    return 1


@bare_inner_kernel
def put(word: WordArrays, size: int, edge: int, trim: int, t: float) -> int:
    """Append a trim, whatever stands before it."""
    if size >= word.new.trims.shape[0] - 1:
        return word.new.trims.shape[0]
    word.new.trims[size], word.new.durations[size], word.new.edges[size] = trim, t, edge
    return size + 1


@bare_inner_kernel
def put_edge(lib: LatticeArrays, word: WordArrays, size: int, edge: int) -> int:
    """Append a maneuver, and the trim that it begins in where the word is in another one."""
    if edge < 0 or size >= word.new.trims.shape[0]:
        return word.new.trims.shape[0]
    source = lib.edges.source[edge]
    if size == 0 or word.new.trims[size - 1] != source:
        size = put(word, size, AT_WILL, source, 0.0)
    return put(word, size, edge, lib.edges.target[edge], 0.0)


@bare_inner_kernel
def append(lib: LatticeArrays, word: WordArrays, size: int, trim: int, t: float) -> int:
    """Append a coast of the class that the word is in, joined with the last one of its trim."""
    if t < lib.library.rounding.shortest or size >= word.new.trims.shape[0]:
        return size
    if size > 0 and word.new.trims[size - 1] == trim:
        word.new.durations[size - 1] += t
        return size
    return put(word, size, AT_WILL, trim, t)


@bare_inner_kernel
def append_through(lib: LatticeArrays, word: WordArrays, size: int, trim: int, t: float) -> int:
    """Append a coast, after the maneuvers that lead to its class."""
    # `via_edge` is the first maneuver of the cheapest chain, so each round is nearer to the class.
    goal = class_of(lib.library, trim)
    while 0 < size < word.new.trims.shape[0]:
        at = class_of(lib.library, word.new.trims[size - 1])
        if at == goal:
            break
        size = put_edge(lib, word, size, lib.edges.via[at, goal])
    return append(lib, word, size, trim, t)


@bare_inner_kernel
def append_after(lib: LatticeArrays, word: WordArrays, size: int, k: int, t: float) -> int:
    """Append trim `k` of the old word, for a time, and the maneuver that leads to it there."""
    if word.now.edges[k] >= 0:
        size = put_edge(lib, word, size, word.now.edges[k])
    return append(lib, word, size, word.now.trims[k], t)


@bare_inner_kernel
def ended(task: ImproveTask, word: WordArrays, n: int, size: int) -> int:
    """End the new word: in the trim of the old one, of `n` trims, where that is given."""
    if not task.given_ends or size >= word.new.trims.shape[0]:
        return size
    if size > 0 and word.new.trims[size - 1] == word.now.trims[n - 1]:
        return size
    return put(word, size, AT_WILL, word.now.trims[n - 1], 0.0)


@bare_inner_kernel
def admitted(lib: LatticeArrays, task: ImproveTask, word: WordArrays, size: int) -> bool:
    """Whether the word in `word.new` keeps the limits of words."""
    if size > word.new.trims.shape[0] - 1 or (
        task.limits.most_trims > 0 and size > task.limits.most_trims
    ):
        return False
    duration = 0.0
    for k in range(size):
        t = word.new.durations[k]
        if 0.0 < t < task.limits.least_coast and not is_still(lib, word.new.trims[k]):
            return False
        duration += t
        if word.new.edges[k] >= 0:
            duration += lib.edges.time[word.new.edges[k]]
    return duration <= task.limits.most_time


@bare_shared_kernel
def still_free(one: Improving, size: int, begin: float) -> bool:
    """Whether the word in `word.new` is free after `begin` [s], where obstacles move."""
    # What ends before `begin` is driven as before, and was proven then.
    word, lib = one.word, one.library
    scene, limits = one.scene, one.task.limits
    pose = (word.start[0], word.start[1], word.start[2], word.start[3])
    time = 0.0
    for k in range(size):
        edge, trim, t = word.new.edges[k], word.new.trims[k], word.new.durations[k]
        if edge >= 0:
            later = time + lib.edges.time[edge] > begin
            if later and edge_proven(scene, lib, edge, pose, limits.clock + time) < 0.0:
                return False
            pose = edge_end(lib, edge, pose)
            time += lib.edges.time[edge]
        if time + t > begin and not coast_free(scene, lib, trim, pose, t, limits.clock + time):
            return False
        pose = coasted(lib, trim, pose, t)
        time += t
    last = word.new.trims[max(size - 1, 0)]
    return may_stay(scene, lib, last, pose, limits.clock + time, limits.stay_until)


@bare_inner_kernel
def take(word: WordArrays, size: int) -> None:
    """Make the word in `word.new` the word."""
    for k in range(size):
        word.now.trims[k], word.now.durations[k] = word.new.trims[k], word.new.durations[k]
        word.now.edges[k] = word.new.edges[k]
    word.length[0] = size
