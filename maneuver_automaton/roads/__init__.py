"""Driving on roads: lanelets, recorded traffic, goals with a time window."""

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.roads.driving import RoadDrive as RoadDrive
    from maneuver_automaton.roads.driving import RoadPlanResult as RoadPlanResult
    from maneuver_automaton.roads.driving import RoadStep as RoadStep
    from maneuver_automaton.roads.driving import drive_road as drive_road
    from maneuver_automaton.roads.driving import drive_scene as drive_scene
    from maneuver_automaton.roads.driving import plan_before as plan_before
    from maneuver_automaton.roads.driving import plan_road as plan_road
    from maneuver_automaton.roads.lanelets import Lanelet as Lanelet
    from maneuver_automaton.roads.lanelets import drivable_area as drivable_area
    from maneuver_automaton.roads.planner import RoadPlanner as RoadPlanner
    from maneuver_automaton.roads.planner import road_planner as road_planner
    from maneuver_automaton.roads.plans import RoadDecision as RoadDecision
    from maneuver_automaton.roads.plans import RoadSettings as RoadSettings
    from maneuver_automaton.roads.rules import RoadVerdict as RoadVerdict
    from maneuver_automaton.roads.rules import judged as judged
    from maneuver_automaton.roads.scene import GoalRegion as GoalRegion
    from maneuver_automaton.roads.scene import RoadBenchmark as RoadBenchmark
    from maneuver_automaton.roads.scene import RoadScene as RoadScene
    from maneuver_automaton.roads.scene import RoadStart as RoadStart
    from maneuver_automaton.roads.several import RoadFleetDrive as RoadFleetDrive
    from maneuver_automaton.roads.several import RoadFleetResult as RoadFleetResult
    from maneuver_automaton.roads.several import drive_roads as drive_roads
    from maneuver_automaton.roads.several import plan_roads as plan_roads
    from maneuver_automaton.roads.vehicle import RoadVehicle as RoadVehicle

__getattr__, __dir__ = lazily(__name__)
