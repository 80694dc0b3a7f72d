"""The folders of the repository are one package, whose parts are imported under one name only."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import isel_twin

ROOT = Path(__file__).parents[1]
NAMES = {
    "twin": "isel_twin",
    "bridge": "isel_twin.bridge",
    "envs": "isel_twin.envs",
    "models": "isel_twin.models",
    "twin.base.files": "isel_twin",
}
"""What somebody at the root may try to import, and the package that it names."""


def ran(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", NAMES)
def test_a_folder_cannot_be_imported_under_its_own_name(name: str) -> None:
    folder = name.partition(".")[0]
    done = ran(f"import {name}")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"ImportError: import {NAMES[name]}, not {folder}: the folder {folder}/ of the repository is that package"
    )


def test_the_package_and_its_parts_can_be_imported_there() -> None:
    done = ran("import isel_twin, isel_twin.bridge.serve, isel_twin.models, isel_twin.envs")
    assert (done.returncode, done.stderr) == (0, "")


def test_the_map_shows_every_room() -> None:
    rooms = {path.parent.name for path in (ROOT / "twin").glob("*/__init__.py")}
    shown = {line.split("/")[0].strip() for line in (isel_twin.__doc__ or "").splitlines() if line.startswith("    ")}
    assert shown - {""} == rooms
