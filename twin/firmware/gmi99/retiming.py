"""Change the settings in a job: top speed and acceleration before the lines that move, feeds in them.

    M40000        -->  M90000                 a line that sets one gets the value of the next line that moves
    B100               B250
    f20000             f90000                 feeds from `rapid_hz` upwards; slower ones are those of a process
    83h 9000 0         83h 9000 0

A top speed is that of the rapids (G0) and limits the feeds: it is never below a feed that the line has (3.1.1). Above
50000 Hz feeds are multiples of the V factor, so slow ones are rounded down by up to 20 Hz. Top speed and acceleration
wait until nothing moves: they get lines of their own before the line, whose moves stay joined. Those of single axes
(`M50000;2`) stay. All are set again after `r`, which brings the defaults back, and after a line with <...>. Programs
that are recorded stay unchanged; they run with what is in force at their start.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from isel_twin.firmware.gmi99.settings import Settings
from isel_twin.language import JobMove, MoveSettings

JOINED = " | "  # frames of one line
_FACTORY = Settings()
_SETS = re.compile(r"([MBf])\s*(\d+)(?:[;,]\s*0)?")  # of the leading axis: without a slot
_MOVES = re.compile(r"[89A-Fa-f][0-9A-Fa-f]h.*|V.*", re.DOTALL)
_RAPID = re.compile(r"G\s*0")
_STARTS, _RECORDS, _RECORDED = (re.compile(rf"p\s*3[;,]\s*{code}\b.*", re.DOTALL) for code in (1, 100, 101))
_DEFAULTS = re.compile(r"r\b.*", re.DOTALL)


def defaults() -> Mapping[str, int]:
    """Of a card as it was delivered (3.1.1); ramps begin at 0."""
    return {"acceleration_hz_per_ms": _FACTORY.b_hz_per_ms[0]}


@dataclass
class _Row:
    """What a line does, and what is in force there."""

    frames: list[str] = field(default_factory=list)
    moves: bool = False
    top_hz: int = _FACTORY.m_hz[0]
    acceleration: int = _FACTORY.b_hz_per_ms[0]
    feed_hz: int | None = None  # at the beginning of the line; None: rapid
    feeds_hz: list[int | None] = field(default_factory=list)  # of its moves
    forgets: bool = False

    @property
    def speeds_hz(self) -> tuple[int, ...]:
        return tuple(min(self.top_hz if feed is None else feed, self.top_hz) for feed in self.feeds_hz)


def job_moves(lines: Sequence[str]) -> list[JobMove]:
    """The lines that move; a card as it was delivered at the beginning."""
    rows = ((number, row) for number, row in enumerate(_rows(lines)) if row.moves)
    return [JobMove(n, row.speeds_hz, row.acceleration, 0, straight=len(row.feeds_hz) == 1) for n, row in rows]


def retimed(lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int) -> list[list[str]]:
    """The replacement of each line."""
    rows = list(_rows(lines))
    in_force: dict[str, int] = {}
    made = []
    for number, (line, row) in enumerate(zip(lines, rows, strict=True)):
        target = number if row.moves else min((move for move in settings if move > number), default=number)
        if row.forgets:
            in_force.clear()
        if target not in settings or row.forgets:
            in_force.update(_set_by(row.frames))
            made.append([line])
            continue
        wanted = _wanted(rows[target], settings[target], rapid_hz, in_force)
        frames = [_retold(frame, wanted, settings[target].speed_hz, rapid_hz) for frame in row.frames]
        before = []
        if row.moves:
            if row.feed_hz is not None and row.feeds_hz[:1] == [row.feed_hz]:
                wanted["f"] = settings[number].speed_hz if row.feed_hz >= rapid_hz else row.feed_hz
            before = [f"{letter}{value}" for letter, value in wanted.items() if in_force.get(letter) != value]
            in_force.update(wanted)
        in_force.update(_set_by(frames))
        made.append([*before, line if frames == row.frames else JOINED.join(frames)])
    return made


def faster(lines: Sequence[str], factor: float) -> list[str]:
    """The lines with all top speeds and feeds that they set times a factor; the card refuses those beyond its range."""

    def scaled(frame: str) -> str:
        found = _SETS.fullmatch(frame)
        if found is None or found[1] == "B":
            return frame
        return f"{found[1]}{round(int(found[2]) * factor)}"

    made = []
    for line in lines:
        frames = _frames(line)
        quick = [scaled(frame) for frame in frames]
        made.append(line if quick == frames else JOINED.join(quick))
    return made


def permanent(settings: MoveSettings) -> list[str]:
    """The acceleration, which `s` keeps (3.1.1)."""
    return [f"B{settings.acceleration_hz_per_ms}", "s"]


def _wanted(row: _Row, settings: MoveSettings, rapid_hz: int, in_force: Mapping[str, int]) -> dict[str, int]:
    """Top speed and acceleration for a line that moves: rapids and recorded programs need just this top speed, feeds
    at least theirs."""
    speeds_hz = [settings.speed_hz if speed >= rapid_hz else speed for speed in row.speeds_hz]
    top_hz = max(speeds_hz, default=settings.speed_hz)
    if None not in row.feeds_hz and row.feeds_hz:
        top_hz = max(top_hz, in_force.get("M", 0))
    return {"M": top_hz, "B": settings.acceleration_hz_per_ms}


def _retold(frame: str, wanted: Mapping[str, int], speed_hz: int, rapid_hz: int) -> str:
    found = _SETS.fullmatch(frame)
    if found is None:
        return frame
    if found[1] == "f":
        return f"f{speed_hz}" if int(found[2]) >= rapid_hz else frame
    return f"{found[1]}{wanted[found[1]]}"


def _set_by(frames: Sequence[str]) -> dict[str, int]:
    """What is in force after these frames, as far as they say; a feed of 0 is rapid."""
    found: dict[str, int] = {}
    for frame in frames:
        if _RAPID.fullmatch(frame):
            found["f"] = 0
        elif sets := _SETS.fullmatch(frame):
            found[sets[1]] = int(sets[2])
    return found


def _frames(line: str) -> list[str]:
    """The frames of a line; none of one with <...>."""
    return [] if "<" in line else [frame.strip() for frame in line.split("|")]


def _rows(lines: Sequence[str]) -> Iterator[_Row]:
    """Each line read."""
    top_hz, acceleration = _FACTORY.m_hz[0], _FACTORY.b_hz_per_ms[0]
    feed_hz: int | None = None
    recording = False
    for line in lines:
        frames = _frames(line)
        row = _Row(frames, top_hz=top_hz, acceleration=acceleration, feed_hz=feed_hz)
        row.forgets = "<" in line and not line.rstrip().endswith("s>")
        for frame in frames:
            if recording:
                recording = not _RECORDED.fullmatch(frame)
                row.frames = []
            elif found := _SETS.fullmatch(frame):
                value = int(found[2])
                if found[1] == "f":
                    feed_hz = value
                elif found[1] == "M":
                    top_hz = row.top_hz = value
                else:
                    acceleration = row.acceleration = value
            elif _RAPID.fullmatch(frame):
                feed_hz = None
            elif _MOVES.fullmatch(frame):
                row.moves = True
                row.feeds_hz.append(feed_hz)
            elif _STARTS.fullmatch(frame):
                row.moves = True
            elif _RECORDS.fullmatch(frame):
                recording, row.frames = True, []
            elif _DEFAULTS.fullmatch(frame):
                top_hz, acceleration, feed_hz = _FACTORY.m_hz[0], _FACTORY.b_hz_per_ms[0], None
                row.forgets = True
        if row.forgets:
            top_hz, acceleration, feed_hz = _FACTORY.m_hz[0], _FACTORY.b_hz_per_ms[0], None
        yield row
