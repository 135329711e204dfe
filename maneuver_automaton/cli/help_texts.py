"""What stands at the end of every ``--help``: exit codes, and examples that run."""

from __future__ import annotations

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
