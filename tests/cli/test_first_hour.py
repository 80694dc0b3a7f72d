"""From nothing to a first result: `init`, `doctor`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pytest_plugin.projects import ALONE

from isel_twin import native
from isel_twin.controller import controller_names, offers
from isel_twin.language import HasExample, create_language
from tests.in_process import isel_twin
from tests.near import NEAR

pytestmark = pytest.mark.long(seconds=11)

FAMILIES = ("imc-s8", "ismif", "gmi99", "bwo900")


def test_there_is_a_project_for_every_controller_of_the_package() -> None:
    """But for the place of another control, which has no commands to begin with."""
    without = {name for name in controller_names() if not offers(create_language(name), HasExample)}
    assert without == {"external"}


@pytest.fixture(scope="module", params=FAMILIES)
def project(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A folder that `init` has filled, and the commands that it has named."""
    folder = tmp_path_factory.mktemp("shop") / request.param
    done = isel_twin("init", folder, "--controller", request.param)
    assert done.returncode == 0, done.stderr
    return folder, [line.strip() for line in done.stdout.splitlines() if line.startswith("    ") and line[4] != " "]


def test_every_command_does_as_it_is_printed(project: tuple[Path, list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the open hood fails. `check` is made with physics, so the jobs keep their bounds; others without, to save
    time: the tests of the project are below."""
    folder, commands = project
    monkeypatch.chdir(folder)
    codes = {}
    for command in commands:
        words = command.split()
        if words[0] == "isel-twin":
            files = [str(path) for word in words[1:] for path in (sorted(folder.glob(word)) if "*" in word else [word])]
            plant = NEAR if words[1] == "check" else ("--plant", "kinematic")
            codes[command] = isel_twin(*files, *plant).returncode
    assert len(codes) == 4
    assert any(command == "isel-twin check" for command in codes)
    assert {command for command, code in codes.items() if code} == {command for command in codes if "hood" in command}


def test_its_tests_pass(tmp_path: Path) -> None:
    isel_twin("init", tmp_path)
    call = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    alone = {**os.environ, **ALONE}
    done = subprocess.run(call, cwd=tmp_path, env=alone, capture_output=True, text=True, check=False)
    assert "2 passed" in done.stdout, done.stdout


def test_nothing_is_replaced_and_nothing_is_left_half(tmp_path: Path) -> None:
    (tmp_path / "hood.toml").write_text("mine")
    done = isel_twin("init", tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"isel-twin: {tmp_path}/hood.toml: exists already; name a folder without it")
    assert [path.name for path in tmp_path.iterdir()] == ["hood.toml"]
    assert (tmp_path / "hood.toml").read_text() == "mine"


def test_a_file_in_the_way_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "shop").write_text("a file")
    done = isel_twin("init", tmp_path / "shop")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_a_controller_without_a_project_is_named(tmp_path: Path) -> None:
    done = isel_twin("init", tmp_path / "shop", "--controller", "imc-s9")
    assert done.returncode == 2
    assert done.stderr.startswith("isel-twin: unknown controller 'imc-s9'; installed: bwo900")
    assert not (tmp_path / "shop").exists()


def test_the_doctor_finds_nothing_wrong_here() -> None:
    done = isel_twin("doctor", "--json")
    told = json.loads(done.stdout)
    assert (done.returncode, told["ok"]) == (0, True)
    states = {one["what"]: one["state"] for one in told["findings"]}
    assert {
        "Python",
        "mujoco",
        "[panel]",
        "compiled core",
        "controllers",
        "serve --pty",
        "the whole chain",
    } <= states.keys()
    assert "wrong" not in states.values()


@pytest.mark.parametrize(("abreast", "way"), [(True, "abreast (AVX2)"), (False, "one after the other")])
def test_the_doctor_says_how_the_core_advances_axes(abreast: bool, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    native.core.load()
    monkeypatch.setattr(native.core, "abreast", abreast)
    findings = json.loads(isel_twin("doctor", "--json").stdout)["findings"]
    found = next(one["found"] for one in findings if one["what"] == "compiled core")
    assert found == f"{native.core.path}, axes {way}"


def test_the_doctor_names_what_is_wrong_and_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "core", native.Core(tmp_path / "core.c"))  # an installation whose library is gone
    done = isel_twin("doctor")
    assert done.returncode == 1
    assert "wrong    compiled core" in done.stdout
    assert f"{tmp_path / 'core'}" in done.stdout
    assert "install isel-twin anew" in done.stdout
