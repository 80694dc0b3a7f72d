"""Small plans."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

PLANS = Path(__file__).parent / "plans"


@pytest.fixture
def plans(tmp_path: Path) -> Path:
    """A folder with the sample plans and what they name, to be changed at will."""
    folder = tmp_path / "plans"
    shutil.copytree(PLANS, folder)
    return folder
