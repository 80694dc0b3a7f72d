"""Runs what the pages print: `make docs-run`. ONE table below says of every command and every Python block what becomes
of it: it is run, in a project that `isel-twin init` has made, or why not, and who runs it then.

tests/test_printed.py checks that nothing printed is missing from the table.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent

# Not run, by the first expression that is found in "PAGE: BLOCK": why, and where the same is run.
LEFT_OUT = (
    (r": isel-twin (serve|tap|opcua|mtconnect|lsp|ctl)\b|--watch|panel session\.mcap +#",
     "stands until it is stopped, or talks to what does: tests/bridge, tests/panel"),
    (r"--isel-port|real\.mcap|capture\.|(sent|session)\.(bin|txt)|part\.(dump|out)|--cluster|/data/|~/",
     "needs a real controller, a capture, a cluster or a place of the reader's: tests/capture, tests/bridge"),
    (r": isel-twin linuxcnc", "needs LinuxCNC: tests/bridge/test_linuxcnc.py"),
    (r": isel-twin fmu|live\.|first\.mcap", "needs what lines before it serve: tests/bridge"),
    (r"gmi99\.md: ", "needs a PLC program of the reader's: tests/firmware/plc"),
    (r"gauge\.nc|identification\.md: |--machine (shop|mill)\b|describe shop", "a machine of the reader's: tests/many"),
    (r": isel-twin (tune|sweep)\b|--robust 20", "takes minutes: tests/cli/test_tune.py, tests/many/studies"),
    (r"(tuning|learning|sweeps|controllers)\.md: (#|\"|import|from)",
     "is run by a test of the page: test_tuning_doc.py, test_learning_doc.py, test_sweeps_page.py, test_plugin.py"),
    (r"bench\.md: import", "talks to what is served: tests/bridge"),
    (r"ci\.md: from", "is run by pytest: tests/pytest_plugin"),
    (r"exec\.md: from", "goes on from a host program of the reader's: tests/bridge"),
    (r"hosts\.md: import socket", "talks to what is served: tests/bridge"),
)  # fmt: skip

FAILS = re.compile(r"--scenario hood\.toml")  # exit code 1: the page says so

PROMPT = re.compile(r"^(?:\$ |- run: |- entry: |)(?:\.venv/bin/)?(isel-twin .*)$")
HOST = """\
import serial

with serial.Serial("COM4", 19200, timeout=60) as port:
    for command in ("@07", "@0R7", "@0A1600,800,0,30,0,30,0,30"):
        port.write(command.encode() + b"\\r")
        assert port.read() == b"0", command
"""
SLOT = "%1\nN1 G01 X10 Y5 F1000\nN2 G01 X30 Y5\nN3 M30\n"


def blocks() -> list[tuple[str, str]]:
    """Page and text of each command and each Python block."""
    found = []
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        name, text = page.relative_to(ROOT).as_posix(), page.read_text(encoding="utf-8").replace("\\\n", " ")
        found += [(name, block) for block in re.findall(r"```python[^\n]*\n(.*?)```", text, re.DOTALL)]
        for block in re.findall(r"(?:^(?: {4}.*)?\n)+", text, re.MULTILINE):
            lines = [line.removeprefix("    ") for line in block.splitlines()]
            if re.match(r"(import \w|from \w[\w.]* import)", "\n".join(lines).strip()):
                found.append((name, "\n".join(lines).strip() + "\n"))
            found += [(name, call[1]) for line in lines if (call := PROMPT.match(line.strip()))]
    return found


def left_out(page: str, block: str) -> str | None:
    """Why it is not run; None: it is."""
    for expression, why in LEFT_OUT:
        if re.search(expression, f"{page}: {block}"):
            return why
    return None


def prepare(folder: Path) -> None:
    """A project, and the files that pages take for granted."""
    subprocess.run([BIN / "isel-twin", "init", folder], check=True, stdout=subprocess.DEVNULL)
    square = folder / "jobs" / "square.txt"
    for name in ("job.txt", "jobs/pocket.txt"):
        shutil.copy(square, folder / name)
    shutil.copy(ROOT / "tests/cam/made/gerbv.ncp", folder / "part.ncp")
    (folder / "part.plt").write_text("IN;SP1;PU400,400;PD1200,400,1200,800;PU;SP0;\n")
    (folder / "part.nc").write_text(SLOT)
    (folder / "host.py").write_text(HOST)
    with (folder / "isel-twin.toml").open("a") as file:  # ends with [cam]
        file.write("feed_mm_s = 20.0\n")
    record = ("run", "job.txt", "--plant", "kinematic", "--record", "session.mcap", "--steps", "job.npz")
    subprocess.run([BIN / "isel-twin", *record], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def run(block: str, folder: Path) -> str:
    """Run it in a folder; return what is wrong, "" if nothing."""
    command = block.startswith("isel-twin ")
    call = ["bash", "-c", f'PATH="{BIN}:$PATH"; {block}'] if command else [sys.executable, "-c", block]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    wanted = 1 if command and FAILS.search(block) else 0
    return (
        "" if done.returncode == wanted else f"exit code {done.returncode}, not {wanted}: {done.stderr.strip()[-300:]}"
    )


def main() -> int:
    wrong = made = 0
    last = ""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "project"
        prepare(folder)
        for page, block in blocks():
            if left_out(page, block) is not None:
                continue
            if page != last:  # a golden run of a page is for its own call
                for golden in folder.glob("*.golden"):
                    golden.unlink()
            last = page
            if block.startswith("isel-twin init"):
                shutil.rmtree(folder / "shop", ignore_errors=True)
            what, made = run(block, folder), made + 1
            wrong += bool(what)
            print(f"{'WRONG' if what else 'ok':6} {page}: {block.splitlines()[0]}{what and ': ' + what}", flush=True)
    print(f"{made} run, {wrong} wrong, {len(blocks()) - made} left out with a reason")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
