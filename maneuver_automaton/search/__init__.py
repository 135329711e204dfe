"""Search over the words of an automaton."""
