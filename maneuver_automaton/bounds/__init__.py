"""What is certain: poses that collide, and that no plan exists."""

from maneuver_automaton.bounds.cells import CostToGo as CostToGo
from maneuver_automaton.bounds.cells import PoseScene as PoseScene
from maneuver_automaton.bounds.cells import pose_scene as pose_scene
from maneuver_automaton.bounds.families import besides as besides
from maneuver_automaton.bounds.levels import Proof as Proof
from maneuver_automaton.bounds.levels import cell_proofs as cell_proofs
from maneuver_automaton.bounds.separation import Narrowest as Narrowest
from maneuver_automaton.bounds.separation import Reachability as Reachability
from maneuver_automaton.bounds.separation import Separation as Separation
from maneuver_automaton.bounds.separation import are_apart as are_apart
from maneuver_automaton.bounds.separation import connectivity as connectivity
from maneuver_automaton.bounds.separation import free_end as free_end
from maneuver_automaton.bounds.separation import separation as separation
from maneuver_automaton.bounds.separation import widest_path as widest_path
