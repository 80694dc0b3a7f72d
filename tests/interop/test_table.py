"""docs/interop.md: each program that pages and help name has a row, and each witness is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "twin" / "cli").glob("*.py"))]
TABLE = (ROOT / "docs" / "interop.md").read_text(encoding="utf-8")
WITNESSES, UNTRIED = TABLE.split("Not tried, and named")
SCRIPT = re.compile(r"`(?:\w+=\w+ )?bash (tests/interop/\w+\.sh)`")
PROGRAMS = re.findall(
    r"\S+",
    """
    Altium Autodesk Chromium com0com cppagent Dask DuckDB Eagle EdingCNC Emacs Estlcam Firefox FlatCAM FMPy
    fmucontainer fmuloader Foxglove FreeCAD gcode-toolpath
    Fusion gerbv GitHub GitLab grblHAL GTKWave Gymnasium Haas HSMWorks Icarus Inkscape Jenkins junit2html KiCad
    Klipper LabVIEW Lichtblick LinuxCNC libplot mcap MTConnect Neovim node-opcua OMSimulator Optuna OrCAD pandas pcb-rnd
    pcb2gcode Polars pre-commit ProNC pstoedit PulseView pygcode PyQt PySide pyvcd pyvisa Rerun Robot
    rs274 Saleae sarif-multitool ser2net sigrok Stable-Baselines3 Surfer umati Vectric Verilator vpype Wine WinPC-NC
    """,
)


def rows(text: str) -> list[list[str]]:
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]


def named(program: str, text: str) -> bool:
    return re.search(rf"(?<![\w-]){re.escape(program)}(?![\w-])", text, re.IGNORECASE) is not None


def test_each_program_that_is_named_has_a_row() -> None:
    text = "".join(page.read_text("utf-8") for page in PAGES if page.name != "interop.md")
    cells = [row[0] for row in rows(TABLE)]
    assert not [one for one in PROGRAMS if named(one, text) and not any(named(one, cell) for cell in cells)]


@pytest.mark.parametrize("row", rows(WITNESSES)[1:], ids=lambda row: row[0])
def test_a_witness_is_there(row: list[str]) -> None:
    *_, witness = row
    if script := SCRIPT.search(witness):
        assert "|| exit 3" in (ROOT / script[1]).read_text(encoding="utf-8"), "it says if it cannot be had"
        return
    file, _, name = witness.partition("::")
    assert re.search(rf"^ *(?:async )?def {name}\(", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)


def test_each_script_has_a_row() -> None:
    assert {*SCRIPT.findall(WITNESSES)} == {f"tests/interop/{one.name}" for one in Path(__file__).parent.glob("*.sh")}


def test_what_has_no_witness_is_named_once() -> None:
    tried = [row[0] for row in rows(WITNESSES)[1:]]
    assert not [row[0] for row in rows(UNTRIED)[1:] if row[0] in tried]
