"""docs/ci.md followed to the letter: a project of two files, outside of this repository."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pytest_plugin.projects import ALONE

from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=7)

PAGE = Path(__file__).parents[2] / "docs" / "ci.md"


def section() -> str:
    return PAGE.read_text(encoding="utf-8").split("## With pytest\n")[1].split("\n## ")[0]


def files() -> list[tuple[str, str]]:
    """Names and contents of the files of the page, in its order."""
    found = re.findall(r"^`([\w./]+)`\n\n((?:    .*\n|\n)+)", section(), re.MULTILINE)
    return [(name, re.sub(r"^    ", "", block.strip("\n") + "\n", flags=re.MULTILINE)) for name, block in found]


def commands() -> list[str]:
    (block,) = re.findall(r"tried out by\n\n((?:    .*\n)+)", section())
    return [line.strip() for line in block.splitlines()]


def run_pytest(folder: Path) -> subprocess.CompletedProcess[str]:
    install, command = commands()
    assert install == "pip install isel-twin pytest", "which is done where this test runs"
    words = [sys.executable, *command.split()[1:]]
    alone = {**os.environ, **ALONE}
    return subprocess.run(words, cwd=folder, env=alone, capture_output=True, text=True, timeout=PATIENCE_S, check=False)


def test_the_project_of_the_page_is_green_and_red(tmp_path: Path) -> None:
    job, test, hurried = files()
    assert (job[0], test[0], hurried[0]) == ("jobs/square.txt", "test_jobs.py", "jobs/square.txt")
    assert len((job[1] + test[1]).splitlines()) <= 12
    (tmp_path / "jobs").mkdir()
    for name, content in (job, test):
        (tmp_path / name).write_text(content)
    green = run_pytest(tmp_path)
    assert green.returncode == 0, green.stdout + green.stderr
    assert "1 passed" in green.stdout

    (tmp_path / hurried[0]).write_text(hurried[1])
    red = run_pytest(tmp_path)
    assert red.returncode == 1, red.stdout + red.stderr
    said = [line.strip() for line in section().splitlines() if line.startswith("    E ")]
    assert len(said) == 6
    for line in said:
        if "was:" not in line and "when:" not in line:  # last bits of the physics depend on the processor
            assert line in [found.strip() for found in red.stdout.splitlines()]
    (recording,) = re.findall(r"recording: (.*)", red.stdout)
    assert Path(recording).is_file()
    assert "the test again: python" in red.stdout


def test_every_fixture_ini_key_and_assertion_is_on_the_page() -> None:
    from isel_twin.bridge.pytest import plugin as pytest_plugin
    from isel_twin.jobs.checks import asserts

    page = section()
    assert [key for key in pytest_plugin.INI if f"isel_twin_{key}" not in page] == []
    assert [name for name in asserts.__all__ if name.startswith("assert_") and f"`{name}(" not in page] == []
    assert [name for name in pytest_plugin.__all__ if name not in page] == []
    assert [key for key in (*pytest_plugin.KEYS, *pytest_plugin.OF_SERVERS) if key not in page] == []
