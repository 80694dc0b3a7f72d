"""docs/controllers.md is true: its toy controller and its language, built and installed by a third party, are there
like any other."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=4)

PAGE = Path(__file__).parents[2] / "docs" / "controllers.md"

MODULES = ("isel_twin_toy.py", "isel_twin_toy_language.py")
"""The page's Python, block by block."""

SESSION = """
from isel_twin import Twin
from isel_twin.controller import controller_names
from isel_twin.language import language_names

assert "toy" in controller_names()
assert "toy" in language_names()
twin = Twin(controller="toy", plant="kinematic", start_mm=(100.0, 50.0, 30.0))
print(repr(twin.query("X1600")), twin.counts.tolist(), twin.position_mm.round(9).tolist())
print(repr(twin.query("?")), repr(twin.query("nonsense")))
print(repr(twin.query("X-90000")), float(twin.counts[0]), float(twin.machine_position_mm[0]) < 0.01)
"""


LANGUAGE = """
from isel_twin.language import create_language

language = create_language("toy")
for data, sent in ((b"X40", True), (b"0\\r?\\rnonsense\\r", True), (b"0=4", False), (b"00\\r52=", False)):
    for message in language.messages(data, sent):
        print(message.text, "|", message.explanation)
print(language.rest(False))
"""

TUNING = """
import gymnasium, isel_twin.envs

env = gymnasium.make("isel_twin/JobTuning-v0", controller="toy", plant="kinematic")
try:
    env.reset(seed=0)
except ValueError as error:
    print(error)
"""

SETTINGS = """
from pathlib import Path
from isel_twin import Twin
from isel_twin.machine import MachineError, load_machine

for line in ("toy_speed_hz = 1000", "toy_speed_hz = 20", "toy_sped_hz = 1000"):
    Path("machine.toml").write_text(f'based_on = "4030"\\n[controller]\\n{line}\\n')
    try:
        twin = Twin(machine="machine.toml", controller="toy", plant="kinematic", start_mm=(100.0, 50.0, 30.0))
        print(twin.query("X1600"), int(twin.steps.t_ns[800] - twin.steps.t_ns[799]))
    except MachineError as error:
        print(str(error).split("machine.toml: ")[1])
"""

LANGUAGE_ENTRY = "toy = isel_twin_toy_language:create"
JOB = "X1600\n?\nno<13>\nX-1600<13> <0.1s> ?\n"


@pytest.fixture(scope="module")
def plugins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the page's toy and its language installed in it by pip."""
    target, source = tmp_path_factory.mktemp("plugins"), tmp_path_factory.mktemp("source")
    text = PAGE.read_text(encoding="utf-8")
    for name, code in zip(MODULES, blocks(text, "python"), strict=True):
        (source / name).write_text(code, encoding="utf-8")
    (project,) = blocks(text, "toml")
    (source / "pyproject.toml").write_text(project, encoding="utf-8")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index", "--no-deps"]
    subprocess.run([*pip, "--no-build-isolation", "--target", str(target), str(source)], check=True)
    return target


def blocks(text: str, language: str) -> list[str]:
    """The code blocks of that language on a page."""
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def run(plugins: Path, *arguments: str, stdin: str = "", code: int = 0) -> tuple[list[str], str]:
    """Lines of standard output, and standard error, of Python with the plugins installed."""
    call = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": str(plugins)},
        input=stdin,
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert call.returncode == code, call.stderr
    return call.stdout.splitlines(), call.stderr


def other_tests(_folder: str, names: list[str]) -> list[str]:
    """What need not be copied: tests but for those of the tables."""
    return [name for name in names if name == "__pycache__" or (name[:5] == "test_" and name != "test_table.py")]


def run_job(plugins: Path, job: str, code: int = 0) -> tuple[list[dict[str, Any]], str]:
    """What `isel-twin run --json` prints about each command, and standard error."""
    arguments = (
        "-c",
        "from isel_twin.cli import main; main()",
        "run",
        "-",
        "--controller",
        "toy",
        "--plant",
        "kinematic",
        "--json",
    )
    out, err = run(plugins, *arguments, stdin=job, code=code)
    return [json.loads(line) for line in out][:-1], err


def test_controller_and_language_are_about_a_page_long_each() -> None:
    for module in blocks(PAGE.read_text(encoding="utf-8"), "python"):
        assert 40 <= len([line for line in module.splitlines() if line.strip()]) <= 75


def test_the_toy_runs_as_an_installed_plugin(plugins: Path) -> None:
    """At 160 steps/mm: 1600 steps are 10 mm; 90000 steps back end at the motor-end switch with the answer 2."""
    (first, second, third), err = run(plugins, "-c", SESSION)
    assert err == ""
    assert first == "'0' [1600, 0, 0, 0] [10.0, 0.0, 0.0]"
    assert second == r"'=1600\r' '5'"
    answer, count, at_switch = third.split()
    assert (answer, at_switch) == ("'2'", "True")
    assert float(count) == pytest.approx(-100 * 160, abs=1)


def test_its_settings_are_those_of_a_machine_file(
    plugins: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (made, low, misspelt), _ = run(plugins, "-c", SETTINGS)
    assert made == "0 1000000"  # ns between pulses at 1000 Hz
    assert low == "controller.toy_speed_hz: 20; allowed: 300 .. 20000 Hz"
    assert misspelt.startswith("controller.toy_sped_hz: unknown key; did you mean 'toy_speed_hz'?")


def test_its_bytes_have_words(plugins: Path) -> None:
    assert run(plugins, "-c", LANGUAGE)[0] == [
        "X400 | move X by 400 steps",
        "? | ask for the counter",
        "nonsense | no command",
        "0 | reply: done",
        "=400 | position X 400",
        "5 | reply: not understood",
        "2 | reply: a switch is struck",
        "b'='",
    ]


def test_its_job_files_are_framed_and_judged_by_its_language(plugins: Path) -> None:
    results, _ = run_job(plugins, JOB, code=1)
    assert [(result["reply"], result["ok"]) for result in results[:3]] == [
        ("0", True), ("=1600\r", True), ("5", False)
    ]  # fmt: skip
    moving, answer = results[3]["reply"].split("\r")
    assert (0 < int(moving.removeprefix("=")) < 1600, answer) == (True, "0")


def test_the_tuning_environment_says_that_it_is_not_for_the_toy(plugins: Path) -> None:
    assert run(plugins, "-c", TUNING) == (["the toy has no reference point"], "")


def test_without_a_language_it_runs_by_bytes(plugins: Path, tmp_path: Path) -> None:
    """As if it had been installed without that entry point."""
    speechless = shutil.copytree(plugins, tmp_path / "plugins")
    (told,) = speechless.glob("*.dist-info/entry_points.txt")
    entries = told.read_text(encoding="utf-8")
    assert LANGUAGE_ENTRY in entries
    told.write_text(entries.replace(LANGUAGE_ENTRY, ""), encoding="utf-8")
    results, _ = run_job(speechless, "X1600<13>\nno<13>\n")
    assert [(result["reply"], result["ok"], result["counts"][0]) for result in results] == [
        ("0", True, 1600), ("5", True, 1600)
    ]  # fmt: skip
    _, err = run_job(speechless, "<88>\nX1600\n", code=2)
    assert "line 2: controller 'toy' has no language: send its bytes as <13>" in err
    assert err.count("\n") == 1


def test_rows_of_the_toys_manual_are_shown_as_the_page_has_it(plugins: Path, tmp_path: Path) -> None:
    """A copy of the tables with the page's: both tests pass, every row has its test; without one, it is missed."""
    root = PAGE.parents[1]
    for folder in ("tests/conformance", "tests/golden", "docs"):
        shutil.copytree(root / folder, tmp_path / folder, ignore=other_tests)
    shutil.copy(root / "pyproject.toml", tmp_path)
    for file in (root / "tests").glob("*.py"):
        if not file.name.startswith("test_"):  # what the session's conftest needs
            shutil.copy(file, tmp_path / "tests")
    folder, text = tmp_path / "tests" / "conformance", PAGE.read_text(encoding="utf-8")
    (table,), (test,) = blocks(text, "toml table"), blocks(text, "python test")
    (folder / "toy.toml").write_text(table, encoding="utf-8")
    (folder / "test_toy_moves.py").write_text(test, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(plugins)}

    def pytest_run(*words: str) -> str:
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
        call = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S
        )
        return call.stdout

    every_row = "tests/conformance/test_table.py::test_every_row_has_a_test[toy]"
    shown = pytest_run("--update-golden", "tests/conformance/test_toy_moves.py", every_row)
    assert "3 passed" in shown, shown
    (folder / "test_toy_moves.py").write_text(test.replace('@shows("toy-2-2")', ""), encoding="utf-8")
    missed = pytest_run(every_row)
    assert "1 failed" in missed, missed
    assert "toy-2-2" in missed
