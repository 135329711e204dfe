"""Trims as a legend names them: one by one, or, where they are many, by how they move."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import Color, shaded, trim_colors, twist_color

MOST_TRIMS = 12  # which have a colour and a name each
NEGLIGIBLE = 1e-3  # of the largest component of a twist
DIAGONAL = 0.4  # of the larger one of two components: less does not name the direction
PALE, DARK = 0.5, -0.15  # shades of the slowest and the fastest of those that move alike


def track_colors(twists: Mapping[str, Array]) -> dict[str, Color]:
    """A colour for each of the trims with `twists` (dof,) by name.

    Up to twelve trims have a colour each. More share the colours of how they move, the darker
    the faster.

    Examples
    --------
    >>> slow, fast = ({f"v {v}": np.array([v, 0.0, 0.0]) for v in vs} for vs in ([1, 2], range(20)))
    >>> track_colors(slow) == trim_colors(slow), len(motion_names(fast, many=True))
    (True, 2)
    """
    if len(twists) <= MOST_TRIMS:
        return trim_colors(twists)
    colors: dict[str, Color] = {}
    for names in _alike(twists).values():
        speeds = np.array([_speed(twists[name]) for name in names])
        most, least = float(speeds.max()), float(speeds.min())
        hue = twist_color(_typical(twists[names[0]]))
        for name, speed in zip(names, speeds.tolist(), strict=True):
            share = (speed - least) / (most - least) if most - least > NEGLIGIBLE * most else 0.8
            colors[name] = shaded(hue, PALE + share * (DARK - PALE))
    return {name: colors[name] for name in twists}


def motion_names(twists: Mapping[str, Array], *, many: bool) -> dict[str, str]:
    """What a legend calls the trims with `twists`, and a trim of each: itself, or the fastest.

    Trims have their own names, and how they move if they are `many`.

    Examples
    --------
    >>> many = {f"trim {k}": np.array([0.1 * k, 0.0, 0.5]) for k in range(1, 21)}
    >>> motion_names(many, many=True)
    {'ahead, turning left, 0.1 (pale) to 2 m/s': 'trim 20'}
    """
    if not many:
        return {name: name for name in twists}
    entries = {}
    for motion, names in _alike(twists).items():
        speeds = [_speed(twists[name]) for name in names]
        least, most = min(speeds), max(speeds)
        unit = "rad/s" if motion.startswith("turn") else "m/s"
        slow, fast = f"{least:.2g}", f"{most:.2g}"
        pace = f"{fast} {unit}" if slow == fast else f"{slow} (pale) to {fast} {unit}"
        entries[f"{motion}, {pace}" if most > 0.0 else motion] = names[int(np.argmax(speeds))]
    return entries


def motion(twist: Array) -> str:
    """How a trim with `twist` (dof,) moves, in words.

    Examples
    --------
    >>> [motion(np.array(twist)) for twist in ([2, 0, -1], [-1, 0, 0], [0, 0, 1], [0, 0, 0, 2])]
    ['ahead, turning right', 'back', 'turn left on the spot', 'climb']
    """
    ahead, aside, turn, *climb = _clear(twist)
    side = "left" if turn > 0.0 else "right"
    if ahead == 0.0 and aside == 0.0:
        if turn:
            return f"turn {side} on the spot"
        return "rest" if not any(climb) else "climb" if climb[0] > 0.0 else "sink"
    ahead, aside, _ = _typical(twist)[:3].tolist()
    along = ["back", "", "ahead"][int(ahead) + 1]
    across = ["to the right", "", "to the left"][int(aside) + 1]
    way = " and ".join(part for part in (along, across) if part)
    return f"{way}, turning {side}" if turn else way


def _alike(twists: Mapping[str, Array]) -> dict[str, list[str]]:
    """Names of the trims that move alike, by how they move."""
    groups: dict[str, list[str]] = {}
    for name, twist in twists.items():
        groups.setdefault(motion(twist), []).append(name)
    return groups


def _speed(twist: Array) -> float:
    """Speed [m/s]; turn rate [rad/s] of a turn on the spot, climb rate of a climb there [m/s]."""
    drive = float(np.hypot(twist[0], twist[1]))
    if drive > NEGLIGIBLE * float(np.abs(twist).max()):
        return drive
    turn = abs(float(_clear(twist)[2]))
    return turn or float(np.abs(twist[3:]).sum())


def _typical(twist: Array) -> Array:
    """The twist (3,) of the same direction at unit speed and turn rate; a climb stays one."""
    clear = _clear(twist)
    signs = np.sign(clear)
    along, across = np.abs(clear[:2]).tolist()
    signs[:2] *= [along >= DIAGONAL * across, across >= DIAGONAL * along]
    return np.asarray(signs)


def _clear(twist: Array) -> Array:
    """The twist, its negligible components zero."""
    return np.where(np.abs(twist) > NEGLIGIBLE * np.abs(twist).max(), twist, 0.0)
