"""Toolpaths as telegrams of the GMI99.

    f10000 | 83h 20000 0 | 83h 20000 30000       cuts in one line are joined, as the card's limits of corners allow
    G3 | 83h -5000 0 | 83h 15000 0               a half circle at most: centre from here, end

    m100;1;12000 | p10;16;0                      the speed of the spindle by the PLC, and the spindle on

f is the speed along the path, in counts of the coarsest axis: W tells the card the resolution of the others (gmi99/34).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from isel_twin.cam.course import Move, Turn, halves
from isel_twin.cam.toolpath import CamError, Place
from isel_twin.cam.writing import COOLANT, Speed, pause, remark
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.firmware.gmi99.instruction import MOVE_BIT
from isel_twin.firmware.gmi99.planner import factor
from isel_twin.firmware.gmi99.settings import HIGHEST, RATIO_ONE

LEAST_HZ, MOST_HZ = 5, 1_000_000  # of M
FREE_HZ = 50_000  # up to here speeds need not be multiples of anything
MOST_MOVES = 60  # in a line; the card buffers 100
MOST_OTHERS = 90  # commands for them: feeds, senses, waits; it buffers 100, too
LONGEST_S = 20.0  # of a line
SPINDLE = 0  # output A0.0
SPEED = 100  # M function: the speed of spindle 1 (gmi99/36)
OUTPUTS = range(96)
SET, RESET = 16, 17  # codes of direct output
LEAST_ARC = 20  # counts: smaller radii, and shorter arcs, are chords
IN_POSITION = "H2"
ROUND = 2.0  # counts by which the radius of an arc may change


class Gmi99Commands:
    """Implements `isel_twin.cam.writing.Commands`."""

    along_path = True
    both_senses = False
    speed_by: Final = "scale"

    def __init__(self, axes: MachineAxes, outputs: Mapping[str, int], rapid_mm_s: float) -> None:
        self._axes = axes
        self._per_mm = min(axes.steps_mm)
        top = min(axes.top_mm_s) if axes.top_mm_s else max(rapid_mm_s, FREE_HZ / self._per_mm)
        self.high_hz = min(max(math.floor(top * self._per_mm), LEAST_HZ), MOST_HZ)
        self.low_hz = 2 * factor(self.high_hz)
        self._outputs = outputs
        self._hz = 0
        self._held: list[str] = []
        self._moves = self._others = 0
        self._takes_s = 0.0
        self._rapid = False
        self._spins, self._rev_min = False, -1
        self._place: Place | None = None

    def begin(self) -> Iterable[str]:
        """Reference run, Z first; absolute coordinates; resolutions; top speed."""
        count = self._axes.count
        ratios = (round(self._per_mm / steps * RATIO_ONE) for steps in self._axes.steps_mm[:count])
        return [
            *self.reference(tuple(range(count))),
            "G90",
            "G94",
            *(f"W1;{ratio};{slot}" for slot, ratio in enumerate(ratios, 1) if ratio != RATIO_ONE),
            f"M{self.high_hz}",
        ]

    def move(self, move: Move) -> Iterable[Written]:
        done = self._room(move.place, move.length_mm / move.speed_mm_s, move.rapid)
        self._speed(move.speed_mm_s)
        mask, numbers = 0, ""
        for axis, steps in enumerate(move.steps):
            if steps:
                mask |= 1 << axis
                numbers += f" {move.to[axis]}"
        self._held.append(f"{MOVE_BIT | mask:02X}h{numbers}")
        return done

    def turn_counts(self, turn: Turn) -> float | None:
        """Neither a helix, of which the manual says nothing, nor a spiral."""
        flat = all(turn.start[axis] == turn.to[axis] for axis in range(3) if axis not in (turn.a, turn.b))
        sized = min(turn.radius_mm, turn.flat_mm) * turn.per_mm >= LEAST_ARC and turn.radius_mm * turn.per_mm <= HIGHEST
        return turn.length_mm * self._per_mm if flat and sized and abs(turn.spread_mm) * turn.per_mm <= ROUND else None

    def turn(self, turn: Turn) -> Iterable[Written]:
        code = f"{MOVE_BIT | 1 << turn.a | 1 << turn.b:02X}h"
        sense = 3 if turn.sweep > 0 else 2
        ends = halves(turn)
        takes_s = turn.length_mm / len(ends) / turn.speed_mm_s
        (u, v), x, y = turn.centre, turn.a, turn.b
        at = turn.start
        for to in ends:
            yield from self._room(turn.place, takes_s, rapid=False)
            self._speed(turn.speed_mm_s)
            centre = f"{round(u - at[x])} {round(v - at[y])}"
            self._held.append(f"G{sense} | {code} {centre} | {code} {to[x]} {to[y]}")
            self._moves += 1
            self._others += 1
            at = to

    def _room(self, place: Place, takes_s: float, rapid: bool) -> Iterable[Written]:
        """What is held back, if a move that takes so long cannot join it."""
        full = self._moves >= MOST_MOVES or self._others >= MOST_OTHERS or self._takes_s + takes_s > LONGEST_S
        done = self.held() if full or rapid != self._rapid else ()
        self._rapid = rapid
        self._place = self._place or place
        self._takes_s += takes_s
        self._moves += 1
        return done

    def _speed(self, mm_s: float) -> None:
        if (hz := round(mm_s * self._per_mm)) != self._hz:
            self._hz = hz
            self._others += 1
            self._held.append(f"f{hz}")

    def held(self) -> Iterable[Written]:
        if not self._held:
            return ()
        line = Written(" | ".join(self._held), self._place)
        self._held, self._moves, self._others, self._takes_s, self._place = [], 0, 0, 0.0, None
        return (line,)

    def settled(self, place: Place) -> Iterable[Written]:
        """By H, in the line of the moves before it."""
        if self._held[-1:] != [IN_POSITION]:
            self._others += 1
            self._held.append(IN_POSITION)
            self._place = self._place or place
        return ()

    def reference(self, axes: tuple[int, ...]) -> Iterable[str]:
        """Z first, so that nothing is in the way of X and Y."""
        masks = (4 if 2 in axes else 0, sum(1 << axis for axis in axes if axis < 2))
        return [f"Q{mask};1" for mask in masks if mask]

    def dwell(self, seconds: float) -> str:
        return pause(seconds)

    def spindle(self, turns: int, speed: Speed | None) -> Iterator[str]:
        if turns and speed is not None and (rev_min := round(speed.rev_min)) != self._rev_min:
            self._rev_min = rev_min
            yield f"m{SPEED};1;{rev_min}"
            if self._spins:
                return
        self._spins = bool(turns)
        yield from self._switch("spindle", self._outputs.get("spindle", SPINDLE), self._spins)

    def coolant(self, number: int, on: bool) -> Iterable[str] | None:
        return self.output(COOLANT[number], on)

    def output(self, name: str, on: bool) -> Iterable[str] | None:
        return self._switch(name, self._outputs[name], on) if name in self._outputs else None

    def _switch(self, name: str, bit: int, on: bool) -> list[str]:
        if bit not in OUTPUTS:
            raise CamError(f"[cam] outputs: {name} = {bit}; the card has {OUTPUTS[0]} to {OUTPUTS[-1]}, 8 a byte")
        return [f"p10;{SET if on else RESET};{bit}"]

    def remark(self, text: str) -> str:
        return remark(text)

    def end(self) -> Iterable[str]:
        return ()
