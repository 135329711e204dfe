"""The features of the matrix, topic by topic: each plans with and without the feature.

The effect is measured outside of the package.
"""

from __future__ import annotations

from tests.matrix.features import (
    answers,
    closed_loops,
    costs,
    ends,
    files,
    free_space,
    heights,
    obstacles,
    on_the_way,
    places,
    planner,
    polishing,
    states,
    symmetry,
)
from tests.matrix.rows import Feature

TOPICS = (
    free_space,
    files,
    obstacles,
    ends,
    costs,
    answers,
    planner,
    symmetry,
    closed_loops,
    polishing,
    heights,
    places,
    on_the_way,
    states,
)
FEATURES = {  # in the order of the table's rows
    row.name: row for topic in TOPICS for row in vars(topic).values() if isinstance(row, Feature)
}
