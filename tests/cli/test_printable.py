"""Characters that steer a terminal are shown as escapes, wherever foreign text is printed (UTR 36, ECMA-48)."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from isel_twin.base.printable import shown, shown_line
from isel_twin.bridge.serve.log import log_to

STEERING = {
    "ESC": ("\x1b", r"\x1b"),
    "BEL": ("\x07", r"\x07"),
    "CR": ("\r", r"\r"),
    "NUL": ("\0", r"\x00"),
    "DEL": ("\x7f", r"\x7f"),
    "C1 CSI": ("\x9b", r"\x9b"),
    "C1 NEL": ("\x85", r"\x85"),
    "right to left override": ("\u202e", r"\u202e"),
    "isolate": ("\u2066", r"\u2066"),
    "Arabic letter mark": ("\u061c", r"\u061c"),
    "zero width space": ("\u200b", r"\u200b"),
    "line separator": ("\u2028", r"\u2028"),
    "byte that is not UTF-8": ("\udcff", r"\udcff"),
    "tag": ("\U000e0041", r"\U000e0041"),
}
RAW = [character for character, _ in STEERING.values()]
NAME = "a\x1b[31mb\x07\x9bc\u202ed"  # of a file
SHOWN = r"a\x1b[31mb\x07\x9bc\u202ed"


@pytest.mark.parametrize(("character", "escape"), STEERING.values(), ids=STEERING)
def test_a_character_that_steers_is_shown_as_an_escape(character: str, escape: str) -> None:
    assert shown(f"a{character}b") == f"a{escape}b"


def test_text_of_any_language_stays_with_its_tabs_and_line_ends() -> None:
    text = "Fräsen µm ☃ שלום 漢字\t1\n2"
    assert shown(text) == text
    assert shown_line("1\n2") == r"1\n2"


def call(folder: Path, *words: str, **variables: str) -> tuple[int, str]:
    """Exit code, and all that is printed."""
    told = subprocess.run(
        [sys.executable, "-m", "isel_twin", *words],
        cwd=folder,
        env=os.environ | variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )
    return told.returncode, told.stdout.decode()


def steering(text: str) -> list[str]:
    return [character for character in RAW if character in text]


@pytest.mark.long(seconds=8)
def test_run_shows_names_and_commands_without_what_steers(tmp_path: Path) -> None:
    (tmp_path / f"{NAME}.imc").write_bytes(b"@07\n@0\x1b]0;title\x07\x9b2J\n")
    code, told = call(tmp_path, "run", f"{NAME}.imc", "--plant", "kinematic", "--report", "run.html")
    assert code == 1
    assert steering(told + (page := (tmp_path / "run.html").read_text())) == []
    assert f"{SHOWN}.imc" in page
    assert r"\x1b]0;title\x07\x9b2J" in told
    code, told = call(tmp_path, "run", f"{NAME}.missing")
    assert code == 2
    assert told == f"isel-twin: {SHOWN}.missing: there is no such file\n"


@pytest.mark.long(seconds=8)
def test_check_shows_them_in_words_annotations_junit_and_sarif(tmp_path: Path) -> None:
    job = tmp_path / f"{NAME}\n::error::x.imc"
    job.write_bytes(b"@07\n@0\x1b[2J\x07\n")
    files = ["--junit", "junit.xml", "--sarif", "out.sarif"]
    code, told = call(tmp_path, "check", job.name, "--plant", "kinematic", *files, GITHUB_ACTIONS="true")
    assert code == 1
    assert steering(told) == []
    assert f"{SHOWN}\\n::error::x.imc: failed" in told
    assert [line for line in told.splitlines() if line.startswith("::error::")] == []
    junit = ElementTree.parse(tmp_path / "junit.xml").getroot()
    case = next(junit.iter("testcase"))
    assert case.get("name") == f"{SHOWN}\\n::error::x.imc"
    assert all(steering(text) == [] for one in junit.iter() for text in [one.text or "", *one.attrib.values()])
    results = json.loads((tmp_path / "out.sarif").read_text())["runs"][0]["results"]
    assert results
    assert all(steering(one["message"]["text"]) == [] for one in results)


@pytest.mark.long(seconds=8)
@pytest.mark.skipif(sys.platform != "linux", reason="names of bytes")
def test_a_name_that_is_not_utf_8_is_reported(tmp_path: Path) -> None:
    name = os.fsdecode(b"part\xff.imc")
    (tmp_path / name).write_text("@07\n@0Q\n")
    files = ["--junit", "junit.xml", "--sarif", "out.sarif"]
    code, told = call(tmp_path, "check", name, "--plant", "kinematic", *files, GITHUB_ACTIONS="true")
    assert code == 1
    assert r"part\udcff.imc: failed" in told
    assert "Traceback" not in told
    result = json.loads((tmp_path / "out.sarif").read_text())["runs"][0]["results"][0]
    assert result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "part%FF.imc"  # RFC 3986
    assert r"part\udcff.imc" in (tmp_path / "junit.xml").read_text()


def test_a_log_of_a_server_shows_them(tmp_path: Path) -> None:
    file = tmp_path / "log"
    pairs = "\x1b[2J\x07\r", "\x9b\u202e\u2028"
    with file.open("w") as stream, log_to(stream):
        logging.getLogger("isel_twin").info("client %s said %s", *pairs)
    told = file.read_bytes().decode()
    assert steering(told) == []
    assert told == "isel-twin: client \\x1b[2J\\x07\\r said \\x9b\\u202e\\u2028\n"
