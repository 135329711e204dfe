"""Motion primitives: trims, which last as long as one likes, and maneuvers, which do not."""

from maneuver_automaton.primitives.driving import drive as drive
from maneuver_automaton.primitives.driving import drive_all as drive_all
from maneuver_automaton.primitives.equilibrium import FoundTrims as FoundTrims
from maneuver_automaton.primitives.equilibrium import MissingTrim as MissingTrim
from maneuver_automaton.primitives.equilibrium import trims_of as trims_of
from maneuver_automaton.primitives.maneuver import Maneuver as Maneuver
from maneuver_automaton.primitives.trajectory import Trajectory as Trajectory
from maneuver_automaton.primitives.trim import Trim as Trim
