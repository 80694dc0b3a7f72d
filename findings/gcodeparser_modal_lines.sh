#!/usr/bin/env bash
# gcodeparser leaves moves out of a program.
#
# Guess: `X5` behind `G1 X1` is a move, as G1 holds until another G comes (RS274), and `Y2` behind a remark in round
#        brackets belongs to its line.
# Seen:  of the four moves of this program two are found, and of the first its Y is missing; nothing tells of it.
# Here:  CAM programs write G once and coordinates alone for a thousand lines. It cannot be a judge of how a twin reads
#        them: rs274 of LinuxCNC is.
# With:  gcodeparser 0.3.0, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check gcodeparser==0.3.0 || exit 3

venv/bin/python -W ignore - <<'PY'
import sys
from importlib.metadata import version

from gcodeparser import GcodeParser

PROGRAM = """\
G1 X1 (a remark) Y2 F600
X5
X5 Y7
G0 X0 Y0
"""
found = [(line.command_str, line.params) for line in GcodeParser(PROGRAM).lines]
print(PROGRAM, end="")
print(f"gcodeparser {version('gcodeparser')}:", *found, sep="\n  ")
sys.exit(found != [("G1", {"X": 1}), ("G0", {"X": 0, "Y": 0})])
PY
