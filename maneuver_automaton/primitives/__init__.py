"""Motion primitives: trims, which last as long as one likes, and maneuvers, which do not."""

from maneuver_automaton.primitives.bang_bang import bang_bang as bang_bang
from maneuver_automaton.primitives.bang_bang import connect_bang_bang as connect_bang_bang
from maneuver_automaton.primitives.driving import drive as drive
from maneuver_automaton.primitives.driving import drive_all as drive_all
from maneuver_automaton.primitives.equilibrium import FoundTrims as FoundTrims
from maneuver_automaton.primitives.equilibrium import MissingTrim as MissingTrim
from maneuver_automaton.primitives.equilibrium import trims_of as trims_of
from maneuver_automaton.primitives.maneuver import Maneuver as Maneuver
from maneuver_automaton.primitives.mirror import Mirror as Mirror
from maneuver_automaton.primitives.mirror import mirror_of as mirror_of
from maneuver_automaton.primitives.resimulation import maneuver_defect as maneuver_defect
from maneuver_automaton.primitives.strokes import Ramp as Ramp
from maneuver_automaton.primitives.strokes import ramp_of as ramp_of
from maneuver_automaton.primitives.strokes import strokes as strokes
from maneuver_automaton.primitives.strokes import turns as turns
from maneuver_automaton.primitives.trajectory import Trajectory as Trajectory
from maneuver_automaton.primitives.trim import Trim as Trim
