"""Every word of job files acts or is told: each cell of docs/jobwords.md is played, and none is empty.

After a deliberate change: `python -m tests.cam.words`, or pytest --update-golden.
"""

from __future__ import annotations

from itertools import product

import pytest
from cam.words import EXAMPLES, NO_EFFECT, PAGE, WRITERS, cell, page, verdict, words, written

Table = dict[tuple[str, str], tuple[str, ...]]


@pytest.fixture(scope="module")
def table(pytestconfig: pytest.Config) -> Table:
    if pytestconfig.getoption("--update-golden"):
        PAGE.write_text(page(), encoding="utf-8")
    return written()


def test_the_page_has_every_word_of_the_readers(table: Table) -> None:
    assert sorted(table) == sorted(words())
    assert {len(cells) for cells in table.values()} == {len(WRITERS)}


@pytest.mark.parametrize(("row", "column"), [*product(words(), range(len(WRITERS)))], ids=str)
def test_a_word_does_what_the_page_says(table: Table, row: tuple[str, str], column: int) -> None:
    said = table[row][column]
    assert cell(*row, WRITERS[column]) == said
    assert said.split(";")[0] in ("acts", "told", "acts, told", "refused", "no effect")


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("letter", "GM")
def test_codes_of_drill_files_that_the_page_has_not_are_refused(letter: str, writer: str) -> None:
    """Their reader has no table of them."""
    codes = [f"{letter}{number:02}" for number in range(100)]
    other = [code for code in codes if code not in EXAMPLES["excellon"]]
    whole = EXAMPLES["excellon"]["G40"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(EXAMPLES, "excellon", {code: whole.replace("+G40", f"+{code}") for code in other})
        assert {code: verdict("excellon", code, writer, True) for code in other} == dict.fromkeys(other, "refused")


def test_no_reason_is_left_of_a_word_that_has_an_effect(table: Table) -> None:
    idle = {row for row, cells in table.items() if "no effect" in cells}
    assert idle == {(reader, word) for reader, reasons in NO_EFFECT.items() for word in reasons}
