"""Streams of firmware without a board: Klipper's batch output, positions of grblHAL's simulator.

    .dump   text of Klipper's parsedump.py: queue_step and its like, in ticks of the board's clock; exact edges
    .out    step.out of grblHAL's simulator: a time and the positions in steps, line by line; not edges

Klipper (MCU_Commands.md): a step of `queue_step oid= interval= count= add=` comes `interval` ticks after the one
before, and then `interval` grows by `add`; `reset_step_clock oid= clock=` says from where, modulo 2^32; `dir` of
`set_next_step_dir` is 1 for positive. Steppers are X, Y, Z ... in the order of `config_stepper`. Intervals are modulo
2^32, too: a fresh board counts from 0, and a stepper that moves first after 24 s at 180 MHz has wrapped (capture/6).

Between two lines of step.out the steps are spread evenly, as those of a row (external/5).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.capture.ticks import Ticks
from isel_twin.capture.wave import LONGEST_NS, CaptureError, WrongCallError
from isel_twin.motion.spreading import spread

_WRAP = 1 << 32  # of a clock of 32 bits
_MOST = 1 << 28  # steps of a file
_FIELD = re.compile(r"(\w+)=(-?\d+)")
_WANTED = ("config_stepper", "reset_step_clock", "set_next_step_dir", "queue_step")


class _Stepper:
    """One motor of a Klipper board."""

    def __init__(self) -> None:
        self.clock = 0  # of the last step, unwrapped
        self.sign = 1
        self.times: list[NDArray[np.int64]] = []
        self.signs: list[NDArray[np.int8]] = []


def read_klipper(path: Path, frequency_hz: float | None) -> Ticks:
    """frequency_hz: CLOCK_FREQ of the board's dictionary. Raises CaptureError, OSError."""
    if frequency_hz is None:
        raise WrongCallError(
            "sample-rate: a Klipper dump needs the clock of its board in Hz, CLOCK_FREQ in its dictionary"
        )
    steppers: dict[int, _Stepper] = {}
    made, latest = 0, 0
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            found = next((word for word in _WANTED if word in line), None)
            if found is None:
                continue
            try:
                fields = {name: int(value) for name, value in _FIELD.findall(line)}
                if found == "config_stepper":
                    steppers[fields["oid"]] = _Stepper()
                    continue
                stepper = steppers[fields["oid"]]
                if found == "reset_step_clock":
                    latest = stepper.clock = _unwrapped(fields["clock"], latest)
                elif found == "set_next_step_dir":
                    stepper.sign = 1 if fields["dir"] else -1
                else:
                    made += fields["count"]
                    if not fields["count"] > 0 or made > _MOST:
                        raise CaptureError(
                            f"{path}:{number}: count={fields['count']}; allowed: 1 and more, {_MOST} in all"
                        )
                    stepper.clock += _wraps(stepper.clock + fields["interval"], latest)
                    latest = max(latest, _queue(stepper, fields["interval"], fields["count"], fields["add"]))
            except CaptureError:
                raise
            except (ValueError, OverflowError):
                raise CaptureError(
                    f"{path}:{number}: {line.strip()[:60]!r}: its steps go back in time, or too far"
                ) from None
            except KeyError:
                raise CaptureError(
                    f"{path}:{number}: {line.strip()[:60]!r} lacks something; is it from parsedump.py?"
                ) from None
    if not steppers:
        raise CaptureError(
            f"{path}: has no config_stepper in it; write it by parsedump.py, from the beginning of a batch"
        )
    if len(steppers) > len(AXIS_NAMES):
        raise CaptureError(f"{path}: has {len(steppers)} steppers; a controller has up to {len(AXIS_NAMES)} axes")
    return _ticks([(s.times, s.signs) for s in steppers.values()], frequency_hz)


def _unwrapped(clock: int, near: int) -> int:
    """The time nearest to `near` with these 32 bits; the clock of a batch begins anywhere. Raises ValueError."""
    if not -_WRAP // 2 <= clock < _WRAP:
        raise ValueError
    return near + (clock - near + _WRAP // 2) % _WRAP - _WRAP // 2 if near else clock


def _wraps(clock: int, latest: int) -> int:
    """The time to add to one that lies more than half a round behind the latest step."""
    return max(0, _unwrapped(clock % _WRAP, latest) - clock) if latest - clock > _WRAP // 2 else 0


def _queue(stepper: _Stepper, interval: int, count: int, add: int) -> int:
    """Lay the steps of one queue_step; return the time of the last."""
    if min(interval, interval + (count - 1) * add) <= 0 or max(interval, interval + (count - 1) * add) > _WRAP:
        raise ValueError
    k = np.arange(1, count + 1, dtype=np.int64)
    times = stepper.clock + k * interval + add * (k * (k - 1) // 2)
    stepper.times.append(times)
    stepper.signs.append(np.full(count, stepper.sign, np.int8))
    stepper.clock = int(times[-1])
    return stepper.clock


def _ticks(axes: Iterable[tuple[list[NDArray[np.int64]], list[NDArray[np.int8]]]], frequency_hz: float) -> Ticks:
    """Steps of all axes as one stream that begins a millisecond before its first step."""
    columns = [(np.concatenate(t), np.concatenate(s)) for t, s in axes for t, s in [(t or [_NONE], s or [_NO_SIGNS])]]
    everything = np.concatenate([t for t, _ in columns])
    count = max(len(CARRIAGES), len(columns))
    if not everything.size:
        return Ticks(np.zeros(0, np.int64), np.zeros((0, count), np.int8), 0)
    begin = int(everything.min())
    lead_ns = SECOND_NS // 1000
    in_ns = [np.round((t - begin) * (SECOND_NS / frequency_hz)).astype(np.int64) + lead_ns for t, _ in columns]
    t_ns = np.unique(np.concatenate(in_ns))
    delta = np.zeros((len(t_ns), count), np.int8)
    for axis, (times, (_, signs)) in enumerate(zip(in_ns, columns, strict=True)):
        np.add.at(delta[:, axis], np.searchsorted(t_ns, times), signs)
    return Ticks(t_ns, delta, int(t_ns[-1]), resolution_ns=SECOND_NS / frequency_hz)


_NONE, _NO_SIGNS = np.zeros(0, np.int64), np.zeros(0, np.int8)


def read_grblhal(path: Path) -> Ticks:
    """Raises CaptureError, OSError."""
    at_ns, at, begun = 0, np.zeros(len(CARRIAGES), np.int64), False
    times: list[NDArray[np.int64]] = []
    deltas: list[NDArray[np.int8]] = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            words = line.split("#")[0].replace(",", " ").split()
            if not words:
                continue
            try:
                then_ns = round(float(words[0]) * SECOND_NS)
                place = np.array([int(word) for word in words[1 : 1 + len(CARRIAGES)]], np.int64)
                if len(place) < len(CARRIAGES) or not at_ns <= then_ns <= LONGEST_NS or np.abs(place).max() > _MOST:
                    raise ValueError
            except (ValueError, OverflowError):
                what = "a line is a time in s that rises, and X, Y, Z in steps"
                raise CaptureError(f"{path}:{number}: {line.strip()[:60]!r}; {what}") from None
            change = place - at
            if begun and change.any():
                if then_ns == at_ns:
                    raise CaptureError(f"{path}:{number}: moves in no time; run the simulator with -r 0.001")
                t_ns, delta = spread(change, at_ns, then_ns - at_ns)
                times.append(t_ns)
                deltas.append(delta)
            at_ns, at, begun = then_ns, place, True
    t_ns = np.concatenate(times) if times else _NONE
    return Ticks(t_ns, np.concatenate(deltas) if deltas else np.zeros((0, len(CARRIAGES)), np.int8), at_ns)
