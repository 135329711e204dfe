"""What a fleet's loop knows from step to step."""

from __future__ import annotations

from dataclasses import dataclass, field

from maneuver_automaton.fleet.agreement import Knowledge
from maneuver_automaton.fleet.asking import Workers
from maneuver_automaton.fleet.conflicts import Course
from maneuver_automaton.fleet.guarantees import Gap
from maneuver_automaton.fleet.log import FleetStep
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.vehicle import Found, Vehicle

FADES, MORE = 0.97, 1.15  # of the time that is kept for the end of a step
AT_FIRST, MOST_KEPT = 0.5, 0.6  # shares of a step's limit

Around = tuple[int, int, int]  # how many are there, and how often plans were exchanged


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoopSettings:
    """How a fleet's loop is closed."""

    step: float  # delta [s]
    margin: float  # that another plan costs less
    tube_m: float
    time_limit: float  # [s] per step
    swaps_per_step: int | None
    at_once: int
    group_size: int
    delay_steps: int


@dataclass(slots=True, eq=False)
class LoopState:
    """What a fleet's loop knows from step to step; vehicles by number."""

    fleet: FleetProblem
    settings: LoopSettings
    vehicles: list[Vehicle]
    agreement: Knowledge
    first: dict[int, Found]  # plans for those that enter
    held: dict[int, Found] = field(default_factory=dict)
    arrived: set[int] = field(default_factory=set)
    broken: set[int] = field(default_factory=set)
    versions: dict[int, int] = field(default_factory=dict)  # how often a plan was exchanged
    # Plans are the same as long as they are only driven, or rejoined at nearly the same cost.
    lineage: dict[int, int] = field(default_factory=dict)
    settled: dict[int, int] = field(default_factory=dict)  # no plan alone is cheaper than this one
    in_vain: dict[int, Around] = field(default_factory=dict)  # past these nothing was found
    attempts: dict[int, int] = field(default_factory=dict)  # in vain, since its last exchange
    gains: dict[int, float] = field(default_factory=dict)  # what the way alone would have saved
    due: dict[int, tuple[int, Found, Found]] = field(default_factory=dict)  # when, what, for what
    workers: Workers | None = None
    silent: set[int] = field(default_factory=set)  # whose workers do not answer any more
    stopped: dict[int, Found] = field(default_factory=dict)  # what was left of their void plans
    crossing: set[tuple[int, int]] = field(default_factory=set)  # whose plans are not apart
    assigned: set[int] = field(default_factory=set)  # who got another problem since the last step
    proven: dict[int, Course] = field(default_factory=dict)  # apart from all, and free
    gap: Gap | None = None  # that was proven in the last step
    kept_s: float = field(init=False)  # of a step's limit for what follows its searches
    last: FleetStep | None = None

    def __post_init__(self) -> None:
        self.kept_s = AT_FIRST * self.settings.time_limit

    def note_end(self, seconds: float) -> None:
        """A step took so much longer than its searches might [s]: that is kept in the next ones.

        As much as the last steps took, and a little more; at most a share of the limit.
        """
        kept = max(FADES * self.kept_s, MORE * seconds)
        self.kept_s = min(kept, MOST_KEPT * self.settings.time_limit)
