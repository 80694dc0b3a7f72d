"""A dump of this package, and what other programs read in it: sigrok-cli, GTKWave's vcd2fst with fst2vcd, wellen.

Values are text: of a wire 0, 1 or x, of a number its digits, of a text itself.
"""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from vcd.reader import TokenKind, tokenize

from isel_twin import Twin
from isel_twin.capture.player import Player
from isel_twin.capture.ticks import Ticks
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.vcd import write_vcd
from tests.forked import PATIENCE_S

MS = 1_000_000
X, Y = [1] * 12 + [-1] * 5, [1] * 7 + [0] * 10
"""Steps, one each ms from 1 ms and 1 ns on; between the ninth and the tenth the hood is opened."""
STEPS_NS = [(k + 1) * MS + 1 for k in range(len(X))]
OPENED_NS = 9_500_000
PROGRAMS = {"sigrok-cli": "sigrok-cli", "vcd2fst": "gtkwave", "fst2vcd": "gtkwave"}
"""And the package of Debian that each comes with."""
WELLEN = """
import json, sys, pywellen
found = {}
for var in pywellen.Waveform(sys.argv[1]).all_vars():
    kind = "{:.16g}" if var.is_real else "{}"
    found[var.full_name] = [[time, kind.format(value)] for time, value in var.signal]
print(json.dumps(found))
"""
Changes = dict[str, list[list[int | str]]]  # time in ns and value, by scope and name of a signal


def written(path: Path) -> None:
    delta = np.array([X, Y, [0] * len(X)], dtype=np.int8).T
    ticks = Ticks(np.array(STEPS_NS), delta, 20 * MS)
    twin = Twin(controller=Player(ticks), plant="kinematic", start_mm=(50, 50, 20))
    with Recorder(twin, MS) as recorder:
        twin.run_until(OPENED_NS)
        twin.set_input("hood", "open")
        twin.run_until(20 * MS)
        write_vcd(path, twin.steps, recorder)


def by_pyvcd(dump: str) -> Changes:
    names: dict[str, str] = {}
    scopes: list[str] = []
    changes: Changes = {}
    now = 0
    for token in tokenize(io.BytesIO(dump.encode())):
        if token.kind is TokenKind.SCOPE:
            scopes.append(token.scope.ident)
        elif token.kind is TokenKind.UPSCOPE:
            scopes.pop()
        elif token.kind is TokenKind.VAR:
            names[token.var.id_code] = ".".join([*scopes, token.var.reference])
            changes[names[token.var.id_code]] = []
        elif token.kind is TokenKind.CHANGE_TIME:
            now = token.time_change
        elif token.kind in (TokenKind.CHANGE_SCALAR, TokenKind.CHANGE_REAL, TokenKind.CHANGE_STRING):
            value = token.data.value
            text = f"{value:.16g}" if isinstance(value, float) else str(value)
            changes[names[token.data.id_code]].append([now, text])
    return changes


def by_sigrok(path: Path) -> Changes:
    """Of wires: the only ones it reads; a sample is a microsecond."""
    read = ("sigrok-cli", "--input-format", "vcd:downsample=1000", "--input-file", path)
    text = output(*read, "--output-format", "vcd")
    found = by_pyvcd(text[text.index("$") :])  # behind a line of its own
    return {name.partition(".")[2]: [[1000 * int(time), what] for time, what in seen] for name, seen in found.items()}


def stepper_positions(path: Path, axis: str) -> list[int]:
    """By sigrok's decoder of stepper motors."""
    read = ("sigrok-cli", "--input-format", "vcd:downsample=1000", "--input-file", path)
    decoder = ("-P", f"stepper_motor:step=step_{axis}:dir=dir_{axis}", "-A", "stepper_motor=position")
    return [int(number) for number in re.findall(r": (-?\d+) steps", output(*read, *decoder))]


def by_gtkwave(path: Path) -> Changes:
    output("vcd2fst", path, path.with_suffix(".fst"))
    return by_pyvcd(output("fst2vcd", path.with_suffix(".fst")))


def by_wellen(path: Path) -> Changes:
    """Of Surfer."""
    uv = (
        sys.executable,
        "-m",
        "uv",
        "run",
        "--no-project",
        "--quiet",
        "--with",
        "pywellen==0.25.7",
        "python",
        "-c",
        WELLEN,
    )
    found: Changes = json.loads(output(*uv, path))
    return found


def output(*words: str | Path) -> str:
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=PATIENCE_S).stdout


def missing() -> list[str]:
    return [f"{name} ({package})" for name, package in PROGRAMS.items() if shutil.which(name) is None]
