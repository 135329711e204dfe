"""Print the matrix, vehicle by feature: ``python -m tests.matrix.table``.

``.`` works, ``p`` works but costlier than a known plan, ``F`` finds nothing, ``I`` accepted and
ignored or done wrongly, ``R`` refused, ``E`` a traceback of another kind, ``-`` makes no sense.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import warnings
from collections.abc import Iterator, Sequence
from functools import partial

from tests.matrix.cells import REFUSED, SECONDS, SENSELESS, WORKS, Outcome, cells, tried
from tests.matrix.features import FEATURES
from tests.matrix.vehicles import VEHICLES


def outcomes(
    features: Sequence[str], vehicles: Sequence[str], *, seconds: int, processes: int
) -> Iterator[Outcome]:
    """What comes of all cells, one vehicle a process at a time; a line of progress each."""
    work = partial(_column, features=features, seconds=seconds)
    if processes == 1:
        for vehicle in vehicles:
            yield from work(vehicle)
        return
    with multiprocessing.get_context("spawn").Pool(processes, maxtasksperchild=1) as pool:
        for column in pool.imap_unordered(work, vehicles):
            yield from column


def _column(vehicle: str, *, features: Sequence[str], seconds: int) -> list[Outcome]:
    warnings.simplefilter("ignore")
    column = []
    for feature, _ in cells(features, [vehicle]):
        outcome = tried(feature, vehicle, seconds=seconds)
        column.append(outcome)
        line = f"{outcome.sign} {feature}-{vehicle} {outcome.seconds:.1f} s {outcome.reason}"
        sys.stderr.write(line.rstrip() + "\n")
    return column


def markdown(results: Sequence[Outcome], features: Sequence[str], vehicles: Sequence[str]) -> str:
    """The matrix as a table, and below it the reason of every cell that does not work."""
    signs = {(one.feature, one.vehicle): one.sign for one in results}
    lines = ["| feature | " + " | ".join(vehicles) + " |", "| --- |" + " --- |" * len(vehicles)]
    for feature in features:
        row = [signs.get((feature, vehicle), SENSELESS) for vehicle in vehicles]
        lines.append(f"| {feature.replace('_', ' ')} | " + " | ".join(row) + " |")
    working, refused = (sum(one.sign == sign for one in results) for sign in (WORKS, REFUSED))
    lines += ["", f"{working} of {len(results)} cells work, {refused} are refused.", ""]
    order = {name: k for k, name in enumerate(features)}
    faults = sorted(
        (one for one in results if one.sign != WORKS),
        key=lambda one: (order[one.feature], list(vehicles).index(one.vehicle)),
    )
    lines += [f"- {one.feature}-{one.vehicle} `{one.sign}`: {one.reason}" for one in faults]
    return "\n".join(lines)


def main() -> None:
    """Run the cells asked for, all if none, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--features", nargs="*", choices=list(FEATURES), default=list(FEATURES))
    parser.add_argument("--vehicles", nargs="*", choices=list(VEHICLES), default=list(VEHICLES))
    parser.add_argument("--seconds", type=int, default=SECONDS, help="of one cell, at most")
    parser.add_argument("--processes", type=int, default=2)
    asked = parser.parse_args()
    results = list(
        outcomes(asked.features, asked.vehicles, seconds=asked.seconds, processes=asked.processes)
    )
    sys.stdout.write(markdown(results, asked.features, asked.vehicles) + "\n")


if __name__ == "__main__":
    main()
