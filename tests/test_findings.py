"""findings/: every script has its head, its row in the README, and nothing of this project in it."""

import os
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "findings"
SCRIPTS = sorted(FOLDER.glob("*.sh"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_head(script: Path) -> None:
    head, _, body = script.read_text().partition("set -euo pipefail")
    assert re.findall(r"^# (\w+): ", head, re.MULTILINE) == ["Guess", "Seen", "Here", "With"]
    assert re.search(r", 20\d\d-\d\d-\d\d$", head.strip())  # the day it was seen last
    assert os.access(script, os.X_OK)
    assert "isel" not in body  # the other program alone


def test_table() -> None:
    rows = re.findall(r"^\| (\w+\.sh) \|", (FOLDER / "README.md").read_text(), re.MULTILINE)
    assert rows == [script.name for script in SCRIPTS]
