"""How tests compare values that hold arrays."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.groups import LieGroup


def assert_same_motion(
    a: LieGroup, b: LieGroup, *, atol: float = 1e-9, modulo_turn: bool = False
) -> None:
    """Fail unless two batches of poses agree to `atol` [m, rad].

    Headings are compared as they are, full turns included, or modulo a turn on demand.
    """
    assert type(a) is type(b), f"{type(a).__name__} is no {type(b).__name__}"
    assert a.pose.shape == b.pose.shape, f"shapes {a.pose.shape} and {b.pose.shape} differ"
    difference = a.pose - b.pose
    if modulo_turn:
        angle = np.array([name.startswith("heading") for name in a.coordinates])
        difference = np.where(angle, wrapped(difference), difference)
    worst = float(np.abs(difference).max(initial=0.0))
    assert worst <= atol, f"motions differ by {worst:.3g}, more than {atol:.3g}:\n{a}\n{b}"
