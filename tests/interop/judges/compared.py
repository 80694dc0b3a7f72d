"""A part and what is made of it, as judges read both.

part --- convert ---> commands --- decode ---> G-code        read by all judges as it was meant, move by move, and
  |                                              |           by rs274 as the way of the part
rs274                                          rs274
  |        the program of a BWO 900 --- rs274 ---|           the same way, its Z downwards, within 1 um and
                                                                 the chords of spirals
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2]))  # as pytest does

import numpy as np
from cam.played import ideal_mm, is_near, largest_radius_mm, lines_of, swept_mm2, texts

from isel_twin.cam.files import WRITERS
from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Element, Line, Place, Point, Rapid
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.recovered import CHORD_MM, recovered
from isel_twin.jobs.toolpaths import source_of
from isel_twin.language import create_language
from tests.interop.rs274.canon import LOOSE, LOOSE_ROUNDED, Move, differ, read

MACHINES = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}
STEP_MM = {"imc-s8": 1 / 320, "ismif": 1 / 80, "gmi99": 1e-3, "bwo900": 1e-3}
ZERO: Point = (100.0, 100.0, -60.0)  # of the work, in mm of the machine
SETTINGS = CamSettings(zero=(100.0, 100.0, 60.0), tolerance_mm=0.002)  # Z of the counters grows downwards
UP = CamSettings(z_sign=1)
P = Place(1)


def decoded(part: str, controller: str) -> list[Element]:
    """What a controller has made of a part."""
    spec = TwinSpec(MACHINES[controller], controller)
    source = source_of(part.encode(), ".nc", create_language(controller), controller, spec.fitted, SETTINGS)
    assert source is not None
    return list(recovered([line.sent for line in source.lines], spec))


def written(path: Sequence[Element]) -> str:
    return "\n".join([*WRITERS["gcode"](iter(path)), ""])


def unlike(path: Sequence[Element], theirs: Sequence[Move]) -> str:
    """The first move that a judge reads otherwise than it was written, by more than 1 um; "" for none. Judges that tell
    no feeds are asked for none; moves of no length, which `read` leaves out, are left out there, too."""
    ours = read(iter(path)).moves
    long = [move for move, before in zip(theirs, [("", 0.0, 0.0, 0.0), *theirs], strict=False) if _moves(move, before)]
    if len(long) == len(ours):
        ours = [own[: len(other)] for own, other in zip(ours, long, strict=True)]
    return differ(ours, long, LOOSE)[1]


def _moves(move: Move, before: Move) -> bool:
    return move[0] == "arc" or math.dist(_end(move), _end(before)) > LOOSE_ROUNDED


def program(part: str) -> str:
    """The program of a BWO 900, in the words of RS274: without its own number, parameter, dwells and zeros that are
    off; centres of arcs are absolute."""
    path = reader_named("gcode").read(part.splitlines(), SETTINGS)
    lines = texts(lines_of("bwo900", path, SETTINGS))
    own = re.compile(r"G53 |G04\.\d+\.\d+|P8816:\d+|^P1$|^#$|;.*")
    return "\n".join(["G21 G90.1", *(own.sub("", line) for line in lines), ""])


def near_mm(controller: str) -> float:
    """By which a decoded file may leave its part: chords of convert and of decode, a step of each axis."""
    steps = math.sqrt(3.0) * STEP_MM[controller]
    return LOOSE + SETTINGS.tolerance_mm + steps + max(CHORD_MM, steps)


def astray(part: Sequence[Move], made: Sequence[Move], near: float, sense: int = 1) -> str:
    """How the way of what was made leaves that of its part, both as a judge reads them; "" for no more than near, mm.

    sense: -1 if its Z grows downwards. The way to the first point is not compared."""
    asked = [_at_zero(element) for element in elements(part)]
    begin = asked[0].to
    wanted = ideal_mm(asked, UP, begin) * (1.0, 1.0, sense)
    way = ideal_mm(elements(made), UP)
    way = way[int(np.argmax(np.linalg.norm(way - wanted[0], axis=1) < near)) :]
    near += largest_radius_mm(asked) * (1.0 - math.cos(math.radians(1.0)))  # of the ways compared
    if not is_near(way, wanted, near) or not is_near(wanted, way, near):
        return f"leaves the way by more than {near:.4f} mm"
    if math.dist(way[-1], wanted[-1]) > near:
        return f"ends at {way[-1]}, not {wanted[-1]}"
    length = float(np.linalg.norm(np.diff(wanted, axis=0), axis=1).sum())
    swept = float(np.abs(swept_mm2(way) - swept_mm2(wanted)).max())
    return f"sweeps {swept:.3f} mm2 more or less" if swept > 2.0 * near * (length + 1.0) else ""


def elements(moves: Sequence[Move]) -> list[Rapid | Line | Arc]:
    found: list[Rapid | Line | Arc] = []
    for move in moves:
        if move[0] == "rapid":
            found.append(Rapid(P, _end(move)))
        elif move[0] == "line":
            found.append(Line(P, _end(move), 1.0))
        elif move[0] == "arc":
            a, b, third, turns = (float(value) for value in move[4:8])
            plane = round(third)
            centre = [0.0, 0.0, 0.0]
            centre[(plane + 1) % 3], centre[(plane + 2) % 3] = a, b
            found.append(Arc(P, _end(move), (centre[0], centre[1], centre[2]), plane, round(turns), 1.0))
    return found


def _end(move: Move) -> Point:
    return float(move[1]), float(move[2]), float(move[3])


def _at_zero(element: Rapid | Line | Arc) -> Rapid | Line | Arc:
    moved = element._replace(to=_shifted(element.to))
    return moved._replace(centre=_shifted(moved.centre)) if isinstance(moved, Arc) else moved


def _shifted(point: Point) -> Point:
    return point[0] + ZERO[0], point[1] + ZERO[1], point[2] + ZERO[2]
