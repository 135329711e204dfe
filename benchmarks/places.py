"""What a price of places does: how soon, how far from obstacles, and on Nav2's own costmaps.

``python benchmarks/places.py [first] [scenes] [nav2] [--pairs N] [--time-limit S] [--out FOLDER]``
(all parts if none is named). ``first``: first plans of 24 car queries with a `Clearance` and
without, processor time, medians. ``scenes``: an S-bend, a room with pillars and a parking lot,
with and without; distances by shapely every 2 cm. ``nav2``: pairs on two maps whose obstacles are
inflated as Nav2 inflates them (inscribed radius, factor 3, 0.55 m); plans with these costs as
prices and without, at what Smac calls the cost of a path: 1 + 2 c / 252 per metre, by cells.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from scipy import ndimage

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks import cases, nav2_pairs
from benchmarks.tables import show
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.blocked import blocked_ends

QUERIES, REPEATS = 24, 5
STEP = 0.02  # [m] between looks at a distance
INSCRIBED, FACTOR, INFLATION = 0.22, 3.0, 0.55  # [m], [1/m], [m]: the robot, and Nav2's defaults
PENALTY = 2.0  # Smac's cost_penalty
TURNS = {"ahead": (1, 0), "left": (1, 0.25), "right": (1, -0.25), "back": (-1, 0),
         "back left": (-1, 0.25), "back right": (-1, -0.25)}  # fmt: skip
CAR = ma.Automaton.of_controls(ma.Unicycle(), TURNS)
BODY = ma.Box([4.0, 1.8])


def queries(near: ma.Clearance) -> list[list[ma.Problem]]:
    """Random queries of a car among thirty boxes: each without and with a clearance."""
    rng = np.random.default_rng(5)
    boxes = tuple(
        ma.Box(rng.uniform(1, 4, 2), rng.uniform(-25, 25, 2), heading=float(rng.uniform(0, 3)))
        for _ in range(30)
    )
    soon = ma.SearchSettings(improve=False)
    plain = ma.Problem(CAR, [0, 0, 0], [1, 0, 0], obstacles=boxes, footprint=BODY, search=soon)
    priced = replace(plain, place_costs=near)
    found, seed = [], 100
    while len(found) < QUERIES:
        seed += 1
        rng = np.random.default_rng(seed)
        start, goal = ([*rng.uniform(-25, 25, 2), rng.uniform(-3, 3)] for _ in range(2))
        pair = [one.starting_at(start, time=0.0, goals=ma.Goal(goal)) for one in (plain, priced)]
        if blocked_ends(pair[0]) is None and ma.plan(pair[0], time_limit=5.0).plan:
            found.append(pair)
    return found


def first_plans() -> None:
    rows: list[list[float]] = [[], []]
    for pair in queries(ma.Clearance(2.0, 1.0)):
        for row, one in zip(rows, pair, strict=True):
            took = []
            for _ in range(REPEATS):
                began = time.process_time()
                ma.plan(one, time_limit=5.0)
                took.append(1e3 * (time.process_time() - began))
            row.append(min(took))
    plain, priced = (statistics.median(row) for row in rows)
    each = statistics.median(b / a for a, b in zip(*rows, strict=True))
    show(["first plan", "without [ms]", "with [ms]", "ratio of medians", "median ratio"],
         [["24 car queries", plain, priced, priced / plain, each]])  # fmt: skip


def scenes() -> dict[str, tuple[ma.Problem, ma.Clearance]]:
    """Places where there is room to keep away, and what is asked for there."""
    bend = [
        ma.Box([24.0, 1.0], [8.0, 3.5]), ma.Box([12.0, 1.0], [2.0, -3.5]),
        ma.Box([1.0, 14.0], [7.5, -10.0]), ma.Box([1.0, 12.0], [19.5, -2.0]),
        ma.Box([24.0, 1.0], [19.0, -16.5]), ma.Box([14.0, 1.0], [26.0, -8.5]),
    ]  # fmt: skip
    pillars = [ma.Disc(0.6, [x, y]) for x in (5, 12, 19) for y in (-6, 0, 6)]
    walls = [ma.Box([28, 1], [12, 10.5]), ma.Box([28, 1], [12, -10.5])]
    parked = [ma.Box([4.2, 1.8], [x, y], heading=np.pi / 2)
              for y in (-6.5, 6.5) for x in np.arange(0.0, 24.0, 2.8)
              if (x, y) != (14.0, -6.5)]  # fmt: skip

    def made(start: list[float], goal: list[float], solids: list[ma.Box | ma.Disc]) -> ma.Problem:
        return ma.Problem(CAR, start, goal, obstacles=tuple(solids), footprint=BODY)

    return {
        "S-bend": (made([0, 0, 0], [30, -12.5, 0], bend), ma.Clearance(3.0, 2.0)),
        "pillars": (made([0, -3, 0], [24, 4, 0], [*pillars, *walls]), ma.Clearance(3.0, 1.5)),
        "parking lot": (
            made([-3, 2, 0], [14.0, -6.5, np.pi / 2], parked), ma.Clearance(3.0, 1.5)
        ),
    }  # fmt: skip


def away(problem: ma.Problem, plan: ma.Plan) -> np.ndarray:
    """Distances [m] of the body to the nearest obstacle along a plan, by shapely."""
    poses = plan.sample(max_step_m=STEP).pose
    solids = shapely.union_all([
        shapely.Point(one.shape.center).buffer(one.shape.radius, quad_segs=500)
        if isinstance(one.shape, ma.Disc) else shapely.Polygon(one.shape.corners)
        for one in problem.obstacles
    ])  # fmt: skip
    bodies = shapely.polygons(SE2(poses[:, None]).act(BODY.corners))
    return np.asarray(shapely.distance(bodies, solids))


def in_scenes(limit: float, out: Path | None) -> None:
    rows = []
    for name, (plain, near) in scenes().items():
        priced = replace(plain, place_costs=near)
        for words, one in (("without", plain), ("with", priced)):
            result = ma.plan(one, time_limit=limit)
            if result.plan is None:
                rows.append([name, words, *["-"] * 4, result.reason])
                continue
            apart = away(one, result.plan)
            rows.append([name, words, float(apart.min()), float(apart.mean()),
                         result.plan.duration, priced.cost_of(result.plan), ""])  # fmt: skip
            if out:
                ma.plotting.save_picture(result, str(out / f"{name} {words}.png"))
    show(["scene", "clearance", "least [m]", "mean [m]", "length [m]", "cost with it", ""], rows)


def inflated(cells: ma.OccupancyMap) -> np.ndarray:
    """The costmap of a map: 254 blocked, 253 within the inscribed radius, and so on down to 0."""
    apart = ndimage.distance_transform_edt(~cells.blocked) * cells.resolution
    values = np.floor(252.0 * np.exp(-FACTOR * (apart - INSCRIBED)))
    values = np.where(apart <= INSCRIBED, 253.0, values)
    values = np.where(apart > INFLATION, 0.0, values)
    return np.where(cells.blocked, 254.0, values)


def smac_cost(cells: ma.OccupancyMap, values: np.ndarray, plan: ma.Plan) -> float:
    """Integral over the way of 1 + penalty times the normalised cost of the cell of the pose."""
    poses = plan.sample(max_step_m=0.005).pose
    ways = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    middles = 0.5 * (poses[1:, :2] + poses[:-1, :2])
    column, row = (SE2(cells.origin).inverse().act(middles) / cells.resolution).T.astype(int)
    normal = np.minimum(values[row, column], 252.0) / 252.0
    return float(ways @ (1.0 + PENALTY * normal))


def on_maps(pairs: int, limit: float) -> None:
    rows, ratios, longer = [], [], []
    for name in nav2_pairs.MAPS:
        cells = cases.nav2_map(name, unknown_blocked=True)
        values = inflated(cells)
        ground, _ = ma.Ground.of_costmap(
            values, resolution=cells.resolution, origin=cells.origin, price=PENALTY
        )
        found = {"without": [], "with": []}
        took = {"without": [], "with": []}
        problems = nav2_pairs.pairs(cells, ma.Disc(INSCRIBED), pairs // 2, 0)
        settings = {"without": problems[0], "with": replace(problems[0], place_costs=ground)}
        for one in settings.values():
            ma.plan(one, time_limit=limit)  # what the map needs is made once
        for plain in problems:
            both = {
                words: one.starting_at(plain.start, time=0.0, goals=plain.goals)
                for words, one in settings.items()
            }
            for words, one in both.items():
                result = ma.plan(one, time_limit=limit)
                took[words].append(result.timing_s.get("first_plan", np.nan))
                found[words].append(
                    None if result.plan is None
                    else (smac_cost(cells, values, result.plan), length_of(result.plan))
                )  # fmt: skip
        solved = [both for both in zip(*found.values(), strict=True) if None not in both]
        ratios += [priced[0] / plain[0] for plain, priced in solved]
        longer += [priced[1] / plain[1] for plain, priced in solved]
        for k, words in enumerate(found):
            rows.append([name, words, sum(one is not None for one in found[words]), pairs // 2,
                         1e3 * float(np.nanmedian(took[words])),
                         float(np.mean([both[k][0] for both in solved])),
                         float(np.mean([both[k][1] for both in solved]))])  # fmt: skip
    show(["map", "prices", "solved", "of", "first plan [ms]", "Smac's cost", "length [m]"], rows)
    if ratios:
        print(
            f"Smac's cost with prices over without: median {np.median(ratios):.3f}, "
            f"least {min(ratios):.3f}, greatest {max(ratios):.3f}; length {np.median(longer):.3f}"
        )
    print("published for Smac (Hybrid-A*, 147,456 cells): 2 to 20 ms; no costs of paths")


def length_of(plan: ma.Plan) -> float:
    """Way [m] of the pose."""
    twists = np.array([trim.body_velocity for trim in plan.trims])
    return float(np.hypot(twists[:, 0], twists[:, 1]) @ plan.durations)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=["first", "scenes", "nav2", []], default=[])
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    parts = options.parts or ["first", "scenes", "nav2"]
    if "first" in parts:
        first_plans()
    if "scenes" in parts:
        in_scenes(options.time_limit, options.out)
    if "nav2" in parts and cases.present("nav2-maps"):
        on_maps(options.pairs, options.time_limit)


if __name__ == "__main__":
    main()
