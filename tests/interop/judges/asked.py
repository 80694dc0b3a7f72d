"""The judges, each asked for the moves of a G-code file in the form of tests/interop/rs274/canon.py.

rs274           of LinuxCNC: on the path, or RS274 names it; reads all of a part, too
pygcode         GCODE_PYTHON names a Python that has it
gcode-toolpath  GCODE_TOOLPATH names the folder where npm has installed it; tells no feeds
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from tests.forked import PATIENCE_S
from tests.interop.rs274.canon import Move, command, interpreted

HERE = Path(__file__).parent


def judges(folder: Path) -> Mapping[str, Callable[[str], list[Move]]]:
    """Those that are here."""
    found: dict[str, Callable[[str], list[Move]]] = {}
    if (interpreter := command()) is not None:
        found["rs274"] = lambda text: _without_error(*interpreted(interpreter, text, folder, 0.0))
    if (python := os.environ.get("GCODE_PYTHON")) is not None:
        found["pygcode"] = lambda text: _told([python, "-W", "ignore", str(HERE / "with_pygcode.py")], text)
    if "GCODE_TOOLPATH" in os.environ:
        found["gcode-toolpath"] = lambda text: _told(["node", str(HERE / "toolpath.mjs")], text)
    return found


def _without_error(moves: list[Move], error: str) -> list[Move]:
    if error:
        raise ValueError(error)
    return moves


def _told(command: list[str], text: str) -> list[Move]:
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    if done.returncode:
        raise ValueError(done.stderr.strip().rpartition("\n")[2])
    return [tuple(move) for move in json.loads(done.stdout)]
