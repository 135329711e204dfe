"""Lie groups that move vehicles: planar poses, planar poses with height, translations, products."""

from maneuver_automaton.groups.families import LieGroup as LieGroup
from maneuver_automaton.groups.families import SE2xR as SE2xR
from maneuver_automaton.groups.families import Translations as Translations
from maneuver_automaton.groups.families import group_of as group_of
from maneuver_automaton.groups.families import product as product
from maneuver_automaton.groups.families import translations as translations
from maneuver_automaton.groups.se2 import SE2 as SE2
