"""docs/controllers.md is true: its toy controller, built and installed by a third party, is there like any other."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "controllers.md"

SESSION = """
from isel_twin import Twin
from isel_twin.controller import controller_names

assert "toy" in controller_names()
twin = Twin(controller="toy", plant="kinematic", start_mm=(100.0, 50.0, 30.0))
print(repr(twin.query("X1600")), twin.counts.tolist(), twin.position_mm.round(9).tolist())
print(repr(twin.query("?")), repr(twin.query("nonsense")))
print(repr(twin.query("X-90000")), float(twin.counts[0]), float(twin.machine_position_mm[0]) < 0.01)
"""


@pytest.fixture(scope="module")
def plugins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the page's toy installed in it by pip."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("plugins")
    text = PAGE.read_text(encoding="utf-8")
    (source / "isel_twin_toy.py").write_text(block(text, "python"), encoding="utf-8")
    (source / "pyproject.toml").write_text(block(text, "toml"), encoding="utf-8")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index", "--no-deps"]
    subprocess.run([*pip, "--no-build-isolation", "--target", str(target), str(source)], check=True)
    return target


def block(text: str, language: str) -> str:
    """The only code block of that language on a page."""
    blocks = re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 1
    return str(blocks[0])


def test_the_toy_is_about_a_page_long() -> None:
    code = [line for line in block(PAGE.read_text(encoding="utf-8"), "python").splitlines() if line.strip()]
    assert 40 <= len(code) <= 75


def test_the_toy_runs_as_an_installed_plugin(plugins: Path) -> None:
    """At 160 steps/mm: 1600 steps are 10 mm; 90000 steps back end at the motor-end switch with the answer 2."""
    environment = {**os.environ, "PYTHONPATH": str(plugins)}
    call = subprocess.run(
        [sys.executable, "-c", SESSION], env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert call.stderr == ""
    first, second, third = call.stdout.splitlines()
    assert first == "'0' [1600, 0, 0, 0] [10.0, 0.0, 0.0]"
    assert second == r"'1600\r' '5'"
    answer, count, at_switch = third.split()
    assert (answer, at_switch) == ("'2'", "True")
    assert float(count) == pytest.approx(-100 * 160, abs=1)
