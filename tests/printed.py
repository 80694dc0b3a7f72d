"""Runs what the pages print, and compares what comes back with what they print of it: `make docs-run`, or
`python -m tests.printed docs/sweeps.md` for one page.

    $ isel-twin sweep speeds.toml              typed in a shell; the lines below it, to the next "$ ", are the answer
    speeds.parquet: 16 of 16 rows, ...         "..." stands for what varies; on a line of its own, for any lines

Commands without a prompt and Python blocks only have to work. Each page has a project of its own, as `isel-twin init`
makes it, with the files that the page shows ("# NAME" is the first line of their fence). ONE table below says which
commands are not run, why, and who runs them then; tests/test_printed.py checks that nothing is missing from it.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent

# Not run, by the first expression that is found in "PAGE: BLOCK": why, and where the same is run.
LEFT_OUT = (
    (r"bench\.md: (python|until|wait|isel-twin serve .*first\.mcap)|first\.mcap again\.mcap|--record again\.mcap",
     "is typed by a test of the page: tests/bridge/test_commissioning.py"),
    (r": isel-twin (serve|tap|opcua|mtconnect|lsp|ctl)\b|--watch|panel session\.mcap +#",
     "stands until it is stopped, or talks to what does: tests/bridge, tests/panel"),
    (r"--isel-port|real\.mcap|capture\.|(sent|session)\.(bin|txt)|part\.(dump|out)|--cluster|/data/|~/",
     "needs a real controller, a capture, a cluster or a place of the reader's: tests/capture, tests/bridge"),
    (r": isel-twin linuxcnc", "needs LinuxCNC: tests/bridge/test_linuxcnc.py"),
    (r": isel-twin fmu|live\.", "needs what lines before it serve: tests/bridge"),
    (r"gmi99\.md: ", "needs a PLC program of the reader's: tests/firmware/plc"),
    (r"gauge\.nc|identification\.md: |--machine mill\b", "a machine of the reader's: tests/many"),
    (r"run job\.txt --machine shop", "a job of the reader's: tests/models/test_machines_page.py"),
    (r"(tuning|learning|sweeps|controllers)\.md: (#|\"|import|from)",
     "is run by a test of the page: test_tuning_doc.py, test_learning_doc.py, test_sweeps_page.py, test_plugin.py"),
    (r"bench\.md: import", "talks to what is served: tests/bridge"),
    (r"ci\.md: from", "is run by pytest: tests/pytest_plugin"),
    (r"exec\.md: from", "goes on from a host program of the reader's: tests/bridge"),
    (r"hosts\.md: import socket", "talks to what is served: tests/bridge"),
)  # fmt: skip

# Exit codes other than 0, as the pages say.
CODES = (
    (r"--scenario hood\.toml|engrave\.txt|--report pages|golden compare jobs/pocket\.txt", 1),
    (r"isel-twin run .*wrong\.", 2),
)

COMMAND = re.compile(r"^(?:- run: |- entry: |)(?:\.venv/bin/)?(isel-twin .*)$")
PROMPT = "$ "
FILE = re.compile(r"```\w*\n# ([\w/-]+\.\w+)[^\n]*\n(.*?)```", re.DOTALL)
HOST = """\
import serial

with serial.Serial("COM4", 19200, timeout=60) as port:
    for command in ("@07", "@0R7", "@0A3200,800,0,30,0,30,0,30"):
        port.write(command.encode() + b"\\r")
        assert port.read() == b"0", command
"""
SLOT = "%1\nN1 G01 X10 Y5 F1000\nN2 G01 X30 Y5\nN3 M30\n"
POCKET = "@07\n@0R7\n@0M3200,1000,1600,1000,0,1000,0,30\n@0M14080,2500,1600,1000,0,1000,0,30\n@0P => *\n"


class Block(NamedTuple):
    """A command or a Python program of a page."""

    page: str
    text: str
    answer: str | None = None  # what the page prints below a prompt; None: without a prompt nothing is compared


def blocks(pages: tuple[Path, ...] = ()) -> list[Block]:
    """Every command and each Python block of these pages, or of all."""
    found = []
    for page in pages or (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        name, text = page.relative_to(ROOT).as_posix(), page.read_text(encoding="utf-8").replace("\\\n", " ")
        found += [Block(name, block) for block in re.findall(r"```python[^\n]*\n(.*?)```", text, re.DOTALL)]
        for lines in indented(text):
            if re.match(r"(import \w|from \w[\w.]* import)", lines[0]):
                found.append(Block(name, "\n".join(lines) + "\n"))
            elif lines[0].startswith(PROMPT):
                found += [Block(name, *step) for step in typed(lines)]
            else:
                found += [Block(name, call[1]) for line in lines if (call := COMMAND.match(line.strip()))]
    return found


def indented(text: str) -> list[list[str]]:
    """The lines of each indented block of a page."""
    found = re.findall(r"(?m)(?:^(?:    .*|)\n)*^    .*\n", text)
    return [[line[4:] for line in block.strip("\n").splitlines()] for block in found]


def typed(lines: list[str]) -> Iterator[tuple[str, str]]:
    """What is typed in a block that begins with a prompt, and the answer below it."""
    starts = [number for number, line in enumerate(lines) if line.startswith(PROMPT)]
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        yield lines[start].removeprefix(PROMPT), "".join(f"{line}\n" for line in lines[start + 1 : end])


def fits(answer: str, printed: str) -> bool:
    """True if an answer is as a page prints it, blanks at the end of a line and "..." apart."""

    def pattern(line: str) -> str:
        return r"(?:.*\n)*" if line == "..." else ".*".join(map(re.escape, line.split("..."))) + r"[ \t]*\n"

    return re.fullmatch("".join(pattern(line.rstrip()) for line in printed.splitlines()), answer) is not None


def left_out(page: str, block: str) -> str | None:
    """Why it is not run; None: it is."""
    for expression, why in LEFT_OUT:
        if re.search(expression, f"{page}: {block}"):
            return why
    return None


def prepare(folder: Path) -> None:
    """A project, and the files that pages take for granted."""
    subprocess.run([BIN / "isel-twin", "init", folder], check=True, stdout=subprocess.DEVNULL)
    shutil.copy(folder / "jobs" / "square.txt", folder / "job.txt")
    shutil.copy(ROOT / "tests/cam/made/gerbv.ncp", folder / "part.ncp")
    shutil.copytree(ROOT / "tests/jobs/imc", folder / "tests/jobs/imc")
    (folder / "part.plt").write_text("IN;SP1;PU400,400;PD1200,400,1200,800;PU;SP0;\n")
    (folder / "part.nc").write_text(SLOT)
    (folder / "host.py").write_text(HOST)
    (folder / "jobs" / "pocket.txt").write_text(POCKET)
    with (folder / "isel-twin.toml").open("a") as file:  # ends with [cam]
        file.write("feed_mm_s = 20.0\n")
    record = ("run", "job.txt", "--plant", "kinematic", "--record", "session.mcap", "--steps", "job.npz")
    subprocess.run([BIN / "isel-twin", *record], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def show_files(page: str, folder: Path) -> None:
    """Write the files that a page shows."""
    for name, text in FILE.findall((ROOT / page).read_text(encoding="utf-8")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def run(block: Block, folder: Path) -> str:
    """Run it in a folder; return what is wrong, "" if nothing."""
    shell = block.answer is not None or block.text.startswith("isel-twin ")
    call = ["bash", "-c", f'PATH="{BIN}:$PATH"; {block.text}'] if shell else [sys.executable, "-c", block.text]
    done = subprocess.run(
        call, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False
    )
    wanted = next((code for expression, code in CODES if shell and re.search(expression, block.text)), 0)
    if done.returncode != wanted:
        return f"exit code {done.returncode}, not {wanted}: {done.stdout.strip()[-300:]}"
    if block.answer is not None and not fits(done.stdout, block.answer):
        return f"answers\n{done.stdout}--- the page has\n{block.answer}"
    return ""


def main(names: list[str]) -> int:
    wrong = made = 0
    every = blocks(tuple(ROOT / name for name in names))
    with tempfile.TemporaryDirectory() as place:
        project, folder, last = Path(place) / "project", Path(place) / "page", ""
        prepare(project)
        for block in every:
            if left_out(block.page, block.text) is not None:
                continue
            if block.page != last:
                shutil.rmtree(folder, ignore_errors=True)
                shutil.copytree(project, folder)
                show_files(block.page, folder)
                last = block.page
            what, made = run(block, folder), made + 1
            wrong += bool(what)
            first = f"{block.page}: {block.text.splitlines()[0]}"
            print(f"{'WRONG' if what else 'ok':6} {first}{what and ': ' + what}", flush=True)
    print(f"{made} run, {wrong} wrong, {len(every) - made} left out with a reason")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
