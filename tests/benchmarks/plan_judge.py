"""Judge plans of `random_plans.py` by numpy and shapely alone; nothing of the package is imported.

``python tests/benchmarks/plan_judge.py FILE [OTHER]``: does a plan begin at the start, end at the
goal, last as long as its primitives, move as its vehicle's equations say (integrated here), and
touch nothing at any of its samples? With a second file of the same problems: which costs differ.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

ENDS = 1e-6  # [m, rad] off start and goal
DRIVEN = 1e-5  # [m, rad] between the recorded pose and the one integrated from the sample before
STRAIGHT = 2e-3  # the same where states are taken as straight between samples up to 0.1 s apart
STEPS = 4  # of Runge and Kutta between two samples
Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]


def unicycle(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.stack([u[:, 0], 0 * u[:, 0], u[:, 1]], axis=1)


def steered(length: float) -> Rates:
    def rates(z: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.stack([u[:, 0], 0 * u[:, 0], u[:, 0] * np.tan(u[:, 1]) / length], axis=1)

    return rates


def of_state(*columns: int) -> Rates:
    """Body velocities that are components of the reduced state."""
    return lambda z, u: z[:, columns]


def none(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.zeros_like(z)


def hitch(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    turn = u[:, 0] * np.tan(u[:, 1]) / 2.5
    return (turn - u[:, 0] * np.sin(z[:, 0]) / 3.0)[:, None]


def same(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    return u


# Body velocity and rate of the reduced state; None where only the velocity is told by few words.
VEHICLES: dict[str, tuple[Rates, Rates | None]] = {
    "unicycle": (unicycle, none),
    "dubins": (unicycle, none),
    "grid": (unicycle, none),
    "car": (steered(1.0), none),
    "boat": (lambda z, u: np.stack([u[:, 0], -0.3 * u[:, 0] * u[:, 1], u[:, 1]], axis=1), none),
    "glider": (lambda z, u: np.stack([u[:, 0], 0 * u[:, 0], u[:, 1], u[:, 2]], axis=1), none),
    "omni": (lambda z, u: u[:, :3], none),
    "stage": (lambda z, u: np.stack([u[:, 0], u[:, 1], 0 * u[:, 0]], axis=1), none),
    "second_order_unicycle": (
        lambda z, u: np.stack([z[:, 0], 0 * z[:, 0], z[:, 1]], axis=1), same,
    ),
    "second_order_car": (
        lambda z, u: np.stack([z[:, 0], 0 * z[:, 0], z[:, 0] * np.tan(z[:, 1]) / 2.8], axis=1),
        same,
    ),
    "car_with_trailer": (steered(2.5), hitch),
    "user": (lambda z, u: np.stack([z[:, 0], -0.2 * z[:, 1], z[:, 1]], axis=1), same),
    "hovercraft": (of_state(0, 1, 2), None),
    "single_track": (of_state(0, 1, 2), None),
    "helicopter": (of_state(0, 1, 3, 2), None),
}  # fmt: skip


def pose_rates(pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Rates of poses (n, d) at body velocities (n, d)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    rates = velocity.copy()
    rates[:, 0] = c * velocity[:, 0] - s * velocity[:, 1]
    rates[:, 1] = s * velocity[:, 0] + c * velocity[:, 1]
    return rates


def defect(vehicle: str, time: np.ndarray, pose: np.ndarray, z: np.ndarray, u: np.ndarray) -> float:
    """Greatest distance of a sample from where the one before leads."""
    velocity, dynamics = VEHICLES[vehicle]
    lasting = np.diff(time)[:, None]
    p, state, control = pose[:-1].copy(), z[:-1].copy(), u[:-1]
    h = lasting / STEPS

    def rates(at: float, p: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if dynamics is None:  # the recorded states, straight between two samples
            here = z[:-1] + at * (z[1:] - z[:-1])
            return pose_rates(p, velocity(here, control)), np.zeros_like(state)
        return pose_rates(p, velocity(state, control)), dynamics(state, control)

    for n in range(STEPS):
        a = rates(n / STEPS, p, state)
        b = rates((n + 0.5) / STEPS, p + h / 2 * a[0], state + h / 2 * a[1])
        c = rates((n + 0.5) / STEPS, p + h / 2 * b[0], state + h / 2 * b[1])
        d = rates((n + 1) / STEPS, p + h * c[0], state + h * c[1])
        p = p + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        state = state + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    off = np.abs(p - pose[1:]).max(initial=0.0)
    if dynamics is not None and z.shape[1]:
        off = max(off, np.abs(state - z[1:]).max(initial=0.0))
    return float(off)


def solids(entries: list[dict[str, Any]], poses: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Geometries (n,) of each shape at poses (n, 3), and a radius around them."""
    found = []
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    for entry in entries:
        corners = np.array(entry.get("corners", [entry.get("center", [0.0, 0.0])]))
        x = poses[:, :1] + c * corners[:, 0] - s * corners[:, 1]
        y = poses[:, 1:2] + s * corners[:, 0] + c * corners[:, 1]
        points = np.stack([x, y], axis=-1)
        shapes = shapely.points(points[:, 0]) if len(corners) == 1 else shapely.polygons(points)
        found.append((shapes, float(entry.get("radius", 0.0))))
    return found


def clearance(answer: dict[str, Any], pose: np.ndarray, z: np.ndarray) -> float:
    """Least distance [m] of the body, and of a trailer, from an obstacle at any sample."""
    flat = pose[:, :3] if pose.shape[1] > 2 else np.column_stack([pose, np.zeros(len(pose))])
    bodies = solids(answer["footprint"], flat)
    if answer["parts"]:
        heading = flat[:, 2] - z[:, 0]
        axle = flat[:, :2] - 3.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        bodies += solids(answer["parts"], np.column_stack([axle, heading]))
    least = math.inf
    for shape, radius in solids(answer["obstacles"], np.zeros((1, 3))):
        for body, around in bodies:
            least = min(least, float(shapely.distance(body, shape[0]).min()) - radius - around)
    return least


def faults(answer: dict[str, Any]) -> list[str]:
    """What is wrong with a plan."""
    plan = answer["plan"]
    course = plan["trajectory"]
    time, pose = np.array(course["time_s"]), np.array(course["pose"])
    pose[:, :2] += course.get("origin", [0.0, 0.0])
    n = len(time)
    z = np.array(course["reduced_state"], dtype=float).reshape(n, -1)
    u = np.array(course["control"], dtype=float).reshape(n, -1)
    wrong = []
    if np.abs(pose[0] - answer["start"]).max() > ENDS:
        wrong.append("start")
    off = pose[-1] - answer["goal"]
    if off.size > 2:
        off[2] = (off[2] + math.pi) % (2.0 * math.pi) - math.pi
    if np.abs(off).max() > ENDS:
        wrong.append("goal")
    lasts = sum(one["duration_s"] for one in plan["primitives"])
    if abs(lasts - (time[-1] - time[0])) > ENDS or abs(lasts - plan["duration_s"]) > ENDS:
        wrong.append("duration")
    off_course = defect(answer["vehicle"], time, pose, z, u)
    if off_course > (STRAIGHT if VEHICLES[answer["vehicle"]][1] is None else DRIVEN):
        wrong.append(f"dynamics {off_course:.1e}")
    if clearance(answer, pose, z) < 0.0:
        wrong.append(f"collision {clearance(answer, pose, z):.1e}")
    return wrong


def read(path: Path) -> dict[tuple[str, int], dict[str, Any]]:
    lines = (json.loads(line) for line in path.open())
    return {(one["vehicle"], one["seed"]): one for one in lines}


def judged(answers: dict[tuple[str, int], dict[str, Any]]) -> None:
    """Print a line for each vehicle, and every fault."""
    rows: dict[str, Counter[str]] = defaultdict(Counter)
    for (vehicle, seed), answer in answers.items():
        rows[vehicle][answer["plan"]["status"]] += 1
        wrong = faults(answer) if answer["plan"]["status"] == "found" else []
        rows[vehicle]["unsound"] += bool(wrong)
        if wrong:
            print(f"{vehicle} {seed}: {', '.join(wrong)}")
    for vehicle, counts in rows.items():
        print(f"{vehicle:22s} {sum(counts.values()) - counts['unsound']:5d} problems: "
              + ", ".join(f"{name} {n}" for name, n in sorted(counts.items())))  # fmt: skip


def compared(ours: dict[Any, dict[str, Any]], other: dict[Any, dict[str, Any]]) -> None:
    """Costs and times of the first file over those of the second, where both have plans."""
    print("\nfirst over second: problems, only first finds, only second finds, sum of costs, "
          "dearer by 0.1 %, cheaper by 0.1 %, median ratio of times")  # fmt: skip
    for vehicle in dict.fromkeys(name for name, _ in ours):
        keys = [key for key in ours if key[0] == vehicle and key in other]
        costs = [(ours[k]["plan"]["cost"], other[k]["plan"]["cost"]) for k in keys]
        both = [(a, b) for a, b in costs if a is not None and b is not None]
        only = sum(b is None and a is not None for a, b in costs)
        lost = sum(a is None and b is not None for a, b in costs)
        times = [ours[k]["seconds"] / other[k]["seconds"] for k in keys if other[k]["seconds"] > 0]
        total = sum(a for a, _ in both) / sum(b for _, b in both) if both else math.nan
        print(f"{vehicle:22s} {len(keys):5d} {only:4d} {lost:4d} {total:.6f} "
              f"{sum(a > b * 1.001 for a, b in both):4d} {sum(a < b * 0.999 for a, b in both):4d} "
              f"{statistics.median(times) if times else math.nan:.3f}")  # fmt: skip


def main() -> None:
    files = [read(Path(name)) for name in sys.argv[1:]]
    if not files:
        print(__doc__)
        return
    for answers in files:
        judged(answers)
    if len(files) > 1:
        compared(files[0], files[1])


if __name__ == "__main__":
    main()
