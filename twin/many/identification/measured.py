"""The file of measurements at a machine: TOML, or CSV for readings only.

    gauge_sigma_mm = 0.005                  # default standard deviation of a reading
    time_sigma_s = 0.005                    # of a duration in a recording

    [[reading]]                             # a dial gauge, a scale, calipers
    recording = "first"                     # the recording's file without .mcap
    command = 7                             # at rest after this command, numbered from 1 as by `compare --all`
    axis = "x"
    mm = 19.993                             # rising in the direction of the counter; nan: not read yet
    gauge = "a"                             # readings of one mounting of the gauge share an unknown zero
    push_n = 150.0                          # force along the axis meanwhile; left out: none
    push_at = "table"                       # where it acts; left out: at the tool
    counter_mm = 20.0                       # the counter at that time, if it is random (an emergency stop)
    at_s = 0.35                             # in motion, at this time after the command was sent; left out: at rest
    sigma_mm = 0.02
    about_mm = [60.0, 80.0, 0.0]            # mm is how far the tool is from here (ball bar, test ring), no position

    [[act]]                                 # an operation at the machine
    recording = "first"
    command = 9
    after_s = 0.4                           # after the command was sent
    set = { estop = "pressed" }             # any keys of a scenario event

    [[stall]]                               # the same move ever faster, until the motor stalled
    recording = "first"                     # fitted or held back with this one; the file need not exist
    command = 20                            # first command of that series, if it is in the recording; replay ends there
    axis = "x"
    from_mm = 20.0
    to_mm = 60.0
    acceleration_hz_per_ms = 400
    start_stop_hz = 300
    held_hz = 24000                         # fastest speed at which no step was lost; left out: the first one lost
    lost_hz = 25000                         # the next one, at which steps were lost; left out: it never stalled
    supply_v = 36.0                         # of the stages meanwhile, measured; left out: as always

    [[ring]]                                # let go or struck at rest, and listened to
    recording = "first"
    command = 12                            # at rest after this command
    axis = "x"
    push_n = 100.0                          # force that is let go at once
    push_at = "tool"
    file = "ring-x.csv"                     # time in s and signal, of a sound or an accelerometer; or, in its place,
    frequency_hz = 38.4
    damping = 0.031                         # ratio; may be left out

    [[repeats]]                             # the same place after several reference runs
    recording = "first"
    axis = "x"
    mm = [0.003, 0.011, -0.004]

A CSV file has the keys of a reading in its first line, then one reading a line. A log of a scale is a list of readings
with `at_s`. What a measuring day predicts beforehand (protocol.py: `protocol`, `predicted`) is none of it.
"""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import FileError, Limits, Place, known, parse_toml, plain, read_text, table, text
from isel_twin.base.toml import toml_line
from isel_twin.many.identification.ring_down import read_signal, ring_down
from isel_twin.wiring import EVENT_KEYS

GAUGE_SIGMA_MM = 0.005
PUSHED_AT = ("tool", "table")
TIME_SIGMA_S = 0.005  # USB adapters hold bytes for 1 to 16 ms, and hosts are sometimes busy

_MM = Limits("mm", -1e5, 1e5)
_N = Limits("N", -1e4, 1e4)
_S = Limits("s", 0.0, 1e5)
_HZ = Limits("Hz", 1.0, 1e6)
_V = Limits("V", 5.0, 200.0)
_SIGMA = Limits("mm", 1e-6, 100.0)
_RANG = {"frequency_hz": Limits("Hz", 0.1, 1e5), "damping": Limits("1", 0.0, 1.0)}
_COMMAND = Limits("", 1, 1e6, whole=True)


class MeasuredError(FileError):
    """A file of measurements is wrong; one line that names file, entry, value and what is allowed."""


@dataclass(frozen=True)
class Reading:
    """A position that was read; fields as in the module docstring."""

    recording: str
    command: int
    axis: str
    mm: float
    sigma_mm: float = GAUGE_SIGMA_MM
    gauge: str = ""
    push_n: float = 0.0
    at_s: float | None = None
    counter_mm: float | None = None
    push_at: str = PUSHED_AT[0]
    about_mm: tuple[float, ...] | None = None  # [3]


@dataclass(frozen=True)
class Ring:
    """A machine that was let go at rest and rang down."""

    recording: str
    command: int
    axis: str
    push_n: float
    push_at: str = PUSHED_AT[0]
    frequency_hz: float = math.nan
    damping: float = math.nan


@dataclass(frozen=True)
class Act:
    recording: str
    command: int
    after_s: float
    content: Mapping[str, Any] = field(default_factory=dict)  # keys of a scenario event


@dataclass(frozen=True)
class Stall:
    """Two speeds between which a move begins to lose steps."""

    recording: str
    axis: str
    from_mm: float
    to_mm: float
    acceleration_hz_per_ms: int
    start_stop_hz: int
    held_hz: float  # 0: none held, the first speed lost steps
    lost_hz: float  # inf: it never stalled
    command: int | None = None
    supply_v: float | None = None  # of the stages during the series; None: as always

    @property
    def middle_hz(self) -> float:
        """Where it stalled, or the speed that is known of a series with one outcome only."""
        if self.held_hz == 0.0:
            return self.lost_hz
        return self.held_hz if self.lost_hz == math.inf else math.sqrt(self.held_hz * self.lost_hz)


@dataclass(frozen=True)
class Repeats:
    """One place after several reference runs, mm."""

    recording: str
    axis: str
    mm: tuple[float, ...]


@dataclass(frozen=True)
class Measured:
    """The content of one file or several."""

    readings: tuple[Reading, ...] = ()
    acts: tuple[Act, ...] = ()
    stalls: tuple[Stall, ...] = ()
    repeats: tuple[Repeats, ...] = ()
    time_sigma_s: float = TIME_SIGMA_S
    gauge_sigma_mm: float = GAUGE_SIGMA_MM
    unread: int = 0  # number of entries that are still nan
    rings: tuple[Ring, ...] = ()

    @property
    def names(self) -> list[str]:
        """Recordings that are named, each once."""
        entries = itertools.chain[Any](self.readings, self.acts, self.stalls, self.repeats, self.rings)
        return list(dict.fromkeys(item.recording for item in entries))

    @property
    def axes(self) -> list[str]:
        """Axes that are named, each once, in the order X, Y, Z."""
        found = {item.axis for item in itertools.chain[Any](self.readings, self.stalls, self.repeats, self.rings)}
        return [name for name in CARRIAGES if name in found]

    def of(self, recording: str) -> Measured:
        """The part that belongs to one recording."""
        lists: tuple[tuple[Any, ...], ...] = (self.readings, self.acts, self.stalls, self.repeats, self.rings)
        found = (tuple(one for one in each if one.recording == recording) for each in lists)
        readings, acts, stalls, repeats, rings = found
        return Measured(readings, acts, stalls, repeats, self.time_sigma_s, self.gauge_sigma_mm, rings=rings)

    def __add__(self, other: Measured) -> Measured:
        return Measured(
            self.readings + other.readings,
            self.acts + other.acts,
            self.stalls + other.stalls,
            self.repeats + other.repeats,
            max(self.time_sigma_s, other.time_sigma_s),
            max(self.gauge_sigma_mm, other.gauge_sigma_mm),
            self.unread + other.unread,
            self.rings + other.rings,
        )


def read_measured(path: str | Path) -> Measured:
    """Read a file of measurements, .csv or TOML. Raises MeasuredError, OSError."""
    place = Place(Path(path), MeasuredError)
    content = read_text(place)
    if Path(path).suffix.lower() == ".csv":
        lines = csv.DictReader(io.StringIO(content), skipinitialspace=True)
        readings = [_from_csv(line, place.at(f"line {n}")) for n, line in enumerate(lines, 2)]
        return _measured({"reading": readings}, place)
    return _measured(parse_toml(content, place), place)


def _from_csv(line: Mapping[str | None, Any], place: Place) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in line.items():
        if key is None or value is None:
            raise place.wrong("has not as many fields as the first line")
        if value == "":
            continue
        if key in ("recording", "axis", "gauge"):
            found[key] = value
            continue
        try:
            found[key] = int(value) if key == "command" else float(value)
        except ValueError:
            raise place.at(key).wrong(f"{value!r}; allowed: a number") from None
    return found


_PUSH = ("push_n", "push_at")
_READING = ("recording", "command", "axis", "mm", "sigma_mm", "gauge", *_PUSH, "at_s", "counter_mm", "about_mm")
_RING = ("recording", "command", "axis", *_PUSH, "frequency_hz", "damping")
_SERIES = ("from_mm", "to_mm", "acceleration_hz_per_ms", "start_stop_hz", "held_hz", "lost_hz")
_STALL = ("recording", "command", "axis", *_SERIES, "supply_v")


def _measured(tree: dict[str, Any], place: Place) -> Measured:
    parts = ("reading", "act", "stall", "repeats", "ring", "protocol", "predicted")
    known(tree, ("gauge_sigma_mm", "time_sigma_s", *parts), place)
    sigma_mm = plain(tree.get("gauge_sigma_mm", GAUGE_SIGMA_MM), _SIGMA, place.at("gauge_sigma_mm"))
    time_sigma_s = plain(tree.get("time_sigma_s", TIME_SIGMA_S), Limits("s", 1e-9, 10.0), place.at("time_sigma_s"))
    readings = [_reading(item, sigma_mm, at) for item, at in _entries(tree, "reading", place)]
    acts = [_act(item, at) for item, at in _entries(tree, "act", place)]
    stalls = [_stall(item, at) for item, at in _entries(tree, "stall", place)]
    repeats = [_repeats(item, at) for item, at in _entries(tree, "repeats", place)]
    every = [_ring(item, at) for item, at in _entries(tree, "ring", place)]
    rings = tuple(item for item in every if not math.isnan(item.frequency_hz))
    read = tuple(item for item in readings if not math.isnan(item.mm) and not math.isnan(item.counter_mm or 0.0))
    done = tuple(item for item in stalls if not math.isnan(item.held_hz + item.lost_hz))
    again = tuple(item for item in repeats if len(item.mm) >= 2 and not any(map(math.isnan, item.mm)))
    unread = len(readings) + len(stalls) + len(repeats) - len(read) - len(done) - len(again) + len(every) - len(rings)
    return Measured(read, tuple(acts), done, again, time_sigma_s, sigma_mm, unread, rings)


def _entries(tree: Mapping[str, Any], key: str, place: Place) -> list[tuple[dict[str, Any], Place]]:
    content = tree.get(key, [])
    if not isinstance(content, list):
        raise place.at(key).wrong(f"must be a list of tables: [[{key}]]")
    return [(table(item, place.at(f"{key} {n}")), place.at(f"{key} {n}")) for n, item in enumerate(content, 1)]


def _need(item: Mapping[str, Any], keys: Sequence[str], place: Place) -> None:
    for key in keys:
        if key not in item:
            raise place.at(key).wrong("missing")


def _plain(item: Mapping[str, Any], key: str, limits: Limits, place: Place) -> float:
    """A number within limits, or nan: not read yet."""
    value = item[key]
    return math.nan if isinstance(value, float) and math.isnan(value) else plain(value, limits, place.at(key))


def _command(item: Mapping[str, Any], place: Place) -> int:
    value = plain(item["command"], _COMMAND, place.at("command"))
    if value != int(value):
        raise place.at("command").wrong(f"{value}; allowed: whole numbers from 1")
    return int(value)


def _reading(item: dict[str, Any], sigma_mm: float, place: Place) -> Reading:
    known(item, _READING, place)
    _need(item, ("recording", "command", "axis", "mm"), place)
    return Reading(
        recording=text(item["recording"], place.at("recording")),
        command=_command(item, place),
        axis=text(item["axis"], place.at("axis"), CARRIAGES),
        mm=_plain(item, "mm", _MM, place),
        sigma_mm=plain(item.get("sigma_mm", sigma_mm), _SIGMA, place.at("sigma_mm")),
        gauge=text(item.get("gauge", ""), place.at("gauge")),
        push_n=plain(item.get("push_n", 0.0), _N, place.at("push_n")),
        at_s=None if "at_s" not in item else plain(item["at_s"], _S, place.at("at_s")),
        counter_mm=None if "counter_mm" not in item else _plain(item, "counter_mm", _MM, place),
        push_at=text(item.get("push_at", PUSHED_AT[0]), place.at("push_at"), PUSHED_AT),
        about_mm=None if "about_mm" not in item else _about(item["about_mm"], place.at("about_mm")),
    )


def _about(value: Any, place: Place) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != len(CARRIAGES):
        raise place.wrong(f"{value!r}; allowed: a list of X, Y and Z in mm")
    return tuple(plain(one, _MM, place) for one in value)


def _ring(item: dict[str, Any], place: Place) -> Ring:
    known(item, (*_RING, "file"), place)
    _need(item, ("recording", "command", "axis", "push_n"), place)
    hz, damping = (_plain(item, key, limits, place) if key in item else math.nan for key, limits in _RANG.items())
    if item.get("file"):
        path = Path(str(place.file)).parent / text(item["file"], place.at("file"))
        try:
            hz, damping = ring_down(*read_signal(path))
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise place.at("file").wrong(f"{path}: {reason}") from None
    return Ring(
        recording=text(item["recording"], place.at("recording")),
        command=_command(item, place),
        axis=text(item["axis"], place.at("axis"), CARRIAGES),
        push_n=plain(item["push_n"], _N, place.at("push_n")),
        push_at=text(item.get("push_at", PUSHED_AT[0]), place.at("push_at"), PUSHED_AT),
        frequency_hz=hz,
        damping=damping,
    )


def _act(item: dict[str, Any], place: Place) -> Act:
    known(item, ("recording", "command", "after_s", *EVENT_KEYS), place)
    _need(item, ("recording", "command", "after_s"), place)
    content = {key: value for key, value in item.items() if key in EVENT_KEYS}
    if not content:
        raise place.wrong(f"says not what was done; allowed: {', '.join(EVENT_KEYS)}")
    recording, after_s = text(item["recording"], place.at("recording")), plain(item["after_s"], _S, place.at("after_s"))
    return Act(recording, _command(item, place), after_s, content)


def _stall(item: dict[str, Any], place: Place) -> Stall:
    known(item, _STALL, place)
    _need(item, [key for key in _STALL if key not in ("command", "held_hz", "lost_hz", "supply_v")], place)
    held_hz, lost_hz = 0.0, math.inf
    if "held_hz" in item and item["held_hz"] != 0:
        held_hz = _plain(item, "held_hz", _HZ, place)
    if "lost_hz" in item and item["lost_hz"] != math.inf:
        lost_hz = _plain(item, "lost_hz", _HZ, place)
    if held_hz == 0.0 and lost_hz == math.inf:
        raise place.wrong("has neither held_hz nor lost_hz; allowed: one of them, or both")
    if lost_hz <= held_hz:
        raise place.at("lost_hz").wrong(f"{lost_hz:g}; allowed: more than held_hz, {held_hz:g} Hz")
    return Stall(
        recording=text(item["recording"], place.at("recording")),
        axis=text(item["axis"], place.at("axis"), CARRIAGES),
        from_mm=plain(item["from_mm"], _MM, place.at("from_mm")),
        to_mm=plain(item["to_mm"], _MM, place.at("to_mm")),
        acceleration_hz_per_ms=int(plain(item["acceleration_hz_per_ms"], _HZ, place.at("acceleration_hz_per_ms"))),
        start_stop_hz=int(plain(item["start_stop_hz"], _HZ, place.at("start_stop_hz"))),
        held_hz=held_hz,
        lost_hz=lost_hz,
        command=_command(item, place) if "command" in item else None,
        supply_v=plain(item["supply_v"], _V, place.at("supply_v")) if "supply_v" in item else None,
    )


def _repeats(item: dict[str, Any], place: Place) -> Repeats:
    known(item, ("recording", "axis", "mm"), place)
    _need(item, ("recording", "axis", "mm"), place)
    if not isinstance(item["mm"], list):
        raise place.at("mm").wrong(f"{item['mm']!r}; allowed: a list of numbers")
    recording, axis = text(item["recording"], place.at("recording")), text(item["axis"], place.at("axis"), CARRIAGES)
    return Repeats(recording, axis, tuple(_plain({"mm": value}, "mm", _MM, place) for value in item["mm"]))


def written(measured: Measured, comments: Mapping[int, str] | None = None) -> str:
    """The file as text; comments: one for the readings after a command."""
    lines = [f"gauge_sigma_mm = {measured.gauge_sigma_mm!r}", f"time_sigma_s = {measured.time_sigma_s!r}"]
    for act in measured.acts:
        values = {"recording": act.recording, "command": act.command, "after_s": act.after_s, **act.content}
        lines += ["", "[[act]]", *map(toml_line, values, values.values())]
    for reading in measured.readings:
        comment = (comments or {}).get(reading.command)
        lines += ["", *([f"# {comment}"] if comment else []), "[[reading]]", *_lines(reading, _READING)]
    for stall in measured.stalls:
        lines += ["", "[[stall]]", *_lines(stall, _STALL)]
    for ring in measured.rings:
        comment = (comments or {}).get(ring.command)
        lines += ["", *([f"# {comment}"] if comment else []), "[[ring]]", 'file = ""', *_lines(ring, _RING)]
    for repeats in measured.repeats:
        lines += ["", "[[repeats]]", *_lines(repeats, ("recording", "axis", "mm"))]
    return "\n".join(lines) + "\n"


def _lines(item: Any, keys: Sequence[str]) -> list[str]:
    values = {key: getattr(item, key) for key in keys}
    left_out: dict[str, Any] = {"push_n": 0.0, "gauge": "", "push_at": PUSHED_AT[0]}
    return [toml_line(key, value) for key, value in values.items() if value != left_out.get(key)]
