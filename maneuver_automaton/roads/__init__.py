"""Driving on roads: lanelets, recorded traffic, goals with a time window."""

from maneuver_automaton.roads.goal_region import GoalRegion as GoalRegion
from maneuver_automaton.roads.lanelets import Lanelet as Lanelet
from maneuver_automaton.roads.lanelets import drivable_area as drivable_area
from maneuver_automaton.roads.lanelets import off_road as off_road
from maneuver_automaton.roads.scene import RoadScene as RoadScene
from maneuver_automaton.roads.scene import RoadStart as RoadStart
