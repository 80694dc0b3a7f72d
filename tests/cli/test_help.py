"""What --help says, and what shells complete."""

from __future__ import annotations

import functools
import os
import pty
import re
import select
import shutil
import subprocess
import typing
from collections.abc import Iterator
from pathlib import Path

import pytest
from cyclopts import App

from isel_twin.cli import app
from tests.forked import PATIENCE_S
from tests.in_process import isel_twin

UNIT = re.compile(r"(?i:seconds?|number|share|factor)|\b(s|us|mm|Hz|bit/s|MB|steps)\b", re.IGNORECASE)
SHELLS = ("bash", "zsh", "fish")


def commands(inner: App, name: str = "") -> Iterator[tuple[str, App]]:
    for word in inner:
        if not word.startswith("-"):
            yield f"{name} {word}".strip(), inner[word]
            yield from commands(inner[word], f"{name} {word}".strip())


COMMANDS = [(name, command) for name, command in commands(app) if command.default_command is not None]


def test_each_number_says_what_it_is_in() -> None:
    """A unit, a share, a factor, or the number of what."""
    numbers = [
        (name, argument.name, argument.parameter.help or "")
        for name, command in COMMANDS
        for argument in command.assemble_argument_collection()
        if {argument.hint, *typing.get_args(argument.hint)} & {int, float}
    ]
    assert len(numbers) > 40
    assert [option for option in numbers if not UNIT.search(option[2])] == []


def test_each_option_and_command_is_explained() -> None:
    unsaid = [
        (name, argument.name)
        for name, command in COMMANDS
        for argument in command.assemble_argument_collection()
        if argument.show and not argument.parameter.help
    ]
    assert unsaid == []
    assert [name for name, command in COMMANDS if not command.help] == []


@functools.cache
def completion(shell: str) -> str:
    """The script, which takes a third of a second to make."""
    return app.generate_completion(shell=shell)


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_takes_the_completion_and_knows_each_command(shell: str, tmp_path: Path) -> None:
    """The script is right for its shell, if that is installed, and has all commands and their options."""
    script = completion(shell)
    words = [word for name, _ in COMMANDS for word in name.split()]
    assert [word for word in words if word not in script] == []
    assert "--scenario" in script or "-l scenario" in script
    (tmp_path / "completion").write_text(script)
    if shutil.which(shell):
        done = subprocess.run([shell, "-n", str(tmp_path / "completion")], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


BEGUN = (("isel-twin swe", "sweep"), ("isel-twin run --rob", "--robust"), ("isel-twin golden re", "record"))
"""Begun lines, and what the tab key offers."""


def test_bash_completes_commands_options_and_choices(tmp_path: Path) -> None:
    """As at the tab key: what the function of the script offers for a line that is begun."""
    if shutil.which("bash") is None:
        pytest.skip("there is no bash here")
    (tmp_path / "completion").write_text(completion("bash"))
    for line, offered in BEGUN:
        ask = (
            f"source ./completion; words=({line}); COMP_WORDS=(${{words[@]}}); COMP_CWORD=$((${{#words[@]}} - 1)); "
            f"COMP_LINE='{line}'; COMP_POINT={len(line)}; "
            "function=$(complete -p isel-twin | sed 's/.*-F \\([^ ]*\\).*/\\1/'); $function isel-twin; "
            'printf "%s\\n" "${COMPREPLY[@]}"'
        )
        done = subprocess.run(["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert offered in done.stdout.split(), (line, done)


def test_fish_completes_commands_and_options(tmp_path: Path) -> None:
    if shutil.which("fish") is None:
        pytest.skip("there is no fish here")
    (tmp_path / "completion").write_text(completion("fish"))
    for line, offered in BEGUN:
        ask = f"source completion; complete -C '{line}'"
        done = subprocess.run(["fish", "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert offered in done.stdout.split(), (line, done)


def test_zsh_completes_commands_and_options_once_it_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A person's shell with compinit, the installed script, and the tab key on a terminal."""
    if (zsh := shutil.which("zsh")) is None:
        pytest.skip("there is no zsh here")
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / ".zshrc").write_text("autoload -Uz compinit; compinit -u\n")
    assert isel_twin("--install-completion", "--shell", "zsh").returncode == 0
    with (tmp_path / ".zshrc").open("a") as file:
        file.write("\nPS1='READY>'\n")
    child, terminal = pty.fork()
    if child == 0:
        os.environ.pop("ZDOTDIR", None)
        os.environ["TERM"] = "dumb"
        os.execv(zsh, ["zsh", "-i"])
    try:
        _seen(terminal, "READY>")
        for line, offered in BEGUN:
            os.write(terminal, f"{line}\t".encode())
            _seen(terminal, f"{offered} ")
            os.write(terminal, b"\x15")  # the line anew
    finally:
        os.close(terminal)
        os.waitpid(child, 0)


def _seen(terminal: int, text: str) -> None:
    """Read from a terminal until it has said this."""
    said = ""
    while text not in said:
        assert select.select([terminal], [], [], PATIENCE_S)[0], said
        said += os.read(terminal, 4096).decode(errors="replace")


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_is_installed(shell: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--install-completion` for a shell writes its script below the home folder, and says where."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", f"/bin/{shell}")
    done = isel_twin("--install-completion", "--shell", shell)
    assert done.returncode == 0, done
    written = [path for path in tmp_path.rglob("*") if path.is_file() and "isel-twin" in path.name]
    assert written
    assert str(written[0]) in done.stdout
