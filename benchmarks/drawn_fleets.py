"""Fleets of cars at random, as CSDO draws them: in the open, among discs, in rooms with walls.

`draw` writes instances of every kind as CSDO's files are written, for ``benchmarks/fleets.py``.

Source: Yang et al. (2024), *CSDO: Enhancing Efficiency and Success in Large-Scale Multi-Vehicle
Trajectory Planning*, arXiv 2405.20858. Discs and poses as its `generate_scenarios.py` draws them:
discs apart, poses one to a cell of 2 m, their two covering circles 0.1 m apart from discs and from
those of other starts and goals. No program is published for its rooms: as there, poses lie on a
grid of 5 m, 0.25 m off it at most, and walls are discs of 0.5 m a metre apart, here of rooms cut in
two until there are 250 discs, each wall with a door.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

FRONT, BACK, WIDTH = 2.0, 1.0, 2.0  # [m] of the car, from its rear axle
CIRCLE = 0.5 * math.hypot((FRONT + BACK) / 2.0, WIDTH)  # [m] one of two that cover it
CENTRES = (0.25 * (3.0 * FRONT - BACK), 0.25 * (FRONT - 3.0 * BACK))  # [m] ahead of the axle
APART = 0.1  # [m] that circles keep
DISC, CELL = 0.8, 2.0  # [m]
WALL, ROOM, DOOR, DISCS = 0.5, 20.0, 10.0, 250  # [m] radius; least side; door; discs in all
KINDS = {  # side [m], discs, cars; None: rooms
    "map50by50/agents25/empty": (50, 0, 25),
    "map50by50/agents25/obstacle": (50, 25, 25),
    "map100by100/agents50/obstacle": (100, 50, 50),
    "room/agents50": (100, None, 50),
    "map100by100/agents100/obstacle": (100, 50, 100),
}


def drawn(side: int, discs: int | None, cars: int, rng: np.random.Generator) -> str:
    """The text of one instance."""
    while True:
        walls = _walls(side, rng) if discs is None else _discs(side, discs, rng)
        spots = _grid(side, rng) if discs is None else _cells(side, rng)
        poses: list[np.ndarray] = []
        circles = np.zeros((0, 2))
        for pose in spots:
            own = _circles(pose)
            keep = CIRCLE + APART
            if not ((keep <= own) & (own <= side - keep)).all():
                continue
            if (_distances(own, walls[:, :2]) < walls[:, 2] + keep).any():
                continue
            if (_distances(own, circles) < CIRCLE + keep).any():
                continue
            poses.append(pose)
            circles = np.concatenate([circles, own])
            if len(poses) == 2 * cars:
                return _text(side, poses[:cars], poses[cars:], walls)


def _discs(side: int, count: int, rng: np.random.Generator) -> np.ndarray:
    found = np.zeros((0, 3))
    while len(found) < count:
        one = np.append(rng.uniform(DISC, side - DISC, 2), DISC)
        if (_distances(one[None, :2], found[:, :2]) > 2.0 * DISC).all():
            found = np.concatenate([found, [one]])
    return found


def _walls(side: int, rng: np.random.Generator) -> np.ndarray:
    """Discs a metre apart along walls; the largest room is cut next."""
    rooms, walls = [(0.0, 0.0, float(side), float(side))], np.zeros((0, 3))
    while len(walls) < DISCS:
        rooms.sort(key=lambda room: (room[2] - room[0]) * (room[3] - room[1]))
        room = np.array(rooms.pop())
        along = int(room[3] - room[1] > room[2] - room[0])  # the wall's normal: the longer side
        low, high = room[along], room[along + 2]
        at = float(rng.choice(np.arange(low + ROOM - 5.0, high - ROOM + 6.0, 10.0)))
        begin, end = room[1 - along], room[3 - along]
        door = float(rng.choice(np.arange(begin + 5.0, end - DOOR, 10.0)))
        on = np.arange(begin, end + 0.5)
        on = on[(on <= door) | (on >= door + DOOR)]
        row = np.full((len(on), 3), WALL)
        row[:, along], row[:, 1 - along] = at, on
        walls = np.concatenate([walls, row])
        for other, side_of in ((along + 2, at), (along, at)):
            half = room.copy()
            half[other] = side_of
            rooms.append(tuple(half.tolist()))
    return walls


def _cells(side: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """A pose about each cell of the inside, in a random order."""
    inside = np.arange(1, int(side / CELL) - 1)
    cells = np.stack(np.meshgrid(inside, inside), axis=-1).reshape(-1, 2)
    for cell in rng.permutation(cells):
        place = CELL * cell + rng.uniform(-CELL / 2.0, CELL / 2.0, 2)
        yield np.append(place, rng.uniform(-math.pi, math.pi))


def _grid(side: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """A pose about each point of the grid of the rooms, in a random order."""
    points = np.arange(5.0, side - 5.0, 5.0)
    for point in rng.permutation(np.stack(np.meshgrid(points, points), axis=-1).reshape(-1, 2)):
        place = point + rng.uniform(-0.25, 0.25, 2)
        yield np.append(place, rng.uniform(-math.pi, math.pi))


def _circles(pose: np.ndarray) -> np.ndarray:
    return pose[:2] + np.outer(CENTRES, [math.cos(pose[2]), math.sin(pose[2])])


def _distances(some: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.hypot(*(some[:, None] - others[None]).transpose(2, 0, 1))


def _text(side: int, starts: list[np.ndarray], goals: list[np.ndarray], discs: np.ndarray) -> str:
    lines = ["agents:"]
    for k, (start, goal) in enumerate(zip(starts, goals, strict=True)):
        lines += [f"  - start: {_row(start)}", f"    name: agent{k}", f"    goal: {_row(goal)}"]
    lines += ["map:", f"  dimensions: [{side}, {side}]", "  obstacles:"]
    return "\n".join([*lines, *(f"  - {_row(disc)}" for disc in discs), ""])


def _row(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.2f}" for value in values) + "]"


def draw(folder: Path, each: int, seed: int) -> None:
    """Write so many instances of every kind into folders below one."""
    for number, (kind, (side, discs, cars)) in enumerate(KINDS.items()):
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for k in range(each):
            rng = np.random.default_rng([seed, number, k])
            (folder / kind / f"ex{k}.yaml").write_text(drawn(side, discs, cars, rng))
