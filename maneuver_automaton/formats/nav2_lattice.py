"""Lattice primitives of Nav2 (JSON): headings towards grid points, poses in the frame of the grid.

The first pose is left out where a primitive moves; turns on the spot state it. Entries are sorted
by their first heading. Motion is forward: Nav2 takes a primitive of the opposite heading for
reverse. What a primitive says of itself, such as its lengths, is kept from file to file; from an
automaton it is worked out of the poses.

Source: the lattice generator of navigation2, `nav2_smac_planner/lattice_primitives`, and its files.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NotRequired

import numpy as np
from pydantic import TypeAdapter
from typing_extensions import TypedDict

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats.documents import check_value, misstated
from maneuver_automaton.formats.entries import Flag, Number, Positive, Whole
from maneuver_automaton.formats.lattice import (
    ON_GRID,
    Lattice,
    Move,
    arcs,
    automaton_of_lattice,
    continuous,
    lattice_of_automaton,
)
from maneuver_automaton.formats.text_source import read_text

KIND = "Nav2 lattice primitives"
MOST_BYTES = 50_000_000
MOST_CELLS = 3  # between two poses in a row; Nav2 writes one a cell
GAP_CELLS = 1.75  # between two poses in a row, where all others of a primitive are nearer
GAP_TURN = 0.25  # [rad] the same of a turn; Nav2 writes at most 0.232 rad
UNEVEN = 1.5  # a gap is so many times as long as the middle one of a primitive's steps
MOTIONS = ("ackermann", "diff", "omni")
ON_HEADING = 1e-6  # [rad] between a last pose and its heading
SIDEWAYS = 0.5  # sine of the angle to the heading above which a straight is no straight ahead
DIGITS = 5  # after the point, of what is worked out of poses


class Nav2Row(TypedDict):
    """A primitive of a file."""

    trajectory_id: Whole
    start_angle_index: Whole
    end_angle_index: Whole
    left_turn: Flag  # true unless it has an arc to the right
    trajectory_radius: Number  # [m] of its arc, 0 without one
    trajectory_length: Number  # [m]
    arc_length: Number  # [m]
    straight_length: Number  # [m]
    poses: list[list[Number]]  # [m, m, rad]; the first one is left out where it moves


class Nav2Head(TypedDict):
    """What holds of all primitives of a file."""

    motion_model: str  # ackermann | diff | omni
    turning_radius: Positive  # [m]
    grid_resolution: Positive  # [m]
    stopping_threshold: NotRequired[Whole]  # of the generator
    num_of_headings: Whole
    trajectory_distinctness_ratio: NotRequired[Number]  # of the generator, newer files
    heading_angles: list[Number]  # [rad], rising
    number_of_trajectories: Whole


class Nav2File(TypedDict):
    """A file of primitives, as JSON holds it."""

    version: NotRequired[Number]
    date_generated: NotRequired[str]  # YYYY-MM-DD
    lattice_metadata: Nav2Head
    primitives: list[Nav2Row]


def read_nav2_lattice(path: Path) -> Nav2File:
    """The primitives of a file, as they stand there."""
    text = read_text(path, most=MOST_BYTES, what="lattice primitives")
    try:
        top = json.loads(text)
    except json.JSONDecodeError as error:
        raise InvalidScenario(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from error
    except (RecursionError, ValueError) as error:
        raise InvalidScenario(f"{path}: not valid JSON: {error}") from error
    check_value(TypeAdapter(Nav2File), top, path)
    head, rows = top["lattice_metadata"], top["primitives"]
    angles, n, motion = head["heading_angles"], head["num_of_headings"], head["motion_model"]

    def wrong(key: str, said: str, *more: int) -> InvalidScenario:
        return misstated(path, ("lattice_metadata", key, *more), said)

    if len(angles) != n or n < 1:
        raise wrong(
            "num_of_headings", f"got {n}, but there are {len(angles)} heading_angles; need as many"
        )
    for k, (low, angle) in enumerate(zip([-1e-12, *angles], angles, strict=False)):
        if not low < angle < 2.0 * math.pi:
            said = f"got {angle:g}, need rising angles from 0 to less than 2 pi"
            raise wrong("heading_angles", said, k)
    if motion not in MOTIONS:
        raise wrong("motion_model", f"got {motion!r:.40}, need one of {', '.join(MOTIONS)}")
    headings, resolution = np.array(angles, dtype=np.float64), float(head["grid_resolution"])
    for k, row in enumerate(rows):
        _check(row, headings, resolution, path, k)
    _check_order(rows, headings.size, path)
    count = head["number_of_trajectories"]
    if count != len(rows):
        said = f"got {count}, but there are {len(rows)} primitives"
        raise wrong("number_of_trajectories", said)
    file: Nav2File = top
    return file


def save_nav2_lattice(file: Nav2File, path: Path) -> None:
    """Write primitives, in one step; every number reads back to the last bit."""
    write_text_atomically(path, json.dumps(file, indent="\t", allow_nan=False) + "\n")


def automaton_of_nav2_lattice(file: Nav2File, *, name: str = "") -> Automaton:
    """The automaton of a file, its times as `automaton_of_lattice` has them."""
    head = file["lattice_metadata"]
    lattice = Lattice(
        resolution=head["grid_resolution"],
        headings=np.array(head["heading_angles"]),
        moves=tuple(_meant(head, one) for one in file["primitives"]),
        turning_radius=head["turning_radius"],
        name=name,
    )
    return automaton_of_lattice(lattice)


def nav2_lattice_of_automaton(automaton: Automaton) -> Nav2File:
    """An automaton of lattice primitives as a file, which leaves its date out."""
    lattice = lattice_of_automaton(automaton, kind=KIND)
    label = automaton.name or "automaton"
    moves = []
    for maneuver, move in zip(automaton.maneuvers, lattice.moves, strict=True):
        if _along(move)[0] < -SIDEWAYS:
            raise InvalidLibrary(
                f"maneuver {maneuver.name!r}: drives in reverse, but a file of {KIND} has forward "
                "motion only: Nav2 drives the primitives of the opposite heading backwards"
            )
        moves.append(move)
    moves.sort(key=lambda move: move.start)
    left_out = set(range(lattice.headings.size)) - {move.start for move in moves}
    if left_out:
        raise InvalidLibrary(
            f"{label}: heading {min(left_out)} has no maneuver; a file of {KIND} needs one for each"
        )
    primitives = [_described(k, move) for k, move in enumerate(moves)]
    radii = [radius for one in primitives if (radius := one["trajectory_radius"]) > 0.0]
    if lattice.turning_radius is None and not radii:
        raise InvalidLibrary(
            f"{label}: has neither a turning radius nor arcs; a file of {KIND} states one"
        )
    least = min(radii) if lattice.turning_radius is None else lattice.turning_radius
    spins = any(not move.poses[:, :2].any() for move in moves)
    aside = any(abs(_along(move)[1]) > SIDEWAYS for move in moves)
    head: Nav2Head = {
        "motion_model": "omni" if aside else "diff" if spins else "ackermann",
        "turning_radius": least,
        "grid_resolution": lattice.resolution,
        "num_of_headings": lattice.headings.size,
        "heading_angles": lattice.headings.tolist(),
        "number_of_trajectories": len(primitives),
    }
    return {"version": 1.0, "lattice_metadata": head, "primitives": primitives}


def _check(row: Nav2Row, headings: Array, resolution: float, path: Path, number: int) -> None:
    """Raise where a primitive is not one on the grid, pose after pose."""

    def wrong(said: str, *where: str | int) -> InvalidScenario:
        return misstated(path, ("primitives", number, *where), said)

    begin, end = row["start_angle_index"], row["end_angle_index"]
    for key, index in (("start_angle_index", begin), ("end_angle_index", end)):
        if not 0 <= index < headings.size:
            raise wrong(f"got {index}, need 0 to {headings.size - 1}", key)
    for k, pose in enumerate(row["poses"]):
        if len(pose) != 3:
            raise wrong(f"got {len(pose)} numbers, need 3: x, y, yaw", "poses", k)
    if not row["poses"]:
        raise wrong("is empty, need at least one pose", "poses")
    poses = np.array(row["poses"], dtype=np.float64)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0, prepend=0.0).T) / resolution
    if not steps.max() <= MOST_CELLS:
        k = int(steps.argmax())
        raise wrong(
            f"is {steps[k] * resolution:g} m from the pose before, need at most {MOST_CELLS} "
            "cells: poses are missing",
            "poses",
            k,
        )
    turns = np.abs(wrapped(np.diff(poses[:, 2], prepend=headings[begin])))
    for values, most, unit in ((steps, GAP_CELLS, "cells"), (turns, GAP_TURN, "rad")):
        k, usual = int(values.argmax()), _usual(values)
        if values[k] > max(most, UNEVEN * usual):
            raise wrong(
                f"is {values[k]:.3g} {unit} from the pose before, need at most "
                f"{max(most, UNEVEN * usual):.3g} {unit} as between others: a pose is missing",
                "poses",
                k,
            )
    last, heading = poses[-1], float(headings[end])
    across = last[:2] / resolution
    if np.abs(across - np.round(across)).max() > ON_GRID:
        raise wrong(
            f"got ({last[0]:g}, {last[1]:g}), need a point of the grid of {resolution:g} m",
            "poses",
            len(poses) - 1,
        )
    if abs(float(wrapped(last[2] - heading))) > ON_HEADING:
        raise wrong(
            f"got the yaw {last[2]:g}, need {heading:g}, that of end_angle_index {end}",
            "poses",
            len(poses) - 1,
        )


def _usual(steps: Array) -> float:
    """The middle one of the steps that are not zero, the lower of two."""
    some = np.sort(steps[steps > 0.0])
    if some.size > 1:
        return float(some[(some.size - 1) // 2])
    return math.inf if steps.size == 1 else 0.0


def _check_order(rows: Sequence[Nav2Row], n: int, path: Path) -> None:
    """Sorted by the first heading, from 0 on, none left out: Nav2 counts the changes."""
    expected = 0
    for k, start in enumerate(row["start_angle_index"] for row in rows):
        if start not in (expected, expected + 1) or (k == 0 and start != 0):
            said = f"got {start} after {expected}, need primitives sorted by it, from 0 on"
            raise misstated(path, ("primitives", k, "start_angle_index"), said)
        expected = start
    if expected != n - 1:
        said = f"ends with the heading {expected}, need primitives up to {n - 1}"
        raise misstated(path, ("primitives",), said)


def _meant(head: Nav2Head, row: Nav2Row) -> Move:
    """A primitive with its first pose, its last one exactly on the grid and its heading."""
    begin, end, cell = row["start_angle_index"], row["end_angle_index"], head["grid_resolution"]
    stated, angles = row["poses"], head["heading_angles"]
    stated = stated if any(stated[0][:2]) or len(stated) == 1 else stated[1:]
    poses = continuous([[0.0, 0.0, angles[begin]], *stated], last_heading=angles[end])
    poses[-1, :2] = cell * np.round(poses[-1, :2] / cell)
    return Move(start=begin, end=end, poses=poses)


def _described(number: int, move: Move) -> Nav2Row:
    """A primitive with what its poses say of it."""
    radius, arc, straight = arcs(move.poses)
    poses = move.poses[1:] if move.poses[:, :2].any() else move.poses
    return {
        "trajectory_id": number,
        "start_angle_index": move.start,
        "end_angle_index": move.end,
        "left_turn": not radius < 0.0,
        "trajectory_radius": round(abs(radius), DIGITS),
        "trajectory_length": round(arc + straight, DIGITS),
        "arc_length": round(arc, DIGITS),
        "straight_length": round(straight, DIGITS),
        "poses": np.column_stack([poses[:, :2], np.mod(poses[:, 2], 2.0 * np.pi)]).tolist(),
    }


def _along(move: Move) -> tuple[float, float]:
    """Cosine and sine of the angle from the first heading to where the first motion goes."""
    steps = move.poses[1:, :2] - move.poses[0, :2]
    far = steps[np.any(steps != 0.0, axis=1)]
    if not far.size:
        return 0.0, 0.0
    angle = math.atan2(far[0, 1], far[0, 0]) - move.poses[0, 2]
    return math.cos(angle), math.sin(angle)
