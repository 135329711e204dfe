"""Every kind of result with all that is done with results, see `tests.matrix.kinds`."""

from __future__ import annotations

import pytest

from tests.matrix.kinds import ACTIONS, KINDS, NOT_YET, SENSELESS, Refused
from tests.search.cases import compiled_only

pytestmark = compiled_only
QUICK = {  # the others are slow
    "show in a notebook": ("plan", "fleet", "statistics"),
    "film": ("plan",),
    "row of a folder": ("closed loop", "road fleet"),
}


def _cells():
    for kind in KINDS:
        for action in ACTIONS:
            marks = [] if kind in QUICK.get(action, KINDS) else [pytest.mark.slow]
            if (kind, action) in NOT_YET:
                marks.append(pytest.mark.skip(reason=NOT_YET[kind, action]))
            yield pytest.param(kind, action, id=f"{kind}-{action}", marks=marks)


@pytest.mark.filterwarnings("ignore")  # of libraries that write
@pytest.mark.parametrize(("kind", "action"), list(_cells()))
def test_an_action_works_for_a_kind(kind, action):
    if (kind, action) not in SENSELESS:
        ACTIONS[action](kind)
        return
    with pytest.raises(Refused) as error:
        ACTIONS[action](kind)
    assert str(error.value).strip().count("\n") == 0


def test_what_is_listed_is_a_cell():
    assert {*SENSELESS, *NOT_YET} <= {(kind, action) for kind in KINDS for action in ACTIONS}
    assert not {*SENSELESS} & {*NOT_YET}
