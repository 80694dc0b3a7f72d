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
from typing import NamedTuple

from isel_twin.cam.gcode import GCode
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Caution, Dwell, Line, Rapid, Toolpath
from tests.forked import PATIENCE_S

Move = tuple[str | float, ...]
LOOSE = 1e-3  # mm and mm/min
LOOSE_ROUNDED = 6e-3  # of centres, of feeds, and of points in a file of both units: rs274 writes four decimals of each
AS_RS274 = CamSettings(z_sign=1, zeros={number: (0.0, 0.0, 0.0) for number in range(1, 10)}, strict=True)
TOOLS = "T1 P1 Z0 D3\nT2 P2 Z0 D6\n"
_CALL = re.compile(r"\s*\d+ N\S*\s+([A-Z0-9_]+)\((.*)\)")
_PLANES = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}


def command() -> str | None:
    """The interpreter: of the path, or of the variable RS274."""
    return os.environ.get("RS274") or shutil.which("rs274")


def interpreted(
    interpreter: str, program: str, folder: Path, least_mm: float = LOOSE_ROUNDED
) -> tuple[list[Move], str]:
    """Moves of a program, without straight ones that are no longer than this, and the error that ended it ("" for
    none)."""
    (folder / "fresh.var").write_text("5161\t0.0\n")
    (folder / "tools.tbl").write_text(TOOLS)
    (folder / "program.ngc").write_text(program)
    done = subprocess.run(
        [interpreter, "-t", "tools.tbl", "-v", "fresh.var", "-g", "program.ngc"],
        cwd=folder, env={**os.environ, "HOME": str(folder)},  # where its tools are kept while it runs
        capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    error = [line for line in done.stderr.splitlines() if line.strip() and line != "executing"]
    return _moves(done.stdout, least_mm), " / ".join(error) if done.returncode else ""


def _moves(calls: str, least_mm: float) -> list[Move]:
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
                if math.dist(to, at) > least_mm:
                    moves.append(("rapid", *to) if name == "STRAIGHT_TRAVERSE" else ("line", *to, feed))
            at = to
    return moves


class Read(NamedTuple):
    """What the reader makes of a program. unlike: behind so many moves, a difference from LinuxCNC that it has told."""

    moves: list[Move]
    error: str
    unlike: list[tuple[int, str]]


def read(path: Toolpath) -> Read:
    """Moves as `interpreted` has them."""
    moves: list[Move] = []
    unlike: list[tuple[int, str]] = []
    at = (0.0, 0.0, 0.0)
    try:
        for element in path:
            if isinstance(element, Caution) and "; LinuxCNC " in element.text:
                unlike.append((len(moves), element.text))
            elif isinstance(element, Rapid | Line) and math.dist(element.to, at) > LOOSE_ROUNDED:
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
        return Read(moves, str(error), unlike)
    return Read(moves, "", unlike)


def differ(ours: list[Move], theirs: list[Move], loose: float) -> tuple[int, str]:
    """Number of the first move that differs, and how; "" for none. loose: mm, of points."""
    for number, (own, other) in enumerate(zip(ours, theirs, strict=False)):
        if (
            len(own) != len(other)
            or own[0] != other[0]
            or any(_far(own, other, at, loose) for at in range(1, len(own)))
        ):
            return number, f"move {number}: {own} here, {other} there"
    both = min(len(ours), len(theirs))
    if len(ours) != len(theirs):
        return both, f"{len(ours)} moves here, {len(theirs)} there, as {max(ours, theirs, key=len)[both]}"
    return both, ""


def _far(own: Move, other: Move, at: int, loose: float) -> bool:
    p, q = float(own[at]), float(other[at])
    return abs(p - q) > (loose if at < 4 else LOOSE_ROUNDED) * max(1.0, abs(q) / 100 if at > 5 else 1.0)


class Verdict(NamedTuple):
    """why: what the reader makes otherwise than the interpreter; "" for nothing. told: the reader says that it does, as
    docs/jobfiles.md lists it."""

    why: str
    told: bool = False


def verdict(program: str, theirs: list[Move], their_error: str) -> Verdict:
    """Of a program that both refuse the moves before are compared; where rapids are told to be others, all that is cut,
    up to a hole that is told to be another."""
    ours, our_error, unlike = read(GCode().read(program.splitlines(), AS_RS274))
    loose = LOOSE_ROUNDED if "G20" in program and "G21" in program else LOOSE
    both = min(len(ours), len(theirs)) if our_error and their_error else max(len(ours), len(theirs))
    number, why = differ(ours[:both], theirs[:both], loose)
    if why and any(begin <= number for begin, _ in unlike):
        end = min((begin for begin, text in unlike if "the plane" in text or "the unit" in text), default=len(ours))
        cuts, others = ([move for move in moves if move[0] != "rapid"] for moves in (ours[:end], theirs))
        _, other = differ(cuts, others if end == both else others[: len(cuts)], loose)
        return Verdict(f"not only rapids differ: {other}") if other else Verdict(why, told=True)
    if bool(our_error) != bool(their_error):
        return Verdict(f"here: {our_error or 'no error'}; there: {their_error or 'no error'}")
    if our_error and abs(len(ours) - len(theirs)) > 3:
        return Verdict(f"refused here behind {len(ours)} moves, there behind {len(theirs)}: {our_error}; {their_error}")
    return Verdict(why)
