"""Controllers and languages of other people that do not work: one line, and everything else goes on."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.controller import PluginError
from isel_twin.language import create_language

MODULES = {
    "raises_on_import": "import isel_twin\n1 / 0\n",
    "exits_on_import": "raise SystemExit(3)\n",
    "no_python": "def create(:\n",
    "misses_something": "import a_package_that_nobody_has\n",
    "has_no_create": "",
    "raises_in_create": "def create(name, *, flash, settings):\n    raise KeyError('port\\nB')\n",
    "takes_nothing": "def create():\n    return None\n",
    "has_wrong_settings": "def create(name, *, flash, settings):\n    raise ValueError('speed: 0; allowed: 1 .. 9')\n",
    "has_no_file": "def create(name, *, flash, settings):\n    open('/nowhere/table')\n",
    "language_raises": "from isel_twin.firmware import imc\n"
    "def controller(name, **given):\n    return imc.create('imc-s8', **given)\n"
    "def create(name):\n    raise KeyError('words')\n",
}
SAID = {
    "raises_on_import": "controller 'raises_on_import' (raises_on_import:create) does not work: "
    "ZeroDivisionError: division by zero",
    "exits_on_import": "controller 'exits_on_import' (exits_on_import:create) does not work: SystemExit: 3",
    "no_python": "controller 'no_python' (no_python:create) does not work: SyntaxError: ",
    "misses_something": "controller 'misses_something' (misses_something:create) does not work: "
    "ModuleNotFoundError: No module named 'a_package_that_nobody_has'",
    "has_no_create": "controller 'has_no_create' (has_no_create:create) does not work: AttributeError: ",
    "raises_in_create": "controller 'raises_in_create' (raises_in_create:create) does not work: KeyError: ",
    "takes_nothing": "controller 'takes_nothing' (takes_nothing:create) does not work: TypeError: ",
    "has_wrong_settings": "machine.toml: [controller]: speed: 0; allowed: 1 .. 9",
    "has_no_file": "controller 'has_no_file' (has_no_file:create) does not work: FileNotFoundError: ",
    "language_raises": "language 'language_raises' (language_raises:create) does not work: KeyError: 'words'",
}


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each module is a package with an entry point of its own name."""
    info = tmp_path / "broken-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 0.1\n")
    names = [name for name in MODULES if name != "language_raises"]
    controllers = "".join(f"{name} = {name}:create\n" for name in names)
    controllers += "language_raises = language_raises:controller\n"
    languages = "language_raises = language_raises:create\n"
    (info / "entry_points.txt").write_text(
        f"[isel_twin.controllers]\n{controllers}[isel_twin.languages]\n{languages}", encoding="utf-8"
    )
    for name, code in MODULES.items():
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")
    (tmp_path / "job.txt").write_text("<64>\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("name", MODULES)
@pytest.mark.parametrize("command", [("run", "job.txt"), ("serve", "--tcp", "127.0.0.1:0")], ids=lambda c: c[0])
def test_a_plugin_that_does_not_work_is_one_line(
    name: str, command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*command, "--controller", name, "--plant", "kinematic"])
    out, err = capsys.readouterr()
    assert (caught.value.code, out, err.count("\n")) == (2, "", 1), err
    assert SAID[name] in err


@pytest.mark.usefixtures("installed")
def test_in_python_it_is_an_error_with_the_cause() -> None:
    with pytest.raises(PluginError, match="raises_in_create") as error:
        Twin(controller="raises_in_create", plant="kinematic")
    assert isinstance(error.value.__cause__, KeyError)
    with pytest.raises(PluginError, match="language_raises"):
        create_language("language_raises")


@pytest.mark.usefixtures("installed")
def test_the_others_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert Twin(plant="kinematic").query("@07") == "0"
    with pytest.raises(SystemExit) as caught:
        main(["controllers"])
    assert not caught.value.code
    assert "raises_on_import" in capsys.readouterr().out
