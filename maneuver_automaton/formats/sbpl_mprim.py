"""Motion primitives of SBPL (.mprim): words in a fixed order, read and written.

A line `min_turning_radius_m:` makes headings that are listed, one `angle:` each, and a radius for
every primitive; without it they are evenly spaced. The cost multiplier of a primitive is that of
its maneuver.

Source: Likhachev, Ferguson (2009), *Planning long dynamically feasible maneuvers for autonomous
vehicles*, IJRR 28(8), and the environments of SBPL.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array, freeze, wrapped
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats.lattice import (
    SPEED,
    TURN_RATE,
    Lattice,
    Move,
    arcs,
    automaton_of_lattice,
    cells,
    continuous,
    lattice_of_automaton,
)
from maneuver_automaton.formats.text_source import finite, lines_of, read_text, whole

KIND = "SBPL primitives"
MOST_BYTES = 50_000_000
RESOLUTION, RADIUS = "resolution_m:", "min_turning_radius_m:"
ANGLES, TOTAL = "numberofangles:", "totalnumberofprimitives:"
FIRST, START, END = "primID:", "startangle_c:", "endpose_c:"
MULTIPLIER, PRIMITIVE_RADIUS, POSES = (
    "additionalactioncostmult:",
    "turning_radius:",
    "intermediateposes:",
)
FARTHEST_CELLS = 50  # from the first pose, besides three times the way to the end
UNEVEN = 1.5  # times the longest other step, that the first may be where the first pose is left out
IN_CELL, IN_BIN = 0.5, 0.5  # of a cell and of a step between headings: how far off an end may be


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MprimPrimitive:
    """One primitive, as it stands in the file."""

    id: int  # unique among those of its heading
    start: int  # index of the first heading
    end: tuple[int, int, int]  # columns and rows gained, last heading modulo their number
    cost_multiplier: int
    poses: Array  # (n, 3) from (0, 0, first heading), which may be left out [m, m, rad]
    turning_radius: float | None = None  # [m], 0 if straight; stated with listed headings only

    def __post_init__(self) -> None:
        freeze(self, "poses", last=3)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MprimFile:
    """A file of primitives."""

    resolution: float  # [m] of a cell
    headings: Array  # (k,) [rad]
    min_turning_radius: float | None  # [m]; None: headings are evenly spaced, and not listed
    primitives: tuple[MprimPrimitive, ...]

    def __post_init__(self) -> None:
        freeze(self, "headings")


class _Words:
    """The words of a file one after the other, each with its line: one use."""

    def __init__(self, path: Path) -> None:
        self.path, self.line = path, 1
        self.words: Iterator[tuple[str, int]] = (
            (word, k + 1)
            for k, line in enumerate(
                lines_of(read_text(path, most=MOST_BYTES, what="a file of primitives"))
            )
            for word in line.split()
        )
        self.ahead: tuple[str, int] | None = None

    def next(self, need: str) -> str:
        word, self.line = self.ahead or next(self.words, ("", self.line))
        self.ahead = None
        if not word:
            raise InvalidScenario(f"{self.path}:{self.line}: ends early, need {need}")
        return word

    def peek(self) -> str:
        self.ahead = self.ahead or next(self.words, None)
        return self.ahead[0] if self.ahead else ""

    def key(self, name: str) -> _Words:
        word = self.next(name)
        if word != name:
            raise InvalidScenario(f"{self.path}:{self.line}: got {word!r:.40}, need {name}")
        return self

    def finite(self, what: str) -> float:
        return finite(self.next(what), at=f"{self.path}:{self.line}: {what.rstrip(':')}")

    def positive(self, what: str) -> float:
        value = self.finite(what)
        if not value > 0.0:
            raise self.wrong(what, f"got {value:g}, need a positive number")
        return value

    def whole(self, what: str, *, least: int = 0) -> int:
        word = self.next(what)
        return whole(word, at=f"{self.path}:{self.line}: {what.rstrip(':')}", least=least)

    def wrong(self, what: str, said: str) -> InvalidScenario:
        return InvalidScenario(f"{self.path}:{self.line}: {what.rstrip(':')}: {said}")


def read_mprim(path: Path) -> MprimFile:
    """The primitives of a file, as they stand there."""
    words = _Words(path)
    resolution = words.key(RESOLUTION).positive(RESOLUTION)
    radius = words.key(RADIUS).positive(RADIUS) if words.peek() == RADIUS else None
    n_angles = words.key(ANGLES).whole(ANGLES, least=1)
    headings = 2.0 * np.pi * np.arange(n_angles) / n_angles
    if radius is not None:
        headings = _listed(words, n_angles)
    total = words.key(TOTAL).whole(TOTAL)
    if total > MOST_BYTES // 10:
        raise words.wrong(TOTAL, f"got {total}, more than a file can hold")
    primitives = tuple(_primitive(words, resolution, headings, radius) for _ in range(total))
    if extra := words.peek():
        raise InvalidScenario(
            f"{path}:{words.ahead[1] if words.ahead else words.line}: got {extra!r:.40} after "
            f"{total} primitives, need the end of the file"
        )
    twice = [key for key, n in Counter((p.start, p.id) for p in primitives).items() if n > 1]
    if twice:
        raise InvalidScenario(
            f"{path}: {FIRST[:-1]}: {twice[0][1]} stands twice for heading {twice[0][0]}, need "
            "numbers that differ"
        )
    return MprimFile(
        resolution=resolution, headings=headings, min_turning_radius=radius, primitives=primitives
    )


def save_mprim(file: MprimFile, path: Path) -> None:
    """Write primitives, in one step; every number reads back to the last bit."""
    lines = [f"{RESOLUTION} {file.resolution!r}"]
    if file.min_turning_radius is not None:
        lines.append(f"{RADIUS} {file.min_turning_radius!r}")
    lines.append(f"{ANGLES} {file.headings.size}")
    if file.min_turning_radius is not None:
        lines += [f"angle:{k} {angle!r}" for k, angle in enumerate(file.headings.tolist())]
    lines.append(f"{TOTAL} {len(file.primitives)}")
    for one in file.primitives:
        lines += [
            f"{FIRST} {one.id}",
            f"{START} {one.start}",
            f"{END} {' '.join(map(str, one.end))}",
            f"{MULTIPLIER} {one.cost_multiplier}",
        ]
        if file.min_turning_radius is not None:
            lines.append(f"{PRIMITIVE_RADIUS} {one.turning_radius or 0.0!r}")
        lines.append(f"{POSES} {len(one.poses)}")
        lines += [" ".join(map(repr, pose)) for pose in one.poses.tolist()]
    write_text_atomically(path, "\n".join(lines) + "\n")


def automaton_of_mprim(
    file: MprimFile, *, speed: float = SPEED, turn_rate: float = TURN_RATE, name: str = ""
) -> Automaton:
    """The automaton of a file, whose rounded ends are taken where they are meant: on the grid."""
    lattice = Lattice(
        resolution=file.resolution,
        headings=file.headings,
        moves=tuple(_meant(file, one) for one in file.primitives),
        turning_radius=file.min_turning_radius,
        name=name,
    )
    return automaton_of_lattice(lattice, speed=speed, turn_rate=turn_rate)


def mprim_of_automaton(automaton: Automaton) -> MprimFile:
    """An automaton of lattice primitives as a file."""
    lattice = lattice_of_automaton(automaton, kind=KIND)
    n = lattice.headings.size
    counts = Counter(move.start for move in lattice.moves)
    if len({counts[k] for k in range(n)}) > 1:
        fewest, most = min(range(n), key=counts.__getitem__), max(range(n), key=counts.__getitem__)
        raise InvalidLibrary(
            f"{automaton.name or 'automaton'}: heading {fewest} has {counts[fewest]} maneuvers and "
            f"heading {most} has {counts[most]}; a file of {KIND} needs as many for each"
        )
    even = bool(np.abs(lattice.headings - 2.0 * np.pi * np.arange(n) / n).max() < 1e-9)
    radius = lattice.turning_radius
    if not even and radius is None:
        raise InvalidLibrary(
            f"{automaton.name or 'automaton'}: its headings are not evenly spaced; a file of "
            f"{KIND} lists headings beside a least turning radius, which the model has not"
        )
    given: Counter[int] = Counter()
    primitives = []
    for move in lattice.moves:
        across = cells(move, lattice.resolution)
        assert across is not None  # checked by `lattice_of_automaton`
        if not float(move.cost_multiplier).is_integer():
            raise InvalidLibrary(
                f"{automaton.name or 'automaton'}: a maneuver from heading {move.start} has the "
                f"cost multiplier {move.cost_multiplier:g}; a file of {KIND} needs whole numbers"
            )
        primitives.append(
            MprimPrimitive(
                id=given[move.start],
                start=move.start,
                end=(*across, move.end),
                cost_multiplier=int(move.cost_multiplier),
                poses=move.poses,
                turning_radius=None if radius is None else arcs(move.poses)[0],
            )
        )
        given[move.start] += 1
    return MprimFile(
        resolution=lattice.resolution,
        headings=lattice.headings,
        min_turning_radius=radius,
        primitives=tuple(primitives),
    )


def end_gap(file: MprimFile) -> tuple[float, float]:
    """How far a stated last pose is, at most, from its cell and its heading [m, rad]."""
    position, heading = 0.0, 0.0
    for one in file.primitives:
        gap = one.poses[-1] - _meant(file, one).poses[-1]
        position = max(position, float(np.abs(gap[:2]).max()))
        heading = max(heading, abs(float(wrapped(gap[2]))))
    return position, heading


def _listed(words: _Words, n_angles: int) -> Array:
    headings: list[float] = []
    for k in range(n_angles):
        headings.append(words.key(f"angle:{k}").finite(f"angle:{k}"))
        if k and not headings[k] > headings[k - 1]:
            raise words.wrong(f"angle:{k}", f"got {headings[k]:g}, need more than the one before")
    if not (headings[0] > -1e-9 and headings[-1] < 2.0 * np.pi):
        raise words.wrong("angle", "need headings from 0 to less than a full turn")
    return np.array(headings)


def _primitive(
    words: _Words, resolution: float, headings: Array, radius: float | None
) -> MprimPrimitive:
    number = words.key(FIRST).whole(FIRST)
    start = words.key(START).whole(START)
    if start >= headings.size:
        raise words.wrong(START, f"got the heading {start}, need 0 to {headings.size - 1}")
    words.key(END)
    column, row = (words.whole(END, least=-(2**31)) for _ in range(2))
    end = (column, row, words.whole(END, least=-headings.size))
    multiplier = words.key(MULTIPLIER).whole(MULTIPLIER)
    own = None if radius is None else words.key(PRIMITIVE_RADIUS).finite(PRIMITIVE_RADIUS)
    count = words.key(POSES).whole(POSES, least=1)
    poses: list[list[float]] = []
    first = words.line
    for k in range(count):
        poses.append([words.finite(f"pose {k}, {what}") for what in ("x", "y", "yaw")])
        first = words.line if k == 0 else first
    made = MprimPrimitive(
        id=number,
        start=start,
        end=end,
        cost_multiplier=multiplier,
        poses=np.array(poses),
        turning_radius=own,
    )
    _check_ends(words, made, resolution, headings, first)
    _check_between(words, made, resolution)
    return made


def _check_ends(
    words: _Words, made: MprimPrimitive, resolution: float, headings: Array, first: int
) -> None:
    """The last pose is in its cell and bin, the first at the origin or a step from it."""
    column, row, last = made.end
    meant = np.array([resolution * column, resolution * row, headings[last % headings.size]])
    begin = np.array([0.0, 0.0, headings[made.start]])
    pose, need, line = made.poses[-1], meant, words.line
    if _is_at(pose, need, resolution, headings):
        steps = np.abs(np.diff(np.vstack([begin, made.poses]), axis=0))
        steps[:, 2] = np.abs(wrapped(steps[:, 2]))
        sizes = np.column_stack([np.hypot(steps[:, 0], steps[:, 1]), steps[:, 2]])
        longest = sizes[1:].max(axis=0, initial=0.0) if len(sizes) > 1 else sizes[0]
        cell = (IN_CELL * resolution, IN_BIN * _narrowest(headings))
        if (sizes[0] <= np.maximum(UNEVEN * longest, cell)).all():
            return
        pose, need, line = made.poses[0], begin, first
    raise InvalidScenario(
        f"{words.path}:{line}: got the pose ({pose[0]:g}, {pose[1]:g}, {pose[2]:g}), need it in "
        f"the cell and at the heading of ({need[0]:g}, {need[1]:g}, {need[2]:g})"
    )


def _is_at(pose: Array, node: Array, resolution: float, headings: Array) -> bool:
    """Whether a pose is in the cell and bin of a node."""
    off = np.abs(pose - node)
    turn = abs(float(wrapped(off[2])))
    return bool(off[:2].max() <= IN_CELL * resolution and turn <= IN_BIN * _narrowest(headings))


def _check_between(words: _Words, made: MprimPrimitive, resolution: float) -> None:
    """No pose is far from the way between the ends."""
    most = resolution * (FARTHEST_CELLS + 3.0 * np.hypot(*made.end[:2]))
    far = np.hypot(*made.poses[:, :2].T)
    if not far.max() <= most:
        k = int(far.argmax())
        raise words.wrong(
            POSES,
            f"got pose {k} of the {len(far)} that end here {far[k]:g} m from the first, need at "
            f"most {most:g} m",
        )


def _narrowest(headings: Array) -> float:
    """Least step between headings [rad], a full turn where there is one alone."""
    return float(np.diff(np.append(headings, headings[0] + 2.0 * np.pi)).min())


def _meant(file: MprimFile, one: MprimPrimitive) -> Move:
    """A primitive whose first and last poses are what their cells and headings say."""
    column, row, last = one.end
    last %= file.headings.size
    begin, end = float(file.headings[one.start]), float(file.headings[last])
    origin = np.array([0.0, 0.0, begin])
    stated = len(one.poses) > 1 and _is_at(one.poses[0], origin, file.resolution, file.headings)
    poses = one.poses if stated else np.vstack([origin, one.poses])
    poses = continuous(poses, last_heading=end)
    poses[:, 2] -= _turns(poses[0, 2] - begin)
    poses[0] = 0.0, 0.0, begin
    poses[-1] = file.resolution * column, file.resolution * row, end + _turns(poses[-1, 2] - end)
    return Move(start=one.start, end=last, poses=poses, cost_multiplier=float(one.cost_multiplier))


def _turns(angle: float) -> float:
    """The whole turns in an angle [rad], to the nearest."""
    return 2.0 * np.pi * round(angle / (2.0 * np.pi))
