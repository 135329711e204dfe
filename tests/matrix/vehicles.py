"""The vehicles of the matrix: a library, a body and a task of its size each.

To add a vehicle is to add one entry to `VEHICLES`: every feature is then tried with it.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Box, Disc, Shape
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import (
    Car,
    FourWheelSteeringCar,
    RearSteeredCar,
    Unicycle,
    UserModel,
)
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from maneuver_automaton.scenario.automata import preset_automaton
from tests import translations
from tests.search.cases import NAMED_TABLE_2 as TABLE_2


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """One column of the matrix: what drives, how large it is, and from where to where."""

    name: str
    library: Callable[[], Automaton]
    footprint: tuple[Shape, ...]
    goal: tuple[float, ...]  # the start is the identity [m, m, rad(, m)]
    end_trim: str | None = None  # of start and goal, for a vehicle that cannot stand
    moving_trim: str | None = None  # another trim in which it may start and end, under way
    slow: float | None = None  # [m/s] of its slower trims, if it has any that go on
    parts: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict)
    max_expansions: int = 2000
    inertia: bool = False
    reverses: bool = True
    flies: bool = False
    rotates: bool = True  # whether its dynamics look the same after a rotation
    has_heading: bool = True  # whether it can turn

    @property
    def automaton(self) -> Automaton:
        """Its library, loaded once."""
        return _library(self.library)

    @property
    def reach(self) -> float:
        """Distance [m] from the start to the goal in the plane."""
        return float(np.hypot(*self.goal[:2]))

    @property
    def size(self) -> float:
        """Radius [m] of a disc around its pose that holds the footprint."""
        return max(_radius(shape) for shape in self.footprint)

    @property
    def fastest(self) -> float:
        """Greatest speed [m/s] of its trims in the plane."""
        return float(np.linalg.norm(self.automaton.body_velocities[:, :2], axis=1).max())

    @property
    def rests(self) -> bool:
        """Whether it starts and ends at rest."""
        return self.end_trim is None and self.automaton.rest is not None

    def target(self, **changes: object) -> Goal:
        """Its goal."""
        return replace(Goal(pose=self.goal, trim=self.end_trim), **changes)

    def problem(self, **changes: object) -> Problem:
        """Its task in free space, or with what `changes` add to it."""
        values: dict[str, object] = {
            "footprint": self.footprint,
            "parts": self.parts,
            "start_trim": self.end_trim,
            "search": SearchSettings(max_expansions=self.max_expansions),
            "goals": self.target(),
        }
        values |= changes
        goals = values.pop("goals")
        return Problem(self.automaton, np.zeros(len(self.goal)), goals, **values)  # type: ignore[arg-type]


def _radius(shape: Shape) -> float:
    if isinstance(shape, Disc):
        return float(np.linalg.norm(shape.center)) + shape.radius
    return float(np.linalg.norm(shape.corners, axis=1).max())


@functools.cache
def _library(make: Callable[[], Automaton]) -> Automaton:
    return make()


def _unicycle() -> Automaton:
    """The five trims of the paper's Table 2."""
    return Automaton.of_controls(Unicycle(), TABLE_2)


def _car() -> Automaton:
    """Left, straight and right, ahead and back: the trims of Reeds and Shepp."""
    turns = {"left": 0.5, "straight": 0.0, "right": -0.5}
    controls = {"ahead " + name: (1.0, angle) for name, angle in turns.items()}
    controls |= {"back " + name: (-1.0, angle) for name, angle in turns.items()}
    return Automaton.of_controls(Car(wheelbase=1.0, max_steering=0.6), controls)


def _dubins() -> Automaton:
    controls = {"left": (1.0, 1.0), "straight": (1.0, 0.0), "right": (1.0, -1.0)}
    return Automaton.of_controls(Unicycle(), controls)


def _grid() -> Automaton:
    """A trim for every tenth of speed and turn rate: 1,681 of them."""
    axis = np.round(np.linspace(-2.0, 2.0, 41), 12)
    return Automaton.of_grid(Unicycle(), [axis, axis])


def _boat() -> Automaton:
    """A user's boat: it drifts outwards in its turns."""
    model = UserModel(
        name="boat",
        group=SE2,
        control_names=("speed", "turn_rate"),
        velocity=lambda z, u: [u[0], -0.3 * u[0] * u[1], u[1]],
    )
    controls = {
        "rest": (0.0, 0.0),
        "ahead": (1.0, 0.0),
        "port": (0.8, 0.6),
        "starboard": (0.8, -0.6),
        "astern": (-0.5, 0.0),
        "astern to port": (-0.4, 0.4),
        "astern to starboard": (-0.4, -0.4),
    }
    return Automaton.of_controls(model, controls)


def _glider() -> Automaton:
    """A kinematic vehicle in space: it climbs or sinks while it flies on or turns."""
    model = UserModel(
        name="glider",
        group=SE2xR,
        control_names=("speed", "turn_rate", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )
    turns = {"left": 0.5, "straight": 0.0, "right": -0.5}
    climbs = {"sinking": -0.4, "level": 0.0, "climbing": 0.4}
    return Automaton.of_controls(
        model,
        {
            f"{turn} {climb}": (1.0, rate, rise)
            for (turn, rate), (climb, rise) in itertools.product(turns.items(), climbs.items())
        },
    )


def _omni() -> Automaton:
    """A holonomic vehicle: ahead, aside, on the spot, and between."""
    model = UserModel(
        name="omni",
        group=SE2,
        control_names=("ahead", "aside", "turn_rate"),
        velocity=lambda z, u: [u[0], u[1], u[2]],
    )
    controls = {
        "rest": (0.0, 0.0, 0.0),
        "ahead": (1.0, 0.0, 0.0),
        "back": (-1.0, 0.0, 0.0),
        "left": (0.0, 1.0, 0.0),
        "right": (0.0, -1.0, 0.0),
        "turn left": (0.0, 0.0, 1.0),
        "turn right": (0.0, 0.0, -1.0),
        "curve left": (1.0, 0.0, 1.0),
        "curve right": (1.0, 0.0, -1.0),
    }
    return Automaton.of_controls(model, controls)


def _stage() -> Automaton:
    """It moves along x and y and between, and never turns."""
    controls = {
        "rest": (0.0, 0.0),
        "right": (1.0, 0.0),
        "left": (-1.0, 0.0),
        "up": (0.0, 1.0),
        "down": (0.0, -1.0),
        "slant": (0.6, 0.6),
    }
    return Automaton.of_controls(translations.stage(), controls)


def _boat_in_current() -> Automaton:
    """A current along x breaks the symmetry of rotations: eight headings, and turns between."""
    model = translations.boat(name="boat in a current")
    return Automaton.of_model(model, {"heading": np.pi / 4 * np.arange(8), "speed": [1.0, 0.5]})


def _user() -> Automaton:
    """A user's sled with inertia: it slides outwards in turns; ramps join every two trims."""
    rates = np.array([1.0, 2.0])  # [m/s^2, rad/s^2]
    model = UserModel(
        name="sled",
        group=SE2,
        control_names=("acceleration", "angular_acceleration"),
        reduced_names=("speed", "turn_rate"),
        velocity=lambda z, u: [z[0], -0.2 * z[1], z[1]],
        dynamics=lambda z, u: [u[0], u[1]],
        control_limits=np.stack([-rates, rates], axis=-1),
        reduced_limits=np.array([[-0.8, 1.2], [-1.0, 1.0]]),
    )
    states = np.array([[0, 0], [1, 0], [0.8, 0.8], [0.8, -0.8], [0.4, 0], [-0.6, 0]], dtype=float)
    names = ("rest", "ahead", "left", "right", "slow", "back")
    still = np.zeros(2)
    trims = tuple(
        Trim(name=name, body_velocity=model.body_velocity(z, still), control=still, reduced_state=z)
        for name, z in zip(names, states, strict=True)
    )
    pairs = list(itertools.permutations(range(len(trims)), 2))
    changes = np.array([states[b] - states[a] for a, b in pairs])
    times = np.abs(changes) / rates
    first, last = times.min(axis=1), times.max(axis=1)
    both = np.sign(changes) * rates
    after = np.where(times > first[:, None], both, 0.0)  # the slower component goes on alone
    courses = drive_all(
        model,
        states[[a for a, _ in pairs]],
        control=np.stack([both, after], axis=1),
        durations=np.stack([first, last - first], axis=1),
    )
    maneuvers = tuple(
        Maneuver(
            name=f"{names[a]} to {names[b]}",
            source=names[a],
            target=names[b],
            displacement=course.pose[-1],
            duration=float(course.time[-1]),
            course=course,
        )
        for (a, b), course in zip(pairs, courses, strict=True)
    )
    return Automaton(model, trims, maneuvers)


def _forklift() -> Automaton:
    return preset_automaton("reeds_shepp", RearSteeredCar(wheelbase=1.5, max_steering=1.2))


def _four_wheels() -> Automaton:
    return preset_automaton("crab", FourWheelSteeringCar(wheelbase=1.0, max_steering=1.2))


def _stock(name: str) -> Callable[[], Automaton]:
    return functools.partial(load_stock_library, name)


ALL = (
    Vehicle(name="unicycle", library=_unicycle, footprint=(Box([0.5, 0.3]),), goal=(4.0, 1.0, 0.5)),
    Vehicle(
        name="car", library=_car, footprint=(Box([1.4, 0.6], [0.5, 0.0]),), goal=(8.0, 2.0, 0.5)
    ),
    Vehicle(
        name="dubins",
        library=_dubins,
        footprint=(Box([0.6, 0.4]),),
        goal=(6.0, 2.0, 0.5),
        reverses=False,
    ),
    Vehicle(
        name="grid", library=_grid, footprint=(Box([0.6, 0.4]),), goal=(5.0, 2.0, 0.5), slow=1.0
    ),
    Vehicle(name="boat", library=_boat, footprint=(Box([0.8, 0.4]),), goal=(7.0, 2.0, 0.5)),
    Vehicle(
        name="glider",
        library=_glider,
        footprint=(Disc(0.4),),
        goal=(12.0, 3.0, 0.5, 2.0),
        reverses=False,
        flies=True,
    ),
    Vehicle(name="omni", library=_omni, footprint=(Box([0.6, 0.4]),), goal=(4.0, 1.5, 0.5)),
    Vehicle(
        name="stage",
        library=_stage,
        footprint=(Box([0.5, 0.3]),),
        goal=(4.0, 1.5, 0.0),
        rotates=False,
        has_heading=False,
    ),
    Vehicle(
        name="boat_in_current",
        library=_boat_in_current,
        footprint=(Box([0.8, 0.4]),),
        goal=(6.0, 2.0, np.pi / 4),
        inertia=True,
        reverses=False,
        rotates=False,
    ),
    Vehicle(
        name="second_order_unicycle",
        library=_stock("second_order_unicycle"),
        footprint=(Box([0.5, 0.25]),),
        goal=(3.0, 1.0, 0.5),
        moving_trim="speed 0.5, turn_rate 0",
        slow=0.25,
        inertia=True,
    ),
    Vehicle(
        name="second_order_car",
        library=_stock("second_order_car"),
        footprint=(Box([4.2, 1.8], [1.3, 0.0]),),
        goal=(16.0, 4.0, 0.3),
        moving_trim="speed 1.5, steering 0",
        slow=1.5,
        inertia=True,
    ),
    Vehicle(
        name="car_with_trailer",
        library=_stock("car_with_trailer"),
        footprint=(Box([4.2, 1.8], [1.2, 0.0]),),
        parts={"trailer": (Box([3.2, 1.7], [-0.2, 0.0]),)},
        goal=(24.0, 6.0, 0.3),
        moving_trim="speed 3, hitch 0",
        slow=1.0,
        inertia=True,
    ),
    Vehicle(
        name="rear_steered_car",
        library=_forklift,
        footprint=(Box([2.4, 1.15], [-0.75, 0.0]),),
        goal=(8.0, 2.0, 0.5),
        max_expansions=20_000,  # its tail swings out: past what moves it takes some 4,000
    ),
    Vehicle(
        name="four_wheel_steering_car",
        library=_four_wheels,
        footprint=(Box([1.5, 0.6]),),
        goal=(6.0, 2.0, 0.5),
        max_expansions=20_000,  # of 18 trims
    ),
    Vehicle(
        name="articulated_vehicle",
        library=_stock("articulated_vehicle"),
        footprint=(Box([3.6, 2.8], [0.9, 0.0]),),
        parts={"rear_part": (Box([3.4, 2.7], [-0.3, 0.0]),)},
        goal=(20.0, 5.0, 0.3),
        moving_trim="speed 2, articulation 0",
        inertia=True,
    ),
    Vehicle(
        name="tractor_with_trailers",
        library=_stock("tractor_with_trailers"),
        footprint=(Box([7.0, 2.5], [2.1, 0.0]),),
        parts={"trailer": (Box([3.0, 2.4]),), "trailer_2": (Box([11.0, 2.5], [2.5, 0.0]),)},
        goal=(60.0, 10.0, 0.2),
        moving_trim="speed 2, steering 0",
        inertia=True,
    ),
    Vehicle(
        name="hovercraft",
        library=_stock("hovercraft"),
        footprint=(Box([1.2, 0.8]),),
        goal=(9.0, 3.0, 0.5),
        moving_trim="speed 1.5, turn_rate 0",
        slow=0.75,
        inertia=True,
        reverses=False,
    ),
    Vehicle(
        name="single_track",
        max_expansions=60_000,  # its tightest turn is 50 m wide: the way past a box is long
        library=_stock("single_track"),
        footprint=(Box([4.5, 1.6]),),
        goal=(120.0, 12.0, 0.1),
        moving_trim="speed 25, turn_rate 0",
        slow=15.0,
        end_trim="speed 20, turn_rate 0",
        inertia=True,
        reverses=False,
    ),
    Vehicle(
        name="helicopter",
        library=_stock("helicopter"),
        footprint=(Disc(2.0),),
        goal=(60.0, 15.0, 0.5, 10.0),
        moving_trim="speed 5, turn_rate 0, climb 0",
        slow=5.0,
        inertia=True,
        reverses=False,
        flies=True,
    ),
    Vehicle(
        name="user",
        library=_user,
        footprint=(Box([0.5, 0.3]),),
        goal=(6.0, 1.5, 0.5),
        moving_trim="ahead",
        slow=0.4,
        inertia=True,
    ),
)
VEHICLES: dict[str, Vehicle] = {vehicle.name: vehicle for vehicle in ALL}
