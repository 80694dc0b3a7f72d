"""Random programs against what LinuxCNC's rs274 2.9 made of them (recorded.json), without having it here."""

from __future__ import annotations

import json

import pytest

from tests.interop.rs274 import __main__ as command_line
from tests.interop.rs274.canon import verdict
from tests.interop.rs274.record import FILE

ROWS = json.loads(FILE.read_text())


@pytest.mark.parametrize("row", ROWS, ids=[str(number) for number in range(len(ROWS))])
def test_as_rs274(row: dict[str, object]) -> None:
    moves = [tuple(move) for move in row["moves"]]
    found = verdict(row["program"], moves, row["error"])
    assert found.told or found.why == ""


def test_a_missing_interpreter_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command_line, "command", lambda: None)
    monkeypatch.setattr("sys.argv", ["rs274", "3"])
    assert command_line.main() == 2
    assert capsys.readouterr().out.count("\n") == 1
