"""Random drill files against what gerbv 2.9.6 reads in them (recorded.json), without having it here, and against what
was meant."""

from __future__ import annotations

import json

import pytest

from tests.interop.gerbv import __main__ as command_line
from tests.interop.gerbv.files import FORMS, OTHERWISE, file
from tests.interop.gerbv.image import differ, ncp_differs, read
from tests.thorough import drawn

ROWS = json.loads(command_line.RECORDED.read_text())


@pytest.mark.parametrize("row", ROWS, ids=[str(number) for number in range(len(ROWS))])
def test_as_gerbv(row: dict[str, object]) -> None:
    ours, said = read(row["file"].splitlines(keepends=True))
    assert differ(ours, row["marks"]) == "", said


@pytest.mark.parametrize("row", ROWS, ids=[str(number) for number in range(len(ROWS))])
def test_ncp_of_gerbv_has_its_holes(row: dict[str, object]) -> None:
    assert ncp_differs(row["ncp"], row["marks"]) == ""


@pytest.mark.parametrize("forms", [FORMS, OTHERWISE])
def test_as_it_is_meant(forms: tuple[object, ...]) -> None:
    for seed in range(drawn(400)):
        text, meant = file(seed, forms)
        ours, said = read(text.splitlines(keepends=True))
        assert differ(ours, meant, 1e-4 * 25.4) == "", (seed, said)


def test_gerbv_missing_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(command_line, "command", lambda: None)
    monkeypatch.setattr("sys.argv", ["gerbv", "3"])
    assert command_line.main() == 2
    assert capsys.readouterr().out.count("\n") == 1
