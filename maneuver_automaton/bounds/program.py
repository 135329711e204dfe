"""The linear program of a lower bound on one level of cells, solved by a primal-dual method.

Maximise the value at the start, with 0 at the goal, over all functions on the cells that fall along
no motion faster than its cost rises. What the method finds need not be admissible: it is divided
by what `slope` measures.

Source: Pock and Chambolle (2011), diagonal preconditioning for first order primal-dual algorithms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.bounds import _kernels_ascent, _kernels_certificate, _kernels_dual
from maneuver_automaton.bounds.arrays import Rows, Single
from maneuver_automaton.bounds.cells import PoseCells
from maneuver_automaton.bounds.families import Families, Motions

OVER = 1.9  # times the step of the method: the limit for convergence is 2
ROUNDING = 1e-9  # relative, of the largest slope


@dataclass(slots=True, eq=False, kw_only=True)
class BoundProgram:
    """State of the method on one level."""

    cells: PoseCells
    motions: Motions
    columns: IntArray  # (C, 4)
    base: NDArray[np.int32]  # (blocks * 64,) first node of each cell, in blocks
    layer: NDArray[np.int32]  # (blocks * 64,) its layer
    rate: Array  # (F, 3, K + 1) sum of the entries of a row, without sign
    share: Array  # (gears, nodes) one over the sum of the entries of a node, 0 where fixed
    aim: Single  # (gears, nodes) weights of the value at the start
    value: Single  # (gears, nodes)
    ahead: Single
    back: Single
    dual: Single  # (blocks * F * 24 * 64,)
    weight: float = 1.0  # of the values against the dual values, in steps

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Gears and nodes."""
        i, j, k = self.cells.nodes
        return self.value.shape[0], i, j, k

    def run(self, steps: int) -> None:
        """So many steps of the method."""
        rows = _rows(self)
        step = (self.share * self.weight).astype(np.float32)
        whole, price = self.cells.round_trip, self.motions.price
        flat = [a.reshape(-1) for a in (self.value, self.ahead, self.back, step, self.aim)]
        value, ahead, back, step, aim = flat
        room = np.zeros(_kernels_dual.ROWS * _kernels_dual.LANES, dtype=np.float32)
        for _ in range(steps):
            _kernels_dual.primal_step(value, ahead, back, step, aim, self.shape, whole, price, OVER)
            _kernels_dual.dual_step(
                ahead, self.dual, back, self.base, self.layer, self.shape, rows, room, OVER
            )


def program_of(
    cells: PoseCells, motions: Motions, *, start: Array, goal_nodes: NDArray[np.bool_], value: Array
) -> BoundProgram:
    """The program of a level, from the pose `start` to the nodes of the goal, from first values."""
    gears = 2 if motions.price > 0.0 else 1
    families, count = motions.families, cells.active.shape[2] + 1
    base, layer = _blocks(cells)
    weights = _weights(cells, families)
    size = np.abs(weights)
    turn = families.turn_rate / cells.turn
    rate = np.zeros((families.side.size, 3, count))
    rate[:, 0] = 2.0 * size.sum(axis=2) + 2.0 * turn[:, None]
    upper = np.roll(size, -1, axis=1).sum(axis=2)
    rate[:, 1] = 2.0 * upper + 2.0 * turn[:, None]
    rate[:, 2] = size.sum(axis=2) + upper + 2.0 * turn[:, None]
    share = _shares(cells, families, size, turn, gears)
    share[:, goal_nodes] = 0.0
    aim = np.zeros((gears, *cells.nodes), dtype=np.float32)
    nodes, inside = cells.corners(cells.coordinates(start))
    for node, part in zip(nodes, inside, strict=True):
        aim[(slice(None), *node)] += part / gears
    if cells.round_trip:
        both = aim[..., 0] + aim[..., -1]
        aim[..., 0], aim[..., -1] = both, both
    single = np.ascontiguousarray(value, dtype=np.float32)
    return BoundProgram(
        cells=cells,
        motions=motions,
        columns=cells.columns,
        base=base,
        layer=layer,
        rate=rate,
        share=share,
        aim=aim,
        value=single,
        ahead=single.copy(),
        back=np.zeros_like(single),
        dual=np.zeros(base.size * families.side.size * 24, dtype=np.float32),
    )


def _blocks(cells: PoseCells) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """First node and layer of each active cell, filled up to whole blocks."""
    index = np.argwhere(cells.active)
    count = -(-len(index) // _kernels_dual.LANES) * _kernels_dual.LANES
    base = np.zeros(count, dtype=np.int32)
    layer = np.full(count, cells.active.shape[2], dtype=np.int32)
    base[: len(index)] = np.ravel_multi_index(tuple(index.T), cells.nodes)
    layer[: len(index)] = index[:, 2]
    return base, layer


def slope(cells: PoseCells, columns: IntArray, motions: Motions, value: Array) -> float:
    """Upper bound of how fast a function (gears, nodes) falls along motions, per unit of cost."""
    if cells.round_trip and (value[..., 0] != value[..., -1]).any():
        return math.inf  # it jumps where the circle of headings is closed
    families = motions.families
    headings = cells.layers[None, :] + families.angle[:, None]
    ahead = np.stack([np.cos(headings), np.sin(headings)], axis=2)
    steep = _kernels_certificate.steepest(
        value, columns, families, ahead, cells.size, cells.turn, max(motions.price, 1e-300)
    )
    return max(steep * (1.0 + ROUNDING), 1e-12)


def raised(
    program: BoundProgram,
    value: Array,
    *,
    fixed: NDArray[np.bool_],
    sweeps: int,
    over: Callable[[], bool],
    backward: bool = False,
) -> Array:
    """A function that obeys the rows, raised where it has room, node by node, until it is `over`.

    `backward`: it is one from the start, which rises along motions. It obeys the rows to within
    single precision; `slope` says how well.
    """
    cells, families, price = program.cells, program.motions.families, program.motions.price
    # First nodes and layers of whole blocks, filled up with the first cell once more.
    filler = program.layer == program.cells.active.shape[2]
    base = np.where(filler, program.base[0], program.base).astype(np.int32)
    layer = np.where(filler, program.layer[0], program.layer).astype(np.int32)
    table, rates = _directions(cells, families, 4)
    single = np.ascontiguousarray(value, dtype=np.float32)
    single = single.copy() if single is value else single
    room = np.empty_like(single)
    free = np.where(fixed, 0.0, 1.0).astype(np.float32).reshape(-1)
    work = np.zeros(_kernels_ascent.ROWS * _kernels_dual.LANES, dtype=np.float32)
    for _ in range(sweeps):
        if over():
            break
        _kernels_ascent.room_above(
            single.reshape(-1),
            room.reshape(-1),
            base,
            layer,
            program.shape,
            table.reshape(-1),
            rates,
            -families.side if backward else families.side,
            families.gear,
            work,
        )
        if cells.round_trip:
            least = np.minimum(room[..., 0], room[..., -1])
            room[..., 0], room[..., -1] = least, least
        _kernels_ascent.raise_nodes(single.reshape(-1), room.reshape(-1), free, price)
    return single.astype(np.float64)


def _weights(cells: PoseCells, families: Families) -> Array:
    """Directions (F, K + 1, 2) at the layers as the rows have them [1 per unit of cost]."""
    headings = cells.layers[None, :] + families.angle[:, None]
    ahead = np.stack([np.cos(headings), np.sin(headings)], axis=2)
    ahead[np.abs(ahead) < 1e-12] = 0.0
    scale = families.speed / (cells.size * math.cos(0.5 * cells.turn))
    return np.asarray(ahead * scale[:, None, None])


def _directions(cells: PoseCells, families: Families, rows: int) -> tuple[Single, Single]:
    """The directions at both layers of each cell (F, rows, K + 1), what follows 0; turn rates."""
    weights = _weights(cells, families).astype(np.float32)
    table = np.zeros((families.side.size, rows, weights.shape[1]), dtype=np.float32)
    table[:, 0:2, :-1] = weights[:, :-1].transpose(0, 2, 1)
    table[:, 2:4, :-1] = weights[:, 1:].transpose(0, 2, 1)
    return table, (families.turn_rate / cells.turn).astype(np.float32)


def _rows(program: BoundProgram) -> Rows:
    cells, families = program.cells, program.motions.families
    table, rates = _directions(cells, families, 7)
    steps = 1.0 / np.maximum(program.weight * program.rate, 1e-30)
    table[:, 4:7, :-1] = steps[:, :, :-1]
    return Rows(table=table.reshape(-1), turn=rates, side=families.side, gear=families.gear)


def _shares(cells: PoseCells, families: Families, size: Array, turn: Array, gears: int) -> Array:
    """One over the sum of the entries of each node in all rows, 0 where there are none."""
    active = cells.active > 0
    total = np.zeros((gears, *cells.nodes))
    for m, gear in enumerate(families.gear.tolist()):
        lower, upper = size[m, :-1].sum(axis=1), size[m, 1:].sum(axis=1)
        below = 4.0 * lower + 2.0 * upper + 6.0 * turn[m]
        above = 4.0 * upper + 2.0 * lower + 6.0 * turn[m]
        for a in (0, 1):
            for b in (0, 1):
                part = total[gear, a : a + active.shape[0], b : b + active.shape[1]]
                part[..., :-1] += active * below
                part[..., 1:] += active * above
    if cells.round_trip:
        both = total[..., 0] + total[..., -1]
        total[..., 0], total[..., -1] = both, both
    with np.errstate(divide="ignore"):
        return np.where(total > 0.0, 1.0 / total, 0.0)
