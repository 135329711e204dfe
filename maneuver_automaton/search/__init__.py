"""Search over the words of an automaton."""

from maneuver_automaton.search.insertion import search_insertion as search_insertion
from maneuver_automaton.search.result import SearchResult as SearchResult
from maneuver_automaton.search.result import SearchStatus as SearchStatus
from maneuver_automaton.search.words import search_words as search_words
