"""Words and numbers as the pictures show them."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from maneuver_automaton.plotting.style import shortened

UNITS = {
    "speed": "m/s",
    "lateral_speed": "m/s",
    "speed_ahead": "m/s",
    "speed_aside": "m/s",
    "climb": "m/s",
    "turn_rate": "rad/s",
    "steering": "rad",
    "steering_rate": "rad/s",
    "acceleration": "m/s²",
    "angular_acceleration": "rad/s²",
    "climb_acceleration": "m/s²",
    "hitch": "rad",
    "tilt": "rad",
    "lateral_tilt": "rad",
    "tilt_rate": "rad/s",
    "lateral_tilt_rate": "rad/s",
    "heading_cos": "1",
    "heading_sin": "1",
    "force": "N",
    "torque": "N m",
}
ARROW = " → "
POLISHED = "polished"  # what planning calls a motion by optimal control


def control_labels(names: Sequence[str]) -> list[str]:
    """Axis labels of controls: words, with the unit of those whose name says what they are.

    Examples
    --------
    >>> control_labels(["turn_rate", "thrust"])
    ['turn rate [rad/s]', 'thrust']
    """
    return [
        name.replace("_", " ") + (f" [{UNITS[name]}]" if name in UNITS else "") for name in names
    ]


def shown_name(name: str) -> str:
    """The name of a trim or maneuver as pictures show it: "polished" alone says little.

    Examples
    --------
    >>> shown_name("polished"), shown_name("polished, back"), shown_name("left")
    ('polished motion', 'polished motion, back', 'left')
    """
    head, comma, rest = name.partition(",")
    return f"{head} motion{comma}{rest}" if head == POLISHED else name


def word_text(word: Sequence[str], *, width: int, lines: int) -> str:
    """A word in at most `lines` of `width` characters, its middle left out if it is longer.

    Examples
    --------
    >>> word_text(["spin", "straight", "rest"], width=40, lines=1)
    'spin → straight → rest'
    >>> word_text(["left", "right"] * 20, width=40, lines=1)
    'left → … → left → right (40 trims)'
    """
    if not word:
        return "no motion"
    if list(word) == [POLISHED]:
        return "one motion by optimal control"
    names = [shortened(shown_name(name), 80) for name in word]
    whole = textwrap.wrap(ARROW.join(names), width, break_long_words=False)
    if len(whole) <= lines or len(names) < 4:
        return "\n".join(whole)
    room, head = width * lines - 16, 1
    tail = names[-2:] if len(ARROW.join([names[0], "…", *names[-2:]])) < room else names[-1:]
    while len(ARROW.join([*names[: head + 1], "…", *tail])) < room and head < len(names) - 3:
        head += 1
    cut = ARROW.join([*names[:head], "…", *tail]) + f" ({len(names)} trims)"
    return "\n".join(textwrap.wrap(cut, width, break_long_words=False))
