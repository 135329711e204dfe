"""Motion planning with symmetry: trims, maneuvers, and the words that join a start to a goal.

>>> import maneuver_automaton as ma
>>> robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
>>> problem = ma.Problem(robot, [0, 0, 0], [1, 0, 0], cost=ma.Cost(effort=1.0))
>>> ma.plan(problem).plan.word
('ahead',)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from maneuver_automaton import _display
from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton import plotting as plotting
    from maneuver_automaton.automaton import Automaton as Automaton
    from maneuver_automaton.automaton import Plan as Plan
    from maneuver_automaton.automaton.building import build_library as build_library
    from maneuver_automaton.automaton.library import load_library as load_library
    from maneuver_automaton.automaton.library import load_stock_library as load_stock_library
    from maneuver_automaton.automaton.library import save_library as save_library
    from maneuver_automaton.collision import Box as Box
    from maneuver_automaton.collision import Disc as Disc
    from maneuver_automaton.collision import Motion as Motion
    from maneuver_automaton.collision import Obstacle as Obstacle
    from maneuver_automaton.collision import OccupancyMap as OccupancyMap
    from maneuver_automaton.collision import Polygon as Polygon
    from maneuver_automaton.collision import Zone as Zone
    from maneuver_automaton.costs import Cost as Cost
    from maneuver_automaton.design import DesignedLibrary as DesignedLibrary
    from maneuver_automaton.design import DispersedLibrary as DispersedLibrary
    from maneuver_automaton.design import design_library as design_library
    from maneuver_automaton.design import disperse_library as disperse_library
    from maneuver_automaton.exports import ros_messages as ros_messages
    from maneuver_automaton.exports import save_commonroad_solution as save_commonroad_solution
    from maneuver_automaton.exports import save_csv as save_csv
    from maneuver_automaton.exports import save_geojson as save_geojson
    from maneuver_automaton.exports import save_rerun as save_rerun
    from maneuver_automaton.exports import save_ros2_bag as save_ros2_bag
    from maneuver_automaton.field import FieldProblem as FieldProblem
    from maneuver_automaton.field import FieldResult as FieldResult
    from maneuver_automaton.field import cover as cover
    from maneuver_automaton.fleet import DaskWorkers as DaskWorkers
    from maneuver_automaton.fleet import FleetHorizon as FleetHorizon
    from maneuver_automaton.fleet import FleetLog as FleetLog
    from maneuver_automaton.fleet import FleetProblem as FleetProblem
    from maneuver_automaton.fleet import FleetResult as FleetResult
    from maneuver_automaton.fleet import plan_fleet as plan_fleet
    from maneuver_automaton.fleet import simulate_fleet as simulate_fleet
    from maneuver_automaton.fleet import verify_driven as verify_driven
    from maneuver_automaton.fleet import verify_fleet as verify_fleet
    from maneuver_automaton.formats.fleet_json import save_fleet as save_fleet
    from maneuver_automaton.formats.plan_json import load_plan as load_plan
    from maneuver_automaton.formats.plan_json import load_plans as load_plans
    from maneuver_automaton.formats.plan_json import save_plan as save_plan
    from maneuver_automaton.formats.registry import load_map as load_map
    from maneuver_automaton.groups import SE2 as SE2
    from maneuver_automaton.groups import SE2xR as SE2xR
    from maneuver_automaton.groups import translations as translations
    from maneuver_automaton.models import ArticulatedVehicle as ArticulatedVehicle
    from maneuver_automaton.models import Car as Car
    from maneuver_automaton.models import CarWithTrailer as CarWithTrailer
    from maneuver_automaton.models import FourWheelSteeringCar as FourWheelSteeringCar
    from maneuver_automaton.models import Helicopter as Helicopter
    from maneuver_automaton.models import Hovercraft as Hovercraft
    from maneuver_automaton.models import Omnidirectional as Omnidirectional
    from maneuver_automaton.models import RearSteeredCar as RearSteeredCar
    from maneuver_automaton.models import SecondOrderCar as SecondOrderCar
    from maneuver_automaton.models import SecondOrderUnicycle as SecondOrderUnicycle
    from maneuver_automaton.models import SingleTrack as SingleTrack
    from maneuver_automaton.models import TractorWithTrailers as TractorWithTrailers
    from maneuver_automaton.models import Unicycle as Unicycle
    from maneuver_automaton.models import UserModel as UserModel
    from maneuver_automaton.places import Clearance as Clearance
    from maneuver_automaton.places import Ground as Ground
    from maneuver_automaton.places import PlaceCost as PlaceCost
    from maneuver_automaton.planning import LowerBound as LowerBound
    from maneuver_automaton.planning import Planner as Planner
    from maneuver_automaton.planning import PlanResult as PlanResult
    from maneuver_automaton.planning import PlanStatus as PlanStatus
    from maneuver_automaton.planning import plan_many as plan_many
    from maneuver_automaton.planning import plans as plans
    from maneuver_automaton.planning.lower_bound import lower_bound as lower_bound
    from maneuver_automaton.planning.plan import plan as plan
    from maneuver_automaton.planning.verdict import Verdict as Verdict
    from maneuver_automaton.planning.verdict import verify as verify
    from maneuver_automaton.primitives import Maneuver as Maneuver
    from maneuver_automaton.primitives import Trajectory as Trajectory
    from maneuver_automaton.primitives import Trim as Trim
    from maneuver_automaton.primitives import trims_of as trims_of
    from maneuver_automaton.problem import Bounds as Bounds
    from maneuver_automaton.problem import Goal as Goal
    from maneuver_automaton.problem import Horizon as Horizon
    from maneuver_automaton.problem import Problem as Problem
    from maneuver_automaton.problem import SearchSettings as SearchSettings
    from maneuver_automaton.problem import Via as Via
    from maneuver_automaton.receding_horizon import Disturbance as Disturbance
    from maneuver_automaton.receding_horizon import RecedingHorizon as RecedingHorizon
    from maneuver_automaton.receding_horizon import simulate as simulate
    from maneuver_automaton.roads import RoadScene as RoadScene
    from maneuver_automaton.roads import RoadVehicle as RoadVehicle
    from maneuver_automaton.roads import drive_road as drive_road
    from maneuver_automaton.roads import drive_roads as drive_roads
    from maneuver_automaton.roads import plan_road as plan_road
    from maneuver_automaton.roads import plan_roads as plan_roads
    from maneuver_automaton.scenario import FleetScenario as FleetScenario
    from maneuver_automaton.scenario import RoadScenario as RoadScenario
    from maneuver_automaton.scenario import Scenario as Scenario
    from maneuver_automaton.scenario import load_scenario as load_scenario

__version__ = "0.1.0"

__getattr__, __dir__ = lazily(__name__)
__all__ = [name for name in __dir__() if not name.startswith("__")]

_display.register(lambda: importlib.import_module("maneuver_automaton.plotting.player"))
