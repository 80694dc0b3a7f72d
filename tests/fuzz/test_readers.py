"""Every reader of files that somebody else may have made, against two hundred mutated ones in `make thorough`.

`python -m tests.fuzz 10000` tries more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.mutate import mutated
from tests.fuzz.readers import READERS
from tests.fuzz.trial import trials
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=6)

FILES = 200


@pytest.mark.parametrize("name", READERS)
def test_a_mutated_file_is_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    assert trials(READERS[name], tmp_path, drawn(FILES)).wrong == []


def test_mutations_change_something_and_are_the_same_again() -> None:
    sample = b"travel = { value = 300.0 }\n" * 5
    made = [mutated(sample, seed) for seed in range(100)]
    assert made == [mutated(sample, seed) for seed in range(100)]
    assert sum(data != sample for data in made) > 95
    assert len(set(made)) > 90
