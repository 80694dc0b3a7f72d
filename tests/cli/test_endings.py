"""The ending of a name decides what is written, or the name is refused: one rule for every file that a command writes.

The options are those that the commands declare. One that names a file must say what it writes (`options.written`), or
stand in READ.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest

from isel_twin.cli import main
from isel_twin.cli.options import OF_ONE_KIND, Ending
from tests.cli.test_vocabulary import COMMANDS

pytestmark = pytest.mark.long(seconds=4)

READ = {  # by any command; what is written of them is the controller's memory, and what `init` and `experiment` name
    *("--scenario", "--settings", "--flash", "--token-file", "--password-file", "--certificates", "--known"),
    *("--measured", "--score", "--ini"),
    *("A", "B", "CAPTURE", "FILE", "JOB", "JOBS", "PLAN", "RECORDING", "RECORDINGS", "--source", "FOLDER", "NAME"),
}
WORDS = {"golden-record", "golden-compare", "plc-assemble", "plc-disassemble", "plc-explain", "plc-load"}
BEGINS = {
    **{".html": b"<!DOCTYPE html>", ".htm": b"<!DOCTYPE html>", ".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"},
    **{".npz": b"PK", ".vcd": b"$", ".parquet": b"PAR1", ".csv": b"time_ns", ".mcap": b"\x89MCAP0"},
}


def arguments() -> Iterator[tuple[str, str, Any]]:
    for command, collection in COMMANDS.items():
        for argument in collection:
            kinds = [argument.hint, *get_args(argument.hint)]
            kinds += [part for kind in kinds for part in get_args(kind)]
            if Path in kinds or ending(argument) is not None:  # the latter: or a URL
                yield command, argument.name, argument


def ending(argument: Any) -> Ending | None:
    return next((each for each in argument.parameter.validator if isinstance(each, Ending)), None)


WRITTEN = [(command, name, of) for command, name, argument in arguments() if (of := ending(argument)) is not None]


def ended(*words: object) -> int:
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    assert isinstance(caught.value.code, int)
    return caught.value.code


def call(command: str, name: str, value: str) -> list[str]:
    """The words of a call that names this file, and `x` for what must be there beside it."""
    words = command.split("-", 1) if command in WORDS else [command]
    if not name.startswith("-"):
        return [*words, *(["x"] if command == "export" else []), value]
    return [*words, *([] if command in ("serve", "doctor") else ["x"]), f"{name}={value}"]


@pytest.mark.parametrize(("command", "name", "argument"), list(arguments()))
def test_an_option_that_names_a_file_says_what_it_writes(command: str, name: str, argument: Any) -> None:
    assert (ending(argument) is not None) != (name in READ), command


@pytest.mark.parametrize(("command", "name", "of"), WRITTEN)
def test_another_ending_is_refused_in_a_line_before_anything_is_done(
    command: str, name: str, of: Ending, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    for kind in sorted({*OF_ONE_KIND, ".PDF", *([".xyz"] if of.kinds else [])} - set(of.kinds)):
        if kind.lower() in of.kinds:
            continue
        assert ended(*call(command, name, f"out{kind}")) == 2
        told = capsys.readouterr().err
        option = f"{name} " if name.startswith("-") else ""
        why = "the name must end in" if of.kinds else f"no {kind.lower()} is written here"
        assert told.startswith(f"isel-twin: {option}out{kind}: {why}")
        assert told.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "kind"),
    [(name, kind) for command, name, of in WRITTEN if command == "run" for kind in (*of.kinds, of.kinds[0].upper())],
)
def test_what_a_run_writes_is_what_its_name_says(name: str, kind: str, tmp_path: Path) -> None:
    job, out = tmp_path / "job.txt", tmp_path / f"out{kind}"
    job.write_text("@07\n")
    assert ended("run", job, "--plant", "kinematic", name, out) == 0
    assert out.read_bytes().startswith(BEGINS[kind.lower()])


@pytest.mark.parametrize("kind", [".png", ".svg", ".pdf", ".PDF"])
def test_so_is_a_picture(kind: str, tmp_path: Path) -> None:
    out = tmp_path / f"out{kind}"
    assert ended("motor", "23HS32-4004S", "--picture", out) == 0
    assert out.read_bytes().startswith(BEGINS[kind.lower()])
