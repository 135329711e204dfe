"""What a design file asks for, beside the candidates."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge
from pydantic import AllowInfNan, Field, Strict

from maneuver_automaton.scenario.checks import Count, Need, Number, Part, Positive, Several
from maneuver_automaton.scenario.schema import CostPart

Factor = Annotated[float, Strict(), AllowInfNan(False), Ge(1), Need("a factor of at least 1")]
_THREE = Several("a pose [x, y, heading], three numbers", at_least=3, at_most=3)
_Pose = Annotated[tuple[Number, Number, Number], _THREE]
_TWO = Several("a task [start, goal], two poses", at_least=2, at_most=2)
_Task = Annotated[tuple[_Pose, _Pose], _TWO]


class DesignPart(Part):
    """How the trims of a library are chosen from the candidates; see `design_library`."""

    cost: CostPart = Field(
        default_factory=lambda: CostPart(length=1.0), description="as in a scenario; its length"
    )
    within: Factor = Field(1.05, description="how much costlier words may be than all candidates'")
    most: Count = Field(24, description="trims that the library may have")
    max_trims: Count | None = Field(None, description="of a word, at least 3; left out: any number")
    radius_m: Positive | None = Field(None, description="of the disc of goals; with max_trims")
    tasks: (
        Annotated[tuple[_Task, ...], Several("a list of tasks [start, goal]", at_least=1)] | None
    ) = Field(None, description="starts and goals that are to be among them")
    least_m: Positive | None = Field(
        None, description="goals whose shortest path is shorter do not count"
    )
    tolerance: Positive = Field(0.01, description="between what is proven and what is met")
