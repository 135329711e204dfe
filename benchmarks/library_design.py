"""Designed libraries beside the lattice primitives of Nav2 and SBPL, on the same goals and maps.

``python benchmarks/library_design.py [--goals N] [--pairs N] [--time-limit S]``: for each
lattice the poses within six turning radii at which its words end, and what the shortest path there
takes with the tightest radius of the lattice; N of them at random. Six trims of that radius are
designed for these goals. Then designs for other costs, and what plans of theirs cost beside plans
of all candidates. Then N pairs of lattice poses on each of two Nav2 maps, planned with both.
Cost is length throughout; primitives that turn in place are left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks import cases
from benchmarks.tables import show
from maneuver_automaton.analysis import ReachSettings, reached
from maneuver_automaton.analysis.coverage import poses_in_ball
from maneuver_automaton.design import reeds_shepp_length, word_lengths
from maneuver_automaton.formats.lattice import (
    Lattice,
    Move,
    automaton_of_lattice,
    lattice_of_automaton,
)
from maneuver_automaton.formats.libraries import read_primitives

LATERAL = 2.0  # [m/s^2]
LENGTH = ma.Cost(length=1.0)
LATTICES = (
    ("Nav2 ackermann, with reverse", "nav2-lattice/ackermann_5cm_r0.5m.json", True),
    ("SBPL noturninplace", "sbpl/mprim/unicycle_noturninplace.mprim", False),
    ("the same, with reverse", "sbpl/mprim/unicycle_noturninplace.mprim", True),
    ("SBPL non-uniform, with reverse", "sbpl/mprim/non_uniform_res01_rad3_err005.mprim", True),
)
REACH, LEAST = 6.0, 1.0  # turning radii
MAX_TRIMS = 4
HEADINGS = 3  # of the start: the others are turned or mirrored on the grid
BODY = ma.Box([0.3, 0.2])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Primitives:
    """A lattice as an automaton, and the tightest circle of its primitives."""

    name: str
    automaton: ma.Automaton
    radius: float  # [m]


def primitives(name: str, path: Path, *, reverse: bool) -> Primitives:
    automaton = read_primitives(path).automaton
    lattice = lattice_of_automaton(automaton, kind="a lattice")
    moving = [move for move in lattice.moves if np.ptp(move.poses[:, :2], axis=0).any()]
    lattice = replace(lattice, moves=tuple(moving))
    if reverse:
        lattice = with_reverse(lattice)
    automaton = automaton_of_lattice(lattice)
    twists = np.concatenate([m.course.control[:-1] for m in automaton.maneuvers])
    turning = np.abs(twists[:, 2]) > 1e-3 * np.hypot(twists[:, 0], twists[:, 1])
    radii = np.hypot(twists[turning, 0], twists[turning, 1]) / np.abs(twists[turning, 2])
    radius = lattice.turning_radius or float(np.percentile(radii, 1))
    return Primitives(name=name, automaton=automaton, radius=radius)


def with_reverse(lattice: Lattice) -> Lattice:
    """Every primitive also driven backwards, unless the file has that motion already."""
    moves = list(lattice.moves)
    known = {signature(move) for move in moves}
    for move in lattice.moves:
        poses = move.poses[::-1] - np.append(move.poses[-1, :2], 0.0)
        back = Move(start=move.end, end=move.start, poses=poses)
        if signature(back) not in known:
            moves.append(back)
    return replace(lattice, moves=tuple(moves))


def signature(move: Move) -> tuple[object, ...]:
    return move.start, move.end, *np.round(move.poses[-1, :2], 6).tolist()


def reached_goals(lattice: Primitives, n: int) -> tuple[np.ndarray, np.ndarray]:
    """At most n poses seen from the start (n, 3) at which words end, and their lengths (n,)."""
    settings = ReachSettings(
        measure="length",
        most=2.0 * REACH * lattice.radius,
        same_m=lattice.automaton.model.resolution / 4.0,
    )
    goals, lengths = [], []
    for start in lattice.automaton.trim_names[:HEADINGS]:
        words = reached(lattice.automaton, start=start, settings=settings)
        goals.append(words.poses)
        lengths.append(words.costs)
    every, costs = np.concatenate(goals), np.concatenate(lengths)
    shortest = reeds_shepp_length(every, radius=lattice.radius)
    near = np.hypot(every[:, 0], every[:, 1]) <= REACH * lattice.radius
    near &= shortest >= LEAST * lattice.radius
    rows = np.flatnonzero(near)
    if len(rows) > n:
        rows = np.random.default_rng(0).choice(rows, n, replace=False)
    return every[rows], costs[rows]


def designed(lattice: Primitives) -> tuple[ma.DesignedLibrary, float]:
    """The library of the lattice's tightest circle for its goals, and the time it took [s]."""
    curvatures = np.linspace(-1.0, 1.0, 9) / lattice.radius
    controls = {f"{v:+g} {k:+.3g}": (v, v * k) for v, k in product((1.0, -1.0), curvatures)}
    candidates = ma.Automaton.of_controls(ma.Unicycle(), controls)
    began = time.process_time()
    design = ma.design_library(
        candidates,
        max_trims=MAX_TRIMS,
        radius=REACH * lattice.radius,
        least=LEAST * lattice.radius,
    )
    return design, time.process_time() - began


def on_goals(lattices: list[Primitives], n: int) -> None:
    rows = []
    for lattice in lattices:
        goals, lengths = reached_goals(lattice, n)
        shortest = reeds_shepp_length(goals, radius=lattice.radius)
        theirs = lengths / shortest
        design, seconds = designed(lattice)
        ours = word_lengths(goals, radius=lattice.radius, max_trims=MAX_TRIMS) / shortest
        rows.append(
            [
                lattice.name,
                len(lattice.automaton.maneuvers),
                lattice.radius,
                len(goals),
                float(theirs.max()),
                float(np.median(theirs)),
                len(design.automaton),
                float(ours.max()),
                design.factor,
                seconds,
            ]
        )
    header = ["lattice", "primitives", "radius [m]", "goals", "t", "median", "trims", "t of ours"]
    show([*header, "proven", "design [s]"], rows)
    print(f"t: largest length over the shortest path's; ours: words of at most {MAX_TRIMS} trims")


def on_maps(lattice: Primitives, n: int, time_limit: float) -> None:
    design, _ = designed(lattice)
    rows = []
    for name in ("tb3_sandbox", "depot"):
        cells = cases.nav2_map(name, unknown_blocked=True)
        low, high = cells.origin[:2], cells.origin[:2] + cells.extent
        free = ma.Problem(
            lattice.automaton, [0, 0, 0], [0, 0, 0], cost=LENGTH, obstacles=cells, footprint=BODY
        )
        poses = cases.free_poses(free, 2 * n, low=low, high=high, rng=np.random.default_rng(0))
        pairs = [snapped(lattice, *pair) for pair in poses.reshape(n, 2, 3)]
        costs = []
        for start, goal, trim, last in pairs:
            theirs = replace(free, start=start, goals=(ma.Goal(goal, trim=last),), start_trim=trim)
            ours = replace(free, automaton=design.automaton, start=start, goals=(ma.Goal(goal),))
            found = [ma.plan(one, time_limit=time_limit) for one in (theirs, ours)]
            costs.append([np.nan if one.cost is None else one.cost for one in found])
        table = np.array(costs)
        both = np.isfinite(table).all(axis=1)
        ratios = table[both, 0] / table[both, 1]
        solved = np.isfinite(table).sum(axis=0)
        rows.append(
            [
                name,
                n,
                int(solved[0]),
                int(solved[1]),
                int(both.sum()),
                *(float(total) for total in table[both].sum(axis=0)),
                float(np.median(ratios)),
                float(ratios.max()),
            ]
        )
    header = ["map", "pairs", "lattice", "ours", "both", "lattice [m]", "ours [m]"]
    show([*header, "median ratio", "largest"], rows)
    print(
        f"plans of {lattice.name} and of the {len(design.automaton)} trims, {time_limit:g} s each"
    )


def other_costs(n: int, time_limit: float) -> None:
    """Designs for costs without a closed form: plans of few switches beside those of all trims."""
    speeds = np.linspace(-1.0, 1.0, 21)
    unicycles = ma.Automaton.of_grid(ma.Unicycle(), [speeds, speeds])
    car = ma.Car(wheelbase=2.8, max_steering=0.6)
    grid = ma.Automaton.of_grid(car, [10.0 * speeds, np.linspace(-0.6, 0.6, 25)])
    sideways = np.abs(grid.body_velocities[:, 0] * grid.body_velocities[:, 2])
    kept = tuple(trim for trim, a in zip(grid.trims, sideways, strict=True) if a <= LATERAL)
    situations = (
        ("unicycle, effort + time", unicycles, ma.Cost(effort=1.0, time=1.0), 3.0),
        ("car, effort + 0.2 time", light_car(), ma.Cost(effort=1.0, time=0.2), 15.0),
        (
            f"car, time, at most {LATERAL:g} m/s^2 aside",
            ma.Automaton(car, kept),
            ma.Cost(time=1.0),
            40.0,
        ),
    )
    rows = []
    for name, candidates, cost, reach in situations:
        began = time.process_time()
        design = ma.design_library(candidates, cost=cost)
        seconds = time.process_time() - began
        goals = poses_in_ball(reach, n, seed=0)
        ratios = []
        for goal in goals:
            problems = [
                ma.Problem(automaton, [0, 0, 0], goal, cost=cost)
                for automaton in (design.automaton, candidates)
            ]
            few, every = (ma.plan(one, time_limit=time_limit).cost for one in problems)
            ratios.append(few / every)
        rows.append(
            [
                name,
                design.candidates,
                len(design.automaton),
                design.factor,
                float(np.median(ratios)),
                float(np.max(ratios)),
                seconds,
            ]
        )
    header = ["vehicle, cost", "candidates", "trims", "factor", "plans: median", "largest"]
    show([*header, "design [s]"], rows)
    print(f"plans to {n} goals, {time_limit:g} s each, of the design over those of all candidates")


def light_car() -> ma.Automaton:
    car = ma.Car(wheelbase=2.8, max_steering=0.6, max_speed=1.0)
    return ma.Automaton.of_grid(car, [np.linspace(-1.0, 1.0, 21), np.linspace(-0.6, 0.6, 25)])


def snapped(
    lattice: Primitives, start: np.ndarray, goal: np.ndarray
) -> tuple[np.ndarray, np.ndarray, str, str]:
    """The nearest lattice poses, the goal a whole number of cells from the start; and headings."""
    states = np.array([trim.reduced_state for trim in lattice.automaton.trims])
    headings = np.arctan2(states[:, 1], states[:, 0])
    cell = lattice.automaton.model.resolution
    names = lattice.automaton.trim_names
    first, last = (int(np.cos(headings - pose[2]).argmax()) for pose in (start, goal))
    begin = np.append(start[:2], headings[first])
    end = np.append(start[:2] + cell * np.round((goal[:2] - start[:2]) / cell), headings[last])
    return begin, end, names[first], names[last]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--goals", type=int, default=2000)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--time-limit", type=float, default=1.0)
    options = parser.parse_args()
    if not (cases.present("nav2-lattice") and cases.present("sbpl")):
        return
    lattices = [
        primitives(name, cases.DATA / path, reverse=reverse) for name, path, reverse in LATTICES
    ]
    on_goals(lattices, options.goals)
    print()
    other_costs(options.pairs, options.time_limit)
    if cases.present("nav2-maps") and options.pairs:
        print()
        on_maps(lattices[0], options.pairs, options.time_limit)


if __name__ == "__main__":
    main()
