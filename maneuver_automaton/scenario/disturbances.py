"""What files say of disturbances, as values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario.fleet_schema import FleetLoopPart, FleetNoise, VehicleLoopPart
from maneuver_automaton.scenario.schema import Disturbance as LateNoise

if TYPE_CHECKING:
    from maneuver_automaton.receding_horizon import Disturbance


def disturbance_of(part: LateNoise | FleetNoise, *, seed: int | None = None) -> Disturbance:
    """What a file says of disturbances, with another seed if one is given."""
    from maneuver_automaton.receding_horizon import Disturbance

    return Disturbance(
        position_m=part.position_m,
        heading_rad=part.heading_rad,
        measured_position_m=part.measured_position_m,
        measured_heading_rad=part.measured_heading_rad,
        twist_scale=part.twist_scale,
        pushes={push.after_step: push.by for push in part.pushes},
        delay=part.delay_steps if isinstance(part, LateNoise) else 0,
        seed=part.seed if seed is None else seed,
    )


def check_disturbance(part: LateNoise | FleetNoise, problem: Problem) -> None:
    """Raise a ValueError where a disturbance does not suit a vehicle."""
    from maneuver_automaton.receding_horizon.disturbance import checked
    from maneuver_automaton.receding_horizon.settings import switches_at_will

    checked(disturbance_of(part), problem.start.size)
    if part.twist_scale is not None and not switches_at_will(problem):
        raise ValueError(
            f"twist_scale: got {list(part.twist_scale)}, need no such key for a vehicle with "
            "inertia: a maneuver is driven as its model says"
        )


def disturbances_of(
    names: Sequence[str], loop: FleetLoopPart | None, own: Mapping[str, VehicleLoopPart]
) -> dict[str, Disturbance]:
    """What disturbs each vehicle of a fleet, by name: what it states itself, or that of the top.

    The seed of the top is not in it: it is that of the loop, in which every vehicle has its own.

    Examples
    --------
    >>> loop = FleetLoopPart(step_s=0.5, disturbance={"position_m": 0.01, "seed": 4})
    >>> calm = VehicleLoopPart(disturbance={})
    >>> found = disturbances_of(["a", "b"], loop, {"b": calm})
    >>> found["a"].position_m, found["a"].seed, found["b"].position_m
    (0.01, 0, 0.0)
    """
    found = {}
    for name in names:
        its = own[name].disturbance if name in own else None
        if its is not None:
            found[name] = disturbance_of(its)
        elif loop is not None and loop.disturbance is not None:
            found[name] = disturbance_of(loop.disturbance, seed=0)
    return found
