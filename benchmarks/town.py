"""Hundreds of cars in a town of blocks: time per step, messages, and whether any two ever touch.

``python benchmarks/town.py [--vehicles N] [--minutes M] [--asks N] [--picture F]``:
streets of 12 m between blocks of 60 m; each car drives from crossing to crossing by a route of its
own. A car's problem is regional: the blocks around it, and a goal one
or two crossings ahead, which is moved on before it gets there. What is driven is judged by shapely
at 2.5 ms, with a bound for what lies between. Seconds are those of one processor.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from maneuver_automaton._arrays import Array
from maneuver_automaton.fleet import FleetHorizon, FleetProblem, FleetResult, FleetStatus, FleetStep

BLOCK, STREET = 60.0, 12.0  # [m]
PITCH = BLOCK + STREET
LANE = 2.6  # [m] from the middle of a street to where cars drive
SPEED = 8.0  # [m/s]
BODY = ma.Box([4.0, 1.8], [1.2, 0.0])
STEP = 0.5  # [s]
EARLY = 5.0  # [s] before a car is at its goal, it gets the next one
STANDING = 0.01  # [m] in a step
PATIENCE = 30  # steps that a car stands before it takes another turn
LOOKS = 200  # of a step, at pairs that come near
NEAR = 3.0  # [m]
WAYS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])  # east, north, west, south

Leg = tuple[int, int, int]  # from a crossing (column, row), in a direction


def car() -> ma.Automaton:
    """At the speed of the town, on circles of 7 m at 4 m/s, and back."""
    turns = {"left": (4.0, 0.34), "right": (4.0, -0.34), "bend left": (SPEED, 0.1)}
    ways = {"rest": (0, 0), "on": (SPEED, 0), "slow": (3.0, 0), "back": (-2.0, 0)}
    return ma.Automaton.of_controls(
        ma.Car(wheelbase=2.5), ways | turns | {"bend right": (SPEED, -0.1)}
    )


class Town:
    """Blocks, and the goals along the streets between them."""

    def __init__(self, size: int) -> None:
        self.size = size  # blocks in a row; there is one more crossing
        self.automaton = car()
        self.blocks = {
            (i, j): ma.Box([BLOCK, BLOCK], [(i + 0.5) * PITCH, (j + 0.5) * PITCH])
            for i in range(-1, size + 1)
            for j in range(-1, size + 1)
        }
        self.around: dict[tuple[int, int, int, int], tuple[ma.Obstacle, ...]] = {}

    def inside(self, i: int, j: int) -> bool:
        """Whether there is a crossing."""
        return 0 <= i <= self.size and 0 <= j <= self.size

    def middle_of(self, leg: Leg, share: float = 0.5) -> list[float]:
        """A pose in the right lane on the way from a crossing to the next one."""
        i, j, way = leg
        x, y = np.array([i, j]) * PITCH + WAYS[way] * share * PITCH + WAYS[way - 1] * LANE
        return [float(x), float(y), math.pi / 2 * way]

    def after(self, leg: Leg, rng: np.random.Generator) -> Leg:
        """The next leg: straight on as often as either turn; the only one left at the edge."""
        i, j = np.array(leg[:2]) + WAYS[leg[2]]
        choices = [(leg[2] + turn) % 4 for turn in (0, 0, 1, -1)]
        able = [way for way in choices if self.inside(*(np.array([i, j]) + WAYS[way]))]
        return int(i), int(j), int(rng.choice(able))

    def problem(self, leg: Leg, to: Leg, start: Array | None = None) -> ma.Problem:
        """From the middle of a leg to that of another one, past the blocks around."""
        corners = np.array([leg[:2], np.array(to[:2]) + WAYS[to[2]], to[:2]])
        (i, j), (k, m) = corners.min(axis=0) - 1, corners.max(axis=0)
        key = (int(i), int(j), int(k), int(m))
        if key not in self.around:
            self.around[key] = tuple(
                ma.Obstacle(block)
                for (a, b), block in self.blocks.items()
                if i <= a <= k and j <= b <= m
            )
        goal = ma.Goal(pose=self.middle_of(to), tolerance_m=0.6, tolerance_rad=0.1)
        begin = self.middle_of(leg) if start is None else start
        return ma.Problem(
            self.automaton,
            begin,
            goal,
            footprint=BODY,
            margin=0.2,
            obstacles=self.around[key],
        )


class Traffic:
    """All cars, their routes, and the loop that drives them."""

    def __init__(self, n: int, seed: int, asks: int) -> None:
        # A town in which a leg in six holds a car.
        size = max(2, math.ceil(math.sqrt(1.5 * n)))
        self.town, self.rng = Town(size), np.random.default_rng(seed)
        legs = [
            (i, j, way)
            for i in range(size + 1)
            for j in range(size + 1)
            for way in range(4)
            if self.town.inside(*(np.array([i, j]) + WAYS[way]))
        ]
        chosen = self.rng.choice(len(legs), n, replace=False)
        self.legs = [legs[k] for k in chosen]
        self.to = [self.town.after(leg, self.rng) for leg in self.legs]
        problems = [self.town.problem(leg, to) for leg, to in zip(self.legs, self.to, strict=True)]
        self.fleet = FleetProblem(problems, margin=0.3)
        rest = FleetResult(problem=self.fleet, status=FleetStatus.NO_PLAN, results={})
        self.loop = FleetHorizon(
            self.fleet, step=STEP, first=rest, time_limit=600.0, swaps_per_step=asks
        )
        self.poses = {
            name: problem.start for name, problem in zip(self.fleet.names, problems, strict=True)
        }
        self.served, self.stood = 0, dict.fromkeys(self.poses, 0)

    def advance(self) -> FleetStep:
        """A step: goals that are near are moved on, then all drive."""
        now = self.loop.step(self.poses)
        self.before = self.poses
        self.poses = {name: plan.pose_at(now.time + STEP) for name, plan in now.plans.items()}
        for k, name in enumerate(self.fleet.names):
            stands = np.hypot(*(self.poses[name] - self.before[name])[:2]) < STANDING
            self.stood[name] = self.stood[name] + 1 if stands else 0
            if self.stood[name] >= PATIENCE:
                self.to[k], self.stood[name] = self.town.after(self.legs[k], self.rng), 0
                self.loop.assign(
                    name, self.town.problem(self.legs[k], self.to[k], self.poses[name])
                )
                continue
            if now.arrivals[name] <= now.time + EARLY:
                leg, self.served = self.to[k], self.served + 1
                self.legs[k], self.to[k] = leg, self.town.after(leg, self.rng)
                self.loop.assign(name, self.town.problem(leg, self.to[k], self.poses[name]))
        return now

    def least(self, now: FleetStep) -> float:
        """Least distance of any two bodies along the step [m], less what they move between looks.

        Pairs that come within `NEAR` at a few looks are looked at again in short steps.
        """
        plans, pairs = list(now.plans.values()), set[tuple[int, int]]()
        for at in np.linspace(now.time, now.time + STEP, 6):
            bodies = bodies_at(np.array([plan.pose_at(at) for plan in plans]))
            one, other = shapely.STRtree(bodies).query(bodies, predicate="dwithin", distance=NEAR)
            pairs |= {(a, b) for a, b in zip(one.tolist(), other.tolist(), strict=True) if a < b}
        least = NEAR - 2.0 * SPEED * STEP / 5.0
        times = np.linspace(now.time, now.time + STEP, LOOKS + 1)
        driven = {
            k: bodies_at(plans[k].pose_at(times)) for k in {k for pair in pairs for k in pair}
        }
        for one, other in pairs:
            nearest = float(shapely.distance(driven[one], driven[other]).min())
            least = min(least, nearest - SPEED * STEP / LOOKS)
        return least


def bodies_at(poses: Array) -> Array:
    """Cars at poses (n, 3)."""
    ring = np.array(BODY.center) + BODY.size / 2 * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    along, aside = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x = poses[:, :1] + along * ring[:, 0] - aside * ring[:, 1]
    y = poses[:, 1:2] + aside * ring[:, 0] + along * ring[:, 1]
    return np.asarray(shapely.polygons(np.stack([x, y], axis=-1)))


def picture(traffic: Traffic, path: Path) -> None:
    """The town, its cars, and what is left of their plans."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 8))
    ax = figure.add_subplot()
    ax.set_aspect("equal")
    ax.axis("off")
    for block in traffic.town.blocks.values():
        (x, y), (wide, high) = block.center, block.size
        ax.fill(
            [x - wide / 2, x + wide / 2, x + wide / 2, x - wide / 2],
            [y - high / 2, y - high / 2, y + high / 2, y + high / 2],
            color="0.88",
        )
    held = traffic.loop.state.held
    now = traffic.loop.state.last.time + STEP
    for found in held.values():
        plan = found.plan
        times = np.linspace(now, max(now, plan.start_time + plan.duration), 30)
        path_ = np.array([plan.pose_at(at) for at in times])
        ax.plot(path_[:, 0], path_[:, 1], lw=0.6, color="tab:blue", alpha=0.5)
    places = np.array(list(traffic.poses.values()))
    ax.scatter(places[:, 0], places[:, 1], s=4, color="tab:red", zorder=3)
    figure.savefig(path, dpi=110, bbox_inches="tight")


def main() -> None:
    """Drive, and print a line every 15 s."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--asks", type=int, help="vehicles that look for plans in a step")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    n = arguments.vehicles
    asks = arguments.asks or max(2, n // 8)
    begun = time.process_time()
    traffic = Traffic(n, arguments.seed, asks)
    print(
        f"{n} cars, {traffic.town.size} x {traffic.town.size} blocks, made in "
        f"{time.process_time() - begun:.1f} s"
    )
    times, still, least, flags, moved, lost = [], [], math.inf, [], 0.0, 0
    every = max(1, round(15.0 / STEP))
    for number in range(round(60.0 * arguments.minutes / STEP)):
        begun = time.process_time()
        now = traffic.advance()
        times.append(time.process_time() - begun)
        least = min(least, traffic.least(now))
        flags += [str(one) for one in now.violations]
        lost += n - len(now.plans)
        steps = [
            float(np.hypot(*(traffic.poses[name] - traffic.before[name])[:2]))
            for name in traffic.poses
        ]
        moved += sum(steps)
        still.append(sum(one < STANDING for one in steps) / n)
        if (number + 1) % every == 0:
            agreement = traffic.loop.state.agreement
            print(
                f"{now.time + STEP:6.1f} s: a step median {np.median(times):.3f} s, p99 "
                f"{np.percentile(times, 99):.3f} s; least {least:.3f} m, lost plans {lost}, "
                f"{len(flags)} flags; {moved / 1e3:.1f} km, standing "
                f"{100 * np.mean(still[-every:]):.0f} %; legs {traffic.served}; "
                f"messages {agreement.sent / len(times) / n:.2f} a car and step",
                flush=True,
            )
            if arguments.picture:
                picture(traffic, arguments.picture)
    for one in flags[:5]:
        print("  ", one)


if __name__ == "__main__":
    main()
