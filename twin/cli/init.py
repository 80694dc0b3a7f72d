"""`isel-twin init`: a folder to begin with, in which everything passes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.files import create
from isel_twin.cli import options
from isel_twin.core.spec import MACHINE, TwinSpec

# files of twin/cli/starter, and where they go
FILES = {
    "plate.nc": "jobs/plate.nc",
    "hood.toml": "hood.toml",
    "isel-twin.toml": "isel-twin.toml",
    "pytest.ini": "pytest.ini",
    "test_machine.py": "test_machine.py",
    "motion.yml": ".github/workflows/motion.yml",
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
    from isel_twin.controller import offers
    from isel_twin.language import HasExample, create_language

    with call_errors():
        language = create_language(controller)
    if not offers(language, HasExample):
        raise CallError(f"{controller}: its language has no job to begin with (HasExample)")
    example = language.example()
    square = f"jobs/square{example.suffix}"
    words = {"controller": controller, "machine": example.machine, "square": Path(square).name}
    texts = {square: example.text} | {into: _text(source, words) for source, into in FILES.items()}
    there = [name for name in texts if (folder / name).exists()]
    if there:
        raise CallError(f"{folder / there[0]}: exists already; name a folder without it, isel-twin init FOLDER")
    _write(folder, texts)
    called = "" if controller == TwinSpec.controller else f" --controller {controller}"
    called += "" if example.machine == MACHINE else f" --machine {example.machine}"
    print(f"{len(texts)} files in {folder.resolve()}: " + ", ".join(texts))
    print("there:" if folder == Path() else f"go there (cd {folder}), then:")
    for command, purpose in (
        (f"isel-twin run {square}{called}", "a job of the controller, and its verdict"),
        (f"isel-twin run jobs/plate.nc{called}", "a file of a CAM program"),
        (f"isel-twin run {square}{called} --scenario hood.toml", "the same with the hood forced open: fails"),
        ("isel-twin check", "all jobs, by the bounds of isel-twin.toml"),
        ("python -m pytest", "the tests of test_machine.py (pip install pytest)"),
    ):
        print(f"    {command}\n        {purpose}")
    return 0


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    """Write all of the files, or leave nothing. Raises CallError."""
    with ExitStack() as undoing:
        for name, text in texts.items():
            path = folder / name
            with call_errors(path):
                for above in reversed(path.parents):
                    if not above.exists():
                        above.mkdir()
                        undoing.callback(above.rmdir)
                with create(path) as file:
                    undoing.callback(path.unlink)
                    file.write(text.encode())
        undoing.pop_all()


def _text(source: str, words: dict[str, str]) -> str:
    """A file of twin/cli/starter with its $words."""
    return Template(files("isel_twin.cli").joinpath("starter", source).read_text(encoding="utf-8")).substitute(words)
