"""The noise of gauges and clocks, estimated from what was measured more than once.

Repeats are readings of one mounting that came about alike: at one push that follows the same push (what is pulled both
ways remembers the last pull), after the same move from the same place; and the durations of such moves, which are the
commands that take LEAST_S. Their scatter about their means, pooled over all of one instrument (readings of one stated
sigma in one recording), with nu degrees of freedom, and what was stated, worth TRUST of them, give

    sigma^2 = (TRUST stated^2 + nu scatter^2) / (TRUST + nu)

the mean of a scaled inverse chi-square prior and these data. Without repeats it is what was stated. What so few repeats
leave open of it is in the intervals: they are those of Student's t with TRUST + nu degrees of freedom.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from isel_twin.machine.spread import NORMAL_95
from isel_twin.many.identification.measured import Reading
from isel_twin.many.identification.session import LEAST_S, Session, exchanges_of

TRUST = 4  # degrees of freedom that a stated noise is worth


@dataclass(frozen=True)
class Noise:
    """One instrument of one recording."""

    recording: str
    unit: str  # mm: a gauge, s: the clock of the recording
    stated: float
    sigma: float
    repeats: int  # degrees of freedom

    @property
    def line(self) -> str:
        shown = (f"{1e3 * self.sigma:.2g}", f"{1e3 * self.stated:.2g}", "um" if self.unit == "mm" else "ms")
        what = "readings" if self.unit == "mm" else "durations"
        repeats = f"{self.repeats} repeat{'' if self.repeats == 1 else 's'}"
        return f"{self.recording}: {what} scatter by {shown[0]} {shown[2]}, by {repeats}; stated {shown[1]}"


def student(told: Iterable[Noise]) -> float:
    """How much wider an interval is, as the noise of gauges is itself an estimate: Student's t over the normal law."""
    from scipy.stats import t

    repeats = sum(one.repeats for one in told if one.unit == "mm")
    return float(t.ppf(0.975, TRUST + repeats)) / NORMAL_95 if repeats else 1.0


def with_noise(session: Session) -> tuple[Session, list[Noise]]:
    """The session with the noise that its repeats tell."""
    measured = session.measured
    after = _moves(session)
    told: list[Noise] = []
    sigmas: dict[float, float] = {}
    came: dict[float, list[tuple[Reading, Hashable]]] = {}
    last: Reading | None = None
    for one in measured.readings:
        before = last.push_n if last is not None and (last.command, last.gauge) == (one.command, one.gauge) else None
        how = one.axis, one.gauge, one.push_n, one.push_at, one.at_s, before, after.get(one.command, one.command)
        came.setdefault(one.sigma_mm, []).append((one, how))
        last = one
    for stated, each in came.items():
        pairs = ((how, one.mm - (one.counter_mm or 0.0)) for one, how in each)
        sigmas[stated] = _estimated(session.name, "mm", stated, pairs, told)
    timed = (
        (after[number], exchange.duration_ns * 1e-9)
        for number, exchange in enumerate(exchanges_of(session), 1)
        if exchange.duration_ns is not None
        and exchange.duration_ns >= LEAST_S * 1e9
        and session.timed(number)
        and number not in session.references
    )
    time_s = _estimated(session.name, "s", measured.time_sigma_s, timed, told)
    readings = tuple(replace(one, sigma_mm=sigmas[one.sigma_mm]) for one in measured.readings)
    return replace(session, measured=replace(measured, readings=readings, time_sigma_s=time_s)), told


def _moves(session: Session) -> dict[int, tuple[str, str]]:
    """By command: the move before it, at whose end it begins, and itself. Those interfered with end anywhere."""
    found, last = {}, ""
    interfered = {act.command for act in session.measured.acts}
    for number, exchange in enumerate(exchanges_of(session), 1):
        found[number] = last, exchange.text
        if exchange.duration_ns is not None and exchange.duration_ns >= LEAST_S * 1e9:
            last = f"{number}" if number in interfered else exchange.text
    return found


def _estimated(
    recording: str, unit: str, stated: float, pairs: Iterable[tuple[Hashable, float]], told: list[Noise]
) -> float:
    """The noise by these repeats: what makes one, and its value."""
    by: dict[Hashable, list[float]] = {}
    for key, value in pairs:
        by.setdefault(key, []).append(value)
    repeats = sum(len(values) - 1 for values in by.values())
    if not repeats:
        return stated
    squares = sum(float(((np.array(values) - np.mean(values)) ** 2).sum()) for values in by.values())
    sigma = math.sqrt((TRUST * stated**2 + squares) / (TRUST + repeats))
    told.append(Noise(recording, unit, stated, sigma, repeats))
    return sigma
