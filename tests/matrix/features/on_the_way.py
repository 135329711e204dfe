"""Features of poses on the way: passed exactly and in order, at any heading, or at a gate."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.planning import PlanResult
from maneuver_automaton.problem import SearchSettings
from maneuver_automaton.via import Via
from tests.matrix import outside
from tests.matrix.measuring import asked, fine, found
from tests.matrix.rows import Engine, feature, without
from tests.matrix.scenes import base, left
from tests.matrix.vehicles import Vehicle

SHARES = (0.35, 0.7)  # of the plan in free space, at which it is to pass aside of it
MET = 1e-8  # [m, rad] from a pose on the way
MISSED = "poses on the way are passed"


def _aside(vehicle: Vehicle, share: float) -> np.ndarray:
    """A pose a little to the left of the plan in free space."""
    motion = found(base(vehicle))
    pose = np.array(motion.pose_at(share * motion.duration))
    heading = outside.flat(pose)[2]
    if not vehicle.has_heading:
        way = motion.end - motion.start
        heading = np.arctan2(way[1], way[0])
    pose[:2] += 0.04 * vehicle.reach * left(heading)
    return pose


def _passed(vehicle: Vehicle, engine: Engine, vias: list[Via]) -> PlanResult:
    """A plan that passes all, where it says it does, one after the other."""
    work = (len(vias) + 1) * vehicle.max_expansions  # of which every leg has its share
    result = asked(vehicle, engine, via=vias, search=SearchSettings(max_expansions=work))
    assert len(result.via) == len(vias), f"{len(result.via)} of {len(vias)} {MISSED}"
    course, times = fine(vehicle, result.plan), [one.time for one in result.via]
    assert times == sorted(times), f"they are passed at {times}"
    for via, time in zip(vias, times, strict=True):
        pose = result.plan.pose_at(time)
        place, turn = _off(via, pose)
        assert max(place, turn) <= MET, f"at {time:.6g} s it is {place:.3g} m, {turn:.3g} rad off"
        k = int(np.argmin(np.abs(course.time - time)))
        seen = np.abs(course.pose[k] - result.plan.pose_at(course.time[k])).max()
        assert seen <= 1e-6 * vehicle.reach, f"driven again it is {seen:.3g} beside the plan"
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)
    return result


def _off(via: Via, pose: np.ndarray) -> tuple[float, float]:
    """Distance [m] and turn [rad] of a pose from what is on the way."""
    place = np.delete(pose, 2) if pose.size > 2 else pose
    if via.gate is None:
        away = place - (np.delete(via.pose, 2) if via.pose.size > 2 else via.pose)
    else:
        along = via.gate[1] - via.gate[0]
        share = min(max(float((place - via.gate[0]) @ along / (along @ along)), 0.0), 1.0)
        away = place - via.gate[0] - share * along
    turn = 0.0 if via.free_heading else float(outside.flat(pose)[2] - outside.flat(via.pose)[2])
    return float(np.linalg.norm(away)), abs(float(np.remainder(turn + np.pi, 2 * np.pi) - np.pi))


@feature(without("via"), says=MISSED)
def via(vehicle: Vehicle, engine: Engine) -> None:
    """Two poses with their headings; of a vehicle whose headings are its trims' one of those."""
    poses = [_aside(vehicle, share) for share in SHARES]
    if not vehicle.rotates and vehicle.has_heading:
        for pose in poses:
            pose[2] = vehicle.goal[2]
    _ = _passed(vehicle, engine, [Via(pose) for pose in poses])


@feature(without("via"), says=MISSED)
def via_free_heading(vehicle: Vehicle, engine: Engine) -> None:
    """The same two places at any heading, which costs no more."""
    vias = [Via(_aside(vehicle, share), free_heading=True) for share in SHARES]
    _ = _passed(vehicle, engine, vias)


@feature(without("via"), says=MISSED)
def gate(vehicle: Vehicle, engine: Engine) -> None:
    """A segment beside the way, across it, is crossed anywhere."""
    near = _aside(vehicle, 0.5)
    middle = found(base(vehicle)).pose_at(0.5 * found(base(vehicle)).duration)
    far = np.array(near)
    far[:2] += 2.0 * (near - middle)[:2]
    ends = [np.delete(one, 2) if one.size > 2 else one for one in (near, far)]
    _ = _passed(vehicle, engine, [Via(gate=ends)])
