"""What a step decides: controls tick by tick; as a `Plan` of trims and maneuvers; polished."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import SecondOrderCar
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.roads import _kernels_polish
from maneuver_automaton.roads.arrays import Moves, RoadArrays

AT_REST = 1e-9  # [m/s]
# Weights of the blocks of a move. All keep the speed, or the steering angle, after it; of the
# steering rate the second keeps the heading besides, and the last the place across, nearly.
PATTERNS = ((1.0, -1.0), (0.5, -1.0, 0.5), (1.0, -1.0, -1.0, 1.0), (1 / 3, -1.0, 1.0, -1 / 3))
SIZES = ((1.0, 0.2), (0.3, 0.06), (0.1, 0.02))  # [m/s^2], [rad/s]
ROUND = len(PATTERNS) * len(SIZES)  # passes in which every pattern has every size
# A pass begins where its number says, which is the same for one pattern and size in every round:
# where a round gains nothing, their order is turned, until each has begun everywhere.
MOVES = tuple(
    Moves(
        pattern=np.array([[*row, *np.zeros(4 - len(row))] for row in PATTERNS[k:] + PATTERNS[:k]]),
        blocks=np.array([len(row) for row in PATTERNS[k:] + PATTERNS[:k]]),
        size=np.roll(SIZES, n, axis=0),
    )
    for n in range(len(SIZES))
    for k in range(len(PATTERNS))
)
ROUNDS = 120  # at most


def plan_of_controls(
    model: SecondOrderCar,
    state: Array,
    controls: Array,
    *,
    tick: float,
    start_time: float = 0.0,
    max_step: float = 0.05,
) -> Plan:
    """The plan that a car drives from a state (5,) under controls (n, 2), a `tick` [s] each.

    Every speed and steering angle is a trim of a second-order car, so a plan may begin and end
    between those of the library, and in the midst of a maneuver. Equal controls in a row are one
    primitive: a trim where nothing changes, else a maneuver, whose course is exact (`drive_all`),
    with samples at most `max_step` [m, rad] apart.

    Examples
    --------
    >>> from maneuver_automaton.roads import RoadVehicle
    >>> controls = np.array([[2.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
    >>> state = np.array([1.0, 0.0, 0.0, 5.0, 0.0])
    >>> plan = plan_of_controls(RoadVehicle().model, state, controls, tick=0.1)
    >>> plan.word, plan.primitive_durations.tolist(), plan.end.round(6).tolist()
    (('acceleration 2, steering rate 0', 'speed 5.4, steering 0'), [0.2, 0.1], [2.58, 0.0, 0.0])
    """
    # Equal to the last bit: controls that nearly are may change little by little over a long drive.
    new = (np.diff(controls, axis=0) != 0.0).any(axis=1)
    begins = np.flatnonzero(np.append(True, new)) if len(controls) else np.zeros(0, dtype=np.intp)
    held, durations = controls[begins], tick * np.diff(np.append(begins, len(controls)))
    gained = np.cumsum(durations[:, None] * held, axis=0)
    trims = [trim_of(model, one) for one in state[3:] + np.concatenate([np.zeros((1, 2)), gained])]
    changing = (held != 0.0).any(axis=1)
    word, coasting = [trims[0]], [0.0]
    for target, duration, changes in zip(
        trims[1:], durations.tolist(), changing.tolist(), strict=True
    ):
        if changes:
            word.append(target)
            coasting.append(0.0)
        else:
            coasting[-1] += duration
    return Plan(
        state[:3],
        word,
        durations=coasting,
        maneuvers=ramps(
            model,
            word[:-1],
            word[1:],
            control=held[changing],
            durations=durations[changing],
            max_step_m=max_step,
            max_step_rad=max_step,
        ),
        start_time=start_time,
    )


def ramps(
    model: SecondOrderCar,
    sources: Sequence[Trim],
    targets: Sequence[Trim],
    *,
    control: Array,
    durations: Array,
    max_step_m: float = 0.05,
    max_step_rad: float = 0.05,
) -> tuple[Maneuver, ...]:
    """Maneuvers from trim to trim (n,) under controls (n, 2) held for durations (n,) [s]."""
    if not len(sources):
        return ()
    courses = drive_all(
        model,
        [source.reduced_state for source in sources],
        control=control[:, None],
        durations=durations[:, None],
        max_step_m=max_step_m,
        max_step_rad=max_step_rad,
    )
    return tuple(
        Maneuver.along(
            course,
            name=f"acceleration {along:.4g}, steering rate {rate:.3g}",
            source=source.name,
            target=target.name,
        )
        for (along, rate), source, target, course in zip(
            control.tolist(), sources, targets, courses, strict=True
        )
    )


def trim_of(model: SecondOrderCar, reduced_state: Array) -> Trim:
    """The trim that holds a speed [m/s] and a steering angle [rad] (2,), and says both."""
    speed, steering = (np.round(reduced_state, 9) + 0.0).tolist()
    control = np.zeros(2)
    return Trim(
        name=f"speed {speed:.4g}, steering {steering:.3g}",
        body_velocity=model.body_velocity(reduced_state, control),
        control=control,
        reduced_state=reduced_state,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSettings:
    """How a drive is planned."""

    horizon_s: float = 6.0  # how far a plan looks ahead at most, its stop apart
    width: int = 80  # nodes of a level that the beam search goes on from
    narrow: int = 40  # the same where the last plan leads to a goal and is only to be improved
    off_edge_m: float = 0.04  # distances kept from the edge of the area
    off_traffic_m: float = 0.15  # and from all other road users
    top_speed: float = 36.0  # [m/s] of the trims, if the start is not faster still
    greed: float = 1.0  # weight of the cost-to-go
    gain: float = 0.02  # share of the cost by which a new plan has to be better than the old one

    __repr__ = brief


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadDecision:
    """Controls for the ticks to come: a plan, and the fail-safe stop after it.

    The kernels prove these states free again in every step, so they are kept as arrays;
    `RoadPlanner.plan_of` makes the `Plan` of them.
    """

    tick: int  # at which it begins
    states: Array  # (n + 1, 5) x, y, heading of the rear axle, speed, steering, the stop included
    controls: Array  # (n, 2) acceleration [m/s^2], steering rate [rad/s], the stop included
    lasting: int  # ticks before the stop begins
    reaches: bool  # whether it reaches a goal there

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "states", last=5)
        freeze(self, "controls", last=2)

    @property
    def stops(self) -> bool:
        """Whether it ends at rest."""
        return abs(float(self.states[-1, 3])) <= AT_REST

    @property
    def stands(self) -> bool:
        """Whether it is to stay at rest, as no motion on is free."""
        return not (self.lasting or self.reaches) and abs(float(self.states[0, 3])) <= AT_REST

    def tail(self, ticks: int) -> RoadDecision:
        """The rest of the plan some ticks later."""
        return replace(
            self,
            tick=self.tick + ticks,
            states=self.states[ticks:],
            controls=self.controls[ticks:],
            lasting=max(self.lasting - ticks, 0),
        )

    def then(self, other: RoadDecision, *, after: int) -> RoadDecision:
        """The first ticks of the plan, and another one that begins where these end."""
        return replace(
            other,
            tick=self.tick,
            states=np.concatenate([self.states[:after], other.states]),
            controls=np.concatenate([self.controls[:after], other.controls]),
            lasting=after + other.lasting,
        )


def polished_controls(
    horizon: RoadArrays, plan: RoadDecision, *, passes: int = ROUND, rounds: int = 1
) -> Array | None:
    """Controls (n, 2) of a plan to a goal that cost less; None if no move makes it cheaper.

    It is free, at the goal at the same tick, and followed by the same stop, as it was. Controls
    change at steps of the scene only. Where a pass begins depends on the plan's tick, so that step
    after step of a drive tries other moves.
    """
    controls, state, moved, turn = np.array(plan.controls), np.array(plan.states[0]), 0, 0
    every = horizon.goals.every
    for k in range(rounds):
        first, made, moves = plan.tick // every + k * passes, 0, MOVES[turn]
        for number in range(first, first + passes):
            row = number % len(PATTERNS)
            size = number // len(PATTERNS) % len(SIZES)
            one = Moves(moves.pattern[[row]], moves.blocks[[row]], moves.size[[size]])
            made += _kernels_polish.polish(
                horizon, one, state, controls, plan.lasting, plan.tick, every * number, 1
            )
        moved += made
        if not made:
            turn += 1
            if turn == len(MOVES):
                break
    return controls if moved else None
