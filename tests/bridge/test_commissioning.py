"""The commissioning of docs/bench.md, followed to the letter: each line is typed, each answer compared."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import printed
from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=8)

PAGE = Path(__file__).parents[2] / "docs" / "bench.md"
SECTION = "## A commissioning, step by step"
PORT = "127.0.0.1:4002"


def blocks() -> list[list[str]]:
    """The indented blocks of the section."""
    return printed.indented(PAGE.read_text(encoding="utf-8").split(SECTION)[1].split("\n## ")[0])


def steps() -> list[tuple[str, str]]:
    """What is typed, and what comes back."""
    return [step for block in blocks() if block[0].startswith(printed.PROMPT) for step in printed.typed(block)]


class Shell:
    """A bash that is typed to."""

    def __init__(self, folder: Path) -> None:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self._bash = subprocess.Popen(
            ["bash", "--norc"],
            cwd=folder,
            env={**os.environ, "PATH": path, "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def type(self, line: str) -> str:
        """What comes back; all of it, the exit code of the command last if it is not 0."""
        assert self._bash.stdin is not None
        assert self._bash.stdout is not None
        mark = uuid.uuid4().hex
        self._bash.stdin.write(f"{line}\necho {mark} $?\n")
        self._bash.stdin.flush()
        out = ""
        for answer in self._bash.stdout:
            if answer.startswith(mark):
                code = answer.split()[1]
                return out if code == "0" else f"{out}exit code {code}\n"
            out += answer
        return f"{out}the shell has ended\n"

    def close(self) -> None:
        assert self._bash.stdin is not None
        self._bash.stdin.write("kill %1 2>/dev/null; wait\n")
        self._bash.stdin.close()
        self._bash.wait(PATIENCE_S)


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Shell]:
    (program,) = (block for block in blocks() if block[0].startswith("# host.py"))
    (tmp_path / "host.py").write_text("\n".join(program) + "\n")
    shell = Shell(tmp_path)
    yield shell
    shell.close()


@pytest.mark.slow
def test_the_commissioning_works_as_it_is_written(shell: Shell) -> None:
    typed = steps()
    assert len(typed) == 20
    with socket.socket() as free:  # the page's port may be taken here
        free.bind(("127.0.0.1", 0))
        port = "{}:{}".format(*free.getsockname())
    for line, expected in typed:
        answer = re.sub(r"(?m)^\[\d+\].*\n", "", shell.type(line.replace(PORT, port)))  # bash's own words about jobs
        assert printed.fits(answer, expected.replace(PORT, port)), f"$ {line}\n{answer}--- the page has\n{expected}"
