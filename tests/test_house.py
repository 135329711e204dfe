"""The package stays one that a stranger can carry on: its sizes and seams, held under ceilings.

The ceilings stand in ``[tool.house]`` of pyproject.toml, and only fall: a change that lowers a
figure lowers its ceiling, and one that would raise it deletes something first. The figures of
today, as they stand there: `python -m tests.test_house`.
"""

from __future__ import annotations

import ast
import collections
import functools
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "maneuver_automaton"
MOST_FIELDS = 15  # of a record
FEW_LINES = 6  # of a function with one caller, which may stand where it is called
WHAT_TO_DO = {
    "records_above_15_fields": "nest what changes together into a record of its own",
    "class_names_with_several_homes": "give one of the two another name: one name, one thing",
    "imports_within_functions": "import at the top; only heavy libraries are loaded where used",
    "files_with_type_checking": "import from the bottom of the room, so that no circle comes up",
    "one_use_functions": f"inline functions of {FEW_LINES} lines or fewer that have one caller",
    "lines": "delete something first: the whole package only shrinks, but for what is new to users",
    "files": "merge files that are one idea; a file below 120 lines is earned",
}


@functools.cache
def trees() -> dict[Path, ast.Module]:
    return {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
        if "compiled" not in path.parts
    }


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else "top"


def statements_in(node: ast.AST) -> Iterator[ast.AST]:
    """What is directly within a node, without expressions, of which there are many."""
    return (one for one in ast.iter_child_nodes(node) if not isinstance(one, ast.expr))


def all_statements(tree: ast.AST) -> Iterator[ast.AST]:
    for child in statements_in(tree):
        yield child
        yield from all_statements(child)


def imports_of(tree: ast.AST) -> Iterator[tuple[str, bool]]:
    """Modules that a file imports, for types alone too, and whether within a function."""

    def walk(node: ast.AST, *, within: bool) -> Iterator[tuple[str, bool]]:
        for child in statements_in(node):
            if isinstance(child, ast.ImportFrom) and child.module:
                yield from ((f"{child.module}.{one.name}", within) for one in child.names)
            elif isinstance(child, ast.Import):
                yield from ((one.name, within) for one in child.names)
            inner = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            yield from walk(child, within=within or inner)

    return walk(tree, within=False)


def circles() -> list[list[str]]:
    """Files that import each other round about."""
    homes = {name_of(path): path for path in trees()}
    graph = nx.DiGraph()
    for path, tree in trees().items():
        names = [name for name, _ in imports_of(tree)]
        names += re.findall(r'import_module\(\s*"([\w.]+)"', path.read_text(encoding="utf-8"))
        for name in names:
            home = name if name in homes else name.rpartition(".")[0]
            if home in homes and home != name_of(path):
                graph.add_edge(name_of(path), home)
    return [sorted(one) for one in nx.strongly_connected_components(graph) if len(one) > 1]


def classes() -> Iterator[tuple[Path, ast.ClassDef]]:
    for path, tree in trees().items():
        yield from ((path, node) for node in all_statements(tree) if isinstance(node, ast.ClassDef))


def is_record(node: ast.ClassDef) -> bool:
    made = [*node.bases, *node.decorator_list]
    return any(re.search(r"NamedTuple|dataclass", ast.unparse(one)) for one in made)


def large_records() -> list[str]:
    fields = {
        f"{node.name} in {path.relative_to(ROOT)}": sum(
            isinstance(one, ast.AnnAssign) for one in node.body
        )
        for path, node in classes()
        if is_record(node)
    }
    return [f"{name}: {count} fields" for name, count in fields.items() if count > MOST_FIELDS]


def homonyms() -> list[str]:
    homes = collections.defaultdict(set)
    for path, node in classes():
        homes[node.name].add(str(path.relative_to(PACKAGE)))
    return [f"{name}: {', '.join(sorted(at))}" for name, at in homes.items() if len(at) > 1]


def late_imports() -> list[str]:
    return [
        f"{path.relative_to(ROOT)}: {name}"
        for path, tree in trees().items()
        for name, within in imports_of(tree)
        if within and name.startswith("maneuver_automaton")
    ]


def one_use_functions() -> list[str]:
    """Short functions whose name stands in one place beside its definition."""
    used: collections.Counter[str] = collections.Counter()
    short = {}
    for path, tree in trees().items():
        used.update(re.findall(r"\w+", path.read_text(encoding="utf-8")))
        for node in all_statements(tree):
            if not isinstance(node, ast.FunctionDef) or node.decorator_list:
                continue
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0
            if node.name.startswith("_") and not node.name.endswith("_") and lines <= FEW_LINES:
                short[node.name] = f"{path.relative_to(ROOT)}: {node.name}"
    return [place for name, place in short.items() if used[name] == 2]


@functools.cache
def figures() -> dict[str, int]:
    texts = {path: path.read_text(encoding="utf-8") for path in trees()}
    return {
        "lines": sum(text.count("\n") for text in texts.values()),
        "files": len(texts),
        "records_above_15_fields": len(large_records()),
        "class_names_with_several_homes": len(homonyms()),
        "imports_within_functions": len(late_imports()),
        "files_with_type_checking": sum("if TYPE_CHECKING" in text for text in texts.values()),
        "one_use_functions": len(one_use_functions()),
    }


def rooms() -> dict[str, int]:
    lines: collections.Counter[str] = collections.Counter()
    for path in trees():
        lines[room_of(path)] += path.read_text(encoding="utf-8").count("\n")
    return dict(sorted(lines.items()))


def ceilings() -> dict[str, int | dict[str, int]]:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    stated: dict[str, int | dict[str, int]] = settings["tool"]["house"]
    return stated


def test_no_file_imports_itself_round_about():
    """Nor for types alone, nor by text."""
    assert len(circles()) <= ceilings()["circles"], circles()


@pytest.mark.parametrize("figure", [*WHAT_TO_DO])
def test_no_figure_rises(figure):
    found, most = figures()[figure], ceilings()[figure]
    listed = {
        "records_above_15_fields": large_records,
        "class_names_with_several_homes": homonyms,
        "imports_within_functions": late_imports,
        "one_use_functions": one_use_functions,
    }.get(figure, list)()
    assert found <= most, f"{found} {figure}, at most {most}: {WHAT_TO_DO[figure]}; {listed}"


def test_no_room_grows():
    most = ceilings()["rooms"]
    grown = {room: lines for room, lines in rooms().items() if lines > most.get(room, 0)}
    assert not grown, f"lines of rooms above their ceilings: {grown}; delete something first"


def test_ceilings_follow_what_was_won():
    """A ceiling far above its figure would let it rise unseen."""
    most = ceilings()["rooms"]
    slack = {room: lines for room, lines in rooms().items() if lines < 0.9 * most[room]}
    assert not slack, f"lower the ceilings of {slack}: python -m tests.test_house prints them"
    assert set(most) == set(rooms())


if __name__ == "__main__":
    print("[tool.house]")  # noqa: T201
    print(f"circles = {len(circles())}")  # noqa: T201
    for name, value in figures().items():
        print(f"{name} = {value}")  # noqa: T201
    print("\n[tool.house.rooms]  # lines")  # noqa: T201
    for name, value in rooms().items():
        print(f"{name} = {value}")  # noqa: T201
