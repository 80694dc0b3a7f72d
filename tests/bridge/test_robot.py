"""Robot Framework runs the suite of docs/connections.md, and one that has to fail."""

from __future__ import annotations

import io
import re
import textwrap
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import robot

from isel_twin.bridge.robot import bench

PAGE = Path(__file__).parents[2] / "docs" / "connections.md"
SUITE = textwrap.dedent(re.findall(r"with bench\.robot\n\n((?:(?:    .*)?\n)+)", PAGE.read_text("utf-8"))[0])

FAILING = """
*** Settings ***
Library    isel_twin.bridge.robot.Bench

*** Test Cases ***
No Twin
    Get State

Refused
    ${info}=    Start Twin    plant=kinematic
    Set Suite Variable    ${info}
    Send Command    @0x

Another Reply
    Send Command    @07    expect=5

Elsewhere
    Position Should Be    x    300

No Such Input
    Set Input    door    open

A Switch
    Input Should Be    limit_x1    struck

Too Late
    Wait Until Position    x    above=9999    patience=0.2

No Such Server
    Connect To Twin    127.0.0.1:1

No Such Line
    Connect To Twin    ${info}[control]    127.0.0.1:1

No Line
    Connect To Twin    ${info}[control]
    Start Command    @07

Somebody Else Has The Line
    ${other}=    Evaluate    __import__('socket').create_connection($info['tcp'].rsplit(':', 1))
    Set Suite Variable    ${other}
    Connect To Twin    ${info}[control]    ${info}[tcp]

The Twin Has Gone
    Evaluate    $other.close()
    Connect To Twin    ${info}[control]    ${info}[tcp]
    Let Happen    {"stop": true}
    Sleep    0.3
    Send Command    @07

The Twin Has Gone For The Operator
    Get State

Told
    Start Twin    no-such-machine
"""
REASONS = (
    "there is no twin: Start Twin, or Connect To Twin",
    "@0x is refused: '",
    "@07 is answered by '0', not '5'",
    "x is at ",
    "set: unknown input 'door'",
    "input limit_x1 is free, not struck",
    "wait: not so in time",
    "127.0.0.1:1: ",
    "127.0.0.1:1: Connection refused",
    "there is no line to the controller",
    "is in use by another client",
    "close",
    "is there a serve --control?",
    "the twin does not start: ",
)


def run(folder: Path, suite: str) -> tuple[int, list[tuple[str, str]]]:
    """Exit code, and (status, message) of each test."""
    path = folder / "bench.robot"
    path.write_text(suite, encoding="utf-8")
    told = io.StringIO()
    code = robot.run(str(path), outputdir=str(folder), log="NONE", report="NONE", stdout=told, stderr=told)
    tree = ElementTree.parse(folder / "output.xml")
    found = [test.find("status") for test in tree.iter("test")]
    return code, [(one.get("status", ""), one.text or "") for one in found if one is not None]


@pytest.fixture(autouse=True)
def started(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """The twins that a suite starts. All have ended with it, each before the next one begins."""
    running: list[Any] = []

    class Noted(bench.Started):
        def __init__(self, *options: str) -> None:
            assert not running, "the one before must have ended"
            super().__init__(*options)
            running.append(self)

        def stop(self) -> int:
            if self in running:  # not if it did not start
                running.remove(self)
            return int(super().stop() or 0)

    monkeypatch.setattr(bench, "Started", Noted)
    yield running
    assert not running


def test_the_suite_of_the_page_passes(tmp_path: Path) -> None:
    code, results = run(tmp_path, SUITE)
    assert (code, [status for status, _ in results]) == (0, ["PASS", "PASS"]), results


class Slipped:
    """The client of a twin that has lost steps of y now, of z before its counter was set."""

    def __init__(self, *_: object) -> None: ...

    def ask(self, _: Any) -> dict[str, Any]:
        axes = {
            "lost_steps": [15.0, -16.0, 0.0, 0.0],
            "slip_steps": [32.0] * 4,
            "forgotten_steps": [0.0, 0.0, 32.0, 0.0],
        }
        quiet = {"outputs": {"power": 1}, "inputs": {}, "faults": {}, "fault": False, "drive_faults": [[0, ""]] * 4}
        return {**axes, **quiet, "margin": [None, 0.5, 0.1, None]}


def test_verdicts_name_the_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a slip, 16 steps, is a loss; a margin as large as demanded is enough."""
    monkeypatch.setattr(bench, "Client", Slipped)
    here = bench.Bench()
    here.connect_to_twin("127.0.0.1:4002")
    line = "y has lost -16 steps; z had lost 32 steps before its counter was set"
    with pytest.raises(AssertionError, match=f"^{line}$"):
        here.no_step_should_be_lost()
    here.margin_should_be_at_least(10.0)
    with pytest.raises(AssertionError, match=r"^z had a margin of 10\.0%, less than 11 %$"):
        here.margin_should_be_at_least(11.0)


OPERATOR = """
*** Settings ***
Library    isel_twin.bridge.robot.Bench

*** Test Cases ***
Elements And Contacts
    Start Twin    plant=kinematic
    Open Hood
    Input Should Be    hood    open
    Close Hood
    Input Should Be    hood    closed
    Press Emergency Stop
    Input Should Be    estop    pressed
    Output Should Be    power    0
    Release Emergency Stop
    Input Should Be    estop    released
    Set Input    power    on
    Output Should Be    power    1
    Break    limit_x2
    ${state}=    Get State
    Should Be Equal    ${state}[faults]    ${{ {'limit_x2': 'broken'} }}
    Mend    limit_x2
    ${state}=    Get State
    Should Be Empty    ${state}[faults]

Time Stands Still And Goes On
    Send Command    @07
    Send Command    @0N7
    Let Happen    {"pause": true}
    ${then}=    Get State
    Start Command    @0A16000,2000,0,900,0,900,0,900
    Sleep    0.05
    ${state}=    Get State
    Should Be Equal    ${state}[time_ns]    ${then}[time_ns]
    Position Should Be    x    0
    Resume
    Wait Until Position    x    above=6
    Resume
    Wait Until Idle
    Position Should Be    x    50    within=0
    Margin Should Be At Least    0
"""


def test_what_an_operator_does(tmp_path: Path) -> None:
    code, results = run(tmp_path, OPERATOR)
    assert (code, [status for status, _ in results]) == (0, ["PASS", "PASS"]), results


def test_what_is_wrong_fails_with_one_clear_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    _, results = run(tmp_path, FAILING)
    assert [status for status, _ in results] == ["FAIL"] * len(REASONS)
    for (_, message), reason in zip(results, REASONS, strict=True):
        assert reason in message, (message, reason)
        assert "\n" not in message
