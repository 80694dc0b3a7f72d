"""The cells of the table against the specification: no wrong green, and no wrong red (expected.py, docs/faults.md).

All cells, some 1700, take minutes: `python -m tests.matrix` tries every one. Here each controller meets each fault once
on the kinematic plant, before `run`, `check` and `exec` by turns, and of the rest every thirteenth cell is tried.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.wiring import ACTS
from tests.matrix.cells import cells, outcome
from tests.matrix.expected import CONTROLLERS, FAULTS, allowed
from tests.matrix.table import DOCUMENT, page

pytestmark = pytest.mark.long(seconds=25)

ALL = list(cells())
TURNS = ("run", "check", "exec")


def in_turn(tool: str, controller: str, fault: str, plant: str) -> bool:
    turn = TURNS[(list(FAULTS).index(fault) + CONTROLLERS.index(controller)) % len(TURNS)]
    return (tool, plant) == (turn, "kinematic")


TRIED = [cell for n, cell in enumerate(ALL) if in_turn(*cell) or n % 13 == 3]


@pytest.mark.parametrize("cell", TRIED, ids=" ".join)
def test_a_cell(cell: tuple[str, str, str, str], tmp_path: Path) -> None:
    made = outcome(*cell, tmp_path)
    assert made.broken == ""
    assert made.code in allowed(cell), made
    tool, _, fault, plant = cell
    if tool == "run" and plant == "kinematic" and FAULTS[fault].physical:
        assert "1 event without effect (no physics)" in made.out
    if made.code == 2:
        assert any(word in made.err for word in ("take", "name", "must", "give", "can", "have", "--")), made.err


def test_the_document_is_the_specification() -> None:
    assert DOCUMENT.read_text(encoding="utf-8") == page()


def test_the_specification_names_what_spares_a_controller() -> None:
    for name, fault in FAULTS.items():
        assert bool(fault.spares) == bool(fault.spared), name
        assert bool(fault.because) == (set(fault.spares) != set(CONTROLLERS)), name


def test_every_act_that_is_a_fault_has_a_kind() -> None:
    """But those whose effect depends on its measure: a cut, a load, and wires that are exchanged."""
    tried = {word.partition(" ")[0].partition(".")[0] for fault in FAULTS.values() for word in fault.acts.splitlines()}
    assert set(ACTS) - tried == {"cut", "payload_kg", "swapped", "key"}
