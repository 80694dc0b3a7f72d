"""Toolpaths as vectors of the iSMIF.

    #E0,1848             end speed of the vectors that follow, in steps of the axis with most of them
    L0,X4000,Y4000
    L0,X8000<1>          the last of a job: with 01h all of them are carried out, one behind the other

Cuts that follow each other are one job, so that no vector waits for the line; a rapid is one by itself (ismif/15).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from isel_twin.cam.course import Move, Turn
from isel_twin.cam.toolpath import CamError, Place
from isel_twin.cam.writing import COOLANT, Speed, pause, remark
from isel_twin.cam.written import AXES, MachineAxes, Written
from isel_twin.firmware.ismif.commands import SPEEDS_HZ

START = "<1>"  # 01h in a job file
PIN = 12  # the only output for the user (6.19)
MOST_LINES = 500  # of a job: a quarter of the memory
LONGEST_S = 20.0  # of a job
RAMPS_S = 1.0  # of a vector, as delivered (6.10)


class IsmifCommands:
    """Implements `isel_twin.cam.writing.Commands`."""

    low_hz, high_hz = SPEEDS_HZ[0], SPEEDS_HZ[-1]
    along_path = False
    both_senses = False
    speed_by: Final = ""

    def __init__(self, axes: MachineAxes, outputs: Mapping[str, int]) -> None:
        self._axes = AXES[: axes.count]
        self._outputs = outputs
        self._hz = 0
        self._held: list[Written] = []
        self._takes_s = 0.0
        self._rapid = False

    def begin(self) -> Iterable[str]:
        return self.reference(tuple(range(len(self._axes))))

    def move(self, move: Move) -> Iterable[Written]:
        takes_s = move.length_mm / move.speed_mm_s + RAMPS_S
        full = self._takes_s + takes_s > LONGEST_S or len(self._held) >= MOST_LINES
        done = self.held() if full or move.rapid or self._rapid else ()
        self._rapid = move.rapid
        self._takes_s += takes_s
        if (hz := round(move.hz)) != self._hz:
            self._hz = hz
            self._held.append(Written(f"#E0,{hz}", move.place))
        text = "L0"
        for name, to, steps in zip(AXES, move.to, move.steps, strict=True):
            if steps:
                text += f",{name}{to}"
        self._held.append(Written(text, move.place))
        return done

    def held(self) -> Iterable[Written]:
        lines, self._held, self._takes_s = self._held, [], 0.0
        if lines:
            lines[-1] = lines[-1]._replace(text=lines[-1].text + START)
        return lines

    def settled(self, place: Place) -> Iterable[Written]:
        return ()

    def turn_counts(self, turn: Turn) -> None:
        return None

    def turn(self, turn: Turn) -> Iterable[Written]:
        raise NotImplementedError

    def reference(self, axes: tuple[int, ...]) -> Iterable[str]:
        """Z first, so that nothing is in the way of X and Y."""
        return [f"$H{''.join(AXES[axis] for axis in (2, 0, 1) if axis in axes)}{START}"] if axes else []

    def dwell(self, seconds: float) -> str:
        return pause(seconds)

    def spindle(self, turns: int, speed: Speed | None) -> Iterable[str] | None:
        return (
            self._pin(bool(turns)) if self._outputs.get("spindle", PIN) == PIN else self.output("spindle", bool(turns))
        )

    def coolant(self, number: int, on: bool) -> Iterable[str] | None:
        return self.output(COOLANT[number], on)

    def output(self, name: str, on: bool) -> Iterable[str] | None:
        if name not in self._outputs:
            return None
        if self._outputs[name] != PIN:
            raise CamError(f"[cam] outputs: {name} = {self._outputs[name]}; the interface switches pin {PIN} only")
        return self._pin(on)

    def _pin(self, on: bool) -> list[str]:
        return [f"A{on:d}{START}"]

    def remark(self, text: str) -> str:
        return remark(text)

    def end(self) -> Iterable[str]:
        return ()
