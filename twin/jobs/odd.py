"""Legal but absurd lines of a job: straight moves that crawl. They are reported and do not make a job fail.

@0z1  @0M12,30,16000,900,0,30,0,30      three axes together: the speed written for X is that of the longest way, so Y
                                        makes 16 000 steps at 30 a second and not at 900
N20 G1 X30 F0.5                         a thousand times slower than other blocks of the same program
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import offers
from isel_twin.jobs.result import Result
from isel_twin.language import JobMove, Language, RetimesJobs

LONG_S = 5.0  # shorter moves are not reported
SLOWER = 5.0  # factor to the time of its ways at the speeds of its line: another axis determines the time
NEAR = 1.01  # factor to the speed of that axis, which ramps only make slower
CRAWLS = 1000.0  # factor to the possible speed


def oddities(results: Sequence[Result], language: Language | None) -> Iterator[tuple[int, str]]:
    """Number of the line, and what is odd."""
    if offers(language, RetimesJobs):
        yield from _of_moves(results, language)
    for result in results:
        if len(result.parts) > 2:
            yield from ((result.number, text) for text in _of_blocks(result))


def _of_moves(results: Sequence[Result], language: RetimesJobs) -> Iterator[tuple[int, str]]:
    commands = [result for result in results if not result.condition]
    fastest_hz = language.ranges["speed_hz"][1]
    moves = language.job_moves([result.command for result in commands])
    stored = {move.line for move in moves if commands[move.line].end_ns == commands[move.line].time_ns}
    for move in moves:
        if move.line == 0 or not move.straight:
            continue
        if stored:  # an interface that carries out several moves at once: none of them has a time
            continue
        before, result = commands[move.line - 1], commands[move.line]
        took_s = (result.end_ns - result.time_ns) / SECOND_NS
        ways = [abs(b - a) for a, b in zip(before.counts, result.counts, strict=True)]
        lead = max(range(len(ways)), key=ways.__getitem__)
        if took_s < LONG_S or not ways[lead] or not result.ok:
            continue
        mean_hz = ways[lead] / took_s
        made = f"{AXIS_NAMES[lead].upper()}: {ways[lead]} steps in {took_s:.0f} s, {mean_hz:.3g} steps/s"
        if _another_times(move, ways, lead, took_s):
            yield result.number, f"{made} instead of {move.speeds_hz[lead]}: another axis sets the time of this move"
        elif mean_hz * CRAWLS < fastest_hz:
            yield result.number, f"{made}; the controller can make {fastest_hz} steps/s"


def _another_times(move: JobMove, ways: Sequence[int], lead: int, took_s: float) -> bool:
    """Does the speed written for another axis determine the time, and not that of the longest way? Axes that go one
    after the other take the sum of their times; what slow ramps take is no other axis' doing."""
    if lead >= len(move.speeds_hz):
        return False
    asked_s = sum(way / speed for way, speed in zip(ways, move.speeds_hz, strict=False) if way and speed)
    others = [speed for axis, speed in enumerate(move.speeds_hz) if axis != lead]
    mean_hz = ways[lead] / took_s
    return took_s > SLOWER * asked_s and any(mean_hz <= NEAR * speed < move.speeds_hz[lead] for speed in others)


def _of_blocks(result: Result) -> Iterator[str]:
    made = [part for part in result.parts if part.position_mm]
    speeds = [
        (math.dist(a.position_mm, b.position_mm) / max((c.time_ns - b.time_ns) / SECOND_NS, 1e-9), b, c)
        for a, b, c in zip(made, made[1:], made[2:], strict=False)
    ]
    fastest = max((speed for speed, _, _ in speeds), default=0.0)
    for speed, part, after in speeds:
        took_s = (after.time_ns - part.time_ns) / SECOND_NS
        if 0.0 < speed * CRAWLS < fastest and took_s >= LONG_S:
            slow = f"{part.text} takes {took_s:.0f} s at {60.0 * speed:.3g} mm/min"
            yield f"{slow}, {fastest / speed:.0f} times slower than another block"
