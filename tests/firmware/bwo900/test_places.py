"""A program that is refused: the finding names the line of the user's file, whatever stands before it."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.cli.jobs import read_job
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks.job import check_job
from tests.in_process import isel_twin

pytestmark = pytest.mark.long(seconds=4)

SPEC = TwinSpec("4030-servo", "bwo900", "kinematic", start_mm=(1.0, 1.0, 1.0))
CONTROL = ("--controller", "bwo900", "--machine", "4030-servo", "--plant", "kinematic")
GOOD = ["N10 G0 X1", "N20 G1 F100 X2", "N40 M30"]
BAD = {
    "nonsense": "foo bar",
    "number that falls": "N5 X3",
    "number too long": "N12345678901234 X3",
    "line too long": "N30 X3" + " " * 400 + ";",
    "unknown axis": "N30 Q5",
    "unknown function": "N30 G777",
    "not in this twin": "N30 G5 X3",
    "a word of other dialects": "N30 G4 P500",
    "centre": "N30 G2 X9 Y9 I40 J0",
    "syntax": "N30 X(3",
}
BEFORE = {
    "alone": [],
    "blank lines": ["", "", ""],
    "remarks": ["; a remark", "", "%"],
    "a name": ["P7"],
    "a cycle before": ["Z77", "N10 X1", "N20 M17", "#", "", "P7"],
}
AMID = {"straight on": [], "a blank line": [""], "a remark": ["; remark"], "both": ["", "; remark", "", ""]}


def refused(path: Path) -> list[str]:
    """Lines that `check` prints of what is refused."""
    done = isel_twin("check", path, *CONTROL)
    assert done.returncode == 1
    return [row.split(maxsplit=1)[1] for row in done.stdout.splitlines() if row.startswith("  refused")]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("end", ["\n", "\r\n"], ids=["LF", "CRLF"])
def test_each_error_in_its_line(bad: str, end: str, tmp_path: Path) -> None:
    """What stands before it in file and program changes from error to error, so that all are tried with each."""
    for shift, before in enumerate(BEFORE.values()):
        amid = list(AMID.values())[(list(BAD).index(bad) + shift) % len(AMID)]
        lines = [*before, *GOOD[:2], *amid, BAD[bad], GOOD[2]]
        path = tmp_path / "part.nc"
        path.write_bytes(end.join([*lines, ""]).encode())
        report = check_job(path, SPEC, read_job(path, SPEC))
        (place,) = [found.place for found in report.findings if found.rule == "refused"]
        assert place.startswith(f"line {lines.index(BAD[bad]) + 1}, column "), (lines, place)


def test_the_second_of_two_programs(tmp_path: Path) -> None:
    path = tmp_path / "two.nc"
    path.write_text("P1\nN10 G0 X1\nN20 M30\n#\n\nP2\n; remark\nN10 G0 X1\nfoo\nN40 M30\n")
    (found,) = refused(path)
    assert found.startswith("line 9, column 1, ")
    assert "(line 9: 'foo'; a block begins with N or /N)" in found


def test_the_run_says_the_same_line(tmp_path: Path) -> None:
    path = tmp_path / "part.nc"
    path.write_text("\n\nN10 G0 X1\nG1 X3\n")
    assert f"isel-twin: {path}: line 4: M1111" in isel_twin("run", path, *CONTROL).stderr


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("G95 X3", "M1224 P1 N30 column 5: there is no spindle (G95 on a machine without one)"),
        ("G5 X3", "M1232 P1 N30 column 5: not in this twin: G5, rotary axes"),
        ("G4 P500", "P500 without ':' or a comparison: here P is a parameter"),
        ("M98 P100", "P100 without ':' or a comparison: here P is a parameter"),
    ],
)
def test_a_refusal_in_plain_words(block: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "part.nc"
    path.write_text("\n".join([*GOOD[:2], f"N30 {block}", GOOD[2], ""]))
    (found,) = refused(path)
    assert said in found
    assert "exclude each other" not in found
