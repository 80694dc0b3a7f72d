"""What is not installed is not needed, and who asks for it is told in one line what to install."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.write import write_trace

pytestmark = pytest.mark.long(seconds=4)

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = {"pyarrow": "trace", "matplotlib": "report", "optuna": "tune", "viser": "panel", "pygls": "lsp"}


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As after `pip install isel-twin`, in a folder with a job."""
    for package in EXTRAS:
        monkeypatch.setitem(sys.modules, package, None)
    for module in (
        *("isel_twin.recordings.parquet", "isel_twin.report.report", "isel_twin.bridge.operate.panel.site"),
        *("isel_twin.bridge.editor.server", *(name for name in sys.modules if name.startswith("pygls."))),
    ):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.txt").write_text("@07\n@0R7\n")


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as caught:
        main([*words])
    assert isinstance(caught.value.code, int)
    return caught.value.code, capsys.readouterr().err


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("run job.txt --trace out", "--trace out: needs pyarrow: pip install 'isel-twin[trace]'"),
        ("run job.txt --report o.png", "--report o.png: needs matplotlib: pip install 'isel-twin[report]'"),
        ("serve --record o.parquet", "--record o.parquet: needs pyarrow: pip install 'isel-twin[trace]'"),
        ("tune job.txt", "a study needs optuna: pip install 'isel-twin[tune]'"),
        ("serve --panel 127.0.0.1:0", "--panel needs viser: pip install 'isel-twin[panel]'"),
        ("lsp", "lsp needs pygls: pip install 'isel-twin[lsp]'"),
        ("motor 23HS32-4004S --picture o.png", "--picture o.png: needs matplotlib: pip install 'isel-twin[report]'"),
    ],
)
def test_who_asks_for_an_extra_is_told_what_to_install(
    words: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said(capsys, *words.split()) == (2, f"isel-twin: {line}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["job.txt"]


@pytest.mark.usefixtures("bare")
def test_so_is_who_asks_in_python(tmp_path: Path) -> None:
    twin = Twin(plant="kinematic")
    with Recorder(twin, 10_000_000) as recorder, pytest.raises(ValueError, match=r"out: needs pyarrow: .*\[trace\]"):
        write_trace(tmp_path / "out", twin.steps, recorder, ".parquet")


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_everything_else_needs_no_extra(plant: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, err = said(capsys, "run", "job.txt", "--plant", plant, "--steps", "o.npz", "--vcd", "o.vcd")
    assert (code, err) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == {"job.txt", "o.npz", "o.vcd"}


@pytest.mark.usefixtures("bare")
def test_nor_do_a_motor_and_a_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "motor", "23HS32-4004S") == (0, "")
    assert said(capsys, "run", "job.txt", "--plant", "kinematic", "--report", "o.html") == (0, "")


def names(requirements: list[str]) -> set[str]:
    return {requirement.split(">")[0] for requirement in requirements}


def test_extras_are_no_dependencies() -> None:
    extras = PROJECT["optional-dependencies"]
    assert not names(PROJECT["dependencies"]) & EXTRAS.keys()
    assert {package: extra for package, extra in EXTRAS.items() if package in names(extras[extra])} == EXTRAS
