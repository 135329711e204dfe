"""Exhaustive search over words, on the paper's parking problem and on small libraries."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Omnidirectional, UserModel
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.search.words import search_words
from tests.reference import Word, words_of
from tests.search.cases import (
    INTERPRETED,
    REVERSED_SPIN,
    TABLE_2,
    compiled_only,
    end_off_goal,
    helicopter,
    lasting,
    names,
    parking,
    reference_word,
    robot,
    without_rest,
)

MINIMUM_TIME = Cost(time=1.0)


def search(problem, **options):
    return search_words(problem, problem.goals[0], **options)


def best(problem, **options):
    return search(problem, **options).solutions[0]


def listed(result):
    """Words with their times, as plain numbers."""
    return [(tuple(s.trims.tolist()), s.durations, s.cost) for s in result.solutions]


def assert_same_solutions(one, other, *, atol=1e-9):
    """The same words, times and costs, in the same order."""
    assert [word for word, _, _ in listed(one)] == [word for word, _, _ in listed(other)]
    for (_, times, cost), (_, again, cost_again) in zip(listed(one), listed(other), strict=True):
        assert again == pytest.approx(times, abs=1e-6)
        assert cost_again == pytest.approx(cost, abs=atol, rel=atol)


def assert_valid(problem, solution):
    """Ends at the goal, times positive and in sum as asked for, cost as it is defined."""
    distance, angle = end_off_goal(problem, solution)
    assert distance < 1e-9
    assert angle < 1e-9 or problem.goals[0].free_heading
    assert solution.durations.min(initial=1.0) > 0.0
    horizon = problem.horizon
    if horizon.time is not None:
        assert solution.duration == pytest.approx(horizon.time, abs=1e-9)
    if horizon.max_time is not None:
        assert solution.duration <= horizon.max_time + 1e-9
    if horizon.max_trims is not None:
        assert len(solution.trims) <= horizon.max_trims
    twists = problem.automaton.body_velocities[solution.trims]
    expected = problem.rates[solution.trims] @ solution.durations + problem.cost.switching(twists)
    assert solution.cost == pytest.approx(expected, abs=1e-9)


# The paper's parking problem.


def test_parking_with_four_trims():
    problem = parking()
    solution = best(problem)
    assert names(problem, solution) == ("cw", "straight", "spin", "rest")
    # two turns by arccos(0.2) with a straight between them, by hand
    angle = np.arccos(0.2)
    straight = np.sqrt(2.0 / 3.0)
    expected = [angle, straight, angle, 8.0 - straight - 2.0 * angle]
    assert solution.durations == pytest.approx(expected)
    rates = problem.rates[solution.trims]
    assert solution.cost == pytest.approx(rates @ solution.durations, abs=1e-12)
    assert solution.cost == pytest.approx(6.664468057636666, abs=1e-9)
    word, times = reference_word(problem, solution)
    again = word.slsqp(times)
    assert word.cost(again) == pytest.approx(solution.cost, abs=1e-6)


def test_with_the_spin_reversed_the_papers_sequence_is_best():
    problem = parking(REVERSED_SPIN)
    solution = best(problem)
    assert names(problem, solution) == ("spin", "straight", "acw", "rest")
    assert solution.cost == pytest.approx(best(parking()).cost, abs=1e-9)


@compiled_only
def test_slsqp_finds_nothing_cheaper_on_a_few_words():
    problem = parking()
    cheapest = best(problem).cost
    rng = np.random.default_rng(0)
    twists, rates = problem.automaton.body_velocities[1:], problem.rates[1:]
    for word in [(1, 0, 3), (1, 0, 2), (2, 0, 3), (3, 0, 2), (2, 1), (3, 0, 3), (0, 3, 0)]:
        one = Word(twists[list(word)], rates[list(word)], np.array([0.0, -1.0, 0.0]), at_most=8.0)
        optima = one.local_optima(starts=8, longest=7.0, rng=rng)
        assert all(one.cost(times) > cheapest - 1e-6 for times in optima)


@pytest.mark.parametrize("controls", [TABLE_2, REVERSED_SPIN], ids=["table 2", "reversed spin"])
def test_the_complete_list_holds_only_solutions(controls):
    problem = parking(controls)
    result = search(problem, alternatives=None)
    assert result.status is SearchStatus.FOUND
    assert result.complete
    assert result.exhaustive
    assert len(result.solutions) >= 73
    costs = [solution.cost for solution in result.solutions]
    assert all(b > a - 1e-9 * (1.0 + a) for a, b in itertools.pairwise(costs))
    for solution in result.solutions:
        assert_valid(problem, solution)
    seen = {(word, tuple(times.round(5))) for word, times, _ in listed(result)}
    assert len(seen) == len(result.solutions)


# numbers in the library without its rest; all of three, and a few of four that take the whole time
SUBSET = [*list(words_of(4, 3))[::4], (2, 1, 0, 2), (0, 3, 0, 3), (1, 3, 0, 2), (3, 0, 1, 3)]


@pytest.mark.exhaustive
@pytest.mark.slow
def test_brute_force_finds_nothing_else():
    problem = parking()
    result = search(problem, alternatives=None)
    twists, rates = problem.automaton.body_velocities[1:], problem.rates[1:]
    rng = np.random.default_rng(1)
    for word in SUBSET:
        limit = {"total": 8.0} if len(word) == 4 else {"at_most": 8.0}
        one = Word(twists[list(word)], rates[list(word)], np.array([0.0, -1.0, 0.0]), **limit)
        optima = one.local_optima(starts=15, longest=8.0, rng=rng)
        moving = tuple(k + 1 for k in word)
        admitted = (moving, (*moving, 0))  # as it is, or padded by rest
        ours = [times[: len(word)] for w, times, _ in listed(result) if w in admitted]
        for times in optima:
            assert any(np.abs(times - mine).max() < 1e-4 for mine in ours), (word, times)


@compiled_only
def test_a_solution_whose_straights_are_antiparallel():
    # half a turn, ahead, half a turn back, ahead: straights at opposite headings
    problem = parking()
    wait = (8.0 - 2.0 * np.pi) / 2.0
    expected = {"acw", "straight", "cw"}
    found = [
        solution
        for solution in search(problem, alternatives=None).solutions
        if names(problem, solution) == ("acw", "straight", "cw", "straight")
    ]
    assert expected
    assert any(
        np.abs(solution.durations - [np.pi, wait, np.pi, wait]).max() < 1e-6 for solution in found
    )


@compiled_only
@pytest.mark.parametrize("alternatives", [0, 3, 20])
@pytest.mark.parametrize("controls", [TABLE_2, REVERSED_SPIN], ids=["table 2", "reversed spin"])
def test_the_pruned_search_is_the_head_of_the_complete_list(controls, alternatives):
    problem = parking(controls)
    pruned = search(problem, alternatives=alternatives)
    assert not pruned.complete
    assert len(pruned.solutions) == alternatives + 1
    complete = search(problem, alternatives=None)
    head = replace(complete, solutions=complete.solutions[: alternatives + 1])
    assert_same_solutions(pruned, head)


@pytest.mark.parametrize("switch", [0.3, 1.0, 2.9])
@pytest.mark.parametrize("at", [(0.8, 1.1), (-0.4, 0.8), (-3.9, 2.7)])
def test_the_turn_of_a_free_heading_is_no_switch(at, switch):
    cost = Cost(effort=1.0, time=0.1, switch=switch)
    problem = parking(TABLE_2, cost=cost, time=None, max_trims=3)
    problem = replace(problem, goals=(Goal([*at, 0.0], free_heading=True),))
    complete = search(problem, alternatives=None)
    assert search(problem).solutions[0].cost == pytest.approx(complete.solutions[0].cost)


def test_ties_go_to_fewer_trims_then_to_the_smaller_word():
    twins = robot({"b": (0.0, 1.0), "a": (1.0, 0.0), "c": (0.0, -1.0)})
    problem = Problem(twins, [0, 0, 0], [-1.0, 0.0, np.pi], horizon=Horizon(max_trims=3))
    words = [names(problem, s) for s in search(problem, alternatives=3).solutions]
    assert words[:2] == [("b", "a"), ("c", "a")]  # half a turn either way, in the library's order
    assert words == [names(problem, s) for s in search(problem, alternatives=3).solutions]


# Minimum time, limits, prices.


def test_minimum_time():
    problem = parking(cost=MINIMUM_TIME, time=None)
    solution = best(problem)
    assert_valid(problem, solution)
    assert solution.cost == pytest.approx(solution.duration, abs=1e-12)
    assert names(problem, solution) == ("cw", "straight", "spin", "acw")
    word, times = reference_word(problem, solution)
    assert word.is_local_optimum(times, np.random.default_rng(0))
    assert solution.cost < best(parking(cost=MINIMUM_TIME, time=None, max_trims=3)).cost


@compiled_only
def test_minimum_time_agrees_with_brute_force_on_a_few_words():
    problem = parking(cost=MINIMUM_TIME, time=None)
    complete = listed(search(problem, alternatives=None))
    twists, rates = problem.automaton.body_velocities[1:], problem.rates[1:]
    rng = np.random.default_rng(2)
    for word in [(1, 0, 3, 2), (2, 1, 3, 1), (1, 0, 2), (3, 2, 1, 2), (0, 2, 1, 3), (2, 0, 2, 1)]:
        one = Word(twists[list(word)], rates[list(word)], np.array([0.0, -1.0, 0.0]))
        ours = [times for w, times, _ in complete if w == tuple(k + 1 for k in word)]
        for times in one.local_optima(starts=15, longest=6.0, rng=rng):
            with np.errstate(divide="ignore"):
                turn = 2.0 * np.pi / np.abs(one.twists[:, 2])
            if (times < turn - 1e-3).all():
                assert any(np.abs(times - mine).max() < 1e-3 for mine in ours), (word, times)


@compiled_only
@pytest.mark.xfail(strict=True, reason="the sign of the price of time is not looked at")
def test_with_a_longest_time_every_solution_is_a_local_optimum():
    problem = parking(time=None, max_time=3.8)
    for solution in search(problem, alternatives=None).solutions:
        word, times = reference_word(problem, solution)
        assert word.cost(word.slsqp(times)) > solution.cost - 1e-6, names(problem, solution)


def test_a_limit_on_words_ends_the_search():
    limited = replace(parking(), search=SearchSettings(max_expansions=1))
    result = search(limited, alternatives=None)
    assert not result.complete
    assert not result.exhaustive
    assert len(result.solutions) < 73
    nothing = search(
        replace(parking(time=None, max_time=0.5), search=SearchSettings(max_expansions=1))
    )
    assert nothing.status is SearchStatus.OUT_OF_BUDGET


# Libraries without rest, goals at the start, words that do not span.


@compiled_only
def test_a_fixed_time_without_rest_is_met_exactly():
    problem = parking(without_rest(TABLE_2))
    result = search(problem, alternatives=None)
    for solution in result.solutions:
        assert_valid(problem, solution)
    with_rest = search(parking(), alternatives=None)
    full = [s.cost for s in with_rest.solutions if 0 not in s.trims]
    assert [s.cost for s in result.solutions] == pytest.approx(full, abs=1e-9)


def test_table_1_of_the_paper():
    # 1.62 m in one second with controls in steps of 0.1: between 1.6 and 1.7
    library = robot({f"{v:.1f}": (v, 0.0) for v in np.arange(0.0, 2.05, 0.1).round(1)})
    problem = Problem(
        library, [-1.62, 0, 0], [0, 0, 0], cost=Cost(effort=1.0),
        horizon=Horizon(time=1.0, max_trims=2),
    )  # fmt: skip
    solution = best(problem)
    assert set(names(problem, solution)) == {"1.6", "1.7"}
    assert solution.cost == pytest.approx(2.626, abs=1e-9)


def test_a_full_circle_is_found_as_an_alternative():
    library = robot({"rest": (0.0, 0.0), "circle": (1.0, 1.0)})
    problem = Problem(
        library, [0, 0, 0], SE2.exp([0.5, 0.0, 0.5]).pose, cost=MINIMUM_TIME,
        horizon=Horizon(time=10.0, max_trims=2),
    )  # fmt: skip
    found = [s.durations[0] for s in search(problem, alternatives=None).solutions]
    assert found == pytest.approx([0.5, 0.5 + 2.0 * np.pi])


@compiled_only
@pytest.mark.parametrize("time", [0.5, 1.0, 1.74230814])
def test_a_word_of_one_trim_is_not_looked_for_among_longer_words(time):
    """Cells in which a trim lasts no time hold shorter words alone: they are not halved."""
    end = SE2.exp(time * np.array([-0.25, 0.0, 1.0])).pose
    cost, horizon = Cost(effort=1.0, time=1.0), Horizon(max_trims=4)
    problem = Problem(robot(TABLE_2), [0.0, 0.0, 0.0], end, cost=cost, horizon=horizon)
    found = search_words(problem, problem.goals[0], upper_bound=2.0625 * time)
    assert names(problem, found.solutions[0]) == ("acw",)
    assert found.counts["steering_calls"] < 4000  # of 160 words; they were 4,797 to 10,459


# Climbing.


@compiled_only
def test_climbing_words_end_at_the_altitude():
    problem = Problem(
        helicopter(), [0, 0, 0, 0], [6.0, 3.0, 1.0, 2.0], horizon=Horizon(max_trims=4)
    )
    result = search(problem, alternatives=5)
    for solution in result.solutions:
        assert_valid(problem, solution)
        word, times = reference_word(problem, solution)
        again = word.slsqp(times)
        assert word.cost(again) == pytest.approx(solution.cost, abs=1e-6)


@compiled_only
def test_a_greatest_time_that_is_far_off_changes_no_climb():
    """An altitude to reach is no time to fill: words need not last as long as they may."""
    model = UserModel(
        name="glider", group=SE2xR, control_names=tuple("abcd"), velocity=lambda _, u: np.asarray(u)
    )
    rates = {"up": 1.0, "sink": -1.0, "ahead": 0.0, "left": 0.0, "right": 0.5, "low": -0.4}
    turns = {"left": 1.0, "right": -1.0, "low": 0.3}
    controls = {
        name: (float(name not in ("up", "sink")), 0.0, turns.get(name, 0.0), rate)
        for name, rate in rates.items()
    } | {"spin": (0.0, 0.0, 1.0, 0.0), "fast": (2.0, 0.0, 0.0, 0.5)}
    problem = Problem(robot(controls, model), [0, 0, 0, 0], [3.0, 1.0, 0.7, 0.6])
    free, limited = (
        best(replace(problem, horizon=Horizon(max_trims=4, max_time=most))) for most in (None, 20.0)
    )
    assert limited.cost == pytest.approx(free.cost, abs=1e-9)


# A moved problem has the moved plan.


def moves(n, dof=3, seed=5):
    rng = np.random.default_rng(seed)
    group = SE2 if dof == 3 else SE2xR
    far = np.array([100.0, 100.0, 7.0, 50.0])[:dof]
    return [group(rng.uniform(-1.0, 1.0, dof) * far) for _ in range(n)]


@pytest.mark.parametrize(
    "problem",
    [parking(), parking(REVERSED_SPIN), parking(cost=MINIMUM_TIME, time=None)],
    ids=["table 2", "reversed spin", "minimum time"],
)
def test_a_moved_problem_has_the_same_words(problem):
    here = search(problem, alternatives=1)
    for by in moves(1 if INTERPRETED else 4):
        assert_same_solutions(here, search(problem.moved(by), alternatives=1))


@pytest.mark.parametrize("options", [{}, {"alternatives": None}], ids=["best", "all"])
@pytest.mark.parametrize("changed", [{}, {"cost": MINIMUM_TIME, "time": None}], ids=["T", "free"])
def test_one_after_the_other_goals_have_the_words_that_they_have_alone(changed, options):
    problem = parking(TABLE_2, **changed)
    for start in ([0.0, 1.0, 0.0], [1.0, 0.2, 2.0], [0.0, 0.0, 0.4], [0.0, 1.0, 0.0]):
        again = search(replace(problem, start=np.array(start)), **options)
        alone = search(replace(parking(TABLE_2, **changed), start=np.array(start)), **options)
        assert [one.trims.tolist() for one in again.solutions] == [
            one.trims.tolist() for one in alone.solutions
        ]
        for one, other in zip(again.solutions, alone.solutions, strict=True):
            assert (one.durations == other.durations).all()


@compiled_only
@pytest.mark.parametrize("start", [[0.3, 1.2, 0.4], [-2.1, 0.57, 2.9]])
def test_a_moved_problem_has_the_same_alternatives(start):
    problem = replace(parking(), start=np.array(start))
    here = search(problem, alternatives=8)
    for by in moves(1 if INTERPRETED else 3):
        assert_same_solutions(here, search(problem.moved(by), alternatives=8))


@compiled_only
def test_a_moved_climb_has_the_same_words():
    problem = Problem(
        helicopter(), [0, 0, 0, 0], [6.0, 3.0, 1.0, 2.0], horizon=Horizon(max_trims=4)
    )
    here = search(problem)
    for by in moves(3, dof=4):
        assert_same_solutions(here, search(problem.moved(by)))


@pytest.mark.parametrize(
    ("problem", "most"),
    [(parking(max_trims=6), 5), (parking(max_trims=40, time=None), 4)],
    ids=["fixed", "free"],
)
def test_too_many_trims_are_refused(problem, most):
    message = rf"max_trims is \d+, need at most {most}; use insertion for more"
    with pytest.raises(ValueError, match=message):
        search(problem)


@compiled_only
@pytest.mark.parametrize("word", ["ahead right left sink", "left ahead right sink"])
def test_a_climb_and_a_fixed_time_are_both_met(word):
    trims = [helicopter()[name] for name in word.split()]
    known = Plan(np.zeros(4), trims, durations=[0.4, 1.2, 0.5, 0.8])
    horizon = Horizon(time=known.duration, max_trims=4)
    problem = Problem(helicopter(), np.zeros(4), known.end, horizon=horizon, cost=MINIMUM_TIME)
    found = [lasting(one) for one in search(problem, alternatives=None).solutions]
    assert any(len(times) == 4 and np.allclose(times, known.durations) for _, times in found)


def test_start_equal_to_goal():
    still = replace(parking(), start=np.zeros(3))
    rest = best(still)
    assert names(still, rest) == ("rest",)
    assert rest.durations.tolist() == [8.0]
    assert rest.cost == 0.0
    free = best(replace(parking(time=None), start=np.zeros(3)))
    assert free.trims.size == 0
    assert free.cost == 0.0
    whole_turn = replace(parking(time=None), start=np.array([0.0, 0.0, -4.0 * np.pi]))
    assert best(whole_turn).trims.size == 0


@pytest.mark.parametrize(
    ("names", "times"),
    [
        ("on left on", (2.0, math.pi, 1.0)),  # along one line, there and back
        ("on right slow", (2.0, math.pi, 1.0)),
        ("side on left on", (0.5, 2.0, math.pi, 1.0)),
        ("left spin right", (2.0, math.pi, 1.0)),  # along one circle
        ("right spin right", (1.5 * math.pi, math.pi, 2.0)),  # where two circles touch
        ("side spin left spin", (0.2, 0.1, math.pi, 0.5)),
        ("spin right left right", (1.0, math.pi, math.pi, math.pi)),  # from one heading alone
        ("spin slow spin slow", (2.0, 4.0, 3.0, 3.9)),  # there and back, far beyond the goal
        ("on spin diag spin", (2.0, math.pi, 2.0, 0.5)),  # the least time there is
        ("on orbit spin left", (0.5, 2.0 * math.pi, 1.5 * math.pi, math.pi)),  # about one centre
        ("on orbit on left", (2.0, 12.56, 1.0, math.pi)),  # next to where there is none
    ],
)
def test_words_that_turn_back_take_a_given_time(names, times):
    controls = {"on": (1, 0, 0), "slow": (0.5, 0, 0), "side": (0, 1, 0), "spin": (0, 0, 1)}
    controls |= {"left": (1, 0, 1), "right": (1, 0, -1), "diag": (-0.5, -0.5, 0)}
    controls |= {"orbit": (0, 0.5, -0.5)}
    robot = Automaton.of_controls(Omnidirectional(), {n: controls[n] for n in names.split()})
    known = Plan(np.zeros(3), [robot[n] for n in names.split()], durations=times)
    horizon = Horizon(time=known.duration, max_trims=len(times))
    problem = Problem(robot, np.zeros(3), known.end, horizon=horizon, cost=Cost(effort=1.0))
    found = search_words(problem, problem.goals[0], alternatives=None)
    listed = [
        one.durations
        for one in found.solutions
        if [robot.trim_names[k] for k in one.trims] == names.split()
    ]
    assert found.exhaustive
    assert any(np.allclose(durations, times) for durations in listed)
