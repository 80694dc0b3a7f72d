"""Every tool with every controller, fault and plant: it works, or is refused in one line that says the way out, and no
fault that bites is called well.

All cells are some four hundred and take minutes: `python -m tests.matrix` writes their table, docs/faults.md. Here are
those of `run`, which all others rest on, and of the other tools every fourteenth; `experiment` is in the smoke tests.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.matrix.cells import FAULTS, cells, outcome
from tests.matrix.table import DOCUMENT, read_table, shown

pytestmark = pytest.mark.long(seconds=14)

ALL = list(cells())
TRIED = [cell for n, cell in enumerate(ALL) if cell[0] == "run" or (n % 14 == 3 and cell[0] != "experiment")]

SEES = {
    "E-stop": ("imc-s8", "ismif", "gmi99", "bwo900"),
    "hood": ("imc-s8", "ismif", "gmi99", "bwo900"),
    "brown-out": ("imc-s8", "ismif", "gmi99", "bwo900"),
    "limit": ("imc-s8", "gmi99", "bwo900"),  # the iSMIF looks at switches in reference runs only
    "obstacle": ("imc-s8", "ismif", "gmi99", "bwo900"),
    "line cut": ("imc-s8", "ismif"),  # the others have answered before they move
    "drive": ("imc-s8", "ismif", "gmi99", "bwo900"),
    "collision": ("imc-s8", "ismif", "gmi99", "bwo900"),
}
"""Controllers of which a job that meets the fault in motion is not well."""
PHYSICAL = ("obstacle", "drive")


def bites(controller: str, fault: str, plant: str) -> bool:
    return controller in SEES[fault] and (plant == "mujoco" or fault not in PHYSICAL)


@pytest.mark.parametrize("cell", TRIED, ids=" ".join)
def test_a_cell(cell: tuple[str, str, str, str], tmp_path: Path) -> None:
    tool, controller, fault, plant = cell
    made = outcome(*cell, tmp_path)
    assert made.broken == ""
    if tool in ("run", "check", "sweep"):
        assert made.code == (1 if bites(controller, fault, plant) else 0), made
    if tool in ("golden", "replay", "compare", "serve"):
        assert made.code == 0, made
    if tool == "run" and fault in PHYSICAL and plant == "kinematic":
        assert "1 event without effect (no physics)" in made.out
    assert shown(made) == read_table()[cell]


def test_every_cell_stands_in_the_document() -> None:
    assert set(read_table()) == set(ALL)
    assert set(SEES) == set(FAULTS)


def test_a_refusal_says_a_way_out() -> None:
    refused = {text for text in read_table().values() if text not in ("well", "not well")}
    assert refused
    for text in refused:
        assert any(word in text for word in ("take", "name", "must", "give", "can", "have", "--")), text
    assert DOCUMENT.is_file()
