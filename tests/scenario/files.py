"""A scenario for tests, and how to change it."""

from __future__ import annotations

SCENARIO = """\
schema: 1
name: A case
vehicle: {model: unicycle}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [1.0, 0.0]}
    - {name: spin, control: [0.0, 1.0]}
start: {pose: [0.0, 0.0, 0.0]}
goal: {pose: [1.0, 1.0, 0.0]}
cost: {effort: 1.0}
horizon: {time_s: free, max_trims: 4}
search: {time_limit_s: 5.0}
"""

TRIMS = SCENARIO[SCENARIO.index("  trims:") : SCENARIO.index("start:")]


def but(old: str, new: str) -> str:
    """The scenario with one passage changed."""
    assert SCENARIO.count(old) == 1, f"{old!r} stands {SCENARIO.count(old)} times"
    return SCENARIO.replace(old, new)


def automaton(text: str) -> str:
    """The scenario with another automaton."""
    return SCENARIO.replace(TRIMS, f"  {text}\n")


def grid(axes: str) -> str:
    """The scenario over a grid of controls."""
    return automaton(f"grid: {{control: {axes}}}")
