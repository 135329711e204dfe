"""`convert`, `plot`, `schema`: from one file to another, without planning."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.cli.guard import FOUND
from maneuver_automaton.cli.inputs import (
    SCENARIO_ENDINGS,
    make_folder,
    not_written,
    refuse_other_format,
    scenario_of,
)
from maneuver_automaton.errors import InvalidScenario

PICTURE_ENDINGS = (".png", ".pdf", ".svg")
ANIMATION_ENDINGS = (".gif",)


def convert(source: Path, target: Path) -> int:
    """Write a scenario again, its trims listed."""
    from maneuver_automaton.scenario import to_yaml

    refuse_other_format(source)
    refuse_other_format(target)
    if target.suffix.lower() not in SCENARIO_ENDINGS:
        raise InvalidScenario(
            f"{target}: is in no format that this version writes, need a scenario file "
            f"({', '.join(SCENARIO_ENDINGS)})"
        )
    try:
        text = to_yaml(scenario_of(source))
    except ValueError as error:
        raise InvalidScenario(f"{source}: {str(error).removeprefix(f'{source}: ')}") from error
    make_folder(target.parent)
    try:
        write_text_atomically(target, text)
    except OSError as error:
        raise not_written(target, error) from error
    return FOUND


def plot(file: Path, out: Path | None, *, animate: bool) -> int:
    """Draw a plan.json again, still or in motion."""
    from maneuver_automaton.formats.plan_json import load_plan, read_plan_document

    document = read_plan_document(file)
    endings = ANIMATION_ENDINGS if animate else PICTURE_ENDINGS
    path = file.with_suffix(endings[0]) if out is None else out
    if path.is_dir():
        path = path / file.with_suffix(endings[0]).name
    if path.suffix.lower() not in endings:
        what = "animation" if animate else "picture"
        raise InvalidScenario(
            f"{path}: is no {what} that this version draws, need an ending of {', '.join(endings)}"
        )
    make_folder(path.parent)
    from maneuver_automaton import plotting

    try:
        if animate:
            plotting.save_plan_animation(load_plan(file), path)
        else:
            plotting.save_plan_file_figure(document, path)
    except OSError as error:
        raise not_written(path, error) from error
    except (KeyError, ValueError, TypeError, IndexError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{file}: {said}") from error
    return FOUND


def print_schema() -> int:
    """Print the JSON Schema of scenario files."""
    from maneuver_automaton.scenario import json_schema

    sys.stdout.write(json.dumps(json_schema(), indent=2) + "\n")
    return FOUND
