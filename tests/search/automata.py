"""Small automata with maneuvers for the tests of searches: no model is integrated here."""

from __future__ import annotations

import itertools

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import Unicycle, UserModel
from maneuver_automaton.primitives import Maneuver, Trim


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
