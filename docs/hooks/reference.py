"""The reference: keys from the schema of scenario files, names and options from the package.

The tables of keys, options and names are kept in their pages: ``python docs/measure.py tables``
writes them. The site has a page of docstrings beside for every topic of the public names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import typer

import maneuver_automaton as ma
from maneuver_automaton.cli.app import app
from maneuver_automaton.formats.documents import KINDS, schema_of
from maneuver_automaton.scenario import json_schema

TOPICS = {  # rooms of the package
    "Planning": ("planning", "field"),
    "Problems and costs": ("problem", "costs", "places", "via"),
    "Vehicles": ("models",),
    "Libraries and plans": ("automaton", "primitives", "groups", "design"),
    "Bodies and obstacles": ("collision",),
    "Closed loop": ("receding_horizon",),
    "Several vehicles": ("fleet",),
    "Roads": ("roads",),
    "Files and other programs": ("scenario", "formats", "exports"),
}
WHOLE = {  # documents that are parts of others, by their sections
    "PlanDocument": "plan",
    "RoadPlanDocument": "road-plan",
    "DriveDocument": "drive",
}
PICTURES = "Pictures"
NAMES = "reference/python.md"


def on_files(files: Any, *, config: Any) -> Any:
    """The files of the site, with a page of docstrings for every topic."""
    from mkdocs.structure.files import File

    for title, values in topics().items():
        text = "\n\n".join([f"# {title}", *(f"::: {path_of(one)}" for one in values.values())])
        files.append(File.generated(config, page_of(title), content=text))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """The text of a page; in the site, the names of the reference lead to their docstrings."""
    if page.file.src_uri != NAMES:
        return markdown
    for title, values in topics().items():
        there = page_of(title).removeprefix("reference/")
        markdown = markdown.replace(f"## {title}\n", f"## [{title}]({there})\n")
        for name, value in values.items():
            linked = f"| [`{name}`]({there}#{path_of(value)}) |"
            markdown = markdown.replace(f"| `{name}` |", linked)
    return markdown


def topics() -> dict[str, dict[str, Any]]:
    """The public names of every topic, and what they are."""
    found: dict[str, dict[str, Any]] = {title: {} for title in TOPICS}
    at_home = {room: title for title, rooms in TOPICS.items() for room in rooms}
    for name in sorted(set(ma.__all__) - {"plotting"}, key=str.lower):
        value = getattr(ma, name)
        found[at_home[value.__module__.split(".")[1]]][name] = value
    found[PICTURES] = {f"plotting.{name}": getattr(ma.plotting, name) for name in drawing()}
    return found


def page_of(title: str) -> str:
    """The page of a topic, by its name in the site."""
    return f"reference/python/{title.lower().replace(' ', '_')}.md"


def names() -> str:
    """A table for every topic, with the first sentence of each docstring."""
    return "\n\n".join(
        f"## {title}\n\n| name | |\n| --- | --- |\n"
        + "\n".join(f"| `{name}` | {first_sentence(value)} |" for name, value in values.items())
        for title, values in topics().items()
    )


def first_sentence(value: Any) -> str:
    """What a name is, for a cell of a table."""
    return cell((value.__doc__ or "").strip().split("\n\n")[0].replace("``", "`"))


def drawing() -> list[str]:
    """Functions of `ma.plotting` that draw on axes or write a file."""
    return [name for name in dir(ma.plotting) if name.startswith(("draw_", "figure_", "save_"))]


def path_of(value: Any) -> str:
    """Where a value is at home."""
    return f"{value.__module__}.{value.__qualname__}"


def keys() -> str:
    """A table of keys for every part of a scenario file."""
    schema = json_schema()
    parts = {"The file": schema, **dict(sorted(schema["$defs"].items()))}
    return "\n\n".join(
        section(title, part) for title, part in parts.items() if "properties" in part
    )


def documents() -> str:
    """A table of keys for every kind of result file, and for each of their parts once."""
    wholes, parts = {}, {}
    for name in KINDS:
        schema = schema_of(name)
        wholes[name] = schema
        parts |= schema.get("$defs", {})
    inner = {title: part for title, part in sorted(parts.items()) if title.endswith("Entry")}
    inner["Piece"] = parts["Piece"]
    return "\n\n".join(stated(title, part) for title, part in (wholes | inner).items())


def stated(title: str, part: Mapping[str, Any]) -> str:
    """The keys of one document, or of a part."""
    rows = [
        f"| `{key}` | {kind(value)} | {meaning(value)} |"
        for key, value in part["properties"].items()
    ]
    head = "| key | value | meaning |\n| --- | --- | --- |"
    return f"## {title}\n\n{part.get('description', '')}\n\n{head}\n" + "\n".join(rows)


def section(title: str, part: Mapping[str, Any]) -> str:
    """The keys of one part."""
    required = set(part.get("required", ()))
    rows = [
        f"| `{key}` | {kind(value)} | {meaning(value)} | {default(key, value, required)} |"
        for key, value in part["properties"].items()
    ]
    head = "| key | value | meaning | default |\n| --- | --- | --- | --- |"
    text = "" if title == "The file" else part.get("description", "")
    return f"## {title.removesuffix('Part')}\n\n{text}\n\n{head}\n" + "\n".join(rows)


def meaning(value: Mapping[str, Any]) -> str:
    """What a key is for."""
    return cell(value.get("description", ""))


def kind(value: Mapping[str, Any]) -> str:
    """What a key may hold, in words."""
    if "$ref" in value:
        name = value["$ref"].rsplit("/", 1)[1]
        title = WHOLE.get(name, name.removesuffix("Part"))
        return f"[{title}](#{title.lower()})"
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return " or ".join(f"`{one}`" for one in value["enum"])
    for union in ("oneOf", "anyOf"):
        if union in value:
            return " or ".join(dict.fromkeys(kind(one) for one in value[union]))
    if value.get("type") == "array":
        items = value.get("prefixItems")
        if items:
            return f"list of {len(items)}: {kind(items[0])}"
        return f"list of: {kind(value.get('items', {}))}"
    if value.get("type") == "object" and value.get("additionalProperties", True) is not True:
        return f"by name: {kind(value['additionalProperties'])}"
    return {"boolean": "true or false", "string": "text"}.get(
        value.get("type", ""), limited(value) or "any"
    )


def limited(value: Mapping[str, Any]) -> str:
    """A number with its limits."""
    limits = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    found = [f"{sign} {value[key]:g}" for key, sign in limits.items() if key in value]
    return " ".join([value.get("type", ""), ", ".join(found)]).strip()


def default(key: str, value: Mapping[str, Any], required: Iterable[str]) -> str:
    """What holds where the key is left out."""
    if key in required:
        return "required"
    return f"`{value['default']}`" if value.get("default") is not None else ""


def cell(text: str) -> str:
    """Text that may stand in a table."""
    for sign, written in (("|", "\\|"), ("<", "&lt;"), ("{", "&#123;"), ("*", "\\*")):
        text = text.replace(sign, written)
    return " ".join(text.split())


def options() -> str:
    """A table of arguments and options for every command."""
    return "\n\n".join(commands("maneuver-automaton", typer.main.get_command(app)))


def commands(path: str, command: Any) -> Iterable[str]:
    """A section for a command, and one for each below it."""
    below = getattr(command, "commands", {})
    if not below:
        rows = [
            f"| `{usage(one)}` | {cell(getattr(one, 'help', None) or '')} |"
            for one in command.params
        ]
        table = "\n".join(["| argument or option | meaning |", "| --- | --- |", *rows])
        yield f"## {path}\n\n{' '.join((command.help or '').split())}\n\n{table}"
    for name, one in below.items():
        if not one.hidden:
            yield from commands(f"{path} {name}", one)


def usage(parameter: Any) -> str:
    """How an argument or option is written."""
    shown = parameter.metavar or parameter.name.upper()
    if parameter.param_type_name == "argument":
        return str(shown)
    flags = ", ".join([*parameter.opts, *parameter.secondary_opts])
    return flags if parameter.is_flag else f"{flags} {shown}"
