"""Plays a recording again: the same causes at the same instants, to a twin built from the recording.

    metadata, attachments --- rebuilt ---> Twin <--- bytes of the host, operations ------- at their virtual times
                                             |
                                             '---> new events == recorded events?   first Difference, or none

With the same versions there is no difference, to the bit, at any speed.

A recording of a real controller (kind `tap`) has only bytes with times: host.py plays its host to a twin that the
caller builds.
"""

from __future__ import annotations

import json
import math
import platform
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.files import atomic_write
from isel_twin.base.parameters import Place, parse_json
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.capture.player import NAME as PLAYER
from isel_twin.capture.player import Player
from isel_twin.core.journal import SETTINGS
from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import Twin
from isel_twin.language import readable
from isel_twin.machine import machine_from_tree, read_fixtures
from isel_twin.recordings.mcap import SAMPLES
from isel_twin.recordings.reading import Entry, Recorded, RecordingError
from isel_twin.recordings.recording import (
    FIXTURE,
    FIXTURES,
    FLASH,
    MACHINE,
    MODEL,
    SCENARIO,
    Recording,
    mesh_name,
    packages,
)
from isel_twin.version import VERSION
from isel_twin.wiring import ScenarioError, event_now

SLICE_NS = 10 * MILLISECOND_NS  # virtual time between two looks of a paced replay at the clock
CAUSES = ("/host/sent", "/operator")
_DONE = (*CAUSES, "/scenario", "/runs")
_TRAFFIC = ("/host/sent", "/host/received")
_NOT_COMPARED = ("/time",)  # the speed of time
Pace = Callable[[int], None]  # pace(time_ns): wait until virtual time time_ns is due


@dataclass(frozen=True)
class Difference:
    time_ns: int
    channel: str
    recorded: str  # the recorded value, or "nothing"
    replayed: str

    def __str__(self) -> str:
        where = f"{self.time_ns / SECOND_NS:.9f} s, {self.channel}"
        return f"{where}: recorded {self.recorded}, now {self.replayed}"


def versions(recorded: Recorded) -> list[str]:
    """Packages with another version in the recording, one line each: they may cause differences."""
    here = {"isel_twin": VERSION, "python": platform.python_version(), "platform": platform.platform(), **packages()}
    then = recorded.metadata
    changed = {name: now for name, now in here.items() if then.get(name, now) != now}
    return [f"recorded with {name} {then[name]}, here is {now}" for name, now in changed.items()]


def rebuilt(recorded: Recorded, folder: Path) -> Twin:
    """The twin of a recording, as it was at power-on. folder: for temporary files.

    Raises RecordingError for an insufficient recording, and ValueError as `Twin` does.
    """
    return Twin.of(spec_of(recorded, folder), 1, captured_player(recorded))


def captured_player(recorded: Recorded) -> Player | None:
    """What takes the controller's place in a recording of captured signals; None for any other."""
    return Player.restored(recorded.attachments.get(FLASH, b"")) if recorded.controller == PLAYER else None


def spec_of(recorded: Recorded, folder: Path) -> TwinSpec:
    """What the twin of a recording was built from. folder: for files that it needs.

    Raises RecordingError for an insufficient recording.
    """
    said = recorded.metadata
    if not recorded.of_twin:
        raise RecordingError(f"{recorded.path}: is of a real controller and does not say what machine there was")
    if said.get("begins_ns") != "0":
        raise RecordingError(f"{recorded.path}: does not begin at power-on: the state of its machine is not known")
    files = recorded.attachments
    for name, data in files.items():
        kind, slash, rest = name.partition("/")
        if name == SCENARIO or (slash and kind in (MODEL, FIXTURE)):
            path = folder / (kind if slash else "") / Path(rest or name).name  # no path leads out of the folder
            path.parent.mkdir(exist_ok=True)
            atomic_write(path, data)
    try:
        tree = parse_json(files[MACHINE])
        tree["model"] = f"{MODEL}/{Path(tree['model']).name}"
        if isinstance(tree.get("fixture"), list):
            for number, entry in enumerate(tree["fixture"]):
                if "file" in entry:
                    entry["file"] = mesh_name(number, Path(entry["file"]))
        elif tree.get("fixture"):
            tree["fixture"] = f"{FIXTURE}/{Path(tree['fixture']).name}"
        overrides, start_mm = _overrides(said["overrides"]), _start_mm(said["start_mm"])
        seed, line_speed = int(said["seed"]), parse_json(said["line_speed"])
        adapter_ms = float(parse_json(said.get("adapter_ms", "0")))
        controller, plant = said["controller"], said["plant"]
        tables = parse_json(files.get(FIXTURES, b"[]"))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(f"{recorded.path}: does not say what was recorded: {error!r}") from None
    place = Place(f"{recorded.path}: {FIXTURES}", key="fixture")
    return TwinSpec(
        machine_from_tree(tree, folder / "machine.toml"),
        controller,
        plant,
        seed,
        flash=files.get(FLASH),
        scenario=folder / SCENARIO if SCENARIO in files else None,
        line_speed=line_speed,
        overrides=overrides,
        start_mm=None if start_mm is None else tuple(start_mm),
        fixtures=tuple(read_fixtures(tables, place, folder)),
        adapter_ms=adapter_ms,
    )


def _overrides(text: str) -> dict[str, Any]:
    """Raises ValueError."""
    overrides = parse_json(text)
    values = overrides.values() if isinstance(overrides, dict) else [None]
    if not all(isinstance(value, bool | int | float | str) for value in values):
        raise ValueError(f"overrides are {text[:80]}; they must be a table of numbers and words")
    return dict(overrides)


def _start_mm(text: str) -> list[float] | None:
    """Raises ValueError."""
    start_mm = parse_json(text)
    if start_mm is None:
        return None
    if not isinstance(start_mm, list) or not all(type(mm) in (int, float) and math.isfinite(mm) for mm in start_mm):
        raise ValueError(f"start_mm is {text[:80]}; it must be a list of places in mm, or null")
    return start_mm


def replay(recorded: Recorded, twin: Twin, pace: Pace | None = None) -> Difference | None:
    """Play a recording to its twin from `rebuilt` and return the first difference. Raises RecordingError, also for a
    recording without operations, as its comparison would have no meaning."""
    if not any(recorded.of(*_DONE)):
        raise RecordingError(f"{recorded.path}: no host and no operator acts in it: there is nothing to compare")
    eye = _Eye(recorded, twin)
    recording = Recording(twin, eye, recorded.interval_ns, recorded.has_forces)
    for entry in recorded.of(*CAUSES):
        run_until(twin, entry.time_ns, pace, eye.seen)
        if eye.seen():
            return eye.difference
        _cause(recorded, entry, twin)
    end_ns = recorded.end_ns
    if not recorded.whole:  # the last reply, written down before it arrives, may be all that is left of its cause
        end_ns = max([end_ns, *(entry.time_ns for entry in recorded.of("/host/received"))])
    run_until(twin, end_ns, pace, eye.seen)
    recording.hand_on()
    return eye.difference or eye.missing()


def run_until(twin: Twin, time_ns: int, pace: Pace | None, stop: Callable[[], bool]) -> None:
    if pace is None:
        twin.run_until(time_ns, stop)
        return
    while twin.time_ns < time_ns and not stop():
        twin.run_until(min(time_ns, twin.time_ns + SLICE_NS), stop)
        pace(twin.time_ns)


def _cause(recorded: Recorded, entry: Entry, twin: Twin) -> None:
    content = entry.content
    place = Place(f"{recorded.path}: {entry.channel} at {entry.time_ns} ns", ScenarioError)
    if entry.channel == "/host/sent":
        twin.write(recorded.data(entry))
    elif not set(content) <= set(SETTINGS):
        twin.carry_out(event_now(content, place, twin.settable, twin.keys))
    elif "line_speed" in content:
        twin.line_speed = bool(content["line_speed"])
    else:
        twin.watch_margin()


class _Eye:
    """Compares events with the recorded ones, channel by channel; a `recording.Sink`."""

    def __init__(self, recorded: Recorded, twin: Twin) -> None:
        self.difference: Difference | None = None
        self._twin, self._end_ns, self._whole = twin, recorded.end_ns, recorded.whole
        self._expected: dict[str, deque[tuple[int, str]]] = {}
        for entry in recorded.entries:
            if entry.channel not in _NOT_COMPARED:
                text = _traffic(entry.content) if entry.channel in _TRAFFIC else _table(entry.content)
                self._expected.setdefault(entry.channel, deque()).append((entry.time_ns, text))
        self._sample_times = recorded.sample_times_ns.tolist()
        self._sample_bytes, self._samples = recorded.sample_bytes, recorded.samples
        self._sample = 0

    def seen(self) -> bool:
        return self.difference is not None

    def missing(self) -> Difference | None:
        """The first recorded message that has not come."""
        left = [(queue[0], channel) for channel, queue in self._expected.items() if queue]
        if self._sample < len(self._sample_times):
            left.append(((self._sample_times[self._sample], "a sample"), SAMPLES))
        if not left:
            return None
        (time_ns, text), channel = min(left)
        return Difference(time_ns, channel, text, "nothing")

    def sent(self, time_ns: int, data: bytes) -> None:
        self._compare("/host/sent", time_ns, readable(data))

    def received(self, time_ns: int, data: bytes, byte_ns: int = 0) -> None:
        self._compare("/host/received", time_ns, _bytes_text(data, byte_ns))

    def message(self, channel: str, time_ns: int, content: Mapping[str, Any]) -> None:
        if channel not in _NOT_COMPARED:
            self._compare(channel, time_ns, _table(content))

    def samples(self, time_ns: NDArray[np.int64], rows: NDArray[np.void], schema: str) -> None:
        data, size = rows.tobytes(), rows.dtype.itemsize
        for index, time in enumerate(time_ns.tolist()):
            self._one_sample(time, data[index * size : (index + 1) * size])

    def _one_sample(self, time_ns: int, now: bytes) -> None:
        number, size = self._sample, len(now)
        if number == len(self._sample_times):
            self._extra(SAMPLES, time_ns, "a sample")
            return
        self._sample += 1
        if self.seen():
            return
        then = self._sample_bytes[number * size : (number + 1) * size]
        if self._sample_times[number] != time_ns:
            at = f"a sample at {self._sample_times[number]} ns"
            self._differ(SAMPLES, min(time_ns, self._sample_times[number]), at, f"one at {time_ns} ns")
        elif then != now:
            field, a, b = _first_field(self._samples[number], np.frombuffer(now, dtype=self._samples.dtype)[0])
            self._differ(SAMPLES, time_ns, f"{field} {a}", f"{b}")

    def _compare(self, channel: str, time_ns: int, text: str) -> None:
        queue = self._expected.get(channel)
        if not queue:
            self._extra(channel, time_ns, text)
            return
        then_ns, then = queue.popleft()
        if (then_ns, then) != (time_ns, text):
            at, now = ("", "") if then_ns == time_ns else (f" at {then_ns} ns", f" at {time_ns} ns")
            self._differ(channel, min(then_ns, time_ns), then + at, text + now)

    def _extra(self, channel: str, time_ns: int, text: str) -> None:
        if self._whole or self._twin.time_ns < self._end_ns:  # else it may be in the missing end of the file
            self._differ(channel, time_ns, "nothing", text)

    def _differ(self, channel: str, time_ns: int, recorded: str, replayed: str) -> None:
        if self.difference is None:
            self.difference = Difference(time_ns, channel, recorded, replayed)


def _traffic(content: Mapping[str, Any]) -> str:
    try:
        return _bytes_text(bytes.fromhex(content["hex"]), content.get("byte_ns", 0))
    except (KeyError, TypeError, ValueError):
        return repr(content)


def _bytes_text(data: bytes, byte_ns: int) -> str:
    return readable(data) + (f" ({byte_ns} ns a byte)" if byte_ns else "")


def _table(content: Mapping[str, Any]) -> str:
    return json.dumps(content, sort_keys=True)


def _first_field(then: Any, now: Any) -> tuple[str, Any, Any]:
    """The first field that differs, to the bit."""
    for name in then.dtype.names:
        if then[name].tobytes() != now[name].tobytes():
            a, b = np.atleast_1d(then[name]), np.atleast_1d(now[name])
            index = next(i for i in range(len(a)) if a[i].tobytes() != b[i].tobytes())
            return (f"{name}[{index}]" if then[name].shape else name), a[index].item(), b[index].item()
    return "nothing", None, None
