"""`check --isel-port`: jobs at a controller of which only its port is known. Here a served twin is behind the port."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
import serial

from isel_twin.bridge.tap.real_job import unfit
from isel_twin.cli import main
from isel_twin.jobs.checks import RULES
from isel_twin.jobs.job import parse_job
from isel_twin.language import create_language
from tests.bridge.conftest import PATIENCE_S, Served

SQUARE = """\
@07
@0R7 => 0
@0M1600,5000,800,5000,0,5000,0,30
! lost == 0
@0P => 0000640000320000000
! count.x == 1600
! time < 60 s
"""


@pytest.fixture(scope="module")
def served() -> Iterator[dict[str, Served]]:
    """Controllers of two families, each at a pseudo terminal."""
    there = {
        name: Served(("--plant", "kinematic", "--speed", "max", "--controller", name)) for name in ("imc-s8", "ismif")
    }
    yield there
    for one in there.values():
        one.end()


Judge = Callable[..., tuple[int, str, str]]


@pytest.fixture
def judge(tmp_path: Path, served: dict[str, Served], capsys: pytest.CaptureFixture[str]) -> Judge:
    def run(text: str, *words: str, controller: str = "imc-s8", port: str = "") -> tuple[int, str, str]:
        job = tmp_path / "job.txt"
        job.write_text(text)
        port = port or served[controller].info["pty"]
        with pytest.raises(SystemExit) as ended:
            main(["check", str(job), "--isel-port", port, "--controller", controller, *words])
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out, said.err

    return run


def test_replies_counters_and_times_are_judged_and_the_rest_is_named(judge: Judge, tmp_path: Path) -> None:
    """Counters are six hexadecimal digits an axis (iMC, 2.2.27): 1600 is 000640."""
    from sarif_pydantic import Sarif

    code, out, _ = judge(SQUARE, "--json", "--junit", str(tmp_path / "report.xml"))
    told = json.loads(out)
    assert (code, told["ok"], told["findings"], told["verdict"]["commands"]) == (0, True, [], 4)
    assert told["not_looked_at"][-1] == "line 4 (! lost == 0)"
    heard = {"unread", "refused", "unmet", "unfinished", "cycle", "caution"}
    assert set(told["not_looked_at"][:-1]) == set(RULES) - heard
    noted = ElementTree.parse(tmp_path / "report.xml").find("testsuite/testcase/system-out")
    assert noted is not None
    assert "not looked at: " in str(noted.text)
    code, out, _ = judge(SQUARE, "--sarif", str(tmp_path / "report.sarif"))
    assert code == 0
    text = (tmp_path / "report.sarif").read_text()
    Sarif.model_validate_json(text)
    (invocation,) = json.loads(text)["runs"][0]["invocations"]  # 2.1.0, 3.20.21
    (note,) = invocation["toolExecutionNotifications"]
    assert (note["level"], invocation["executionSuccessful"]) == ("note", True)
    assert note["message"]["text"].endswith("line 4 (! lost == 0)")
    assert note["locations"][0]["physicalLocation"]["artifactLocation"]["uri"].endswith("job.txt")
    assert "job.txt: ok (4 commands" in out
    assert "  not looked at: restart, " in out


@pytest.mark.parametrize(
    ("text", "line", "rule", "unsent"),
    [
        ("@07\n@0P => 1*\n@0P\n", 2, "refused", 1),
        ("@07\n@0Q9\n@0P\n", 2, "refused", 1),
        ("@0P\n! count.x == 77\n@0P\n@0P\n", 2, "unmet", 2),
        ("@07 => none within 0.3 s\n", 1, "refused", 0),
    ],
)
def test_what_is_not_as_expected_ends_the_job(judge: Judge, text: str, line: int, rule: str, unsent: int) -> None:
    code, out, err = judge(text, "--json")
    told = json.loads(out)
    assert code == 1
    assert [(one["line"], one["rule"]) for one in told["findings"]] == [
        (line, rule),
        *([(line, "unfinished")] if unsent else []),
    ]
    assert told["verdict"]["unsent"] == unsent
    assert "<255> was sent to" in err


def test_another_family(judge: Judge) -> None:
    """The iSMIF answers text with CR, and 01h with nothing."""
    code, out, _ = judge("$HZXY<1>\n#E1,1200\nL1,X80<1>\n@LX\n", "--json", controller="ismif")
    told = json.loads(out)
    assert (code, told["findings"], told["verdict"]["commands"]) == (0, [], 4)
    code, out, _ = judge("@LY\n! count.y == 0\n! count.x == 0\n", "--json", controller="ismif")
    assert (code, json.loads(out)["findings"]) == (0, [])
    assert json.loads(out)["not_looked_at"][-1] == "line 3 (! count.x == 0)"
    code, out, _ = judge("@LX => 17\n", "--json", controller="ismif")
    assert (code, json.loads(out)["findings"][0]["rule"]) == (1, "refused")


def test_the_time_is_bounded(judge: Judge) -> None:
    code, out, _ = judge("@07\n@0P\n", "--json", "--cycle-s", "1e-9")
    assert (code, [one["rule"] for one in json.loads(out)["findings"]]) == (1, ["cycle"])


@pytest.mark.parametrize(
    "words",
    [
        ("--margin", "0.2"),
        ("--seed", "0"),
        ("--set", "payload.mass=1"),
        ("--workers", "2"),
        ("--golden",),
        ("--watch",),
    ],
)
def test_what_needs_the_twin_is_refused_beside_it(judge: Judge, words: tuple[str, ...]) -> None:
    code, out, err = judge("@07\n", *words)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert words[0] in err
    assert "isel-port" in err


def test_a_port_that_is_not_there_or_in_use(judge: Judge, served: dict[str, Served], tmp_path: Path) -> None:
    code, out, err = judge("@07\n", port=str(tmp_path / "nowhere"))
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "serial ports here" in err
    with served["imc-s8"].open() as other:
        other.exclusive = True
        code, out, err = judge("@07\n")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "in use by another program" in err


def test_a_pseudo_terminal_has_no_parity(judge: Judge) -> None:
    """Linux refuses settings of which none can be made; the way out is named."""
    master, slave = os.openpty()
    serial.Serial(os.ttyname(slave), 38_400).close()
    try:
        words = ("--machine", "4030-servo")
        code, out, err = judge("<01>\n", *words, controller="gmi99", port=os.ttyname(slave))
    finally:
        os.close(master)
        os.close(slave)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "Invalid argument; a pseudo terminal has no parity" in err
    assert "rfc2217://" in err


def test_nobody_answers(judge: Judge) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        code, out, err = judge("@07\n", "--timeout", "0.3", port=os.ttyname(slave))
        heard = b""
        while len(heard) < 5:
            heard += os.read(master, 5)
        assert heard == b"@07\r\xff"  # and a motion, if there were one, is broken off
    finally:
        os.close(master)
        os.close(slave)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "no reply to @07 within 0.3 s" in err


def test_a_stop_by_hand_breaks_the_motion_off(tmp_path: Path) -> None:
    """Ctrl-C while nobody answers: the controller gets its stop, and the report says so."""
    master, slave = os.openpty()
    tty.setraw(slave)
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0P\n")
    words = [sys.executable, "-m", "isel_twin", "check", str(job), "--isel-port", os.ttyname(slave)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert os.read(master, 4) == b"@07\r"
        process.send_signal(signal.SIGINT)
        assert os.read(master, 1) == b"\xff"
        out, err = process.communicate(timeout=PATIENCE_S)
    os.close(master)
    os.close(slave)
    assert process.returncode == 1
    assert "interrupted: <255> was sent to" in err
    assert "1 line is not sent" in out


def test_a_controller_whose_line_says_nothing_is_refused(judge: Judge, served: dict[str, Served]) -> None:
    lines = parse_job("N10 G0 X0\n", create_language("bwo900"), "bwo900")
    assert "acknowledges nothing" in unfit(lines, "bwo900")
    assert unfit(parse_job(SQUARE, create_language("imc-s8"), "imc-s8"), "imc-s8") == ""
    code, _, err = judge("K1:P1\n", controller="bwo900", port=served["imc-s8"].info["pty"])
    assert code == 2
    assert len(err.splitlines()) == 1


def test_cautions_of_a_file_are_said_of_the_real_machine_too(judge: Judge) -> None:
    """A file without a unit; the machine carries it out."""
    code, out, _ = judge("G0 X1\nM2\n")
    assert code == 0
    assert out.count("warning caution    line 1: there is no G20 or G21: numbers are read as mm") == 1
    assert judge("G0 X1\nM2\n", "--strict")[0] == 1
