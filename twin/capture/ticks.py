"""Edges to ticks, and pulses that are too short for the drives of a real machine.

    step   ____|~~~~|______|~~~~|____        a tick at each active edge; those of several axes at one time are one tick
           --->|    |<---                    high: shorter than the least pulse?    low: the same of the pause
    dir    ==X=================X=====
             |<->|          |<-->|           setup: from the change to the edge     hold: from the edge to the change

A drive outside its data-sheet timing may miss a pulse or take it in the wrong direction; the twin does neither, so
times that are too short are counted, and judged (judging.py). A change of direction at the time of an edge counts as
before it (capture/2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.capture.mapping import OUTPUTS, Signal
from isel_twin.capture.wave import Capture, Wave


@dataclass(frozen=True)
class Needs:
    """Least times that drives need; defaults of a DRV8825 (TI, SLVSA73, timing requirements)."""

    pulse_ns: int = 1900  # of a step signal at either level
    setup_ns: int = 650  # from a change of direction to an active edge of step
    hold_ns: int = 650  # from an active edge of step to a change of direction

    def told_by(self, resolution_ns: float) -> Needs:
        """The same without those that are shorter than a capture can tell: 0 asks for nothing."""
        return Needs(*(need if need >= resolution_ns else 0 for need in (self.pulse_ns, self.setup_ns, self.hold_ns)))


@dataclass(frozen=True)
class Offence:
    """Times that are too short: how many, the shortest, and when the first one ends."""

    count: int
    least_ns: int
    first_ns: int


@dataclass(frozen=True)
class AxisTiming:
    steps: int
    fastest_hz: float  # of two successive steps, 0 if there are none
    short_pulses: Offence | None
    short_pauses: Offence | None
    setup: Offence | None
    hold: Offence | None
    while_off: int  # steps while the power stages were off; a drive does not make them


@dataclass(frozen=True, eq=False)
class Ticks:
    """A stream as captured; times from the beginning of the capture."""

    t_ns: NDArray[np.int64]  # int64 [n], strictly increasing
    delta: NDArray[np.int8]  # int8 [n, axes]
    end_ns: int
    outputs: tuple[tuple[int, str, int], ...] = ((0, "stages", 1),)  # outputs for the drives: (time, output, level)
    timing: Mapping[str, AxisTiming] = field(default_factory=dict)  # by axis; empty if the file has no signals
    resolution_ns: float = 0.0  # time between two samples, 0 if unknown
    shift_ns: int = 0  # added to the times of the file
    gaps: tuple[tuple[int, int], ...] = ()  # times from and to which a signal has no level: steps there are missing
    remarks: tuple[str, ...] = ()  # steps that may be counted or not, in words

    @property
    def over_ns(self) -> int:
        """Time of the last thing that happens."""
        return max(int(self.t_ns[-1]) if self.t_ns.size else 0, self.outputs[-1][0] if self.outputs else 0)


def ticks_of(capture: Capture, signals: Mapping[str, Signal], needs: Needs, edge: str = "rising") -> Ticks:
    """The stream of a capture. signals: by role, as from `parse_map`. edge: the active one, or "both"."""
    needs = needs.told_by(capture.resolution_ns)
    waves = {role: capture.waves[signal.name] for role, signal in signals.items()}
    waves |= {role: waves[role].inverted() for role, signal in signals.items() if signal.inverted}
    used = [axis for axis in AXIS_NAMES if f"{axis}.step" in waves or f"{axis}.plus" in waves]
    count = max(len(CARRIAGES), *(AXIS_NAMES.index(axis) + 1 for axis in used))
    enable = waves.get("enable") or waves.get("stages")
    times: list[NDArray[np.int64]] = []
    signs: list[NDArray[np.int8]] = []
    timing = {}
    remarks = []
    for axis in used:
        if f"{axis}.step" in waves:
            step, direction = waves[f"{axis}.step"], waves[f"{axis}.dir"]
            (t_ns, said), pulses = _steps(step, edge), [step]
            sign = np.where(direction.at(t_ns), 1, -1).astype(np.int8)
            if f"{axis}.full" in waves:
                sign *= waves[f"{axis}.full"].at(t_ns) + np.int8(1)
            setup, hold = _around(t_ns, direction.t_ns, needs)
        else:
            pulses = [waves[f"{axis}.plus"], waves[f"{axis}.minus"]]
            parts, told = zip(*(_steps(wave, edge) for wave in pulses), strict=True)
            said = " and ".join(filter(None, dict.fromkeys(told)))
            t_ns = np.concatenate(parts)
            sign = np.repeat(np.array([1, -1], dtype=np.int8), [part.size for part in parts])
            order = np.argsort(t_ns, kind="stable")
            t_ns, sign = t_ns[order], sign[order]
            setup = hold = None
        remarks += [f"{axis.upper()}: {said}"] if said else []
        between = np.diff(t_ns)
        timing[axis] = AxisTiming(
            steps=t_ns.size,
            fastest_hz=round(1e9 / max(int(between.min()), 1), 3) if between.size else 0.0,
            short_pulses=None if edge == "both" else _short(pulses, edge == "rising", needs.pulse_ns),
            short_pauses=None if edge == "both" else _short(pulses, edge == "falling", needs.pulse_ns),
            setup=setup,
            hold=hold,
            while_off=0 if enable is None else int((~enable.at(t_ns)).sum()),
        )
        times.append(t_ns)
        signs.append(sign)
    t_all = np.sort(np.concatenate(times), kind="stable")  # merges sorted parts; np.unique takes ten times longer
    t_all = t_all[np.diff(t_all, prepend=-1) > 0]
    delta = np.zeros((t_all.size, count), dtype=np.int8)
    for axis, t_ns, sign in zip(used, times, signs, strict=True):
        np.add.at(delta[:, AXIS_NAMES.index(axis)], np.searchsorted(t_all, t_ns), sign)
    gaps = _merged([*capture.gaps, *(gap for wave in waves.values() for gap in wave.gaps)])
    about = capture.resolution_ns, capture.shift_ns, gaps, tuple(remarks)
    return Ticks(t_all, delta, capture.end_ns, _outputs(waves), timing, *about)


def _steps(step: Wave, edge: str) -> tuple[NDArray[np.int64], str]:
    """Times of the active edges, and what is to be told of the first level (capture/4)."""
    active = edge == "rising"
    t_ns = step.t_ns if edge == "both" else step.edges(rising=active)
    first = f"its step signal has its first level at {step.known_ns / SECOND_NS:.6f} s"
    if edge == "both":
        return t_ns, f"{first}; that is not counted as a step" if step.known_ns else ""
    if step.first != active:
        return t_ns, ""
    if step.known_ns:
        return np.concatenate([[step.known_ns], t_ns]), f"{first}, an active one; that is counted as a step"
    return t_ns, "its step signal is active from the beginning on; that is not counted as a step"


def _merged(gaps: list[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    merged: list[tuple[int, int]] = []
    for begin, end in sorted(gaps):
        if merged and begin <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(end, merged[-1][1])
        else:
            merged.append((begin, end))
    return tuple(merged)


def _outputs(waves: Mapping[str, Wave]) -> tuple[tuple[int, str, int], ...]:
    """Outputs for the drives: from a dump of this package, or the enable signal as stages and brakes."""
    told = {name: waves[name] for name in OUTPUTS if name in waves}
    if "enable" in waves:
        told |= dict.fromkeys(("stages", "brake"), waves["enable"])
    if "stages" not in told:
        always = Wave(True, np.empty(0, dtype=np.int64))
        told |= {"stages": always, "brake": always}
    changes = []
    for order, (name, wave) in enumerate(told.items()):
        level = int(wave.first)
        changes.append((0, order, name, level))
        for t_ns in wave.t_ns.tolist():
            level = 1 - level
            changes.append((t_ns, order, name, level))
    changes.sort(key=lambda change: change[:2])
    return tuple((t_ns, name, level) for t_ns, _, name, level in changes)


def _around(t_ns: NDArray[np.int64], turns: NDArray[np.int64], needs: Needs) -> tuple[Offence | None, Offence | None]:
    """Setup and hold of edges among changes of direction."""
    if not turns.size or not t_ns.size:
        return None, None
    after = np.searchsorted(turns, t_ns, side="right")
    far = 1 << 62
    since = np.where(after > 0, t_ns - turns[np.maximum(after - 1, 0)], far)
    until = np.where(after < turns.size, turns[np.minimum(after, turns.size - 1)] - t_ns, far)
    return _offence(since, t_ns, needs.setup_ns), _offence(until, t_ns, needs.hold_ns)


def _short(waves: list[Wave], high: bool, least_ns: int) -> Offence | None:
    """Stretches at one level that are too short, without those at the ends of the capture."""
    widths, ends = [], []
    for wave in waves:
        start = int(wave.first == high)  # the first change that begins such a stretch
        stretches = wave.t_ns[start:]
        stretches = stretches[: stretches.size // 2 * 2].reshape(-1, 2)
        widths.append(stretches[:, 1] - stretches[:, 0])
        ends.append(stretches[:, 1])
    return _offence(np.concatenate(widths), np.concatenate(ends), least_ns)


def _offence(measured: NDArray[np.int64], t_ns: NDArray[np.int64], least_ns: int) -> Offence | None:
    wrong = measured < least_ns
    if not wrong.any():
        return None
    return Offence(int(wrong.sum()), int(measured[wrong].min()), int(t_ns[wrong].min()))
