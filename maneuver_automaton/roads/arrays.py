"""What the kernels of roads are given: each value once, and what each row means."""

from typing import NamedTuple, TypeAlias

import numpy as np

from maneuver_automaton._compile import by_value
from maneuver_automaton.collision.arrays import WorldArrays
from maneuver_automaton.collision.body import Body

# x, y [m], heading [rad] of the rear axle, speed [m/s], steering angle [rad]
State: TypeAlias = tuple[float, float, float, float, float]


class Limits(NamedTuple):
    """Limits of the vehicle and of the library, and the weights of comfort."""

    wheelbase: float
    tick: float  # [s]
    ticks: int  # of every maneuver
    rate: float  # [rad/s] of the steering
    sharpest: float  # [rad] of the steering
    braking: float  # [m/s^2] at most
    lateral: float  # [m/s^2] at most
    friction: float  # [m/s^2] along and across together
    engine: float  # [m/s^2] up to `power_speed`, less beyond it
    power_speed: float  # [m/s]
    left_out: tuple[float, float]  # [m/s] between these, changes of speed are left out
    most_steps: int  # of the speed grid that a maneuver spans
    weight_along: float  # per (m/s^2)^2 s
    weight_across: float  # per (m/s^2)^2 s
    weight_jerk: float  # per (m/s^3)^2 s, across


class RoadTrims(NamedTuple):
    """S trims: pairs of a speed and a steering angle, speed by speed."""

    speed: np.ndarray  # (S,) [m/s]
    steering: np.ndarray  # (S,) [rad]
    first: np.ndarray  # (speeds + 1,) first trim of each speed: slow ones have more angles


@by_value
class Maneuvers(NamedTuple):
    """E maneuvers from the identity pose, all of the same number of ticks."""

    # Sorted by the trim they leave, so that the edges of a node are one range.
    first: np.ndarray  # (S + 1,) where those of each trim begin; (2,) of a single state
    target: np.ndarray  # (E,) trim that is reached
    control: np.ndarray  # (E, 2) acceleration [m/s^2], steering rate [rad/s]
    # Poses at all ticks: an edge is proven tick by tick, as others are known at the ticks.
    pose: np.ndarray  # (E, ticks, 3) at the end of each tick
    effort: np.ndarray  # (E,) cost of comfort


class RouteArrays(NamedTuple):
    """The line to follow, as equally spaced points."""

    # Equal spacing makes the number of a point its station: nothing has to be searched for.
    point: np.ndarray  # (n, 2)
    heading: np.ndarray  # (n,)
    direction: np.ndarray  # (n, 2) cosine and sine of it: every node of the search asks for them
    # The limit of whatever lane is there, and no more than what braking to those ahead leaves.
    limit: np.ndarray  # (n, 2 m + 1) [m/s] at offsets from right to left, the line in the middle
    time: np.ndarray  # (n,) [s] from the first point as fast as limits allow; 0 where there is none
    # Closed lines across the route, those that close first in front.
    closed: (
        np.ndarray
    )  # (B, 3) station before it [m], when it closes and opens [s]; inf: once stood
    slowing: float  # [m/s^2] at least, of whoever is beyond a limit; -inf: limits have a price only
    spacing: float  # [m]
    aside: float  # [m] between offsets of `limit`


class GoalArrays(NamedTuple):
    """G goals in world coordinates, and where they are along the route."""

    # Rings of all places one after another, as goals have any number of places of any size.
    corner: np.ndarray  # (R, 2)
    ring: np.ndarray  # (P + 1,) first corner of each ring
    place: np.ndarray  # (G + 1,) first ring of each goal
    anywhere: np.ndarray  # (G,) whether a goal is no place
    heading: np.ndarray  # (G, 2) least heading, width of the interval
    speed: np.ndarray  # (G, 2) least and greatest
    tick: np.ndarray  # (G, 2) first and last
    every: int  # ticks: only at multiples of these, where the scene's clock ticks, a goal counts
    # For the cost-to-go, which knows no rings: the intervals that hold the places of each goal.
    extent: np.ndarray  # (G, 4) least and greatest station, least and greatest offset; or infinite
    turned: np.ndarray  # (G, 2) least and greatest heading, seen from the route's direction there


class StaticObstacles(NamedTuple):
    """B static obstacles on the road, as intervals in which the vehicle's middle may not be."""

    extent: np.ndarray  # (B, 4) least and greatest station, least and greatest offset
    passable: np.ndarray  # (B, 2) whether there is road to its right and to its left


class Weights(NamedTuple):
    """Weights of the stage cost per second, and of the accelerations in the cost-to-go."""

    offset: float  # per m^2 from the route
    turned: float  # per rad^2 from the route's direction
    hurry: float  # per (m/s)^2 beyond the speed limit
    pace: float  # per (m/s)^2 from the pace
    progress: float  # [m/s] the pace, nan where the goal sets it
    # Of the cost-to-go: prices of the accelerations that are still needed, and their limits.
    ahead: float  # per (m/s^2)^2 s, along the route
    aside: float  # per (m/s^2)^2 s, across it
    lateral: float  # [m/s^2] limit across
    braking: float  # [m/s^2] limit of slowing down
    gain: float  # [m/s^2] limit of speeding up


class CarArrays(NamedTuple):
    """The car as a rectangle; the pose is that of the rear axle's middle."""

    half_length: float  # [m]
    half_width: float  # [m]
    ahead: float  # [m] from the rear axle to the middle of the body
    wheelbase: float  # [m]
    braking: float  # [m/s^2] of a fail-safe stop


class Clearing(NamedTuple):
    """All obstacles, the distances kept from them, and the body that moves."""

    car: CarArrays
    body: Body  # the same rectangle, for `world`
    world: WorldArrays  # land beside the road, static and moving obstacles on it
    off_static: float  # [m] kept all the way from land and static obstacles
    off_traffic: float  # [m] from moving obstacles, each there as long as it was recorded
    margin: float  # [m] besides, where the motion is looked at: the edge is simplified by as much
    start: float  # [s] time of the world at tick 0
    tick: float  # [s]


class RoadArrays(NamedTuple):
    """Everything that stays the same from step to step."""

    clearing: Clearing
    limits: Limits
    trims: RoadTrims
    maneuvers: Maneuvers
    route: RouteArrays
    goals: GoalArrays
    obstacles: StaticObstacles
    weights: Weights


class HorizonTask(NamedTuple):
    """Where the vehicle is, and how far to look."""

    x: float
    y: float
    heading: float
    speed: float
    steering: float
    tick: int
    until: int  # no plan goes on after this tick
    cell: float  # [m] of equal nodes
    turn_cell: float  # [rad]
    speed_cell: float  # [m/s]
    width: int  # nodes of a level that go on at most
    abreast: int  # of these, in one strip along the route
    greed: float  # weight of the cost-to-go
    below: float  # a plan to a goal as dear as this is not looked for


class BeamArrays(NamedTuple):
    """Nodes and their queue: room that is made once and used in every step."""

    # The start, the ends of the two plans in `reached`, and all nodes that were kept: a word is
    # read backwards along the parents. After them the children of one level, which the next level
    # writes over. A row of `pose`: x, y, heading, cost to come.
    pose: np.ndarray  # (3 + levels W + C, 4)
    links: np.ndarray  # (N, 4) parent, maneuver that led here, trim, nearest point of the route
    # What was kept of each level, best first: the search goes on from these, and if no goal is
    # reached, the plan is to one of the last of them.
    kept: np.ndarray  # (levels, W) nodes
    counts: np.ndarray  # (levels,) how many of them
    # Of the level at hand. Strips keep nodes on either side of an obstacle in the beam, where the
    # cheaper side alone would fill it.
    strips: np.ndarray  # (n,) how many in each strip, the first and last without an end
    cells: np.ndarray  # (4 W,) keys of cells that are taken, EMPTY for none
    # A binary heap of the level at hand: cost plus weighted cost-to-go, and the node.
    heap_key: np.ndarray  # (C,)
    heap_node: np.ndarray  # (C,)
    # Plans to a goal, those with a stop after them and those without: cost, node, tick.
    reached: np.ndarray  # (2, 3)
    state: np.ndarray  # (5,) end of the nodes, size of the heap, nodes kept, edges proven, children


class Moves(NamedTuple):
    """What is tried: patterns, by sizes, one pair of them in a pass."""

    pattern: np.ndarray  # (P, blocks) weights of the blocks of a move, no further than 1 from zero
    blocks: np.ndarray  # (P,) how many of them
    size: np.ndarray  # (S, 2) of acceleration [m/s^2] and steering rate [rad/s]


@by_value
class TickPlan(NamedTuple):
    """A plan tick by tick, the stop after it included."""

    states: np.ndarray  # (m + 1, 5)
    controls: np.ndarray  # (m, 2)
    # Of the plan alone, up to each state: what a move leaves as it is needs no second look.
    cost: np.ndarray  # (m + 1,)
    near: np.ndarray  # (m + 1,) nearest point of the route
