"""What a recording tells by itself, without a twin: axes, speeds, how often it is referenced, speed of the line."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from statistics import median

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.many.learning.session import Session
from isel_twin.recordings.judging import QUICK_NS

BAUDS = (300, 600, 1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200)
BITS = 10  # of a byte on the line: start, 8 data bits, stop
LEAST_APART = 8  # bytes on the line by which two exchanges differ that tell of its speed
NEAREST = 1.25  # a usual speed is taken if the measured one is within this factor


@dataclass(frozen=True)
class Told:
    """One line of what was learned."""

    what: str
    value: str
    sure: str  # how, or how sure


def told_alone(session: Session) -> list[Told]:
    """What a session tells before anything is played."""
    referenced = 0
    speeds: set[int] = set()
    runs = 0
    language = session.language
    for one, act in zip(session.exchanges, session.acts, strict=True):
        if language.accepted(one.command, one.reply) and one.reply:
            referenced |= act.references
            runs += bool(act.references)
            speeds.update(act.speeds_hz or ())
    axes = " ".join(name.upper() for axis, name in enumerate(CARRIAGES) if referenced >> axis & 1)
    found = [Told("axes", axes or "unknown", f"{runs} reference runs succeeded" if runs else "never referenced")]
    if speeds:
        found.append(Told("speeds", f"{min(speeds)} to {max(speeds)} Hz", "the host sends them"))
    found.append(_line(session))
    return found


def _line(session: Session) -> Told:
    """The speed of the line, from how much longer quick exchanges with more bytes take: a median of slopes, so that
    late replies of a busy computer do not decide."""
    quick = [
        (len(one.command) + len(one.reply), one.duration_ns)
        for one, act in zip(session.exchanges, session.acts, strict=True)
        if act.speeds_hz is None and one.duration_ns is not None and one.duration_ns < QUICK_NS
    ]
    fastest: dict[int, int] = {}
    for size, ns in quick:
        fastest[size] = min(ns, fastest.get(size, ns))
    slopes = [
        (b[1] - a[1]) / (b[0] - a[0]) for a, b in combinations(sorted(fastest.items()), 2) if b[0] - a[0] >= LEAST_APART
    ]
    if not slopes or (byte_ns := median(slopes)) <= 0.0:
        return Told("line speed", "unknown", "no quick replies of different lengths")
    measured = BITS * SECOND_NS / byte_ns
    baud = min(BAUDS, key=lambda each: abs(each - measured))
    near = max(baud / measured, measured / baud) <= NEAREST
    value = f"{baud} baud" if near else f"about {measured:.0f} baud"
    low, high = min(slopes), max(slopes)
    sure = f"{byte_ns / 1e3:.0f} us a byte ({low / 1e3:.0f} to {high / 1e3:.0f}), {len(quick)} quick replies"
    return Told("line speed", value, sure)
