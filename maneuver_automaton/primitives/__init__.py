"""Motion primitives: trims, which last as long as one likes, and maneuvers, which do not."""

from maneuver_automaton.primitives.closed_form import bang_bang as bang_bang
from maneuver_automaton.primitives.closed_form import connect_bang_bang as connect_bang_bang
from maneuver_automaton.primitives.closed_form import from_rest as from_rest
from maneuver_automaton.primitives.connecting import maneuver_defect as maneuver_defect
from maneuver_automaton.primitives.driving import drive as drive
from maneuver_automaton.primitives.driving import drive_all as drive_all
from maneuver_automaton.primitives.equilibrium import FoundTrims as FoundTrims
from maneuver_automaton.primitives.equilibrium import MissingTrim as MissingTrim
from maneuver_automaton.primitives.equilibrium import trims_of as trims_of
from maneuver_automaton.primitives.primitive import Maneuver as Maneuver
from maneuver_automaton.primitives.primitive import Trajectory as Trajectory
from maneuver_automaton.primitives.primitive import Trim as Trim
from maneuver_automaton.primitives.symmetry import Mirror as Mirror
from maneuver_automaton.primitives.symmetry import mirror_of as mirror_of
