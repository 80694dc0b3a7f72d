"""Random parts, what is made of them, and what LinuxCNC's rs274 2.9, pygcode 0.2.1 and gcode-toolpath 3.0.0 read there
(recorded.json), without having them here."""

from __future__ import annotations

import json

import pytest

from tests.interop.judges import __main__ as command_line

ROWS = json.loads(command_line.RECORDED.read_text())


@pytest.mark.parametrize("row", ROWS, ids=[str(number) for number in range(len(ROWS))])
def test_as_the_judges(row: dict[str, object]) -> None:
    assert set(row["files"]) == set(command_line.ALL)
    assert list(command_line.verdicts(row)) == []


def test_a_turn_less_is_found() -> None:
    """The judges' moves of another part, and a circle left out."""
    row = ROWS[0]
    assert list(command_line.verdicts({**row, "moves": ROWS[1]["moves"]}))
    assert list(command_line.verdicts({**row, "bwo900": row["bwo900"][:-3]}))


def test_a_missing_judge_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command_line, "judges", lambda folder: {})
    monkeypatch.setattr("sys.argv", ["judges", "3"])
    assert command_line.main() == 2
    assert capsys.readouterr().out.count("\n") == 1
