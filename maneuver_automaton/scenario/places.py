"""Places of a scenario file in what constructors refuse."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.yaml_source import Document, Where


@contextlib.contextmanager
def at(document: Document, where: Where) -> Iterator[None]:
    """Give what a constructor refuses the file, line and field it comes from."""
    try:
        yield
    except InvalidScenario:
        raise
    except (ValueError, LookupError) as error:
        said = str(error)
        for step in where:
            said = said.removeprefix(f"{step}: ").removeprefix(f"{step} ")
        raise document.error(where, said) from error
