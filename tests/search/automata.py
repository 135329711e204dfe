"""Small automata with maneuvers for the tests of searches: no model is integrated here."""

from __future__ import annotations

import itertools

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import SecondOrderUnicycle, Unicycle, UserModel
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive


def linked(twists, *, rng: np.random.Generator | None = None, size: float = 0.3) -> Automaton:
    """Trims of different classes, and a maneuver of random displacement between every two."""
    dof = len(twists[0])
    trims = tuple(
        Trim(name=f"t{k}", body_velocity=twist, control=[0.0, 0.0], reduced_state=[float(k)])
        for k, twist in enumerate(twists)
    )
    rng = np.random.default_rng(0) if rng is None else rng
    maneuvers = tuple(
        Maneuver(
            name=f"{a.name}-{b.name}",
            source=a.name,
            target=b.name,
            displacement=size * rng.uniform(-1.0, 1.0, dof),
            duration=float(rng.uniform(0.2, 1.0)),
        )
        for a, b in itertools.permutations(trims, 2)
    )
    return Automaton(_model(dof), trims, maneuvers)


def joined_end(automaton: Automaton, library, start, word, durations, start_trim, goal_trim):
    """Pose at the end of a word of transitions and trims, group element by group element."""
    group = automaton.model.group
    pose = group(np.asarray(start, dtype=np.float64))
    at = start_trim
    for trim, time in zip([*word, goal_trim], [*durations, 0.0], strict=True):
        for maneuver, following in library.chain(at, trim):
            if maneuver >= 0:
                pose = pose @ group(automaton.maneuvers[maneuver].displacement)
            at = following
        pose = pose @ group.exp(time * automaton.trims[trim].body_velocity)
    return pose.pose


def _model(dof: int):
    if dof == 3:
        return Unicycle()
    from maneuver_automaton.groups import SE2xR

    return UserModel(
        name="lift",
        group=SE2xR,
        control_names=("speed", "climb"),
        velocity=lambda z, u: [u[0], 0.0, 0.0, u[1]],
    )


def inertial_unicycle(*, levels: int = 3, reach: float = 0.5) -> Automaton:
    """Second-order unicycle: speeds and turn rates to 0.5, bang-bang maneuvers of limited change."""
    model = SecondOrderUnicycle(
        max_speed=0.5, max_turn_rate=0.5, max_acceleration=0.25, max_angular_acceleration=0.25
    )
    grid = np.linspace(-0.5, 0.5, levels)
    trims = tuple(
        Trim(
            name=f"{speed:g} {turn:g}",
            body_velocity=[speed, 0.0, turn],
            control=[0.0, 0.0],
            reduced_state=[speed, turn],
        )
        for speed in grid
        for turn in grid
    )
    maneuvers = []
    for a, b in itertools.permutations(trims, 2):
        change = b.reduced_state - a.reduced_state
        if np.abs(change).max() > reach + 1e-9:
            continue
        until = np.abs(change) / 0.25
        knots = np.unique(np.append(0.0, until))
        control = [0.25 * np.sign(change) * (knot < until) for knot in knots[:-1]]
        course = drive(model, a.reduced_state, control=control, durations=np.diff(knots))
        maneuvers.append(
            Maneuver(
                name=f"{a.name} to {b.name}",
                source=a.name,
                target=b.name,
                displacement=course.pose[-1],
                duration=float(course.time[-1]),
                course=course,
            )
        )
    return Automaton(model, trims, tuple(maneuvers))
