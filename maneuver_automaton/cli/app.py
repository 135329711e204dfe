"""The commands and their options. Nothing heavy is imported before a command runs."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, complain, exits
from maneuver_automaton.cli.streams import safe_streams

STOPPED = "130 interrupted (the best so far is written)"
BAD = "2 bad input (one line says which)"
CODES = {
    "plan": f"0 a plan was found and audited, 1 no plan (one line says why), {BAD}, {STOPPED}; "
    "of several vehicles: 0 all have plans, 1 some not; "
    "of a folder: 0 all found, 1 some not, 2 some file bad",
    "mpc": f"0 the goal was reached, 1 not, or a collision, {BAD}, {STOPPED}; "
    "of several vehicles: 0 all arrived but those that broke down, and no guarantee was broken",
    "cover": f"0 the field is covered and the plan audited, 1 no plan (one line says why), {BAD}",
    "check": f"0 all holds, 1 something does not, {BAD}",
    "automaton build": f"0 all maneuvers were found, 1 some not, {BAD}, "
    "130 interrupted (called again, it goes on)",
    "automaton design": f"0 the factor is proven, 1 a greater one is, {BAD}",
    "plain": f"0 done, {BAD}",
}
EXAMPLES = {
    "": (
        "maneuver-automaton example parking",
        "maneuver-automaton plan parking.yaml",
        "maneuver-automaton --install-completion",
    ),
    "plan": (
        "maneuver-automaton plan scenarios/parking.yaml",
        "maneuver-automaton plan scenarios/car_slot.yaml --gap 0.1 --time-limit 20",
        "maneuver-automaton plan scenarios --out out --jobs 2",
        "maneuver-automaton plan scenarios/fleets/car_park.yaml",
        "maneuver-automaton plan Case1.csv --with scenarios/tpcap.yaml",
    ),
    "mpc": (
        "maneuver-automaton mpc scenarios/parking_loop.yaml",
        "maneuver-automaton mpc scenarios/parking_noise.yaml --seeds 20 --jobs 2",
        "maneuver-automaton mpc scenarios --jobs 2",
        "maneuver-automaton mpc scenarios/fleets/depot_loop.yaml --animate",
    ),
    "cover": (
        "maneuver-automaton cover scenarios/fields/meadow.yaml",
        "maneuver-automaton cover field.geojson --with tractor.yaml --width 4.5",
    ),
    "check": (
        "maneuver-automaton check scenarios/parking.yaml",
        "maneuver-automaton check out/plan.json --with scenarios/parking.yaml",
    ),
    "automaton": ("maneuver-automaton automaton show scenarios/parking.yaml",),
    "automaton build": (
        "maneuver-automaton automaton build scenarios/grid_1681.yaml --out grid.json",
        "maneuver-automaton automaton build hovercraft.yaml --out hovercraft.json --jobs 2",
    ),
    "automaton design": (
        "maneuver-automaton automaton design docs/howto/city_car.yaml --out city_car.json",
        "maneuver-automaton automaton design second_order_car.json --most 150 --out small.json",
    ),
    "automaton show": ("maneuver-automaton automaton show scenarios/parking.yaml --coverage",),
    "automaton draw": ("maneuver-automaton automaton draw scenarios/parking.yaml --out trims.pdf",),
    "cache": ("maneuver-automaton cache show",),
    "cache show": ("maneuver-automaton cache show",),
    "cache clear": ("maneuver-automaton cache clear",),
    "compile": ("maneuver-automaton compile --jobs 4",),
    "convert": (
        "maneuver-automaton convert scenarios/maps/warehouse.yaml warehouse.map",
        "maneuver-automaton convert scenarios/car_slot.yaml listed.yaml",
        "maneuver-automaton convert unicycle.mprim library.json",
    ),
    "example": ("maneuver-automaton example", "maneuver-automaton example warehouse --out hall/"),
    "export": (
        "maneuver-automaton export out/plan.json --to csv --step 0.1",
        "maneuver-automaton export out/plan.json --to geojson --with parking.yaml",
        "maneuver-automaton export out/closed_loop.json --to ros2 --with loop.yaml",
    ),
    "plot": (
        "maneuver-automaton plot out/plan.json --out plan.pdf",
        "maneuver-automaton plot out/plan.json --html --with scenarios/parking.yaml",
        "maneuver-automaton plot out/closed_loop.json --with parking_loop.yaml",
    ),
    "schema": (
        "maneuver-automaton schema > scenario.schema.json",
        "maneuver-automaton schema --document plan > plan.schema.json",
    ),
}


def ending(command: str) -> str:
    """The end of the help of a command, as click lays it out."""
    codes = CODES.get(command, CODES["plain"])
    lines = "\n".join(f"  {example}" for example in EXAMPLES[command])
    return f"Exit codes: {codes}.\n\n\b\nExamples:\n{lines}"


PRINTED = (["schema"],)  # commands that do nothing but print
KINDS: dict[str, Any] = {  # of values, by what stands for them; of others a text
    **dict.fromkeys(("DIR", "FILE", "FIELD", "LOG", "IN", "OUT", "PLAN.json"), Path),
    **dict.fromkeys(("S", "M", "R", "T", "HZ", "SHARE"), float),
    **dict.fromkeys(("N", "K"), int),
    "": bool,
}
NEEDED = inspect.Parameter.empty


class OptionEntry(NamedTuple):
    """An argument or option of commands: its flags, what stands for its value, what it is."""

    flags: str  # none: an argument
    stands: str  # empty: the option itself says it
    said: str
    default: Any  # None: it may be left out
    more: Mapping[str, Any]

    def parameter(self, name: str) -> inspect.Parameter:
        """What Typer makes an argument or an option of."""
        make: Callable[..., Any] = typer.Option if self.flags else typer.Argument
        keywords = {"metavar": self.stands or None, "help": self.said or None, **self.more}
        kind = KINDS.get(self.stands, str)
        return inspect.Parameter(
            name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=self.default,
            annotation=Annotated[
                kind | None if self.default is None else kind, make(*self.flags.split(), **keywords)
            ],
        )


def option(flags: str, stands: str, said: str, default: Any = None, **more: Any) -> OptionEntry:
    """An option with a value."""
    return OptionEntry(flags, stands, said, default, more)


def argument(stands: str, said: str = "", default: Any = NEEDED) -> OptionEntry:
    """An argument."""
    return OptionEntry("", stands, said, default, {})


def flag(flags: str, said: str, *, default: bool = False) -> OptionEntry:
    """An option without a value."""
    return OptionEntry(flags, "", said, default, {})


OUT, RESULT = Path("out"), "Of plan, or a closed_loop.json of mpc."
TABLE = {
    "file": argument("FILE", "Scenario (YAML), or another format."),
    "field": argument("FIELD", "A scenario with `field` (YAML), or GeoJSON."),
    "library": argument("FILE", "Scenario or library file."),
    "build_file": argument("FILE", "Build file with design, or library."),
    "result": argument("PLAN.json", RESULT),
    "source": argument("IN"),
    "target": argument("OUT"),
    "name": argument("NAME", "Of a scenario; left out, all are listed.", default=None),
    "out": option("--out -o", "DIR", "Folder for the results.", default=OUT),
    "picture": option("--out", "FILE", "The picture."),
    "exported": option("--out -o", "FILE", "The file, or the folder of a bag."),
    "copy": option("--out -o", "FILE", "File or folder (default: NAME.yaml)."),
    "time_limit": option("--time-limit", "S", "Upper bound for search and refinement [s]."),
    "turn_limit": option("--time-limit", "S", "For each turn [s]; left out: 1."),
    "gap": option(
        "--gap",
        "SHARE",
        "Stop once no plan is proven to be cheaper by more than this share (0.05: 5 %).",
    ),
    "alternatives": option(
        "--alternatives", "K", "Costlier plans to list as well.", default=0, min=0
    ),
    "steps": option("--steps", "N", "Steps at most (default: the scenario's).", min=1),
    "seed": option("--seed", "N", "Seed of the disturbance.", min=0),
    "seeds": option("--seeds", "K", "Statistics over K seeds instead of one loop.", min=1),
    "resume": option("--resume", "LOG", "Go on from a closed_loop.json."),
    "leave": flag("--leave", "Leave a start in contact first, by the shortest coast."),
    "leaves": flag("--leave", "The plan of one vehicle leaves a start in contact."),
    "plot": flag("--plot/--no-plot", "Draw the plan.", default=True),
    "factor": flag("--plot", "Draw the factor over the goals, with --max-trims."),
    "title": option("--title", "TEXT", "Of the pictures (default: scenario's name)."),
    "size": option("--size", "WxH", "Of the main picture [in]: 7x4, or 3.5."),
    "style": option("--style", "NAME", "screen, or paper: no numbers above.", default="screen"),
    "animate": flag("--animate", "Animate it as well (plan: GIF; mpc: GIF and HTML)."),
    "html": flag("--html", "Write a page that plays it: one file, no network."),
    "quiet": flag("--quiet", "Print nothing but errors."),
    "as_json": flag("--json", "Print what is written, as JSON; the table goes to stderr."),
    "jobs": option(
        "--jobs",
        "N",
        "Files (of a folder), seeds, or searches for a fleet at a time.",
        default=1,
        min=1,
    ),
    "turns": option("--jobs", "N", "Turns that are planned at a time.", default=1, min=1),
    "solved": option("--jobs", "N", "Maneuvers solved at a time.", default=1, min=1),
    "processes": option("--jobs", "N", "Processes; by default one a core, 2 GB each.", min=1),
    "dask": option("--dask", "ADDRESS", "Dask scheduler for files, seeds or a fleet, or local."),
    "dask_build": option("--dask", "ADDRESS", "Dask scheduler for them, or local."),
    "beside": option("--with", "FILE", "Scenario for what FILE leaves out, such as the vehicle."),
    "world": option("--with", "FILE", "Scenario: its body, obstacles and goals."),
    "driven_in": option("--with", "FILE", "Scenario that was planned or driven."),
    "model": option(
        "--model", "MODULE:OBJECT", "Your own vehicle, for files that cannot state it."
    ),
    "case": option("--case", "N", "Which problem of FILE, from 0.", min=0),
    "width": option("--width", "M", "Working width [m]."),
    "headland": option("--headland", "M", "Of the strip to turn in [m]."),
    "corner": option("--origin", "LAT,LON", "Of the point 0, 0 [deg], for the GeoJSON written."),
    "origin": option(
        "--origin",
        "LAT,LON",
        "Of the point 0, 0 [deg]: longitudes and latitudes as well (csv), or instead of metres "
        "(geojson); x is east.",
    ),
    "within": option("--within", "T", "Factor that words may be costlier.", min=1.0),
    "most": option("--most", "N", "Trims (or maneuvers) of it.", min=1),
    "max_trims": option("--max-trims", "N", "Trims of a word.", min=3),
    "radius": option("--radius", "R", "Of the disc of goals [m]."),
    "coverage": flag("--coverage", "How well its words cover the poses around, by samples."),
    "to": option(
        "--to", "FORMAT", "commonroad, csv, geojson, rerun or ros2 (a bag).", default=NEEDED
    ),
    "step": option("--step", "S", "Time between rows [s] (csv, rerun, ros2)."),
    "rate": option("--rate", "HZ", "Rows per second, instead of --step."),
    "document": option(
        "--document",
        "KIND",
        "Of a result file: plan, loop, statistics, fleet, fleet-loop, road-plan, drive, road-fleet "
        "or road-fleet-drive.",
    ),
}
LOOK = "title size style"

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Exact motion planning with symmetry: trims, maneuvers, and the words that join them.",
    epilog=ending(""),
)
GROUPS = {"": app}
for group, said in {
    "automaton": "Make, list or draw a library of trims.",
    "cache": "List or clear what is kept on disk.",
}.items():
    GROUPS[group] = typer.Typer(
        no_args_is_help=True, rich_markup_mode=None, help=said, epilog=ending(group)
    )
    app.add_typer(GROUPS[group], name=group)


class Command(NamedTuple):
    """A command: what does it, the entries of the table that it has, and what it is for."""

    work: str  # FILE.FUNCTION of this folder, which takes the entries by name
    known: str  # an entry that the command knows by another name is NAME:ENTRY
    said: str


COMMANDS = {
    "cache show": Command(
        "file_commands.show_cache",
        "",
        "List what is kept on disk to be quicker the next time: compiled kernels, tables.",
    ),
    "cache clear": Command(
        "file_commands.clear_cache", "", "Remove it; it is made again when it is needed."
    ),
    "compile": Command(
        "file_commands.compile_all",
        "jobs:processes",
        "Compile all kernels now; an installation that is not editable brings those of first "
        "plans.",
    ),
    "plan": Command(
        "jobs.plan",
        "file out time_limit alternatives plot animate quiet jobs beside case model gap "
        f"{LOOK} html scheduler:dask leave as_json",
        "Plan the problem of a file, or of every file of a folder.\n\n"
        "A folder that was interrupted goes on where it was when the same command is called again.",
    ),
    "cover": Command(
        "cover_command.cover_file",
        "file:field out beside width_m:width headland_m:headland origin:corner "
        "time_limit:turn_limit plot quiet jobs:turns model as_json",
        "Cover a field in swaths, with turns inside its headland, as one plan.\n\n"
        "Writes plan.json, field.png and field.geojson.",
    ),
    "mpc": Command(
        "jobs.mpc",
        "file steps seed out time_limit gap alternatives plot animate quiet jobs beside case seeds "
        f"scheduler:dask resume model {LOOK} html as_json",
        "Drive a scenario, or every one of a folder, in closed loop: plan, drive a step, plan "
        "again.\n\n"
        "A folder that was interrupted goes on where it was when the same command is called again.",
    ),
    "check": Command(
        "check_command.check_file",
        "file beside case model leave:leaves",
        "Report symmetry, consistency and feasibility, without a plan.\n\n"
        "FILE may be a plan.json: its plans are proven again, in the world of the file that they "
        "were planned from, which is that of --with or, of several vehicles, the one that they "
        "name. So is what was driven in a closed_loop.json, of one vehicle or several, on roads "
        "too.",
    ),
    "automaton build": Command(
        "automaton_command.build",
        "file:library out quiet jobs:solved scheduler:dask_build",
        "Write the library of a scenario, or of a build file, as a file.\n\n"
        "It is DIR/library.json, or DIR itself if it ends in .json. A build that was killed goes "
        "on where it was when it is called again.",
    ),
    "automaton design": Command(
        "automaton_command.design",
        "file:build_file out quiet plot:factor within most max_trims radius_m:radius",
        "Write the smallest library whose words lose no more than a factor, which is proven.\n\n"
        "It is DIR/library.json, or DIR itself if it ends in .json. The options hold instead of "
        "what the file says. Of a library with maneuvers, the --most are kept whose ends are "
        "spread best.",
    ),
    "automaton show": Command(
        "automaton_command.show",
        "file:library coverage model",
        "List the trims and maneuvers of a scenario, a library or another file of primitives.",
    ),
    "automaton draw": Command(
        "automaton_command.draw",
        f"file:library out model {LOOK}",
        "Draw the trims and maneuvers of a scenario, a library or another file of primitives.\n\n"
        "The picture is DIR/automaton.png, or DIR itself if it ends in .png, .pdf or .svg; that of "
        "the maneuvers stands beside it, its name ending in _maneuvers.",
    ),
    "convert": Command(
        "file_commands.convert",
        "source target beside case",
        "Write a problem as a scenario, its trims listed, or a map or primitives in another "
        "format.\n\n"
        "OUT ends in .yaml or .yml, or, for a map, in .map (MovingAI). A map without --with "
        "becomes a Nav2 map: OUT and an image beside it. Primitives end in .json (a library), "
        ".nav2.json (Nav2), .mprim (SBPL) or .xml (CommonRoad); IN is one of these, a scenario, or "
        "a folder or .zip exported by AROC.",
    ),
    "example": Command(
        "file_commands.example",
        "name out:copy",
        "Write one of the scenarios that come with the package, with its maps, or list them.",
    ),
    "plot": Command(
        "result_commands.plot",
        f"file:result out:picture animate {LOOK} html beside:world",
        "Draw a plan.json, or a closed_loop.json, again: PLAN.png beside it, or the file "
        "given.\n\n"
        "With --animate it is an animation, PLAN.gif; with --html a page that plays it, PLAN.html. "
        "These files state neither body nor obstacles: --with its scenario, all is drawn as plan "
        "and mpc do. A closed loop alone is drawn as an arc from step to step.",
    ),
    "export": Command(
        "result_commands.export",
        "file:result kind:to out:exported beside:driven_in case model step rate origin",
        "Write a plan.json, or a closed_loop.json, for another program.\n\n"
        "It goes to PLAN.csv, PLAN.geojson, PLAN.rrd, PLAN_ros2 or PLAN_commonroad.xml beside it, "
        "or to the file given. --with its scenario it holds the body and what is around it; a "
        "closed loop and a solution for CommonRoad need that.",
    ),
    "schema": Command(
        "file_commands.print_schema",
        "document",
        "Print the JSON Schema of scenario files, for editors, or of a file that is written.",
    ),
}
TOGETHER = {  # arguments that travel as one value of `inputs`, made where the last is given
    "parts": ("Parts", "case"),
    "look": ("LookOptions", "title"),
    "options": ("Options", "gap"),
}


def _register(name: str, command: Command) -> None:
    """Have Typer know a command; what does it is loaded when it is called."""
    words = (word.partition(":") for word in command.known.split())
    parameters = [TABLE[entry or word].parameter(word) for word, _, entry in words]

    @exits
    def run(**given: Any) -> int:
        home, _, function = command.work.partition(".")
        module = importlib.import_module(f"{__package__}.{home}")
        for group, (kind, mark) in TOGETHER.items():
            if mark in given:
                value = getattr(importlib.import_module(f"{__package__}.inputs"), kind)
                keys = [one.name for one in dataclasses.fields(value) if one.name in given]
                given[group] = value(**{key: given.pop(key) for key in keys})
        code: int = getattr(module, function)(**given)
        return code

    vars(run)["__signature__"] = inspect.Signature(parameters)
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    group, _, last = name.rpartition(" ")
    GROUPS[group].command(last, help=command.said, epilog=ending(name))(run)


for name, command in COMMANDS.items():
    _register(name, command)


def run(argv: list[str]) -> int:
    """Run the command line with the arguments `argv`, and return the exit code."""
    with safe_streams() as (out, _):
        try:
            app(args=argv, prog_name="maneuver-automaton")
            code = 0
        except SystemExit as done:
            code = done.code if isinstance(done.code, int) else int(done.code is not None)
        out.flush()
        if out.failure is not None and not isinstance(out.failure, BrokenPipeError):
            complain(f"standard output: cannot be written: {out.failure.strerror or out.failure}")
            if code == FOUND and argv[:1] in PRINTED:
                code = BAD_INPUT  # there is no other output
    return code


def _version(asked: bool) -> None:
    if asked:
        from maneuver_automaton import __version__

        typer.echo(f"maneuver-automaton {__version__}")
        raise typer.Exit


@app.callback()
def every_command(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options before the name of a command."""
