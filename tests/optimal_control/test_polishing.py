"""Lines between a body and what is in its way, and a small problem with one box."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from maneuver_automaton.models import CarWithTrailer, SecondOrderUnicycle
from maneuver_automaton.optimal_control import Guess, SolveStatus
from maneuver_automaton.optimal_control.polish_program import program_of
from maneuver_automaton.optimal_control.polishing import polish
from maneuver_automaton.optimal_control.scene import (
    NEVER,
    BodyPart,
    MotionEnds,
    MovingSolid,
    Point,
    PolishScene,
    PolishSettings,
    pieces_during,
)
from maneuver_automaton.optimal_control.separation import pairs_near, parted
from tests.reference_dynamics import trailer_pose

SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
ROBOT = SecondOrderUnicycle(
    max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
)
BODY = BodyPart(solids=((0.4 * SQUARE, 0.0),))


def moved(x: float, y: float) -> np.ndarray:
    """The unit square somewhere."""
    return SQUARE + np.array([x, y])


def guess(n: int = 40, *, aside: float = 0.0, length: float = 4.0, duration: float = 6.0) -> Guess:
    """Straight ahead, bulging to the left."""
    share = np.linspace(0.0, 1.0, n + 1)
    state = np.zeros((n + 1, 5))
    state[:, 0] = length * share
    state[:, 1] = aside * np.sin(np.pi * share)
    state[1:-1, 3] = length / duration
    return Guess(state=state, control=np.zeros((n, 2)), duration=duration)


def at_rest(x: float, y: float = 0.0, heading: float | None = 0.0) -> MotionEnds:
    return MotionEnds((0.0,) * 5, (x, y, heading, 0.0, 0.0))


def test_without_obstacles_full_ahead_and_full_back() -> None:
    free = polish(ROBOT, at_rest(0.5), PolishScene(), guess(length=0.5, duration=2.0))
    assert free.status is SolveStatus.SOLVED
    assert free.duration == pytest.approx(2.0 * np.sqrt(0.5), abs=2e-3)  # the effort costs a bit


@pytest.mark.parametrize("fixed", [False, True])
def test_a_box_is_passed_without_touching_it_between_nodes(fixed: bool) -> None:
    box = SQUARE * [1.0, 0.6] + [2.0, 0.0]
    scene = PolishScene(parts=(BODY,), pieces=((box, 0.0),))
    found = polish(ROBOT, at_rest(4.0), scene, guess(aside=0.8), fixed_planes=fixed)
    assert found.status is SolveStatus.SOLVED
    assert touched(found.state, found.control, found.durations, box) > 0.0
    assert np.abs(found.control).max() <= 1.0
    assert np.abs(found.state[:, 3:]).max() <= 1.0


def test_a_disc_is_passed_as_it_is() -> None:
    scene = PolishScene(parts=(BODY,), pieces=((np.array([[2.0, 0.0]]), 0.3),))
    found = polish(ROBOT, at_rest(4.0), scene, guess(aside=0.8))
    assert found.status is SolveStatus.SOLVED
    around = shapely.Point(2.0, 0.0).buffer(0.3, quad_segs=64)
    clearance = touched(
        found.state, found.control, found.durations, shapely.get_coordinates(around)
    )
    assert 0.0 < clearance < 0.01


def test_first_lines_are_midway_between_rounded_solids() -> None:
    body = BodyPart(solids=((np.zeros((1, 2)), 0.1),))
    scene = PolishScene(parts=(body,), pieces=((np.array([[2.0, 1.0]]), 0.3),))
    ahead = guess()
    point = Point(ahead.state, ahead.control, np.full(40, 0.15))
    program = program_of(ROBOT, at_rest(4.0), scene, PolishSettings(), None, None, point)
    apart = parted(program, point, pairs_near(program, point, 0.7))
    to_body, to_disc = apart.lines.anchor[:, 1] - 0.1, 0.7 - apart.lines.anchor[:, 1]
    middle = np.argmin(np.abs(apart.lines.anchor[:, 0] - 2.0))
    assert to_body[middle] == pytest.approx(to_disc[middle], abs=1e-2)


def test_a_guess_inside_is_led_out() -> None:
    scene = PolishScene(parts=(BODY,), pieces=((SQUARE * [1.0, 0.6] + [2.0, 0.1], 0.0),))
    refused = polish(ROBOT, at_rest(4.0), scene, guess(), fixed_planes=True)
    assert refused.reason == "the guess is too deep inside obstacles for fixed planes"
    out = polish(ROBOT, at_rest(4.0), scene, guess(), elastic=True)
    found = polish(ROBOT, at_rest(4.0), scene, out.as_guess)
    assert (out.status, found.status) == (SolveStatus.SOLVED, SolveStatus.SOLVED)
    assert found.state[20, 1] < -0.3  # on the nearer side


def test_a_free_heading_is_free() -> None:
    found = polish(ROBOT, at_rest(2.0, 1.0, None), PolishScene(), guess(length=2.0, aside=0.3))
    assert found.status is SolveStatus.SOLVED
    assert found.state[-1, :2] == pytest.approx([2.0, 1.0])
    assert abs(found.state[-1, 2]) > 0.1


def test_a_trailer_is_part_of_the_body() -> None:
    truck = CarWithTrailer(
        wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5, max_hitch=0.7
    )
    trailer = BodyPart(
        solids=((SQUARE * [0.3, 0.25], 0.0),),
        pose=trailer_pose(0.5),
    )
    car = BodyPart(solids=((SQUARE * [0.5, 0.25], 0.0),))
    box = SQUARE * [0.5, 0.5] + [1.5, -0.45]
    share = np.linspace(0.0, 1.0, 61)
    state = np.stack([3 * share, 0.1 * np.sin(np.pi * share), 0 * share, 0 * share], axis=1)
    first = Guess(state=state, control=np.tile([0.5, 0.0], (60, 1)), duration=6.0)
    ends = MotionEnds((0.0,) * 4, (3.0, 0.0, 0.0, 0.0))
    found = polish(truck, ends, PolishScene(parts=(car, trailer), pieces=((box, 0.0),)), first)
    alone = polish(truck, ends, PolishScene(parts=(car,), pieces=((box, 0.0),)), first)
    assert (found.status, alone.status) == (SolveStatus.SOLVED, SolveStatus.SOLVED)
    clearance = min(part_clearance(row, box) for row in found.state)
    assert clearance >= 0.0
    assert found.duration >= alone.duration - 1e-3


def part_clearance(state: np.ndarray, box: np.ndarray) -> float:
    """Distance of the trailer from a box."""
    x, y, heading, hitch = state
    back = heading - hitch
    place = np.array([x - 0.5 * np.cos(back), y - 0.5 * np.sin(back)])
    turn = np.array([[np.cos(back), -np.sin(back)], [np.sin(back), np.cos(back)]])
    ring = SQUARE * [0.3, 0.25] @ turn.T + place
    return float(shapely.Polygon(ring).distance(shapely.Polygon(box)))


def simulated(state: np.ndarray, control: np.ndarray, durations: np.ndarray) -> np.ndarray:
    """Poses of the unicycle, 20 in every interval, by small Runge-Kutta steps."""
    now, poses = state[0].copy(), [state[0, :3].copy()]
    for u, h in zip(control, durations, strict=True):
        for _ in range(20):
            now = runge_kutta(now, u, h / 20)
            poses.append(now[:3].copy())
    return np.array(poses)


def runge_kutta(x: np.ndarray, u: np.ndarray, h: float) -> np.ndarray:
    def rates(s: np.ndarray) -> np.ndarray:
        return np.array([s[3] * np.cos(s[2]), s[3] * np.sin(s[2]), s[4], *u])

    k_1 = rates(x)
    k_2 = rates(x + h / 2 * k_1)
    k_3 = rates(x + h / 2 * k_2)
    k_4 = rates(x + h * k_3)
    return np.asarray(x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4))


def touched(
    state: np.ndarray, control: np.ndarray, durations: np.ndarray, ring: np.ndarray
) -> float:
    """Least distance of the body from an obstacle, over the whole motion."""
    obstacle = shapely.Polygon(ring)
    least = np.inf
    for x, y, heading in simulated(state, control, durations):
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        body = shapely.Polygon(0.4 * SQUARE @ turn.T + [x, y])
        least = min(least, body.distance(obstacle))
    return float(least)


def test_a_solve_that_is_cut_short_hands_on_its_best_iterate() -> None:
    """It breaks no condition of the program, and is near the end of the whole solve."""
    scene = PolishScene(parts=(BODY,), pieces=((SQUARE * [1.0, 0.6] + [2.0, 0.0], 0.0),))
    whole = polish(ROBOT, at_rest(4.0), scene, guess(aside=0.8))
    few = PolishSettings(max_iterations=whole.iterations - 1)
    cut = polish(ROBOT, at_rest(4.0), scene, guess(aside=0.8), settings=few)
    assert cut.status is SolveStatus.OUT_OF_BUDGET
    assert cut.is_feasible
    poses = simulated(cut.state, cut.control, cut.durations)
    assert poses[-1] == pytest.approx([4.0, 0.0, 0.0], abs=1e-3)
    assert whole.objective <= cut.objective < 1.001 * whole.objective


def test_the_last_digits_of_a_guess_of_the_ends_and_on_the_way_change_nothing() -> None:
    """They are all that a moved problem differs by, and a solver's way may depend on them."""
    box = SQUARE * [1.0, 0.6] + [2.0, 0.0]
    scene = PolishScene(parts=(BODY,), pieces=((box, 0.0),))
    one, noise = guess(aside=0.8), np.random.default_rng(0)
    other = Guess(
        state=one.state + noise.uniform(-1e-13, 1e-13, one.state.shape),
        control=one.control + noise.uniform(-1e-13, 1e-13, one.control.shape),
        duration=one.duration * (1.0 + 1e-15),
    )
    via = [[(20, (2.0, y, None, None, None))] for y in (0.7, 0.7 + 1e-15)]
    first = polish(ROBOT, at_rest(4.0), scene, one, via=via[0])
    second = polish(ROBOT, at_rest(4.0 * (1.0 + 1e-15), 1e-14), scene, other, via=via[1])
    assert first.state[20, :2] == pytest.approx([2.0, 0.7], abs=1e-6)
    np.testing.assert_array_equal(first.state, second.state)
    assert first.iterations == second.iterations


def test_what_moves_goes_on_while_a_motion_stays() -> None:
    """One metre a second, over two seconds with a stay of three between them."""

    def poses(times: np.ndarray) -> np.ndarray:
        return np.stack([times, 0.0 * times, 0.0 * times], axis=1)

    mover = MovingSolid(np.zeros((1, 2)), 0.1, poses, (0.0, 4.5))
    swept = pieces_during((), (mover,), np.ones(2), stays=[(1, 3.0)])
    along = [corners[:, 0].tolist() for corners, _ in swept.solids]
    assert along == [[0.0, 4.0], [4.0, 4.5]]
    assert swept.interval.tolist() == [0, 1]
    gone = pieces_during((), (mover,), np.ones(2), stays=[(1, 4.0)])
    assert gone.interval.tolist() == [0, NEVER]
