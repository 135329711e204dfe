"""Where the benchmark data from outside the project lie, if they are there."""

from __future__ import annotations

from pathlib import Path

import pytest

DATA = (Path(__file__).parents[2] / "../shared/data").resolve()
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the benchmark data are not here")


def message_of(read, path, content, **options):
    """What a reader says of a file with this content, without the name of the file."""
    from maneuver_automaton.errors import InvalidScenario

    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InvalidScenario) as error:
        read(path, **options)
    said = str(error.value)
    assert said.startswith(str(path))
    assert "\n" not in said
    return said.removeprefix(str(path))
