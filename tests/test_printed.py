"""The table of tests/printed.py fits the pages; what README shows in Python, and pages that are quick, are run here."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.printed import LEFT_OUT, ROOT, Block, blocks, fits, left_out, prepare, run, show_files, typed

BLOCKS = blocks()


def test_most_kinds_of_blocks_are_there_and_every_reason_is_needed() -> None:
    """The first reason that fits counts; one that no block has is stale."""
    reasons = [left_out(block.page, block.text) for block in BLOCKS]
    assert {why for _, why in LEFT_OUT} == set(reasons) - {None}
    assert reasons.count(None) >= 30
    assert sum(not block.text.startswith("isel-twin") for block in BLOCKS) > 20


def test_the_reasons_name_tests_that_there_are() -> None:
    names = {path.name for path in (ROOT / "tests").rglob("*.py")}
    for _, why in LEFT_OUT:
        for word in re.findall(r"[\w/]*test[\w/]*(?:\.py)?", why):
            if word.endswith(".py"):
                assert Path(word).name in names, why
            elif word.startswith("tests/"):
                assert (ROOT / word).is_dir(), why


def test_a_prompt_begins_what_is_typed_and_the_answer_ends_at_the_next() -> None:
    page = ["$ isel-twin check a.txt", "a.txt: ok", "", "1 job: all well", "$ rm a.txt", "$ ls", "..."]
    assert list(typed(page)) == [
        ("isel-twin check a.txt", "a.txt: ok\n\n1 job: all well\n"),
        ("rm a.txt", ""),
        ("ls", "...\n"),
    ]


@pytest.mark.parametrize(
    ("answer", "printed", "same"),
    [
        ("8 of 16 (50 %) failed\n", "8 of 16 (50 %) failed\n", True),
        ("8 of 16 (50 %) failed  \n", "8 of 16 (50 %) failed\n", True),
        ("9 of 16 (56 %) failed\n", "8 of 16 (50 %) failed\n", False),
        ("8 of 16 (lost 8, refused 2)\n", "8 of 16 (lost 8...)\n", True),
        ("8 of 16 (lost 8)\n", "8 of 16 (lost 8...)\n", True),
        ("8 of 16 (lost 7)\n", "8 of 16 (lost 8...)\n", False),
        ("time 3.21 s\nand more\n", "time ... s\n", False),
        ("one\ntwo\nthree\n", "...\nthree\n", True),
        ("three\n", "...\nthree\n", True),
        ("", "", True),
        ("something\n", "", False),
    ],
)
def test_dots_stand_for_what_varies_within_a_line_or_for_lines(answer: str, printed: str, same: bool) -> None:
    assert fits(answer, printed) is same


@pytest.mark.parametrize(
    ("block", "wrong"),
    [
        (Block("page.md", "echo 2 of 3", "2 of 3\n"), ""),
        (Block("page.md", "echo 2 of 3 >&2", "2 of 3\n"), ""),
        (Block("page.md", "echo 2 of 3", "1 of 3\n"), "answers\n2 of 3\n--- the page has\n1 of 3\n"),
        (Block("page.md", "false", ""), "exit code 1, not 0: "),
    ],
)
def test_what_comes_back_is_compared_with_the_page(tmp_path: Path, block: Block, wrong: str) -> None:
    assert run(block, tmp_path) == wrong


@pytest.mark.slow
@pytest.mark.long(seconds=10)
def test_quick_pages_print_what_comes_back(tmp_path: Path) -> None:
    project = tmp_path / "project"
    prepare(project)
    pages = [ROOT / "docs" / name for name in ("ci.md", "exec.md", "hosts.md", "scenarios.md")]
    answered = [
        block for block in blocks(tuple(pages)) if block.answer is not None or "golden record jobs" in block.text
    ]
    assert len(answered) > 8
    wrong = []
    for block in answered:
        show_files(block.page, project)
        wrong.append(run(block, project))
    assert not any(wrong), wrong


PROGRAMS = [
    block
    for block in BLOCKS
    if block.answer is None and not block.text.startswith("isel-twin") and left_out(block.page, block.text) is None
]


@pytest.mark.parametrize("block", PROGRAMS, ids=[block.page for block in PROGRAMS])
def test_a_program_runs_as_printed(block: Block) -> None:
    names: dict[str, object] = {}
    exec(compile(block.text, block.page, "exec"), names)
    assert names
