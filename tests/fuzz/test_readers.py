"""Every reader of what somebody else may have made or said, against up to two hundred mutations in `make thorough`.

`python -m tests.fuzz 10000` tries more."""

from __future__ import annotations

from pathlib import Path
from subprocess import CompletedProcess

import pytest

from tests.fuzz.mutate import mutated
from tests.fuzz.readers import READERS
from tests.fuzz.shown import check_page, check_terminal
from tests.fuzz.trial import trials
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=6)

ENOUGH = 50  # files, of which most get past the first refusal


@pytest.mark.parametrize("name", READERS)
def test_a_mutated_file_is_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    tally = trials(READERS[name], tmp_path, drawn(READERS[name].files))
    assert tally.wrong == []
    assert tally.tried < ENOUGH or tally.past > 0.5


@pytest.mark.parametrize(
    "page",
    [
        "<p>zz <zz></p>",
        "<p title='' onload='x'>",
        "<p>",
        "<p><figure></figure></p>",
        "</p>",
        "<script>zz</script>",
        "<a href='//x'></a>",
        "<!-- x -->",
    ],
)
def test_what_a_page_must_not_have_is_noticed(page: str) -> None:
    check_page("<!DOCTYPE html><p title='&lt;zz&gt;'>&lt;zz onload=x&gt; zz</p>")
    with pytest.raises(AssertionError):
        check_page(page)


@pytest.mark.parametrize("character", ["\x1b", "\r", "\x9b", "\u202e", "\ud800"])
def test_what_steers_a_terminal_is_noticed(character: str) -> None:
    check_terminal(CompletedProcess([], 0, "tab\tand line end\n", ""))
    with pytest.raises(AssertionError):
        check_terminal(CompletedProcess([], 0, "", f"a{character}b"))


def test_mutations_change_something_and_are_the_same_again() -> None:
    sample = b"travel = { value = 300.0 }\n" * 5
    made = [mutated(sample, seed) for seed in range(100)]
    assert made == [mutated(sample, seed) for seed in range(100)]
    assert sum(data != sample for data in made) > 95
    assert len(set(made)) > 90
