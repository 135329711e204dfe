"""Exhaustive search: every word of a given number of trims.

A word of n trims has n - 3 times more than the planar pose fixes. Words of three follow in closed
form, longer ones are scanned; words that cannot span the plane have closed forms of their own.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel, shared_kernel
from maneuver_automaton.groups._kernels import coast
from maneuver_automaton.search._kernels_polish import polish_all
from maneuver_automaton.search._kernels_problem import (
    COST,
    DISTANCE,
    TURN,
    Candidates,
    Found,
    Links,
    WordProblem,
    condition,
    conjugate,
    is_parallel,
    is_straight,
    look,
    look_ahead,
    moves_in_plane,
    propose,
    room_for,
    switch_prices,
    time_left,
    transitions_cost,
    word_extra,
)
from maneuver_automaton.search._kernels_scan_costs import any_node_may_do, may_be_optimal
from maneuver_automaton.search._kernels_scan_one import scan_one
from maneuver_automaton.search._kernels_triple import choose_triple, levels, solve_triple
from maneuver_automaton.words._kernels_steering import phase, unit
from maneuver_automaton.words._kernels_times import least_squares

SAME_PRICE = 1e-9  # relative: chains of transitions of one price are one
ROUNDED = 1e-6  # relative, of times: by less than that they change where they are refined
NEARLY = 1e-5  # [m, s] a linear condition is met: where circles touch, half of the digits are lost
NONE_LEFT = 1e-9  # [m, s] of a linear condition: transitions leave no more than rounding


@bare_inner_kernel
def closed_form_words(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    room: tuple[Array, Array, Array],
    upper_bound: float,
) -> None:
    """Words of three trims: isolated solutions."""
    times, out, span = room
    library = problem.library
    steering = library.twists, library.goal, problem.scan.tolerance, candidates.counter
    solve_triple(steering, word, n, triple, times, out)
    for branch in range(2):
        admissible = not math.isnan(out[branch, 0])
        cost = problem.terms.pad_cost + word_extra(problem, word, n)
        for i in range(3):
            times[i] = out[branch, i]
            if times[i] <= 1e-9:
                times[i] += problem.trims.periods[word[i]]  # a full turn instead of none
            if not 1e-9 < times[i] < np.inf:
                admissible = False
                break
            cost += problem.library.rates[word[i]] * times[i]
        if admissible and cost < upper_bound:
            for r in range(problem.library.targets.size):
                span[r, 0] = condition(problem, word, n, r, times) - NEARLY
                span[r, 1] = span[r, 0] + 2.0 * NEARLY
            levels(problem, candidates, word, n, times, times, times, span)


@inner_kernel
def low_rank_word(problem: WordProblem, candidates: Candidates, word: IntArray, n: int) -> None:
    """Words that cannot reach every pose: one or two subgroups, or straights only."""
    # The goal must lie where they can go. What each subgroup contributes follows in closed form;
    # the times are then the solution of a square linear system. The second subgroup may lead back
    # to the line, or circle, of the first: as a U-turn does, after which this one goes on.
    twists, m = problem.library.twists, problem.library.targets.size
    straight = True
    # Positions of the first trim of either subgroup, and after both; n: no trim is of it. One that
    # only climbs or rests is of none: it would be taken for parallel to any.
    begin, split, back = n, n, n
    for i in range(n):
        straight = straight and is_straight(problem, word[i])
        if not moves_in_plane(twists[word[i]]):
            continue
        if begin == n:
            begin = i
        elif split == n and not problem.trims.parallel[word[begin], word[i]]:
            split = i
        elif split < n and back == n and not problem.trims.parallel[word[split], word[i]]:
            back = i
    rank = (begin < n) + (split < n)
    if n > rank + m:
        return
    heading = problem.library.goal[2]
    full = 2.0 * math.pi
    if straight:
        if abs(heading - full * round(heading / full)) > 1e-9:
            return
        matrix, rhs = with_conditions(problem, word, n, 2)
        for k in range(2):
            rhs[k] = problem.library.goal[k]
            for i in range(n):
                matrix[k, i] = twists[word[i], k]
        times, found_rank = least_squares(matrix, rhs, 1e-11)
        if found_rank == n:
            propose(problem, candidates, word, n, times)
        return
    second = word[split] if rank == 2 else -1
    w_1, w_2 = twists[word[begin], 2], twists[second, 2] if rank == 2 else 0.0
    if w_1 == 0.0 and w_2 == 0.0:
        return
    block_1, block_2 = blocks_of(problem, word[begin], second)
    block_1 -= full * round(block_1 / full) if w_1 != 0.0 else 0.0
    block_2 -= full * round(block_2 / full) if w_2 != 0.0 else 0.0
    motions = twists[word[:n]]  # those that come back as seen from before the second subgroup
    if back < n:
        time = block_2 / w_2 if w_2 != 0.0 else block_2
        x, y, turn = coast(twists[second, 0], twists[second, 1], w_2, time)
        for i in range(back, n):
            conjugate(motions[i], x, y, turn)
            if not is_parallel(motions[i], motions[begin]):
                return
    fastest = 0.0
    for i in range(n):
        fastest = max(fastest, abs(twists[word[i], 2]))
    most = 1
    if problem.terms.more_turns == 1 and time_left(problem) < np.inf:
        most += math.floor(time_left(problem) * fastest / full)
    # Without other conditions each trim is the only one of its subgroup, and goes on in time.
    alone_1, alone_2 = m == 0, m == 0 and rank == 2
    pace_1, pace_2 = w_1 if w_1 != 0.0 else 1.0, w_2 if w_2 != 0.0 else 1.0
    most_1, most_2 = most if w_1 != 0.0 else 0, most if w_2 != 0.0 else 0
    for turns_1 in range(-most_1, most_1 + 1):
        time_1 = (block_1 + full * turns_1) / pace_1
        if alone_1 and not 0.0 <= time_1 <= longest_time(problem, word[begin], 0.0):
            continue
        for turns_2 in range(-most_2, most_2 + 1):
            time_2 = (block_2 + full * turns_2) / pace_2
            if alone_2 and not 0.0 <= time_2 <= longest_time(problem, second, time_1):
                continue
            matrix, rhs = with_conditions(problem, word, n, rank)
            rhs[0] = block_1 + full * turns_1
            if rank == 2:
                rhs[1] = block_2 + full * turns_2
            for i in range(n):
                row = 1 if split <= i < back else 0
                twist, head = motions[i], motions[split if row == 1 else begin]
                pace = twist[2]
                if head[2] == 0.0:
                    pace = (twist[0] * head[0] + twist[1] * head[1]) / (head[0] ** 2 + head[1] ** 2)
                matrix[row, i] = pace
            times, found_rank = least_squares(matrix, rhs, 1e-11)
            if found_rank == n and times.min() > 1e-9:
                propose(problem, candidates, word, n, times)


@bare_inner_kernel
def longest_time(problem: WordProblem, trim: int, before: float) -> float:
    """How long a trim may last in a solution, after others of so long: no other is recorded."""
    longest: float = problem.trims.periods[trim] if problem.terms.more_turns == 0 else np.inf
    longest *= 1.0 + ROUNDED
    if problem.trims.weights[trim] > 0.0:
        longest = min(longest, time_left(problem) * (1.0 + ROUNDED) - before)
    return longest


@inner_kernel
def with_conditions(problem: WordProblem, word: IntArray, n: int, rows: int) -> tuple[Array, Array]:
    """A linear system for the times of a word: `rows` to be filled in, then its conditions."""
    m = problem.library.targets.size
    matrix, rhs = np.zeros((rows + m, n)), np.empty(rows + m)
    for r in range(m):
        rhs[rows + r] = problem.library.targets[r]
        for i in range(n):
            matrix[rows + r, i] = problem.library.rows[r, word[i]]
    return matrix, rhs


@bare_inner_kernel
def blocks_of(problem: WordProblem, first: int, second: int) -> tuple[float, float]:
    """What trims parallel to the `first` and to the `second` contribute; -1 for no second one."""
    z, heading = complex(problem.library.goal[0], problem.library.goal[1]), problem.library.goal[2]
    if second < 0:
        return heading, 0.0
    one, other = problem.library.twists[first], problem.library.twists[second]
    v_1, v_2, w_1, w_2 = complex(one[0], one[1]), complex(other[0], other[1]), one[2], other[2]
    if w_1 != 0.0 and w_2 != 0.0:
        r_1, r_2 = -1j * v_1 / w_1, -1j * v_2 / w_2
        angle = phase((z + r_1 - r_2 * unit(heading)) / (r_1 - r_2))
        return angle, heading - angle
    if w_1 != 0.0:
        rest = z + 1j * v_1 / w_1 * (unit(heading) - 1.0)
        return heading, (rest * (v_2 * unit(heading)).conjugate()).real / abs(v_2) ** 2
    rest = z + 1j * v_2 / w_2 * (unit(heading) - 1.0)
    return (rest * v_1.conjugate()).real / abs(v_1) ** 2, heading


@bare_inner_kernel
def passing_words(
    links: Links,
    seen: WordProblem,
    candidates: Candidates,
    word: IntArray,
    rows: IntArray,
    n: int,
    tail: int,
    less: IntArray,
    room: tuple[Array, Array, Array],
    upper_bound: float,
) -> None:
    """Words of four trims that pass through one of them: the other three follow in closed form."""
    # Its transitions alone turn and move a vehicle on, which may be all that is wanted of a trim.
    kept, triple = less[0], less[1]  # rows that last a while, and those solved for
    for passed in range(n):
        if word[passed] == tail:
            continue
        before = links.start if passed == 0 else links.class_of[word[passed - 1]]
        last = passed == n - 1 or word[passed + 1] == tail
        after = links.goal if last else links.class_of[word[passed + 1]]
        through = links.class_of[word[passed]]
        if first_of_class(links, through) != word[passed]:
            continue  # the same transitions lead through another trim of its class
        around = links.cost[before, through] + links.cost[through, after]
        if around <= links.cost[before, after] * (1.0 + SAME_PRICE):
            continue  # the cheapest chain passes through it by itself
        for i in range(n - 1):
            kept[i] = rows[i] if i < passed else rows[i + 1]
        if word_blocks(seen, kept, n - 1) > 0 and choose_triple(seen, kept, n - 1, triple):
            closed_form_words(seen, candidates, kept, n - 1, triple, room, upper_bound)


@bare_inner_kernel
def first_of_class(links: Links, wanted: int) -> int:
    """The first trim of a class."""
    for trim in range(links.class_of.size):
        if links.class_of[trim] == wanted:
            return trim
    return -1


@bare_inner_kernel
def promising(
    problem: WordProblem, left: WordProblem, word: IntArray, n: int, upper_bound: float
) -> bool:
    """Whether a word can be cheaper than the costliest of the solutions asked for."""
    # Lower bounds that hold for any times, of what its transitions have `left` to its trims:
    # distance and turn at the best price per metre and radian, each linear condition at the best
    # per unit.
    if upper_bound == np.inf:
        return True
    per_metre, per_radian, per_second = np.inf, np.inf, np.inf
    for i in range(n):
        per_metre = min(per_metre, problem.trims.prices[word[i], 0])
        per_radian = min(per_radian, problem.trims.prices[word[i], 1])
        per_second = min(per_second, problem.library.rates[word[i]])
    if per_second < 0.0:
        return True
    bound = 0.0
    if left.fixed[DISTANCE] > 0.0:
        bound = max(bound, left.fixed[DISTANCE] * per_metre)
    if left.fixed[TURN] > 0.0:
        bound = max(bound, left.fixed[TURN] * per_radian)
    for r in range(left.library.targets.size):
        target = left.library.targets[r]
        if abs(target) > NONE_LEFT:  # no trim of the other direction brings it nearer
            per_unit = np.inf
            for i in range(n):
                pace = problem.library.rows[r, word[i]] * math.copysign(1.0, target)
                if pace > 0.0:
                    per_unit = min(per_unit, problem.library.rates[word[i]] / pace)
            bound = max(bound, abs(target) * per_unit)
    bound += problem.terms.pad_cost + left.fixed[COST] + switch_prices(problem, word, n)
    return bound < upper_bound


# The transitions of a word are looked at where they stand in the loop: with a function for that,
# inlined or called, a scan of words with transitions takes twice the time.


@shared_kernel
def propose_words(
    problem: WordProblem,
    links: Links,
    candidates: Candidates,
    flat: bool,
    numbers: tuple[int, int, int],
    upper_bound: float,
) -> int:
    """Propose starts for words of n trims, at most one time free, of `numbers` (n, first, last)."""
    # Those that cannot span the plane if `flat`, otherwise those that can. Returns the number of
    # the word to go on with: before the last when the buffer is full.
    n, first, last = numbers
    linked = links.cost.shape[0] > 1
    seen = room_for(problem, n) if linked else problem
    word = np.zeros(n, dtype=np.int64)
    rows = np.zeros(n, dtype=np.int64) if linked else word
    triple = np.zeros(3, dtype=np.int64)
    less = np.zeros((2, n), dtype=np.int64)  # rows that last where one is passed, their triple
    # times of a word, both branches of those that are solved for, and what conditions come to
    room = np.zeros(n), np.empty((2, 3)), np.empty((problem.library.targets.size, 2))
    most = upper_bound - problem.terms.pad_cost
    passes = linked and problem.library.targets.size == 0
    everything, tail = problem.scan.slack == np.inf, problem.tail
    n_trims = problem.library.twists.shape[0]
    counter, full = candidates.counter, candidates.words.shape[0] // 2
    for number in range(first, last):
        if counter[0] > full:
            return number
        word_of_number(n_trims, word, n, number, tail)
        if linked:
            if not transitions_cost(links, word, n, tail) < most:
                continue
            look_ahead(problem, links, seen, word, n)
            if not promising(problem, seen, word, n, upper_bound):
                counter[1] += 1
                continue
            look(problem, links, seen, word, n, rows)
        elif n == 4 and not may_be_optimal(problem, word, number, upper_bound):
            counter[1] += 1
            continue
        spans = prepare_word(seen, candidates, rows, n, triple, upper_bound)
        if flat:
            if spans > 0:
                low_rank_word(seen, candidates, rows, n)
        elif spans == 2 and n == 3:
            closed_form_words(seen, candidates, rows, n, triple, room, upper_bound)
        elif spans == 2:
            if passes:
                passing_words(links, seen, candidates, word, rows, n, tail, less, room, upper_bound)
            if everything or any_node_may_do(seen, candidates, rows, n, triple, room, upper_bound):
                scan_one(seen, candidates, rows, n, triple, upper_bound)
    return last


@kernel
def scan_words(
    problem: WordProblem,
    links: Links,
    candidates: Candidates,
    flat: bool,
    numbers: tuple[int, int, int],
    upper_bound: float,
) -> int:
    """`propose_words`, for Python to call."""
    return propose_words(problem, links, candidates, flat, numbers, upper_bound)


@bare_inner_kernel
def word_of_number(n_trims: int, word: IntArray, n: int, number: int, tail: int) -> None:
    """Fill `word` with the digits of its number, and with the turn of a free heading."""
    # It takes few arguments, as does the price of the transitions: for most words with transitions
    # that is all there is to do, and arguments cost more than that.
    if tail >= 0:
        n_trims -= 1
        n -= 1
        word[n] = tail
    for i in range(n - 1, -1, -1):
        word[i] = number % n_trims
        number //= n_trims


@bare_inner_kernel
def prepare_word(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    upper_bound: float,
) -> int:
    """Fill `triple`: 0 nothing to do, 1 a word that cannot span, 2 one that can."""
    # Whether the trims of a word span, and what its transitions leave of the distance, shows only
    # in one that is seen. The lower bound of its cost comes before all that is costly.
    blocks = word_blocks(problem, word, n)
    if blocks == 0 or not time_left(problem) > 0.0:
        return 0
    candidates.counter[1] += 1
    if not promising(problem, problem, word, n, upper_bound):
        return 0
    if blocks < 0:
        return 1
    return 2 if choose_triple(problem, word, n, triple) else 0


@bare_inner_kernel
def word_blocks(problem: WordProblem, word: IntArray, n: int) -> int:
    """Number of runs of parallel trims; negative where the word cannot span, 0 if useless."""
    # Without linear conditions two parallel neighbours are never better than one of them.
    blocks = 0
    straights = 0
    last = -1  # the last trim that moves in the plane
    for i in range(n):
        straights += is_straight(problem, word[i])
        if i > 0:
            if word[i] == word[i - 1]:
                return 0
            if problem.library.targets.size == 0 and problem.trims.parallel[word[i], word[i - 1]]:
                return 0
        if moves_in_plane(problem.library.twists[word[i]]):
            if last < 0 or not problem.trims.parallel[word[i], last]:
                blocks += 1
            last = word[i]
    return -max(blocks, 1) if blocks <= 2 or straights == n else blocks


@inner_kernel
def tied_to_best(found: Found, tie: float) -> float:
    """Largest cost that counts as equal to the costliest solution asked for."""
    best: float = found.best[found.best.size - 1]
    return best + tie * (1.0 + abs(best))


@inner_kernel
def scan_mode(
    problem: WordProblem,
    links: Links,
    candidates: Candidates,
    found: Found,
    n: int,
    tail: int,
    portions: IntArray,
    most: int,
    tie: float,
    not_first: int,
) -> None:
    """Scan words of `n` trims, with a free turn if `tail`, not from `not_first`; polish them."""
    trims = problem.library.twists.shape[0] - tail
    each, last = trims ** (n - 1), trims**n  # words that begin with one trim, and all
    left_out = not_first * each if not_first >= 0 else last
    n += tail
    for scan in range(2):  # words that cannot span the plane; those that can
        if (scan == 0 and n > 2 + problem.library.targets.size) or (scan == 1 and n < 3):
            continue
        portion = portions[0] if scan == 0 or n == 3 else portions[1]
        # No plain 0: until all is known of the loop numba takes it for a constant, and compiles
        # `propose_words`, which takes half a minute, for words from number 0 as well.
        number = 0 * last
        while number < last:
            if number == left_out:
                number += each
                continue
            upper_bound = tied_to_best(found, tie)
            end = min(number + portion, left_out if number < left_out else last)
            numbers = (n, number, end)
            number = propose_words(problem, links, candidates, scan == 0, numbers, upper_bound)
            if candidates.counter[0] > 0:
                polish_all(problem, links, candidates, found, most)


@kernel
def scan_all_words(
    one: WordProblem,
    links_of_one: Links,
    other: WordProblem,
    links_of_other: Links,
    most_moving: IntArray,
    at_least: Array,
    candidates: Candidates,
    found: Found,
    tail: int,
    portions: IntArray,
    most: int,
    tie: float,
    left_out: IntArray,
) -> None:
    """Scan and polish all words of up to `most` trims, at most four with the free turn.

    It does what `WordScan` does portion by portion. Where a whole scan takes less than a glance at
    the clock is worth, calls from Python would take most of the time.

    In one or two ways to meet the time, each with its greatest number of moving trims, 0 for a way
    that is none, and with a lower bound of what its words cost. Shorter words come first;
    `portions` says how many words, of three trims and of four, are scanned before the solutions of
    some lower the upper bound of the others. Where `left_out` (1,) is a trim, only words of the
    first way's most moving trims that do not begin with it are scanned, and longer ones.
    """
    not_first = left_out[0]
    for n in range(1 if not_first < 0 else most_moving[0], most + 1):
        if n <= most_moving[0] and not at_least[0] > tied_to_best(found, tie):
            scan_mode(one, links_of_one, candidates, found, n, tail, portions, most, tie, not_first)
        if n <= most_moving[1] and not at_least[1] > tied_to_best(found, tie):
            scan_mode(
                other, links_of_other, candidates, found, n, tail, portions, most, tie, not_first
            )
