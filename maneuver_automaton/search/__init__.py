"""Search over the words of an automaton."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.search.choose import search_insertion as search_insertion
    from maneuver_automaton.search.result import SearchResult as SearchResult
    from maneuver_automaton.search.result import SearchStatus as SearchStatus
    from maneuver_automaton.search.words import search_words as search_words

__getattr__, __dir__ = lazily(__name__)
