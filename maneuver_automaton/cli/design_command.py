"""`automaton design`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._arrays import vector_text
from maneuver_automaton.automaton.library import automaton_hash, save_library
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import automaton_of, make_folder, not_written, target
from maneuver_automaton.cli.progress import waiting
from maneuver_automaton.cli.tables import console, table
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.design import DesignedLibrary, WordsProof


def design(
    file: Path, out: Path, *, instead: Mapping[str, float], quiet: bool, plot: bool = False
) -> int:
    """Write the smallest library that a design file asks for, and say what is proven of it.

    Of a library with maneuvers, those are kept whose ends spread best.
    """
    path = target(out, "library.json")
    if file.suffix == ".json":
        return _disperse(file, path, instead=instead, quiet=quiet)
    from maneuver_automaton.scenario.build_file import design_of_file

    make_folder(path.parent)
    with waiting("choosing trims, and proving their factor", quiet=quiet):
        designed = design_of_file(file, instead=instead)
    _save(designed.automaton, path)
    if not quiet:
        _print(path, designed)
    if plot:
        _draw(designed, path.with_suffix(".png"), quiet=quiet)
    if not designed.holds:
        remedy = "allow longer words (max_trims)"
        if designed.any_length > designed.within:
            remedy = "allow more trims (most), or more candidates"
        complain(
            f"{file}: asked for a factor within {designed.within:g}, proven is "
            f"{designed.factor:.4g}: {remedy}"
        )
    return FOUND if designed.holds else NO_PLAN


def _disperse(file: Path, path: Path, *, instead: Mapping[str, float], quiet: bool) -> int:
    """The library of a library file, with fewer maneuvers."""
    from maneuver_automaton.design import disperse_library

    others = [key for key in instead if key != "most"]
    if others or "most" not in instead:
        raise InvalidScenario(
            f"{file}: of a library with maneuvers --most says how many are kept, and nothing else; "
            "a factor is proven for the trims of a build file with the key design"
        )
    library = automaton_of(file)
    make_folder(path.parent)
    try:
        with waiting("choosing maneuvers", quiet=quiet):
            done = disperse_library(library, most=int(instead["most"]))
    except ValueError as error:
        raise InvalidScenario(f"{file}: {error}") from error
    _save(done.automaton, path)
    if not quiet:
        console().print(
            f"{path}: {len(done.automaton.maneuvers)} of {done.maneuvers} maneuvers, hash "
            f"{automaton_hash(done.automaton)}\n  dispersion {done.dispersion:.4g} m, at "
            f"{done.farthest}; no choice of as many has less than {done.at_least:.4g} m",
            soft_wrap=True,
        )
    return FOUND


def _save(automaton: Automaton, path: Path) -> None:
    try:
        save_library(automaton, path)
    except OSError as error:
        raise not_written(path, error) from error


def _draw(designed: DesignedLibrary, path: Path, *, quiet: bool) -> None:
    """The factor over the goals; without short words it is the same everywhere, and not drawn."""
    if designed.words is None:
        complain(f"{path}: not drawn: the factor of words of any length is one for all goals")
        return
    from maneuver_automaton import plotting
    from maneuver_automaton.cli.pictures import skip_documentation

    skip_documentation()
    try:
        plotting.save_factor_figure(designed.words, path)
    except OSError as error:
        raise not_written(path, error) from error
    if not quiet:
        console().print(str(path), soft_wrap=True)


def _print(path: Path, designed: DesignedLibrary) -> None:
    out, size = console(), len(designed.automaton)
    rows = [
        [str(trims), f"{factor:.6g}", "this one" if trims == size else ""]
        for trims, factor in designed.by_size
    ]
    columns = ["trims", "factor, words of any length", ""]
    out.print(table(designed.automaton.name, columns, rows, numbers=(0, 1)))
    chosen = [
        [str(k + 1), trim.name, vector_text(trim.body_velocity)]
        for k, trim in enumerate(designed.automaton.trims)
    ]
    out.print(table("", ["", "trim", "twist [m/s, m/s, rad/s]"], chosen, numbers=(0,)))
    for line in _lines(designed):
        out.print(f"  {line}", soft_wrap=True)
    out.print(
        f"{path}: {size} of {designed.candidates} candidates, "
        f"hash {automaton_hash(designed.automaton)}",
        soft_wrap=True,
    )


def _lines(designed: DesignedLibrary) -> list[str]:
    """What is proven, in words."""
    everywhere = f"words of any length: factor {designed.any_length:.6g}, every start and goal"
    if designed.any_length > 1.0:
        everywhere += f"; {designed.hardest} loses most"
    return [everywhere] if designed.words is None else [everywhere, *_of_words(designed.words)]


def _of_words(proof: WordsProof) -> list[str]:
    """The same of short words."""
    return [
        f"words of at most {proof.max_trims} trims: factor {proof.factor:.6g} proven "
        f"on {proof.boxes} boxes of goals, {proof.sampled:.6g} met at {vector_text(proof.worst)}",
        f"goals within {proof.radius:.6g} m, at all headings, to which the shortest path is at "
        f"least {proof.least:.6g} m long",
    ]
