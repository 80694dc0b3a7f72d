"""Small plans, and the command in a process of its own."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

PLANS = Path(__file__).parent / "plans"
COMMAND = (sys.executable, "-m", "isel_twin.cli", "sweep")


@pytest.fixture
def plans(tmp_path: Path) -> Path:
    """A folder with the sample plans and what they name, to be changed at will."""
    folder = tmp_path / "plans"
    shutil.copytree(PLANS, folder)
    return folder
