"""Maneuvers made when they are asked for: between a reduced state that no trim has, and trims.

Where the controls are the rates of the reduced state they are quickest, in closed form; so are
those of a hitch. For any other vehicle a small program of optimal control is solved, which is
written down once for each model.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.models import CarWithTrailer, Model
from maneuver_automaton.models.speeds import is_too_sharp
from maneuver_automaton.optimal_control.ipopt import SolverSettings, SolveStatus
from maneuver_automaton.optimal_control.maneuvers import (
    TransferProgram,
    TransferSettings,
    duration_guess,
    ends_program,
    solve_transfer,
    transfer_program,
)
from maneuver_automaton.primitives.closed_form import (
    differing,
    has_limited_rates,
    may_drive,
    quickest_between,
)
from maneuver_automaton.primitives.connecting import CLOSED, WITHIN, Inputs, beyond_limits, closed
from maneuver_automaton.primitives.primitive import Maneuver, Trim
from maneuver_automaton.primitives.turning import hitch_maneuvers

FEW = TransferSettings(  # intervals: enough for a short way, and solved in some 20 ms
    intervals=8, steps=1, solver=SolverSettings(tolerance=1e-7, max_iterations=80, far=True)
)
GUESSES = ((1.0, 0.0), (2.0, 0.5))  # (factor of the guessed duration, swing), in turn
AIMS = 4  # at ends that make up for what the program of the ends is off the vehicle
MODELS = 16  # whose programs are kept
LEAST = 1e-9  # [units of the reduced state] a difference that takes time


def state_of(model: Model, value: Any, what: str) -> Array:
    """A reduced state (n_z,) of a model, stated in its order or by names; those left out are 0."""
    names = model.reduced_names
    if not names:
        raise ValueError(
            f"{what}: a state is given, but the {model.name} has no reduced state: it changes its "
            "velocity at will"
        )
    if isinstance(value, Mapping):
        unknown = [name for name in value if name not in names]
        if unknown:
            raise ValueError(
                f"{what}: state: the {model.name} has no {unknown[0]!r}, need some of "
                f"{', '.join(names)}"
            )
        value = [value.get(name, 0.0) for name in names]
    state = as_array(f"{what}: state", value)
    if state.shape != (len(names),):
        raise ValueError(
            f"{what}: state has shape {state.shape}, need {len(names)} numbers: {', '.join(names)}"
        )
    for name, number, (low, high) in zip(names, state, model.reduced_limits, strict=True):
        slack = WITHIN * (high - low if np.isfinite(high - low) else 1.0)
        if not low - slack <= number <= high + slack:
            raise ValueError(
                f"{what}: state: {name} is {number:.6g}, need one of the {model.name} within "
                f"[{low:.6g}, {high:.6g}]"
            )
    state = state.copy()
    state.setflags(write=False)
    return state


def trim_at(model: Model, state: Array, name: str) -> Trim:
    """What stands for a reduced state at an end of a plan: a trim that lasts no time.

    Its control is zero, where that is within the limits of the vehicle.
    """
    control = np.clip(np.zeros(len(model.control_names)), *model.control_limits.T)
    velocity = np.asarray(model.body_velocity(state, control), dtype=np.float64)
    return Trim(name=name, body_velocity=velocity, control=control, reduced_state=state)


def seconds_between(model: Model, state: Array, others: Array) -> Array:
    """About how long (m,) [s] it takes from a reduced state to others (m, n_z), or back.

    Each component changes at its fastest rate half way; exact where the control is that rate.
    """
    corners = np.where(np.isfinite(model.control_limits), model.control_limits, [[-1.0, 1.0]])
    controls = np.array(list(itertools.product(*corners)))
    middles = ((state + others) / 2.0)[:, None]
    shape = (len(others), len(controls))
    rates = model.reduced_dynamics(
        np.broadcast_to(middles, (*shape, state.size)),
        np.broadcast_to(controls, (*shape, controls.shape[1])),
    )
    change, fastest = np.abs(others - state), np.abs(rates).max(axis=1)
    seconds = np.where(change > LEAST, change / np.maximum(fastest, LEAST), 0.0)
    return np.asarray(seconds.max(axis=1, initial=0.0))


def maneuvers_between(model: Model, source: Trim, target: Trim) -> tuple[Maneuver, ...]:
    """Maneuvers from one reduced state to another, quick ones; none where none was found.

    In closed form the components change at once, or as late as they can; a hitch is bent or
    straightened ahead and in reverse.
    """
    return next(all_maneuvers_between(model, [(source, target)]))


def all_maneuvers_between(
    model: Model, pairs: Sequence[tuple[Trim, Trim]]
) -> Iterator[tuple[Maneuver, ...]]:
    """The maneuvers of each pair, see `maneuvers_between`; in closed form all are made at once."""
    if isinstance(model, CarWithTrailer):
        low, high = model.control_limits[0].tolist()
        speeds = [speed for speed in (high, low) if speed]
        wanted = [(*pair, speed) for pair in pairs for speed in speeds]
        made = hitch_maneuvers(model, wanted)
        for pair in pairs:
            ends = tuple(trim.name for trim in pair)
            yield tuple(one for one in made if (one.source, one.target) == ends)
    elif _is_limited(_ModelKey(model)):
        yield from _in_closed_form(model, pairs)
    else:
        for source, target in pairs:
            yield _by_optimal_control(model, source, target)


def _in_closed_form(
    model: Model, pairs: Sequence[tuple[Trim, Trim]]
) -> Iterator[tuple[Maneuver, ...]]:
    try:
        late = np.arange(2 * len(pairs)) >= len(pairs)
        made = quickest_between(model, [*pairs, *pairs], late=late)
    except ValueError:  # a component cannot change that way at all
        if len(pairs) == 1:
            yield ()
            return
        for pair in pairs:
            yield from _in_closed_form(model, [pair])
        return
    for one, other in zip(made[: len(pairs)], made[len(pairs) :], strict=True):
        both = (one, *differing([one], [other]))
        yield tuple(one for one in both if may_drive(model, one))


class _ModelKey:
    """A model as a key of a cache, which holds it: by what it is, or itself if it has no hash."""

    def __init__(self, model: Model) -> None:
        self.model = model
        try:
            self._key: tuple[Any, int] = (model, hash(model))
        except TypeError:
            self._key = (None, id(model))

    def __hash__(self) -> int:
        return self._key[1]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ModelKey) and self._key == other._key


@functools.lru_cache(maxsize=MODELS)
def _is_limited(known: _ModelKey) -> bool:
    return has_limited_rates(known.model)


@functools.lru_cache(maxsize=MODELS)
def _program_of(known: _ModelKey) -> tuple[TransferProgram, Any]:
    """The program of short maneuvers of a model and that of their ends, written down once."""
    ends = ends_program(known.model, intervals=FEW.intervals)
    return transfer_program(known.model, settings=FEW), ends


def _by_optimal_control(model: Model, source: Trim, target: Trim) -> tuple[Maneuver, ...]:
    """The quickest maneuver that the solver finds, closed to rounding; none if it finds none."""
    start, end = source.reduced_state, target.reduced_state
    limits = model.control_limits
    program, ends = _program_of(_ModelKey(model))
    for factor, swing in GUESSES:
        found = solve_transfer(
            program,
            start=start,
            end=end,
            controls=np.stack([target.control, target.control]),
            tightening=WITHIN**0.5,
            duration=factor * duration_guess(model, start, end),
            swing=swing,
        )
        if found.status is not SolveStatus.SOLVED:
            continue
        inputs = Inputs(control=found.control, interval=found.duration / len(found.control))
        aim, enough = end, CLOSED / 100.0
        for _ in range(AIMS):
            inputs, course = closed(
                model, start, aim, inputs=inputs, limits=limits, enough=enough, ends=ends
            )
            off = course.reduced_state[-1] - end
            if (missed := float(np.abs(off).max())) <= CLOSED:
                break
            aim = aim - off
        over = beyond_limits(model.reduced_limits, course.reduced_state).max()
        if not missed <= CLOSED or over > WITHIN or is_too_sharp(model, course.twists(model)).any():
            continue
        name = f"{source.name} to {target.name}"
        made = Maneuver.along(course, name=name, source=source.name, target=target.name)
        return (made,) if may_drive(model, made) else ()
    return ()


def prepare_maneuvers(model: Model) -> None:
    """Have the program of a model ready, before a clock runs."""
    if not (isinstance(model, CarWithTrailer) or _is_limited(_ModelKey(model))):
        _program_of(_ModelKey(model))
