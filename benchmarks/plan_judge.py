"""Judge plans of `random_plans.py` by numpy and shapely alone; nothing of the package is imported.

``python benchmarks/plan_judge.py FILE [OTHER]``: does a plan begin at the start, end at the
goal, last as long as its primitives, cost what it says, move as its vehicle's equations say
(integrated here from sample to sample, and from the start to the end), touch nothing at any of its
samples or between them, and keep the clearance that it states? Of a closed loop: does every piece
do so, begin where the piece before ended, and is the loop where, when and as costly as stated?
With a second file of the same problems: which costs differ.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A sampled motion, integrated here."""

    time: np.ndarray  # (n,)
    pose: np.ndarray  # (n, d) as recorded
    z: np.ndarray  # (n, n_z)
    u: np.ndarray  # (n, n_u) from each sample to the next
    between: np.ndarray  # (n_b, d) poses at all samples and within every step, integrated
    between_z: np.ndarray  # (n_b, n_z)
    off: float  # greatest distance of a sample from where the one before leads
    end: np.ndarray  # (d,) where the integrated steps lead, one after the other, from the start


def integrated(vehicle: str, entry: dict[str, Any]) -> Course:
    """The motion of a recorded trajectory."""
    time, pose = np.array(entry["time_s"]), np.array(entry["pose"])
    pose[:, :2] += entry.get("origin", [0.0, 0.0])
    n = len(time)
    z = np.array(entry["reduced_state"], dtype=float).reshape(n, -1)
    u = np.array(entry["control"], dtype=float).reshape(n, -1)
    poses, states = steps(vehicle, np.diff(time)[:, None], pose[:-1], z, u[:-1])
    off = np.abs(poses[-1] - pose[1:]).max(initial=0.0)
    if VEHICLES[vehicle][1] is not None and z.shape[1]:
        off = max(off, np.abs(states[-1] - z[1:]).max(initial=0.0))
    own = poses[-1] - pose[:-1]  # seen from the body before each step, it adds up from the start
    heading = pose[:-1, 2] if pose.shape[1] > 2 else np.zeros(n - 1)
    ahead = np.cos(heading) * own[:, 0] + np.sin(heading) * own[:, 1]
    aside = np.cos(heading) * own[:, 1] - np.sin(heading) * own[:, 0]
    if pose.shape[1] > 2:
        heading = pose[0, 2] + np.concatenate([[0.0], np.cumsum(own[:-1, 2])])[: n - 1]
    own[:, 0] = np.cos(heading) * ahead - np.sin(heading) * aside
    own[:, 1] = np.sin(heading) * ahead + np.cos(heading) * aside
    return Course(
        time,
        pose,
        z,
        u,
        np.concatenate([pose[:1], *poses]),
        np.concatenate([z[:1], *states]),
        float(off),
        pose[0] + own.sum(axis=0),
    )


def steps(
    vehicle: str, lasting: np.ndarray, p: np.ndarray, z: np.ndarray, control: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Poses and reduced states after each step of Runge and Kutta from all samples but the last."""
    velocity, dynamics = VEHICLES[vehicle]
    state, h = z[:-1], lasting / STEPS

    def rates(at: float, p: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if dynamics is None:  # the recorded states, straight between two samples
            here = z[:-1] + at * (z[1:] - z[:-1])
            return pose_rates(p, velocity(here, control)), (z[1:] - z[:-1]) / lasting
        return pose_rates(p, velocity(state, control)), dynamics(state, control)

    poses, states = [], []
    for n in range(STEPS):
        a = rates(n / STEPS, p, state)
        b = rates((n + 0.5) / STEPS, p + h / 2 * a[0], state + h / 2 * a[1])
        c = rates((n + 0.5) / STEPS, p + h / 2 * b[0], state + h / 2 * b[1])
        d = rates((n + 1) / STEPS, p + h * c[0], state + h * c[1])
        p = p + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        state = state + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        poses.append(p)
        states.append(state)
    return poses, states


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


def clearance(answer: dict[str, Any], course: Course) -> float:
    """Least distance [m] of the body, and of a trailer, from an obstacle anywhere on a course."""
    pose, z = course.between, course.between_z
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


def off_goal(pose: np.ndarray, goal: list[float]) -> np.ndarray:
    """Components of a pose less those of the goal, the heading modulo a turn."""
    off = pose - goal
    if off.size > 2:
        off[2] = (off[2] + math.pi) % (2.0 * math.pi) - math.pi
    return np.abs(off)


def motion_faults(answer: dict[str, Any], course: Course) -> list[str]:
    """What is wrong with a motion, wherever it leads; it may touch something."""
    wrong = []
    straight = VEHICLES[answer["vehicle"]][1] is None
    if course.off > (STRAIGHT if straight else DRIVEN):
        wrong.append(f"dynamics {course.off:.1e}")
    drift = np.abs(course.end - course.pose[-1]).max()
    if drift > (STRAIGHT * 10.0 if straight else DRIVEN * 10.0):
        wrong.append(f"integrated from the start, it ends {drift:.1e} off")
    return wrong


def faults(answer: dict[str, Any]) -> list[str]:
    """What is wrong with a plan."""
    plan = answer["plan"]
    course = integrated(answer["vehicle"], plan["trajectory"])
    wrong = motion_faults(answer, course)
    if np.abs(course.pose[0] - answer["start"]).max() > ENDS:
        wrong.append("start")
    if off_goal(course.pose[-1], answer["goal"]).max() > ENDS:
        wrong.append("goal")
    lasts, lasted = sum(one["duration_s"] for one in plan["primitives"]), np.ptp(course.time)
    if abs(lasts - lasted) > ENDS or abs(lasts - plan["duration_s"]) > ENDS:
        wrong.append("duration")
    if abs(plan["cost"] - lasts) > ENDS:  # all are asked for least time
        wrong.append(f"costs {plan['cost']}, lasts {lasts}")
    if plan["lower_bound"] is not None and plan["lower_bound"] > plan["cost"] + ENDS:
        wrong.append(f"costs {plan['cost']}, bound {plan['lower_bound']}")
    least = clearance(answer, course)
    if least < 0.0:
        wrong.append(f"collision {least:.1e}")
    elif plan["clearance_m"] is not None and plan["clearance_m"] > least + ENDS:
        wrong.append(f"clearance {least}, stated {plan['clearance_m']}")
    return wrong


def loop_faults(answer: dict[str, Any]) -> list[str]:
    """What is wrong with a closed loop."""
    loop, wrong = answer["loop"], []
    entries, least, spent = loop["steps"], math.inf, 0.0
    if np.abs(np.subtract(entries[0]["vehicle_pose"], answer["start"])).max() > ENDS:
        wrong.append("start")
    if len(answer["pieces"]) != len(entries) - 1:
        wrong.append("pieces")
    for k, piece in enumerate(answer["pieces"]):
        now, then = entries[k], entries[k + 1]
        if not piece["time_s"]:
            continue
        course = integrated(answer["vehicle"], piece)
        wrong += [f"step {k}: {said}" for said in motion_faults(answer, course)]
        if np.abs(course.pose[0] - now["vehicle_pose"]).max() > ENDS:
            wrong.append(f"step {k}: start")
        jump = np.abs(course.pose[-1] - then["vehicle_pose"]).max()
        if jump > (0.01 * math.dist(answer["goal"][:2], [0.0, 0.0]) if answer["noisy"] else ENDS):
            wrong.append(f"step {k}: end {jump:.1e}")
        spent += float(np.ptp(course.time))
        if abs(then["time_s"] - now["time_s"] - np.ptp(course.time)) > ENDS:
            wrong.append(f"step {k}: time")
        if abs(then["accumulated_cost"] - spent) > ENDS:
            wrong.append(f"step {k}: cost")
        if now["control"] is not None and not np.allclose(now["control"], course.u[0], atol=ENDS):
            wrong.append(f"step {k}: control")
        least = min(least, clearance(answer, course))
    place, turn = answer["tolerance"]
    off = off_goal(np.array(entries[-1]["vehicle_pose"]), answer["goal"])
    away = float(np.linalg.norm(np.delete(off, 2) if off.size > 2 else off))
    there = away <= place + ENDS and off[2:3].max(initial=0.0) <= turn + ENDS
    if loop["reached"] and not there:
        wrong.append("goal")
    if abs(loop["cost"] - spent) > ENDS:
        wrong.append("cost")
    if least < 0.0 and not (answer["noisy"] and loop["collisions"]):
        wrong.append(f"collision {least:.1e}")
    elif loop["min_clearance_m"] is not None and loop["min_clearance_m"] > max(least, 0.0) + ENDS:
        wrong.append(f"clearance {least}, stated {loop['min_clearance_m']}")
    return wrong


def read(path: Path) -> dict[tuple[str, int], dict[str, Any]]:
    lines = (json.loads(line) for line in path.open())
    return {(one["vehicle"], one["seed"]): one for one in lines}


def judged(answers: dict[tuple[str, int], dict[str, Any]]) -> None:
    """Print a line for each vehicle, and every fault."""
    rows: dict[str, Counter[str]] = defaultdict(Counter)
    for (vehicle, seed), answer in answers.items():
        status = (answer["loop"] if "loop" in answer else answer["plan"])["status"]
        rows[vehicle][status] += 1
        wrong = loop_faults(answer) if "loop" in answer else []
        if status == "found":
            wrong = faults(answer)
        rows[vehicle]["unsound"] += bool(wrong)
        if wrong:
            print(f"{vehicle} {seed}: {', '.join(wrong)}")
    for vehicle, counts in rows.items():
        print(f"{vehicle:22s} {sum(counts.values()) - counts['unsound']:5d} problems: "
              + ", ".join(f"{name} {n}" for name, n in sorted(counts.items())))  # fmt: skip


def compared(ours: dict[Any, dict[str, Any]], other: dict[Any, dict[str, Any]]) -> None:
    """Costs and times of the first file over those of the second, where both have plans."""
    print("\nfirst over second: problems, only first finds, only second finds, sum of costs, "
          "costlier by 0.1 %, cheaper by 0.1 %, median ratio of times")  # fmt: skip
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
