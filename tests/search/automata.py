"""Small automata with maneuvers for the tests of searches: no model is integrated here."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.optimize import brentq

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import CarWithTrailer, UserModel
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.closed_form import connect_bang_bang
from maneuver_automaton.primitives.driving import drive
from tests.inertia import ROBOT


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
    return Automaton(model_of_kinds(dof), trims, maneuvers)


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


def model_of_kinds(dof: int = 3) -> UserModel:
    """A vehicle whose reduced state is no more than the number of its trim."""
    return UserModel(
        name="kinds",
        group=SE2 if dof == 3 else SE2xR,
        control_names=("speed", "turn_rate"),
        reduced_names=("kind",),
        velocity=lambda z, u: [u[0], 0.0, u[1], 0.0][:dof],
        dynamics=lambda z, u: [0.0],
    )


def inertial_unicycle(*, levels: int = 3) -> Automaton:
    """Second-order unicycle: a grid of speeds and turn rates to 0.5, bang-bang maneuvers."""
    model = ROBOT
    values = np.linspace(-0.5, 0.5, levels)
    trims = [
        Trim(
            name=f"{speed:g} {turn:g}",
            body_velocity=[speed, 0.0, turn],
            control=[0.0, 0.0],
            reduced_state=[speed, turn],
        )
        for speed in values
        for turn in values
    ]
    near = [
        (i, j)
        for i, j in itertools.permutations(range(len(trims)), 2)
        if np.abs(trims[i].reduced_state - trims[j].reduced_state).max() <= 0.5 + 1e-9
    ]
    return Automaton(model, tuple(trims), connect_bang_bang(model, trims, pairs=near))


def truck_with_trailer(*, levels: int = 5) -> Automaton:
    """dynobench's car with a trailer: steady turns both ways, each with the hitch that it keeps.

    Maneuvers steer fully to one side until the hitch is that of another trim.
    """
    model = CarWithTrailer(
        wheelbase=0.25, hitch_length=0.5, max_steering=math.pi / 3.0, max_speed=0.5, min_speed=-0.1,
        max_hitch=math.pi / 4.0,
    )  # fmt: skip
    hitches = np.linspace(-0.9, 0.9, levels) * math.pi / 4.0
    trims: list[Trim] = []
    for hitch in hitches:
        steering = math.atan(0.25 * math.sin(hitch) / 0.5)
        for speed in (0.0, 0.5, -0.1):
            control = np.array([speed, steering])
            twist = model.body_velocity(np.array([hitch]), control)
            trims.append(
                Trim(
                    name=f"{speed:g} at {hitch:.2f}",
                    body_velocity=twist,
                    control=control,
                    reduced_state=[hitch],
                )
            )
    maneuvers = []
    for a, b in itertools.permutations(trims, 2):
        speed = float(a.control[0])
        before, after = float(a.reduced_state[0]), float(b.reduced_state[0])
        if speed != b.control[0] or speed == 0.0 or before == after:
            continue
        control = [[speed, math.copysign(math.pi / 3.0, (after - before) * speed)]]

        def left(t: float, before=before, after=after, control=control) -> float:
            return (
                drive(model, [before], control=control, durations=[t]).reduced_state[-1, 0] - after
            )

        course = drive(model, [before], control=control, durations=[brentq(left, 1e-6, 40.0)])
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
    return Automaton(model, tuple(trims), tuple(maneuvers))
