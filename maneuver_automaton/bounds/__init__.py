"""What is certain: poses that collide, parts of a scene that are not connected."""

from maneuver_automaton.bounds.certified import cell_proofs as cell_proofs
from maneuver_automaton.bounds.levels import Proof as Proof
from maneuver_automaton.bounds.pose_scene import PoseScene as PoseScene
from maneuver_automaton.bounds.pose_scene import pose_scene as pose_scene
