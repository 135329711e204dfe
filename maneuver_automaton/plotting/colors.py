"""One colour per trim: the direction in which it drives and turns, the same in every picture.

The hue goes round with the direction of motion, from straight ahead over a left turn, a turn
on the spot, and reverse back again, through eight anchors that colour-blind readers tell apart;
slow trims are lighter. Two trims of one picture that would look alike are told apart by shade.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from maneuver_automaton._arrays import Array

Color = tuple[float, float, float]

INK: Color = (0.10, 0.11, 0.13)
GREY: Color = (0.55, 0.56, 0.58)
REST: Color = (0.48, 0.49, 0.51)
CLIMB: Color = (0.42, 0.29, 0.16)
# after Okabe, Ito (2008), "Color universal design", darkened where thin lines would fade
WHEEL = np.array(
    [
        [0.00, 0.40, 0.70],  # ahead
        [0.00, 0.62, 0.45],  # ahead and left
        [0.80, 0.62, 0.00],  # left on the spot
        [0.93, 0.45, 0.05],  # back, turning left
        [0.78, 0.16, 0.10],  # back
        [0.85, 0.47, 0.68],  # back, turning right
        [0.42, 0.20, 0.52],  # right on the spot
        [0.28, 0.68, 0.90],  # ahead and right
    ]
)
ASIDE = np.array([[0.53, 0.70, 0.10], [0.66, 0.34, 0.36]])  # to the left, to the right
SLIP = 0.2  # of the speed: less motion aside does not show
# for whole plans: the first is the best one
SEQUENCE: tuple[Color, ...] = (
    (0.00, 0.40, 0.70),
    (0.90, 0.45, 0.05),
    (0.00, 0.62, 0.45),
    (0.80, 0.47, 0.65),
    (0.80, 0.62, 0.00),
    (0.34, 0.71, 0.91),
    (0.42, 0.20, 0.52),
    (0.55, 0.56, 0.58),
)
# for vehicles: ten that are told apart, also on what is grey
TEN: tuple[Color, ...] = (
    (0.00, 0.40, 0.70),
    (0.90, 0.45, 0.05),
    (0.00, 0.58, 0.40),
    (0.78, 0.14, 0.20),
    (0.48, 0.25, 0.62),
    (0.20, 0.68, 0.92),
    (0.86, 0.42, 0.66),
    (0.50, 0.58, 0.05),
    (0.52, 0.33, 0.18),
    (0.90, 0.68, 0.00),
)
SWEPT: Color = (0.36, 0.60, 0.85)
LANE: Color = (0.91, 0.91, 0.92)
NEGLIGIBLE = 1e-6  # of the largest component of a twist
ALIKE = 0.13  # distance in RGB
SHADES = (0.0, -0.2, -0.36, 0.25, 0.42, -0.5, 0.58)  # towards white, towards black


def trim_colors(twists: Mapping[str, Array]) -> dict[str, Color]:
    """A colour for each of the trims with `twists` (dof,) by name.

    Examples
    --------
    >>> ahead, back = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    >>> trim_colors({"ahead": ahead, "back": back})["ahead"] == trim_colors({"go": ahead})["go"]
    True
    """
    colors: dict[str, Color] = {}
    for name in sorted(twists, key=lambda name: (*np.abs(twists[name]).round(9), name)):
        colors[name] = _unlike(twist_color(twists[name]), list(colors.values()))
    return {name: colors[name] for name in twists}


def twist_color(twist: Array) -> Color:
    """Colour of a trim with `twist` (dof,), whatever else is in the picture."""
    size = np.abs(twist).max()
    ahead, aside, turn, *climb = np.where(np.abs(twist) > NEGLIGIBLE * size, twist, 0.0)
    drive = np.hypot(ahead, aside)
    if drive == 0.0 and turn == 0.0:
        return CLIMB if any(climb) else REST
    along = -1.0 if ahead < 0.0 or (ahead == 0.0 and aside < 0.0) else 1.0
    if drive == 0.0 or turn == 0.0:
        eighth = 2.0 if drive == 0.0 else 0.0
    else:
        eighth = 0.8 + 0.4 * abs(turn) / (abs(turn) + drive)
    place = eighth * np.sign(turn) if along > 0.0 else 4.0 - eighth * np.sign(turn)
    corner = int(np.floor(place))
    share = place - corner
    hue = (1.0 - share) * WHEEL[corner % 8] + share * WHEEL[(corner + 1) % 8]
    if drive:
        sideways = max(0.0, (abs(aside) / drive - SLIP) / (1.0 - SLIP))
        hue = hue + sideways * (ASIDE[0 if aside > 0.0 else 1] - hue)
    red, green, blue = hue.tolist()
    pace = np.hypot(drive, turn)
    return _rounded(shaded((red, green, blue), 0.5 * (0.5 - pace / (1.0 + pace))))


def fleet_colors(count: int) -> list[Color]:
    """A colour for each of `count` vehicles: ten, then their shades."""
    shades = [SHADES[(k // len(TEN)) % len(SHADES)] for k in range(count)]
    return [_rounded(shaded(TEN[k % len(TEN)], shade)) for k, shade in enumerate(shades)]


def shaded(color: Color, amount: float) -> Color:
    """`color` mixed with white (`amount` up to 1) or with black (down to -1)."""
    target = 1.0 if amount > 0.0 else 0.0
    red, green, blue = (c + abs(amount) * (target - c) for c in color)
    return (red, green, blue)


def _unlike(color: Color, taken: Sequence[Color]) -> Color:
    """`color`, or the first of its shades and then of all that is unlike the `taken` ones."""
    others = [shaded((r, g, b), shade) for shade in SHADES for r, g, b in WHEEL.tolist()]
    candidates = [*(shaded(color, shade) for shade in SHADES), *others]
    if not taken:
        return color
    gaps = np.linalg.norm(np.array(candidates)[:, None] - np.array(taken), axis=-1).min(axis=1)
    unlike = np.flatnonzero(gaps > ALIKE)
    return _rounded(candidates[int(unlike[0]) if unlike.size else int(np.argmax(gaps))])


def _rounded(color: Color) -> Color:
    red, green, blue = (round(min(max(c, 0.0), 1.0), 4) for c in color)
    return red, green, blue


MOST_TRIMS = 12  # which have a colour and a name each
SLIGHT = 1e-3  # of the largest component of a twist
DIAGONAL = 0.4  # of the larger one of two components: less does not name the direction
PALE, DARK = 0.5, -0.15  # shades of the slowest and the fastest of those that move alike


def track_colors(twists: Mapping[str, Array]) -> dict[str, Color]:
    """Colours of trims with `twists` (dof,): one each, or of many by how they move."""
    if len(twists) <= MOST_TRIMS:
        return trim_colors(twists)
    colors: dict[str, Color] = {}
    for names in _alike(twists).values():
        speeds = np.array([_speed(twists[name]) for name in names])
        most, least = float(speeds.max()), float(speeds.min())
        hue = twist_color(_typical(twists[names[0]]))
        for name, speed in zip(names, speeds.tolist(), strict=True):
            share = (speed - least) / (most - least) if most - least > SLIGHT * most else 0.8
            colors[name] = shaded(hue, PALE + share * (DARK - PALE))
    return {name: colors[name] for name in twists}


def motion_names(twists: Mapping[str, Array], *, many: bool) -> dict[str, str]:
    """What a legend calls trims, of `many` how they move, and a trim of each, or the fastest."""
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
    """How a trim with `twist` (dof,) moves, in words."""
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
    if drive > SLIGHT * float(np.abs(twist).max()):
        return drive
    return abs(float(_clear(twist)[2])) or float(np.abs(twist[3:]).sum())


def _typical(twist: Array) -> Array:
    """The twist (3,) of the same direction at unit speed and turn rate; a climb stays one."""
    clear = _clear(twist)
    signs = np.sign(clear)
    along, across = np.abs(clear[:2]).tolist()
    signs[:2] *= [along >= DIAGONAL * across, across >= DIAGONAL * along]
    return np.asarray(signs)


def _clear(twist: Array) -> Array:
    """The twist, its negligible components zero."""
    return np.where(np.abs(twist) > SLIGHT * np.abs(twist).max(), twist, 0.0)
