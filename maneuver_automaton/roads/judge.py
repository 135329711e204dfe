"""What a drive was, seen by another library: contacts, distances, the road left, the dynamics.

Nothing of the planner is used: the body is laid by shapely at poses close in time against
everybody who is there then and against the lanelets, and the controls are driven once more by an
ODE solver.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import rollout
from maneuver_automaton.primitives import Trajectory
from maneuver_automaton.roads.lanelets import drivable_area
from maneuver_automaton.roads.scene import RoadScene
from maneuver_automaton.roads.vehicle import RoadVehicle

EVERY = 0.02  # [s] between the poses that are looked at
OFF_ROAD = 1e-6  # [m^2] of the body outside the lanelets, beyond which it counts


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadVerdict:
    """What was found along a drive."""

    poses: int  # how many were looked at
    collisions: int  # poses at which the body touches somebody
    hit: tuple[str, ...]  # whom
    clearance_m: float  # least distance to anybody; inf if nobody was there
    off_road: int  # poses at which a part of the body is outside the lanelets
    edge_m: float  # least distance of the body to the edge of the road, 0 outside
    defect: float  # greatest difference from the ODE solver at the end of a step [m, rad, m/s]

    @property
    def clean(self) -> bool:
        """Whether nobody was touched and the road not left."""
        return not self.collisions and not self.off_road


def judged(
    scene: RoadScene, vehicle: RoadVehicle, driven: Trajectory, *, every: float = EVERY
) -> RoadVerdict:
    """The verdict on a trajectory, whose times are those of the scene."""
    import shapely

    area = drivable_area(scene.lanelets)
    edge = shapely.boundary(area)
    shapely.prepare(area)
    begin, end = driven.time[[0, -1]].tolist()
    times = begin + every * np.arange(math.floor((end - begin) / every + 1e-9) + 1)
    poses = driven.pose_at(times)
    bodies = shapely.polygons(
        np.stack([SE2(pose).act(vehicle.footprint.corners) for pose in poses])
    )
    outside = ~shapely.covers(area, bodies)
    outside[outside] = shapely.area(shapely.difference(bodies[outside], area)) > OFF_ROAD
    clearance, collisions, hit = math.inf, 0, set()
    for time, body in zip(times.tolist(), bodies, strict=True):
        touched = False
        for one in scene.present(time):
            distance = _distance(one.at(time), body)
            clearance = min(clearance, distance)
            if distance <= 0.0:
                touched = True
                hit.add(one.name)
        collisions += touched
    return RoadVerdict(
        poses=len(times),
        collisions=collisions,
        hit=tuple(sorted(hit)),
        clearance_m=clearance,
        off_road=int(outside.sum()),
        edge_m=0.0 if outside.any() else float(shapely.distance(bodies, edge).min()),
        defect=_defect(vehicle, driven),
    )


def _distance(shape: object, body: object) -> float:
    import shapely

    from maneuver_automaton.collision import Disc

    if isinstance(shape, Disc):
        middle = shapely.Point(shape.center)
        return max(float(shapely.distance(middle, body)) - shape.radius, 0.0)
    holes = getattr(shape, "holes", ())
    return float(shapely.distance(shapely.Polygon(shape.corners, holes), body))  # type: ignore[attr-defined]


def _defect(vehicle: RoadVehicle, driven: Trajectory) -> float:
    """Difference from the ODE solver, stretch by stretch of constant control, never corrected."""
    states = np.concatenate([driven.pose, driven.reduced_state], axis=1)
    changes = np.flatnonzero((np.diff(driven.control, axis=0) != 0.0).any(axis=1)) + 1
    state: Array = states[0]
    worst = 0.0
    for a, b in zip([0, *changes], [*changes, len(states) - 1], strict=True):
        if b <= a:
            continue
        state = rollout(
            vehicle.model,
            state,
            control=driven.control[a],
            times=[driven.time[a], driven.time[b]],
            rtol=1e-10,
            atol=1e-10,
        )[-1]
        worst = max(worst, float(np.abs(state - states[b]).max()))
    return worst
