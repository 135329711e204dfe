"""Libraries made to measure: the fewest trims that lose no more than a factor, with its proof."""

from maneuver_automaton.design.choice import mixing_costs as mixing_costs
from maneuver_automaton.design.dispersing import DispersedLibrary as DispersedLibrary
from maneuver_automaton.design.dispersing import disperse_library as disperse_library
from maneuver_automaton.design.library_design import DesignedLibrary as DesignedLibrary
from maneuver_automaton.design.library_design import design_library as design_library
from maneuver_automaton.design.proof import WordsProof as WordsProof
from maneuver_automaton.design.proof import word_lengths as word_lengths
from maneuver_automaton.words.shortest import reeds_shepp_length as reeds_shepp_length
