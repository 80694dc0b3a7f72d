"""Toolpaths as programs of the BWO 900: DIN 66025, absolute coordinates in mm, feeds in mm/min (bwo900/80).

P1
N10 G17 G40 G53 G90 G94
N20 P8816:2400                 rapid speed of the longest axis
N30 G0 X10 Y20
N40 G1 Z5 F300
N50 G3 X30 Y20 I20 J20
N60 M30
#
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

from isel_twin.cam.arcs import PLANES
from isel_twin.cam.course import CLOSE, Move, Turn, halves
from isel_twin.cam.toolpath import CamError, Place
from isel_twin.cam.writing import Speed
from isel_twin.cam.written import Counts, MachineAxes, Written
from isel_twin.firmware.bwo900.numbers import G, M, P
from isel_twin.firmware.bwo900.programs.lines import END
from isel_twin.firmware.bwo900.programs.syntax import LONGEST

CENTRES = "IJK"
CODES = dict(zip(PLANES, (G.PLANE_YZ, G.PLANE_ZX, G.PLANE_XY), strict=True))
LEAST_ARC_MM = 0.02  # smaller radii, and shorter arcs, are chords
MOST_ARC_MM = 100_000.0  # larger radii, too
ROUND_MM = 0.002  # by which the radius of an arc may change: less than P8843
SLOWEST_MM_MIN = 0.01  # feed; three decimals are written
MINUTE_S = 60.0
STEP = 10  # of block numbers
M_FUNCTIONS = range(100)


class Bwo900Commands:
    """Implements `isel_twin.cam.writing.Commands`."""

    high_hz = math.inf  # by the axes
    along_path = True
    both_senses = True
    speed_by: Final = "number"

    def __init__(self, axes: MachineAxes, outputs: Mapping[str, int], rapid_mm_s: float) -> None:
        self._x, self._y, self._z = axes.steps_mm
        self.low_hz = SLOWEST_MM_MIN / MINUTE_S * min(axes.steps_mm)
        self._rapid_mm_s = rapid_mm_s
        self._outputs = outputs
        self._number = 0
        self._plane: int = G.PLANE_XY
        self._mm_s = 0.0
        self._feed = ""  # as it is written: small changes are none
        self._stands = True  # behind G0 and a dwell
        self._cooled: set[int] = set()

    def _block(self, words: str) -> str:
        self._number += STEP
        return f"N{self._number} {words}"

    def begin(self) -> Iterable[str]:
        yield "P1"
        yield self._block(f"G{G.PLANE_XY} G{G.RADIUS_OFF} G{G.MACHINE_ZERO} G{G.ABSOLUTE} G{G.FEED_PER_MINUTE}")
        yield self._block(f"P{P.RAPID}:{_number(self._rapid_mm_s * MINUTE_S)}")

    def _words(self, to: Counts, steps: Counts) -> str:
        """Those that change, in mm."""
        words = f" X{_number(to[0] / self._x)}" if steps[0] else ""
        if steps[1]:
            words += f" Y{_number(to[1] / self._y)}"
        return words + f" Z{_number(to[2] / self._z)}" if steps[2] else words

    def _fed(self, mm_s: float) -> str:
        if mm_s == self._mm_s:
            return ""
        self._mm_s = mm_s
        feed = _number(mm_s * MINUTE_S)
        if feed == self._feed:
            return ""
        self._feed = feed
        return f" F{feed}"

    def move(self, move: Move) -> Iterable[Written]:
        words = self._words(move.to, move.steps)
        self._stands = move.rapid
        if move.rapid and abs(move.speed_mm_s - self._rapid_mm_s) <= CLOSE * self._rapid_mm_s:
            return (Written(self._block(f"G0{words}"), move.place),)
        stop = f" G{G.EXACT_STOP_HERE}" if move.rapid else ""
        return (Written(self._block(f"G1{stop}{words}{self._fed(move.speed_mm_s)}"), move.place),)

    def turn_counts(self, turn: Turn) -> float | None:
        sized = min(turn.radius_mm, turn.flat_mm) >= LEAST_ARC_MM and turn.radius_mm <= MOST_ARC_MM
        counts = turn.length_mm * min(self._x, self._y, self._z)
        return counts if sized and abs(turn.spread_mm) <= ROUND_MM else None

    def turn(self, turn: Turn) -> Iterable[Written]:
        """G18 turns from Z to X."""
        self._stands = False
        plane = CODES[turn.a, turn.b]
        select = f"G{plane} " if plane != self._plane else ""
        self._plane = plane
        per_mm = (self._x, self._y, self._z)
        forwards = (turn.sweep > 0) != (plane == G.PLANE_ZX)
        code = G.CIRCLE_COUNTER_CLOCKWISE if forwards else G.CIRCLE_CLOCKWISE
        (u, v), a, b = turn.centre, turn.a, turn.b
        centre = f" {CENTRES[a]}{_number(u / per_mm[a], 4)} {CENTRES[b]}{_number(v / per_mm[b], 4)}"
        at = turn.start
        for to in halves(turn):
            moved = [1, 1, 1]  # both axes of the plane are always written
            moved[3 - a - b] = to[3 - a - b] - at[3 - a - b]
            words = self._words(to, (moved[0], moved[1], moved[2]))
            yield Written(self._block(f"{select}G{code}{words}{centre}{self._fed(turn.speed_mm_s)}"), turn.place)
            select, at = "", to

    def held(self) -> Iterable[Written]:
        return ()

    def settled(self, place: Place) -> Iterable[Written]:
        """By a dwell of no time: each is behind an exact stop (bwo900/19), as G0 is by itself."""
        if self._stands:
            return ()
        self._stands = True
        return (Written(self.dwell(0.0), place),)

    def reference(self, axes: tuple[int, ...]) -> None:
        return None

    def dwell(self, seconds: float) -> str:
        return self._block(f"G04.{seconds:.3f}")

    def spindle(self, turns: int, speed: Speed | None) -> Iterable[str] | None:
        if not turns:
            return [self._block(f"M{M.SPINDLE_OFF}")]
        rev_min = "" if speed is None else f" S{round(speed.rev_min)}"
        return [self._block(f"M{M.SPINDLE_RIGHT if turns > 0 else M.SPINDLE_LEFT}{rev_min}")]

    def coolant(self, number: int, on: bool) -> Iterable[str] | None:
        """M9 ends both."""
        (self._cooled.add if on else self._cooled.discard)(number)
        switched = [M.COOLANT_1_ON if each == 1 else M.COOLANT_2_ON for each in ([number] if on else self._cooled)]
        return [self._block(" ".join(f"M{function}" for function in [*([] if on else [M.COOLANT_OFF]), *switched]))]

    def output(self, name: str, on: bool) -> Iterable[str] | None:
        """By two M functions of the PLC, on and off, as M10 and M11."""
        if name not in self._outputs:
            return None
        if (function := self._outputs[name]) not in M_FUNCTIONS:
            raise CamError(
                f"[cam] outputs: {name} = {function}; it is the M function that switches it on, the next off"
            )
        return [self._block(f"M{function if on else function + 1}")]

    def remark(self, text: str) -> str:
        plain = " ".join(text.split()).replace("\\", "/").encode("latin-1", "replace").decode("latin-1")
        return f"; {plain}"[:LONGEST]

    def end(self) -> Iterable[str]:
        return [self._block(f"M{M.END}"), END]


def _number(value: float, decimals: int = 3) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
