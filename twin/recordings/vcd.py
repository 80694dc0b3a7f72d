"""A value change dump for waveform viewers (GTKWave, Surfer, sigrok): IEEE 1364, timescale 1 ns.

Numbers are reals, and codes have no sign that begins a value: libsigrok 0.5.2 ends reading at a vector, and takes the
code of a text for a value if it looks like one.

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
import itertools
import math
import os
from bisect import bisect_left
from collections.abc import Iterator
from io import TextIOWrapper
from operator import itemgetter
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.files import replacing
from isel_twin.motion import Steps
from isel_twin.native import core
from isel_twin.recordings.recorder import Change, Samples

PULSE_NS = 5000  # longest high time of a step pulse
SETUP_NS = 1000  # time by which a direction is set before its first pulse
IN_C = ("PULSE_NS", "SETUP_NS")  # records.h has them, too
PINS = {
    f"{signal}_{axis}": f"pin{2 + 2 * i + j}"
    for i, axis in enumerate("xyz")
    for j, signal in enumerate(("step", "dir"))
}
"""What the pins of the socket carry while the output CLOCK is on."""
CLOCK = "clock_signals"
CHUNK = 1 << 16  # ticks expanded at a time
_TIME_BYTES = 21  # of a line with a time, at most
_SIZES = {"wire": 1, "string": 1, "real": 64}
_SIGNS = "!%&()*+,./:;<=>?@[]^_{|}~"  # of codes: no letter, digit, # or $
_Entry = tuple[int, str, int | float | str]  # (time in ns, name of the signal, new value)
_Edges = tuple[NDArray[np.int64], NDArray[np.int64]]  # times in ns, rising, and what changes, as in `_edge_names`


class _Signal:
    """A signal of a dump: how its values are written, and the last one."""

    def __init__(self, number: int, kind: str, value: float | str) -> None:
        self.kind = kind
        self.value = value
        self.code = ""
        while number >= 0:
            number, sign = divmod(number, len(_SIGNS))
            self.code += _SIGNS[sign]
            number -= 1

    def line(self, value: float | str) -> str:
        if self.kind == "wire":
            return f"{value}{self.code}"
        if self.kind == "real":
            return f"r{value:.16g} {self.code}"
        return f"s{str(value).translate(_ESCAPES)} {self.code}"


_ESCAPES = {ord(sign): f"\\x{ord(sign):02x}" for sign in "\t\n\r "} | {ord("\\"): "\\\\"}


def write_vcd(path: str | os.PathLike[str], steps: Steps, recorder: Samples) -> None:
    """Write stream, samples and changes. Raises OSError."""
    with replacing(path) as raw, TextIOWrapper(raw, encoding="ascii", errors="replace") as file:
        signals: dict[str, _Signal] = {}
        scopes: dict[str, list[str]] = {}

        def add(scope: str, name: str, kind: str, value: float | str, key: str = "") -> None:
            signal = signals[key or name] = _Signal(len(signals), kind, value)
            scopes.setdefault(scope, []).append(f"$var {kind} {_SIZES[kind]} {signal.code} {name} $end\n")

        led = any(motion.lead_ns for motion in steps.motions)
        stepped = not led or any(not motion.lead_ns for motion in steps.motions)
        doubled = stepped and _doubled(steps)
        for axis in AXIS_NAMES[: steps.axes]:
            for name in (*(("full",) if doubled else ()), *(("step", "dir") if stepped else ())):
                add("step", f"{name}_{axis}", "wire", 0)
            if led:
                add("step", f"command_{axis}", "real", 0)
        for axis in AXIS_NAMES[: recorder.axes]:
            add("machine", f"count_{axis}", "real", 0)
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
                kind, value = ("real", math.nan) if (group, name) in wide else ("wire", "x")
                add(group, key, kind, value, f"{group}.{name}")
        if ("output", CLOCK) in recorder.names():
            for pin in PINS.values():
                add("connector", pin, "wire", 0)
        streams = [_samples(recorder), _changes(recorder.changes, texts)]
        if led:
            streams.append(_commands(steps))
        if ("output", CLOCK) in recorder.names():
            streams.append(_connector(_pulses(steps, doubled), steps.axes, recorder.changes))
        file.write("$comment isel-twin $end\n$timescale 1 ns $end\n")
        for scope, declared in sorted(scopes.items()):
            file.writelines([f"$scope module {scope} $end\n", *declared, "$upscope $end\n"])
        _write(file, signals, _pulses(steps, doubled), steps.axes, heapq.merge(*streams, key=itemgetter(0)))


def _write(
    file: IO[str],
    signals: dict[str, _Signal],
    pulses: Iterator[_Edges],
    axes: int,
    others: Iterator[_Entry],
) -> None:
    """Write edges, of which there are millions, block by block, and all else between them."""
    entry = next(others, None)
    while entry is not None and entry[0] <= 0:  # the values at power-on stand in the head
        signals[entry[1]].value = entry[2]
        entry = next(others, None)
    file.write("$enddefinitions $end\n#0\n$dumpvars\n")
    file.writelines(f"{signal.line(signal.value)}\n" for signal in signals.values())
    file.write("$end\n")
    kinds = [signals.get(name) for name in _edge_names(axes)]
    lines = [kind.line(value) if kind else "" for kind in kinds for value in (0, 1)]
    written_ns = 0
    nothing = np.empty(0, dtype=np.int64)
    for edge_ns, codes in itertools.chain(pulses, [(nothing, nothing)]):
        until_ns = int(edge_ns[-1]) if len(edge_ns) else None  # the next block may begin at that time
        times: list[int] = []
        texts: list[str] = []
        while entry is not None and (until_ns is None or entry[0] < until_ns):
            time_ns, name, value = entry
            signal = signals[name]
            if value != signal.value:
                signal.value = value
                times.append(time_ns)
                texts.append(signal.line(value))
            entry = next(others, None)
        all_ns = np.concatenate([edge_ns, np.array(times, dtype=np.int64)])
        order = np.argsort(all_ns, kind="stable")
        all_ns = all_ns[order]
        new = np.diff(all_ns, prepend=written_ns) != 0
        pool = [f"{text}\n".encode("ascii", "replace") for text in (*lines, *texts)]
        ends = np.cumsum([0, *map(len, pool)])
        which = np.concatenate([codes, len(lines) + np.arange(len(texts))])[order]
        room = int(np.diff(ends)[which].sum()) + _TIME_BYTES * int(new.sum())
        out = np.empty(room, np.uint8)
        laid = core.lay_lines(all_ns, new.view(np.uint8), which, np.frombuffer(b"".join(pool), np.uint8), ends, out)
        file.write(out[:laid].tobytes().decode("ascii"))
        written_ns = int(all_ns[-1]) if len(all_ns) else written_ns


def _doubled(steps: Steps) -> bool:
    """True if any pulse is two steps of the counter."""
    pieces = (Steps(steps.axes, [motion]).chunks(CHUNK) for motion in steps.motions if not motion.lead_ns)
    return any(bool((abs(delta) > 1).any()) for chunks in pieces for _, delta in chunks)


def _edge_names(axes: int) -> list[str]:
    """Signals of edges; edge 2 k sets signal k to 0, edge 2 k + 1 sets it to 1."""
    return [f"{kind}_{axis}" for kind in ("step", "dir", "full") for axis in AXIS_NAMES[:axes]]


def _pulses(steps: Steps, doubled: bool) -> Iterator[_Edges]:
    """Rising and falling edges of step, with the direction before them and, if `doubled`, the steps of a pulse."""
    axes = steps.axes
    minus, full, high = (np.zeros(axes, dtype=np.uint8) for _ in range(3))  # as the tick before left them
    rose_ns = 0
    for t_ns, delta in _windows(steps):
        most = len(t_ns) * axes * 4
        edges = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
        made = core.lay_edges(t_ns, np.ascontiguousarray(delta, np.int32), rose_ns, minus, full, high, doubled, *edges)
        yield edges[0][:made], edges[1][:made]
        rose_ns = int(t_ns[-1])
    falling = 2 * np.flatnonzero(high)
    if len(falling):
        yield np.full(len(falling), rose_ns + PULSE_NS), falling


def _windows(steps: Steps) -> Iterator[tuple[NDArray[np.int64], NDArray[Any]]]:
    """Times and changes of ticks that are pulses."""
    for motion in steps.motions:
        if not motion.lead_ns:
            for k in range(motion.first, motion.last, CHUNK):
                yield motion.window(k, min(k + CHUNK, motion.last))


def _connector(pulses: Iterator[_Edges], axes: int, changes: list[Change]) -> Iterator[_Entry]:
    """The pulses and directions that leave by the socket: those made while clock signals are chosen."""
    names = _edge_names(axes)
    switched = [(change.time_ns, change.value) for change in changes if change.name == CLOCK]
    times = [time for time, _ in switched]
    high: set[str] = set()
    edges = (edge for block in pulses for edge in zip(*(part.tolist() for part in block), strict=True))
    for time, code in edges:
        at = bisect_left(times, time) - 1  # a tick at that instant was made before
        pin, value = PINS.get(names[code // 2]), code % 2
        if pin is not None and (pin in high or (at >= 0 and switched[at][1])):
            (high.add if value else high.discard)(pin)
            yield time, pin, value


def _commands(steps: Steps) -> Iterator[_Entry]:
    command = [0] * steps.axes
    for t_ns, delta in steps.chunks(CHUNK):
        for time, changes in zip(t_ns.tolist(), delta.tolist(), strict=True):
            for axis, change in enumerate(changes):
                if change:
                    command[axis] += change
                    yield time, f"command_{AXIS_NAMES[axis]}", command[axis]


def _samples(recorder: Samples) -> Iterator[_Entry]:
    """Values of samples that are not those of the sample before."""
    axes = AXIS_NAMES[: recorder.axes]
    names = [name for axis in axes for name in (f"count_{axis}", f"lost_{axis}_steps")]
    names += [f"position_{axis}_mm" for axis in CARRIAGES]
    for piece in recorder.samples():
        columns = [piece[field][:, i] for i in range(len(axes)) for field in ("counts", "lost_steps")]
        columns += list(piece["position_mm"].T)
        changed = np.ones((len(piece), len(columns)), dtype=np.bool_)
        for k, column in enumerate(columns):
            changed[1:, k] = column[1:] != column[:-1]
        rows, signals = np.nonzero(changed)
        times, values = piece["time_ns"].tolist(), [column.tolist() for column in columns]
        for row, k in zip(rows.tolist(), signals.tolist(), strict=True):
            yield times[row], names[k], values[k][row]


def _changes(changes: list[Change], texts: set[tuple[str, str]]) -> Iterator[_Entry]:
    first: dict[str, int | str] = {}
    for change in changes:
        yield change.time_ns, f"{change.group}.{change.name}", change.value
        if (change.group, change.name) in texts:
            at_first = first.setdefault(change.name, change.value)
            yield change.time_ns, f"changed.{change.name}", int(change.value != at_first)
