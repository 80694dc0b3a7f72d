"""`isel-twin init`: a folder to begin with, in which everything passes."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options
from isel_twin.core.spec import MACHINE, TwinSpec

# controller: its job in twin/cli/starter, and the machine that it drives
_IMC = ("square.imc.txt", MACHINE)
SQUARES = {
    "imc-s8": _IMC,
    "imc-m": _IMC,
    "imc-mp": _IMC,
    "c142": _IMC,
    "ismif": ("square.ismif.txt", MACHINE),
    "gmi99": ("square.gmi99.txt", "4030-servo"),
    "bwo900": ("square.bwo900.nc", "4030-servo"),
}


def init(
    folder: Annotated[Path, Parameter(help="Made if there is none.")] = Path(),
    /,
    *,
    controller: options.ControllerName = TwinSpec.controller,
) -> int:
    """Begin a project: a job, a part of a CAM program, a scenario, bounds, tests and a file for CI, all of which pass.

    Nothing is replaced: if one of the files exists, none is written.
    """
    made = dict(_files(controller))
    there = [name for name in made if (folder / name).exists()]
    if there:
        raise CallError(f"{folder / there[0]}: exists already; name a folder without it, isel-twin init FOLDER")
    for name, text in made.items():
        path = folder / name
        with call_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
    square, machine = next(iter(made)), SQUARES[controller][1]
    called = "" if controller == TwinSpec.controller else f" --controller {controller}"
    called += "" if machine == MACHINE else f" --machine {machine}"
    print(f"{len(made)} files in {folder.resolve()}: " + ", ".join(made))
    print("there:")
    for command, purpose in (
        (f"isel-twin run {square}{called}", "a job of the controller, and its verdict"),
        (f"isel-twin run jobs/plate.nc{called}", "a file of a CAM program"),
        (f"isel-twin run {square}{called} --scenario hood.toml", "the same with the hood forced open: fails"),
        ("isel-twin check jobs/*", "all jobs, by the bounds of isel-twin.toml"),
        ("python -m pytest", "the tests of test_machine.py (pip install pytest)"),
    ):
        print(f"    {command}\n        {purpose}")
    return 0


def _files(controller: str) -> Iterator[tuple[str, str]]:
    """Names of the files in the folder, and their texts."""
    if controller not in SQUARES:
        raise CallError(f"{controller}: no files to begin with; there are some for {', '.join(SQUARES)}")
    square, machine = SQUARES[controller]
    name = f"square{Path(square).suffix}"
    words = {"controller": controller, "machine": machine, "square": name}
    for source, into in {
        square: f"jobs/{name}",
        "plate.nc": "jobs/plate.nc",
        "hood.toml": "hood.toml",
        "isel-twin.toml": "isel-twin.toml",
        "pytest.ini": "pytest.ini",
        "test_machine.py": "test_machine.py",
        "motion.yml": ".github/workflows/motion.yml",
    }.items():
        text = files("isel_twin.cli").joinpath("starter", source).read_text(encoding="utf-8")
        yield into, Template(text).substitute(words) if "$" in text and source != square else text
