"""Findings of a capture, as of a job: faults of its signals, beside what it makes of the machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from isel_twin.base.units import MICROSECOND_NS, SECOND_NS
from isel_twin.capture.play import Strike
from isel_twin.capture.ticks import Needs, Ticks
from isel_twin.jobs.checks.rules import Finding

_MOST_GAPS = 4  # named in a finding; JSON has all
_OFFENCES = {  # by the names of `AxisTiming` and `Needs`
    "short_pulses": ("pulse_ns", "pulses shorter than {} us"),
    "short_pauses": ("pulse_ns", "pauses between pulses shorter than {} us"),
    "setup": ("setup_ns", "changes of direction less than {} us before a step"),
    "hold": ("hold_ns", "changes of direction less than {} us after a step"),
}


def of_signals(ticks: Ticks, needs: Needs) -> Iterator[Finding]:
    """Gaps (capture/5), and times too short for the drives of each axis. Steps without power are the verdict's
    (`unpowered`).
    """
    if ticks.gaps:
        where = ", ".join(
            f"{begin / SECOND_NS:.6f} to {end / SECOND_NS:.6f} s" for begin, end in ticks.gaps[:_MOST_GAPS]
        )
        more = f" and {len(ticks.gaps) - _MOST_GAPS} times more" if len(ticks.gaps) > _MOST_GAPS else ""
        told = f"a mapped signal has no level from {where}{more}: what it did then is missing"
        yield Finding("signal", told, time_ns=ticks.gaps[0][0])
    for axis, timing in ticks.timing.items():
        for name, (need, words) in _OFFENCES.items():
            if (offence := getattr(timing, name)) is not None:
                many = f"{offence.count} {words.format(f'{getattr(needs, need) / MICROSECOND_NS:g}')}"
                first = f"the first at {offence.first_ns / SECOND_NS:.6f} s"
                told = f"{axis.upper()}: {many}, {first}, the shortest {offence.least_ns / MICROSECOND_NS:g} us"
                yield Finding("signal", told, time_ns=offence.first_ns)


def of_strikes(strikes: Sequence[Strike], allowed: Callable[[str], bool]) -> Iterator[Finding]:
    """Switches that are struck and must not be."""
    for one in strikes:
        if not allowed(one.switch):
            yield Finding("switch", f"{one.switch} is struck", time_ns=one.time_ns)
