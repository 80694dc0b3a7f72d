"""A value change dump for waveform viewers (GTKWave, Surfer, sigrok): IEEE 1364, timescale 1 ns.

    scope step       step_x, dir_x ...        what the controller sends to the power stages; dir 1: minus
    scope step       full_x ...               1: a pulse is two steps of the counter; only if there are such pulses
    scope step       command_x ...            sum of the changes so far; only if there are set points
    scope machine    position_x_mm, count_x, lost_x_steps ...     the samples of the recorder
    scope level      p3_0 ...                 electrical level of the input terminals
    scope input      hood, limit_x1 ...       state of switches and elements, as text
    scope input      hood_changed ...         the same as one bit, for viewers without text: 1, not as at the beginning
    scope output     stages, spindle ...      outputs of the controller and relays; one bit, if only 0 and 1

    scope connector  pin2 .. pin7             the socket of an iSMIF with clock and direction signals (T1; ismif/6)

A pulse rises at the time of its tick, one for each axis that the tick changes (a full step of a half-step stage is one
pulse too), and is over before the next tick. Direction is stable before and after it, as power stages want it:

    dir_x    ----X================X----
    step_x   ______|~~~|____________|~~~|___
                   |<->| PULSE_NS, at most half the time to the next tick
                 |<| SETUP_NS, at most half the time since the tick before

Between ticks less than 2 ns apart there is no time for a falling edge: two such pulses of an axis are one, which begins
with the first, and a change of direction comes with the second. No controller is that fast.

Ticks of set points have no pulses. If there are any, `command_<axis>` follows every tick, also those of steps; the
drive reaches the value shown during the time after it.
"""

from __future__ import annotations

import heapq
import os
from bisect import bisect_left
from collections.abc import Iterator
from operator import itemgetter
from typing import Any

from vcd import VCDWriter

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.files import replacing
from isel_twin.motion import Steps
from isel_twin.recordings.recorder import Change, Samples

PULSE_NS = 5000  # longest high time of a step pulse
SETUP_NS = 1000  # time by which a direction is set before its first pulse
PINS = {
    f"{signal}_{axis}": f"pin{2 + 2 * i + j}"
    for i, axis in enumerate("xyz")
    for j, signal in enumerate(("step", "dir"))
}
"""What the pins of the socket carry while the output CLOCK is on."""
CLOCK = "clock_signals"
CHUNK = 1 << 16  # ticks expanded at a time
_Entry = tuple[int, str, int | float | str]  # (time in ns, name of the signal, new value)


def write_vcd(path: str | os.PathLike[str], steps: Steps, recorder: Samples) -> None:
    """Write stream, samples and changes. Raises OSError."""
    with (
        replacing(path) as temporary,
        open(temporary, "w", encoding="ascii", errors="replace") as file,
        VCDWriter(file, timescale="1 ns", date="", comment="isel-twin") as writer,
    ):
        signals: dict[str, Any] = {}

        def add(scope: str, name: str, kind: str, init: Any, key: str = "") -> None:
            size = {"wire": 1, "integer": 64}.get(kind)
            signals[key or name] = writer.register_var(scope, name, kind, size=size, init=init)

        led = any(motion.lead_ns for motion in steps.motions)
        stepped = not led or any(not motion.lead_ns for motion in steps.motions)
        doubled = stepped and _doubled(steps)
        for axis in AXIS_NAMES[: steps.axes]:
            for name in (*(("full",) if doubled else ()), *(("step", "dir") if stepped else ())):
                add("step", f"{name}_{axis}", "wire", 0)
            if led:
                add("step", f"command_{axis}", "integer", 0)
        for axis in AXIS_NAMES[: recorder.axes]:
            add("machine", f"count_{axis}", "integer", 0)
            add("machine", f"lost_{axis}_steps", "real", 0.0)
        for axis in CARRIAGES:
            add("machine", f"position_{axis}_mm", "real", 0.0)
        texts = {(change.group, change.name) for change in recorder.changes if isinstance(change.value, str)}
        wide = {(change.group, change.name) for change in recorder.changes if change.value not in (0, 1)}
        for group, name in recorder.names():
            key = name.replace(".", "_")
            if (group, name) in texts:
                add(group, key, "string", "", f"{group}.{name}")
                add(group, f"{key}_changed", "wire", "x", f"changed.{name}")
            else:
                add(group, key, "integer" if (group, name) in wide else "wire", "x", f"{group}.{name}")
        if ("output", CLOCK) in recorder.names():
            for pin in PINS.values():
                add("connector", pin, "wire", 0)
        streams = [_pulses(steps, doubled), _samples(recorder), _changes(recorder.changes, texts)]
        if led:
            streams.append(_commands(steps))
        if ("output", CLOCK) in recorder.names():
            streams.append(_connector(_pulses(steps, doubled), recorder.changes))
        change = writer.change
        for time, name, value in heapq.merge(*streams, key=itemgetter(0)):
            change(signals[name], time, value)


def _ticks(steps: Steps, every: bool) -> Iterator[tuple[int, list[int]]]:
    """Time and changes of each tick; those of set points only if `every`."""
    for motion in steps.motions:
        if every or not motion.lead_ns:
            for k in range(motion.first, motion.last, CHUNK):
                t_ns, delta = motion.window(k, min(k + CHUNK, motion.last))
                yield from zip(t_ns.tolist(), delta.tolist(), strict=True)


def _doubled(steps: Steps) -> bool:
    """True if any pulse is two steps of the counter."""
    pieces = (Steps(steps.axes, [motion]).chunks(CHUNK) for motion in steps.motions if not motion.lead_ns)
    return any(bool((abs(delta) > 1).any()) for chunks in pieces for _, delta in chunks)


def _pulses(steps: Steps, doubled: bool) -> Iterator[_Entry]:
    """Rising and falling edges of step, with the direction before them and, if `doubled`, the steps of a pulse."""
    minus = [False] * steps.axes
    full = [False] * steps.axes
    high: list[int] = []
    rose = 0
    for time, changes in _ticks(steps, every=False):
        new = [axis for axis, change in enumerate(changes) if change]
        room = time - rose >= 2
        middle = (rose + time) // 2 if room else time
        kept = [] if room else [axis for axis in high if axis in new or time == rose]
        for axis in high:
            if axis not in kept:
                yield min(rose + PULSE_NS, middle), f"step_{AXIS_NAMES[axis]}", 0
        for axis in new:
            if minus[axis] != (changes[axis] < 0):
                minus[axis] = changes[axis] < 0
                yield max(time - SETUP_NS, middle), f"dir_{AXIS_NAMES[axis]}", int(minus[axis])
            if doubled and full[axis] != (abs(changes[axis]) > 1):
                full[axis] = not full[axis]
                yield max(time - SETUP_NS, middle), f"full_{AXIS_NAMES[axis]}", int(full[axis])
        for axis in new:
            if axis not in kept:
                yield time, f"step_{AXIS_NAMES[axis]}", 1
        high = new + [axis for axis in kept if axis not in new]
        rose = time
    for axis in high:
        yield rose + PULSE_NS, f"step_{AXIS_NAMES[axis]}", 0


def _connector(pulses: Iterator[_Entry], changes: list[Change]) -> Iterator[_Entry]:
    """The pulses and directions that leave by the socket: those made while clock signals are chosen."""
    switched = [(change.time_ns, change.value) for change in changes if change.name == CLOCK]
    times = [time for time, _ in switched]
    high: set[str] = set()
    for time, name, value in pulses:
        at = bisect_left(times, time) - 1  # a tick at that instant was made before
        pin = PINS.get(name)
        if pin is not None and (pin in high or (at >= 0 and switched[at][1])):
            (high.add if value else high.discard)(pin)
            yield time, pin, value


def _commands(steps: Steps) -> Iterator[_Entry]:
    command = [0] * steps.axes
    for time, changes in _ticks(steps, every=True):
        for axis, change in enumerate(changes):
            if change:
                command[axis] += change
                yield time, f"command_{AXIS_NAMES[axis]}", command[axis]


def _samples(recorder: Samples) -> Iterator[_Entry]:
    for piece in recorder.samples():
        columns = (piece[name].tolist() for name in ("time_ns", "counts", "position_mm", "lost_steps"))
        for time, counts, position_mm, lost_steps in zip(*columns, strict=True):
            for axis, count, lost in zip(AXIS_NAMES, counts, lost_steps, strict=False):
                yield time, f"count_{axis}", count
                yield time, f"lost_{axis}_steps", lost
            for axis, position in zip(CARRIAGES, position_mm, strict=True):
                yield time, f"position_{axis}_mm", position


def _changes(changes: list[Change], texts: set[tuple[str, str]]) -> Iterator[_Entry]:
    first: dict[str, int | str] = {}
    for change in changes:
        yield change.time_ns, f"{change.group}.{change.name}", change.value
        if (change.group, change.name) in texts:
            at_first = first.setdefault(change.name, change.value)
            yield change.time_ns, f"changed.{change.name}", int(change.value != at_first)
