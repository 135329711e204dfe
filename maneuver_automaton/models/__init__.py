"""Vehicles: how a reduced state and a control become a body velocity."""

from maneuver_automaton.models.axles import ArticulatedVehicle as ArticulatedVehicle
from maneuver_automaton.models.axles import FourWheelSteeringCar as FourWheelSteeringCar
from maneuver_automaton.models.axles import RearSteeredCar as RearSteeredCar
from maneuver_automaton.models.cars import AcceleratingCar as AcceleratingCar
from maneuver_automaton.models.cars import Car as Car
from maneuver_automaton.models.cars import CarWithTrailer as CarWithTrailer
from maneuver_automaton.models.cars import SecondOrderCar as SecondOrderCar
from maneuver_automaton.models.cars import TractorWithTrailers as TractorWithTrailers
from maneuver_automaton.models.dynamic import Helicopter as Helicopter
from maneuver_automaton.models.dynamic import Hovercraft as Hovercraft
from maneuver_automaton.models.dynamic import SingleTrack as SingleTrack
from maneuver_automaton.models.in_world import InWorld as InWorld
from maneuver_automaton.models.in_world import as_stated as as_stated
from maneuver_automaton.models.in_world import in_world as in_world
from maneuver_automaton.models.model import Model as Model
from maneuver_automaton.models.model import OnLattice as OnLattice
from maneuver_automaton.models.model import OnlyTranslated as OnlyTranslated
from maneuver_automaton.models.robots import LatticeBody as LatticeBody
from maneuver_automaton.models.robots import Omnidirectional as Omnidirectional
from maneuver_automaton.models.robots import (
    SecondOrderUnicycle as SecondOrderUnicycle,
)
from maneuver_automaton.models.robots import Unicycle as Unicycle
from maneuver_automaton.models.state import VectorField as VectorField
from maneuver_automaton.models.state import equivariance_defect as equivariance_defect
from maneuver_automaton.models.state import moved_rates as moved_rates
from maneuver_automaton.models.state import moved_state as moved_state
from maneuver_automaton.models.state import rollout as rollout
from maneuver_automaton.models.state import vector_field as vector_field
from maneuver_automaton.models.user import UserModel as UserModel
from maneuver_automaton.models.user import model_of_vector_field as model_of_vector_field
