"""What is given to the wrong controller, or is no job at all: one line that names it, and what to type."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.controller import offers
from isel_twin.jobs.foreign import check_controller
from isel_twin.jobs.job import JobError
from isel_twin.language import HasExample, create_language, language_names
from tests.in_process import isel_twin

JOBS = {"imc-s8": "@07\n@0R7\n", "ismif": "#E1,400\nL1,X3000<1>\n", "gmi99": "Q7;1\nf2000\n81h 9000\n"}
SERVO = {"gmi99", "bwo900"}


def why(text: str, controller: str) -> str:
    """What is wrong with it; "" if it is a job for this controller."""
    try:
        check_controller(text, create_language(controller), controller)
    except JobError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("controller", [*JOBS, "bwo900"])
@pytest.mark.parametrize("whose", JOBS)
def test_each_job_is_known_by_its_own_controller_and_named_by_all_others(whose: str, controller: str) -> None:
    for text in (JOBS[whose], f"# a remark before it\n{JOBS[whose]}"):
        told = why(text, controller)
        if whose == controller:
            assert told == ""
        else:
            machine = "4030-servo" if whose in SERVO else "4030"
            assert f"not of {controller}: --controller {whose} --machine {machine}" in told
            assert told.startswith("line 1: " if text == JOBS[whose] else "line 2: ")


@pytest.mark.parametrize("controller", JOBS)
def test_a_program_is_named_with_what_to_type(controller: str) -> None:
    told = why("P1\nN10 G90 G0 X10\nN20 M30\n", controller)
    assert told.startswith(
        f"is a program for bwo900, which {controller} cannot run: --controller bwo900 --machine 4030-servo"
    )


def test_the_examples_of_all_controllers_are_their_own() -> None:
    for name in language_names():
        language = create_language(name)
        if offers(language, HasExample):
            assert why(language.example().text, name) == ""


@pytest.mark.parametrize("controller", JOBS)
@pytest.mark.parametrize("text", ["x\n", "Dear Sir,\nwe are sorry to say\n", "1;2;3\n4;5;6\n"])
def test_text_for_people_is_no_job(text: str, controller: str) -> None:
    first = text.splitlines()[0]
    assert why(text, controller).startswith(f"line 1: {first!r} is no command of {controller}")
    assert why(f"# sent as it is\n{text}", controller) == ""
    assert why(f"{text}again => 5\n", controller) == ""


@pytest.mark.parametrize("controller", [*JOBS, "bwo900"])
def test_remarks_alone_are_named(controller: str) -> None:
    assert why("(a tool)\n; another\n", controller) == "there are only remarks in it"


@pytest.mark.parametrize("controller", JOBS)
def test_bytes_pauses_and_one_known_command_make_it_a_job(controller: str) -> None:
    """Wrong commands of the own controller are findings of their lines, not of the file."""
    assert why("<64>07<13>\n<0.5s>\n<253>\n", controller) == ""
    assert why(f"x\n{JOBS[controller]}", controller) == ""


@pytest.mark.parametrize("words", [("run",), ("check",), ("golden", "record"), ("tune",)], ids=" ".join)
def test_every_command_refuses_it_before_anything_moves(words: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "job.txt"
    for text in (JOBS["gmi99"], '{"a": 1}\n', "hello\n", ""):
        file.write_text(text)
        done = isel_twin(*words, file)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(f"isel-twin: {file}: ")
        assert done.stderr.count("\n") == 1
    assert [each.name for each in tmp_path.iterdir()] == ["job.txt"]


@pytest.mark.parametrize(
    ("text", "what"), [("G21 G90\nG1 X1 F60\nM2\n", "is G-code"), (JOBS["gmi99"], "is a command of gmi99")]
)
def test_decode_says_what_it_is_and_makes_no_file_of_it(text: str, what: str, tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text(text)
    explained, made = isel_twin("decode", file), isel_twin("decode", file, "--to", "gcode")
    assert (explained.returncode, made.returncode, made.stdout) == (0, 2, "")
    for done in (explained, made):
        assert what in done.stderr
        assert done.stderr.count("\n") == 1
