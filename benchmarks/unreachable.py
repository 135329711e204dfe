"""How often it is proven that no plan exists, by the centimetres that a passage lacks.

    python -m benchmarks.unreachable [--scenes 200] [--figure rate.png]

Scenes from seeds, of six families whose critical width is known; each is turned and shifted at
random. In the first part a passage lacks 1 to 30 cm, spread evenly; both ends are free, and the
inscribed disc passes. In the second it has 1 to 5 cm to spare, so that a way exists, which a car
that reverses can follow. A proof counts if it took at most 10 s of processor time.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from maneuver_automaton import Automaton, Box, Car, Disc, OccupancyMap, Problem
from maneuver_automaton.bounds import Reachability, connectivity, pose_scene
from maneuver_automaton.groups import SE2

LENGTH, WIDTH = 4.7, 1.9  # [m] of the car
BEND = (LENGTH + 2.0 * WIDTH) / math.sqrt(8.0)  # least width of a corridor with a right angle
DIAGONAL = math.hypot(LENGTH, WIDTH)  # least width of a corridor in which the car turns round
LEG = 12.0  # [m] of a corridor before and after a bend
SECONDS = 10.0
BINS = (1, 3, 5, 8, 12, 16, 20, 25, 31)  # [cm]
CAR = Automaton.of_controls(
    Car(wheelbase=2.7, max_steering=0.58),
    {"ahead": (1, 0), "left": (1, 0.58), "right": (1, -0.58), "back": (-1, 0)},
)
BODY = Box([LENGTH, WIDTH], [1.35, 0.0])

Family = Callable[[np.random.Generator, float], Problem]


def walled(rng, rings, start, goal, more=()):
    """A problem among rectangles (low x, low y, high x, high y), turned and shifted at random."""
    walls = [Box([c - a, d - b], [0.5 * (a + c), 0.5 * (b + d)]) for a, b, c, d in rings]
    problem = Problem(CAR, start, goal, obstacles=[*walls, *more], footprint=BODY)
    return problem.moved(SE2([*rng.uniform(-50.0, 50.0, 2), rng.uniform(-math.pi, math.pi)]))


def corner(a, b):
    """Walls of a corridor of width `a` that turns left into one of width `b`, and its ends."""
    x, y = LEG + b, LEG + a
    rings = [
        (-1.0, -1.0, x + 1.0, 0.0),
        (x, 0.0, x + 1.0, y + 1.0),
        (0.0, a, LEG, y),
        (-1.0, 0.0, 0.0, y + 1.0),
        (0.0, y, x, y + 1.0),
    ]
    return rings, [2.0, 0.5 * a, 0.0], [x - 0.5 * b, y - 4.5, 0.5 * math.pi]


def bend(rng, spare):
    return walled(rng, *corner(BEND + spare, BEND + spare))


def narrowing_bend(rng, spare):
    """The second corridor has the least width that goes with the first one."""
    a = rng.uniform(2.6, 3.6)

    def needed(angle):
        c, s = math.cos(angle), math.sin(angle)
        return -(WIDTH + LENGTH * s * c - a * c) / s

    least = minimize_scalar(needed, bounds=(0.02, 1.55), method="bounded", options={"xatol": 1e-9})
    return walled(rng, *corner(a, max(-least.fun, WIDTH) + spare))


def s_bend(rng, spare):
    width = BEND + spare
    leg = rng.uniform(LEG, LEG + 4.0)
    x, y = LEG + width, leg + 2.0 * width
    rings = [
        (-1.0, -1.0, x + 1.0, 0.0),
        (-1.0, 0.0, 0.0, y),
        (0.0, width, LEG, y + 1.0),
        (x, 0.0, x + LEG, y - width),
        (LEG, y, x + LEG + 1.0, y + 1.0),
        (x + LEG, 0.0, x + LEG + 1.0, y),
    ]
    return walled(rng, rings, [2.0, 0.5 * width, 0.0], [x + 5.0, y - 0.5 * width, 0.0])


def dead_end(rng, spare):
    width, long = DIAGONAL + spare, rng.uniform(12.0, 25.0)
    rings = [
        (-1.0, -1.0, long + 1.0, 0.0),
        (-1.0, width, long + 1.0, width + 1.0),
        (-1.0, 0.0, 0.0, width),
        (long, 0.0, long + 1.0, width),
    ]
    middle = 0.5 * width
    return walled(rng, rings, [3.0, middle, 0.0], [long - 3.0, middle, math.pi])


def pillar(rng, spare):
    """A bend around a round pillar on the inner corner."""
    radius = rng.uniform(0.2, 0.8)
    width = (0.5 * LENGTH + WIDTH + radius) / math.sqrt(2.0) + spare
    rings, start, goal = corner(width, width)
    return walled(rng, rings, start, goal, [Disc(radius, [LEG, width])])


def mapped_bend(rng, spare):
    """A bend in an occupancy map, whose cells divide the width of the corridor."""
    width, cells = BEND + spare, int(rng.integers(30, 70))
    size = width / cells
    leg = math.ceil(LEG / size)
    blocked = np.ones((leg + cells + 2, leg + cells + 2), dtype=bool)
    blocked[1 : cells + 1, 1:-1] = False
    blocked[1:-1, -cells - 1 : -1] = False
    room = OccupancyMap(blocked, resolution=size, origin=[-size, -size, 0.0])
    x, y = (leg + cells) * size, (leg + cells) * size
    start, goal = [2.0, 0.5 * width, 0.0], [x - 0.5 * width, y - 4.5, 0.5 * math.pi]
    return walled(rng, [], start, goal, [room])


FAMILIES: dict[str, Family] = {
    "bend": bend,
    "narrowing bend": narrowing_bend,
    "S-bend": s_bend,
    "dead end": dead_end,
    "round pillar": pillar,
    "map": mapped_bend,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What was found of one scene."""

    family: str
    spare: float  # [m] negative: what is missing
    answer: Reachability
    boxes: int
    seconds: float  # of processor time


def run(family: str, seed: int, spare: float) -> Run:
    """Ask whether the start of one scene is connected with its goal."""
    problem = FAMILIES[family](np.random.default_rng(seed), spare)
    begin = time.process_time()
    scene = pose_scene(problem)
    ends = [
        np.append(scene.world.into(pose), np.zeros(3))[None]
        for pose in (problem.start, problem.goals[0].pose)
    ]
    assert (scene.states(np.concatenate(ends)) == 2).all(), "an end collides"
    found = connectivity(scene, *ends, deadline=time.monotonic() + 5.0 * SECONDS)
    seconds = time.process_time() - begin
    answer = found.answer if seconds <= SECONDS else Reachability.OPEN
    return Run(family=family, spare=spare, answer=answer, boxes=found.boxes, seconds=seconds)


def runs(count: int, low: float, high: float, seed: int) -> list[Run]:
    """Scenes with evenly spread room [m], the families in turn."""
    names = list(FAMILIES)
    found = []
    for k, spare in enumerate(np.linspace(low, high, count)):
        found.append(run(names[k % len(names)], seed + k, float(spare)))
        one = found[-1]
        print(
            f"{one.family:15} {100 * spare:7.2f} cm  {one.answer.value:10} {one.boxes:8d} boxes "
            f"{one.seconds:6.2f} s",
            flush=True,
        )
    return found


def rates(missing: list[Run]) -> list[tuple[str, int, int, float]]:
    """Bin, scenes, proven, median seconds."""
    rows = []
    for low, high in itertools.pairwise(BINS):
        inside = [one for one in missing if low <= -100.0 * one.spare + 1e-9 < high]
        proven = [one for one in inside if one.answer is Reachability.SEPARATED]
        middle = float(np.median([one.seconds for one in inside])) if inside else math.nan
        rows.append((f"{low}-{high} cm", len(inside), len(proven), middle))
    return rows


def draw(missing: list[Run], path: Path) -> None:
    """The rate by what is missing, and the time of each scene."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for (_, count, proven, _), low, high in zip(rates(missing), BINS[:-1], BINS[1:], strict=True):
        if count:
            share = 100.0 * proven / count
            upper.bar(low, share, high - low, align="edge", color="#0066b2", ec="white")
    upper.set_ylabel("proven within 10 s [%]")
    for name in FAMILIES:
        mine = [one for one in missing if one.family == name]
        lower.plot(
            [-100.0 * one.spare for one in mine], [one.seconds for one in mine], ".", label=name
        )
    lower.set_yscale("log")
    lower.set_xlabel("missing [cm]")
    lower.set_ylabel("processor time [s]")
    lower.legend(fontsize=7, ncols=3)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    run("bend", 0, -0.5)  # compile
    missing = runs(options.scenes, -0.30, -0.01, seed=1)
    spared = runs(options.scenes, 0.01, 0.05, seed=10_001)
    print("\n| missing | scenes | proven | median [s] |\n| --- | --- | --- | --- |")
    for name, count, proven, middle in rates(missing):
        print(f"| {name} | {count} | {proven} | {middle:.2f} |")
    large = [one for one in missing if one.spare <= -0.05]
    shown = [one for one in large if one.answer is Reachability.SEPARATED]
    print(f"\nmissing 5 cm and more: {len(shown)} of {len(large)} proven")
    wrong = [one for one in spared if one.answer is Reachability.SEPARATED]
    ways = [one for one in spared if one.answer is Reachability.CONNECTED]
    print(
        f"1-5 cm to spare: {len(wrong)} of {len(spared)} called infeasible, {len(ways)} connected"
    )
    wrong += [one for one in missing if one.answer is Reachability.CONNECTED]
    print(f"wrong answers: {len(wrong)}")
    if options.figure:
        draw(missing, options.figure)


if __name__ == "__main__":
    main()
