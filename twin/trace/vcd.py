"""A value change dump for waveform viewers (GTKWave, Surfer, sigrok): IEEE 1364, timescale 100 ps.

    scope step       step_x, dir_x ...        what the controller sends to the power stages; dir 1: minus
    scope machine    position_x_mm, count_x, lost_x_steps ...     the samples of the recorder
    scope level      p3_0 ...                 electrical level of the input terminals
    scope input      hood, limit_x1 ...       state of switches and elements, as text
    scope output     stages, spindle ...      outputs of the controller and relays

A pulse rises at the exact time of its tick, t = 10 * t_ns of the timescale, and is over before the next tick, be that
only 1 ns later: so every tick is a rising edge of its own. Direction is stable before and after it, as power stages
want it:

    dir_x    ----X================X----
    step_x   ______|~~~|____________|~~~|___
                   |<->| PULSE_NS, at most half the time to the next tick
                 |<| SETUP_NS, at most half the time since the tick before
"""

from __future__ import annotations

import heapq
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from vcd import VCDWriter

from isel_twin.files import replacing
from isel_twin.trace.recorder import Change, Recorder

if TYPE_CHECKING:
    from isel_twin.motion import Steps

__all__ = ["write_vcd"]

PULSE_NS = 5000
"""Longest high time of a step pulse."""
SETUP_NS = 1000
"""Time by which a direction is set before its first pulse."""
AXES = "xyza"
CHUNK = 1 << 16
UNITS_PER_NS = 10
"""Units of the timescale in a nanosecond: room for a falling edge between two ticks 1 ns apart."""

_Entry = tuple[int, str, int | float | str]
"""(time in units of the timescale, name of the signal, new value)"""


def write_vcd(path: str | os.PathLike[str], steps: Steps, recorder: Recorder) -> None:
    """Write step stream, samples and changes. Raises OSError."""
    with (
        replacing(path) as temporary,
        open(temporary, "w", encoding="ascii", errors="replace") as file,
        VCDWriter(file, timescale="100 ps", date="", comment="isel-twin") as writer,
    ):
        signals = {}
        for axis in AXES:
            signals[f"step_{axis}"] = writer.register_var("step", f"step_{axis}", "wire", size=1, init=0)
            signals[f"dir_{axis}"] = writer.register_var("step", f"dir_{axis}", "wire", size=1, init=0)
            signals[f"count_{axis}"] = writer.register_var("machine", f"count_{axis}", "integer", size=64, init=0)
            name = f"lost_{axis}_steps"
            signals[name] = writer.register_var("machine", name, "real", init=0.0)
        for axis in AXES[:3]:
            name = f"position_{axis}_mm"
            signals[name] = writer.register_var("machine", name, "real", init=0.0)
        texts = {(change.group, change.name) for change in recorder.changes if isinstance(change.value, str)}
        for group, name in recorder.names():
            key = name.replace(".", "_")
            if (group, name) in texts:
                signal = writer.register_var(group, key, "string", init="")
            elif group == "level":
                signal = writer.register_var(group, key, "wire", size=1, init="x")
            else:
                signal = writer.register_var(group, key, "integer", size=64, init="x")
            signals[f"{group}.{name}"] = signal
        for time, name, value in heapq.merge(
            _pulses(steps), _samples(recorder), _changes(recorder.changes), key=lambda entry: entry[0]
        ):
            writer.change(signals[name], time, value)


def _pulses(steps: Steps) -> Iterator[_Entry]:
    """Rising and falling edges of step, and direction before them."""
    minus = [0, 0, 0, 0]
    high: list[int] = []
    rose = 0
    longest, setup = PULSE_NS * UNITS_PER_NS, SETUP_NS * UNITS_PER_NS
    for t_ns, delta in steps.chunks(CHUNK):
        for time, row in zip((t_ns * UNITS_PER_NS).tolist(), delta.tolist(), strict=True):
            middle = (rose + time) // 2
            for axis in high:
                yield min(rose + longest, middle), f"step_{AXES[axis]}", 0
            high = [axis for axis in range(4) if row[axis]]
            for axis in high:
                if minus[axis] != (row[axis] < 0):
                    minus[axis] = int(row[axis] < 0)
                    yield max(time - setup, middle), f"dir_{AXES[axis]}", minus[axis]
            for axis in high:
                yield time, f"step_{AXES[axis]}", 1
            rose = time
    for axis in high:
        yield rose + longest, f"step_{AXES[axis]}", 0


def _samples(recorder: Recorder) -> Iterator[_Entry]:
    for piece in recorder.samples():
        columns = (piece[name].tolist() for name in ("time_ns", "counts", "position_mm", "lost_steps"))
        for time_ns, counts, position_mm, lost_steps in zip(*columns, strict=True):
            time = time_ns * UNITS_PER_NS
            for axis, count, lost in zip(AXES, counts, lost_steps, strict=True):
                yield time, f"count_{axis}", count
                yield time, f"lost_{axis}_steps", lost
            for axis, position in zip(AXES, position_mm, strict=False):
                yield time, f"position_{axis}_mm", position


def _changes(changes: list[Change]) -> Iterator[_Entry]:
    for change in changes:
        yield change.time_ns * UNITS_PER_NS, f"{change.group}.{change.name}", change.value
