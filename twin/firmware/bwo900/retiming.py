"""Change the settings in a program: rapid speed and acceleration of the axes, which are parameters.

    P1
    N5 P8816:5400.000 P12008:200.000 P12208:200.000 P12408:200.000      before the first block
    N10 G0 X20 Y20
    N20 P8816:2400  -->  P8816:5400.000                                 where the program sets one of them

All are lines of a text; the first program is the one that is started. Rapid is the speed of the axis with the longest
way, mm/min; the time of a ramp is that to P12004, 6000 mm/min as delivered (8.7), and a count is 0.001 mm
(bwo900/75). Feeds (F) are those of a process and stay. The parameters stay in the control when the program is over.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import of_axis
from isel_twin.firmware.bwo900.programs.lines import END, program_name
from isel_twin.language import JobMove, MoveSettings

AXES: Final = 3
MM_MIN: Final = 0.06  # a Hz, at 1000 increments/mm
RAPID_HZ: Final = 100_000.0  # P12004 as delivered: 6000 mm/min, the highest rapid
RAMP_MS: Final = 250.0  # P12008 as delivered
_BLOCK = re.compile(r"\s*+/?\s*+N\s*(\d+)")
_SAID = re.compile(r"\{[^}]*\}?|!.*|^\s*;.*", re.DOTALL)  # remarks and texts for the screen
_NUMBER = r"(\d+(?:\.\d*)?)(?![\d.]|\s*[-+*/])"
_RAPID = re.compile(rf"(\bP\s*{P.RAPID}\s*[:=]\s*){_NUMBER}")
_FEED = re.compile(rf"((?<![A-Za-z_])F\s*:?\s*){_NUMBER}")
_RAMPS = tuple(of_axis(axis, Axis.DYNAMICS_1) for axis in range(AXES))
_RAMP = re.compile(rf"(\bP\s*(?:{'|'.join(map(str, _RAMPS))})\s*[:=]\s*){_NUMBER}")

DEFAULTS: Final[Mapping[str, int]] = {"acceleration_hz_per_ms": round(RAPID_HZ / RAMP_MS)}


def job_moves(lines: Sequence[str]) -> list[JobMove]:
    """The program as one motion, at its first block, with its highest rapid speed and slowest ramps."""
    first = _first_block(lines)
    if first is None:
        return []
    speeds = [float(each) for line in lines for each in _found(_RAPID, line)]
    ramps_ms = [float(each) for line in lines for each in _found(_RAMP, line)]
    speed_hz = round(min(max(speeds) / MM_MIN, RAPID_HZ)) if speeds else round(RAPID_HZ)
    acceleration = max(1, round(RAPID_HZ / max(ramps_ms, default=RAMP_MS)))
    return [JobMove(first, (speed_hz,), acceleration, 0, straight=False)]


def retimed(lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int) -> list[list[str]]:
    """The replacement of each line."""
    if not settings:
        return [[line] for line in lines]
    ((first, wanted),) = settings.items()  # of `job_moves`: the program
    rapid, ramp_ms = wanted.speed_hz * MM_MIN, RAPID_HZ / wanted.acceleration_hz_per_ms
    values = dict.fromkeys(_RAMPS, ramp_ms)
    if job_moves(lines)[0].speeds_hz[0] >= rapid_hz:
        lines = [_replaced(_RAPID, line, lambda _: rapid) for line in lines]
        values = {P.RAPID: rapid, **values}
    made = [[_replaced(_RAMP, line, lambda _: ramp_ms)] for line in lines]
    words = " ".join(f"P{number}:{value:.3f}" for number, value in values.items())
    made[first].insert(0, f"N{_unused(lines, first)} {words}")
    return made


def faster(lines: Sequence[str], factor: float) -> list[str]:
    """The lines with all feeds and rapid speeds that they set times a factor."""

    def scaled(value: float) -> float:
        return value * factor

    return [_replaced(_FEED, _replaced(_RAPID, line, scaled), scaled) for line in lines]


def _first_block(lines: Sequence[str]) -> int | None:
    """Of the first program, which has no name or P and its number; not of a cycle, Z and its number."""
    cycle = False
    for number, line in enumerate(lines):
        word = line.strip()
        if name := program_name(word):
            cycle = name[0] == "Z"
        elif word == END:
            cycle = False
        elif not cycle and _BLOCK.match(line):
            return number
    return None


def _unused(lines: Sequence[str], first: int) -> int:
    """A block number of no line: the next one before the first block's, or the least."""
    taken = {int(found[1]) for line in lines if (found := _BLOCK.match(line))}
    found = _BLOCK.match(lines[first])
    before = int(found[1]) - 1 if found else 0
    return before if before > 0 and before not in taken else min(set(range(1, len(taken) + 2)) - taken)


def _replaced(pattern: re.Pattern[str], line: str, value: Callable[[float], float]) -> str:
    """The line with other numbers, outside remarks and texts."""

    def one(found: re.Match[str]) -> str:
        return f"{found[1]}{value(float(found[2])):.3f}"

    kept = _SAID.findall(line)
    return "".join(pattern.sub(one, code) + said for code, said in zip(_SAID.split(line), [*kept, ""], strict=True))


def _found(pattern: re.Pattern[str], line: str) -> list[str]:
    return [each[1] for code in _SAID.split(line) for each in pattern.findall(code)]
