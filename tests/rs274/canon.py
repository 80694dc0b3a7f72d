"""What LinuxCNC's stand-alone interpreter makes of a program: its canonical calls as moves in mm of the machine.

A move is ("rapid", x, y, z), ("line", x, y, z, feed), ("arc", x, y, z, centre a, centre b, plane, turns, feed) or
("dwell", s); feeds in mm/min. Its values stand in units and coordinates of the program; offsets are announced.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from pathlib import Path

from isel_twin.cam.gcode import GCode
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Dwell, Line, Rapid, Toolpath
from tests.forked import PATIENCE_S

Move = tuple[str | float, ...]
LOOSE = 1e-3  # mm and mm/min: rs274 writes four decimals,
LOOSE_INCH = 6e-3  # of inches too
AS_RS274 = CamSettings(z_sign=1, zeros={number: (0.0, 0.0, 0.0) for number in range(1, 10)}, strict=True)
TOOLS = "T1 P1 Z0 D3\nT2 P2 Z0 D6\n"
_CALL = re.compile(r"\s*\d+ N\S*\s+([A-Z0-9_]+)\((.*)\)")
_PLANES = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}


def command() -> str | None:
    """The interpreter: of the path, or of the variable RS274."""
    return os.environ.get("RS274") or shutil.which("rs274")


def interpreted(interpreter: str, program: str, folder: Path) -> tuple[list[Move], str]:
    """Moves of a program, and the error that ended it ("" for none)."""
    (folder / "fresh.var").write_text("5161\t0.0\n")
    (folder / "tools.tbl").write_text(TOOLS)
    (folder / "program.ngc").write_text(program)
    done = subprocess.run(
        [interpreter, "-t", "tools.tbl", "-v", "fresh.var", "-g", "program.ngc"],
        cwd=folder, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    error = [line for line in done.stderr.splitlines() if line.strip() and line != "executing"]
    return _moves(done.stdout), " / ".join(error) if done.returncode else ""


def _moves(calls: str) -> list[Move]:
    unit, feed, plane = 1.0, 0.0, "XY"
    offsets = {"SET_G5X_OFFSET": [0.0] * 3, "SET_G92_OFFSET": [0.0] * 3, "USE_TOOL_LENGTH_OFFSET": [0.0] * 3}
    at = (0.0, 0.0, 0.0)
    moves: list[Move] = []
    for line in calls.splitlines():
        match = _CALL.match(line)
        if match is None:
            continue
        name, text = match.groups()
        if name in offsets:
            numbers = [float(word) for word in re.findall(r"-?[\d.]+", text)]
            offsets[name] = [unit * value for value in (numbers[1:4] if name == "SET_G5X_OFFSET" else numbers[:3])]
        elif name == "USE_LENGTH_UNITS":
            unit = 25.4 if "INCHES" in text else 1.0
        elif name == "SELECT_PLANE":
            plane = text[-2:]
        elif name == "SET_FEED_RATE":
            feed = float(text) * unit
        elif name == "DWELL":
            moves.append(("dwell", float(text)))
        elif name in ("STRAIGHT_TRAVERSE", "STRAIGHT_FEED", "ARC_FEED"):
            values = [float(word) * unit for word in text.split(",")]
            shift = [sum(axis) for axis in zip(*offsets.values(), strict=True)]
            if name == "ARC_FEED":
                a, b, third = _PLANES[plane]
                point = [0.0] * 3
                point[a], point[b], point[third] = values[0], values[1], values[5]
                to = tuple(p + s for p, s in zip(point, shift, strict=True))
                moves.append(("arc", *to, values[2] + shift[a], values[3] + shift[b], third, values[4] / unit, feed))
            else:
                to = tuple(p + s for p, s in zip(values, shift, strict=False))
                if math.dist(to, at) > LOOSE:
                    moves.append(("rapid", *to) if name == "STRAIGHT_TRAVERSE" else ("line", *to, feed))
            at = to
    return moves


def read(path: Toolpath) -> tuple[list[Move], str]:
    """The same of a reader's toolpath."""
    moves: list[Move] = []
    at = (0.0, 0.0, 0.0)
    try:
        for element in path:
            if isinstance(element, Rapid | Line) and math.dist(element.to, at) > LOOSE:
                feed = (element.feed_mm_s * 60.0,) if isinstance(element, Line) else ()
                moves.append(("line" if feed else "rapid", *element.to, *feed))
            elif isinstance(element, Arc):
                a, b, third = {2: (0, 1, 2), 1: (2, 0, 1), 0: (1, 2, 0)}[element.plane]
                centre = element.centre
                moves.append(
                    ("arc", *element.to, centre[a], centre[b], third, element.turns, element.feed_mm_s * 60.0)
                )  # fmt: skip
            elif isinstance(element, Dwell):
                moves.append(("dwell", element.seconds))
            if isinstance(element, Rapid | Line | Arc):
                at = element.to
    except CamError as error:
        return moves, str(error)
    return moves, ""


def differ(ours: list[Move], theirs: list[Move], loose: float) -> str:
    """The first difference, "" for none; loose: mm and mm/min."""
    for number, (own, other) in enumerate(zip(ours, theirs, strict=False)):
        near = len(own) == len(other) and own[0] == other[0]
        if not near or any(
            abs(float(p) - float(q)) > loose * max(1.0, abs(float(q)) / 100)
            for p, q in zip(own[1:], other[1:], strict=True)
        ):
            return f"move {number}: {own} here, {other} there"
    if len(ours) != len(theirs):
        more = (ours if len(ours) > len(theirs) else theirs)[min(len(ours), len(theirs))]
        return f"{len(ours)} moves here, {len(theirs)} there, as {more}"
    return ""


def verdict(program: str, theirs: list[Move], their_error: str) -> str:
    """What this reader makes otherwise of a program than the interpreter; "" for nothing. Of a program that both refuse
    the moves before are compared."""
    ours, our_error = read(GCode().read(program.splitlines(), AS_RS274))
    if bool(our_error) != bool(their_error):
        return f"here: {our_error or 'no error'}; there: {their_error or 'no error'}"
    both = min(len(ours), len(theirs)) if our_error else max(len(ours), len(theirs))
    if our_error and abs(len(ours) - len(theirs)) > 3:
        return f"refused here behind {len(ours)} moves, there behind {len(theirs)}: {our_error}; {their_error}"
    return differ(ours[:both], theirs[:both], LOOSE_INCH if "G20" in program else LOOSE)
