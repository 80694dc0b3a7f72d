"""Every command that the pages print is one that the command line takes: names, options and kinds of values."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from isel_twin.cli import _plain_tokens, app

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PROMPT = re.compile(r"^(?:\$ |- run: |- |entry: |)(?:\.venv/bin/)?(isel-twin .*)$")
END = re.compile(r"[|&;<]|\d?>")  # what belongs to the shell


def printed(page: Path) -> list[str]:
    """Calls in indented blocks and fences, without comments; a line that ends in a backslash goes on."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    found = []
    for line in text.splitlines():
        if line.startswith("    ") and (call := PROMPT.match(line.strip())):
            found.append(call[1])
    return found


def words(call: str) -> list[str]:
    split = shlex.split(call, comments=True)[1:]
    end = next((place for place, word in enumerate(split) if END.match(word)), len(split))
    return [word for word in split[:end] if word != "..."]


CALLS = [(page.relative_to(ROOT).as_posix(), call) for page in PAGES if page.exists() for call in printed(page)]


def test_there_are_many() -> None:
    assert len(CALLS) > 80


@pytest.mark.parametrize(("page", "call"), CALLS)
def test_a_printed_command_is_understood(page: str, call: str) -> None:
    app.parse_args(list(_plain_tokens(words(call))), print_error=False, exit_on_error=False)
