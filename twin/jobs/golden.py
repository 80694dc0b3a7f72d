"""Golden runs: a reference run of a job in a small text file, and the differences of a new run from it. A run is stored
command by command, one line each, so that two versions of a file differ only in the commands that changed:

    command   reply   time it took   ticks of each axis   counters        digests of the stream, window by window
    ----------------------------------------------------------------------------------------------------------------
    @0M...    0       3.21 s         16000 4000 0 0       16000 4000 0 0  |7f3a11|09bc52|...|  X 5dd01c Y 20aa71 Z - A -

A digest covers the ticks of a window: their times since the command was sent, in ns, and the change of every axis. A
command has at most WINDOWS of them, none shorter than WINDOW_TICKS, so the first difference is found to a part of a
move without storing the stream. Times count from their own command, so a difference does not make all that follows
differ.

Replies, times and streams are compared exactly; positions within TOLERANCE_MM, because the last bits of the physics
depend on the processor.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.parameters import FileError, Place, known, read_toml, table
from isel_twin.base.toml import toml_line, toml_value
from isel_twin.base.units import SECOND_NS

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.result import Result
    from isel_twin.jobs.verdict import Verdict
    from isel_twin.motion import Steps

SUFFIX = ".golden"
FORMAT = 1  # version of the file format
WINDOWS = 16  # most windows of a command
WINDOW_TICKS = 500  # least ticks in a window
DIGITS = 6  # hexadecimal digits of a digest: one in 16 million changes of a window is missed
LONG_STEP = 60  # characters of a step of a program that are shown
TOLERANCE_MM = 0.002
TOLERANCE_STEPS = 2  # of lost steps; smaller differences are load angle

_HEAD = (
    "format",
    "job",
    "machine",
    "controller",
    "plant",
    "seed",
    "scenario",
    "set",
    "zero",
    "line_speed",
    "adapter_ms",
)
_END = ("ok", "cycle_s", "counts", "position_mm", "lost_steps", "collisions")  # the last only if there are some


class GoldenError(FileError):
    """A golden file is wrong; the message is one line that names file, key and remedy."""


@dataclass(frozen=True)
class Move:
    """A command of a job and its outcome."""

    line: int
    sent: str
    reply: str
    took_ns: int
    counts: tuple[int, ...] = ()  # at its end
    ticks: tuple[int, ...] = ()  # ticks in which each axis moves; () if none does
    axes: tuple[str, ...] = ()  # digest of each axis, "-": at rest
    windows: tuple[str, ...] = ()
    # not in the file: first and last tick of each window, steps of a program, in ns since the command was sent
    spans_ns: tuple[tuple[int, int], ...] = field(default=(), compare=False)
    steps: tuple[tuple[int, str], ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Golden:
    """A run of a job."""

    call: Mapping[str, Any] = field(default_factory=dict)  # the call: job, machine, controller, plant, seed ...
    moves: tuple[Move, ...] = ()
    end: Mapping[str, Any] = field(default_factory=dict)  # fields of the verdict, by the keys _END


class Scribe:
    """A watcher that stores each command of a job, without what the twin did before."""

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._ticks = twin.steps.made
        self.moves: list[Move] = []

    def take(self, result: Result) -> None:
        """Take a line that has just ended; conditions are left to the verdict."""
        steps, before = self._twin.steps, self._ticks
        self._ticks = steps.made
        if result.condition:
            return
        t_ns, delta = _since(steps, before)
        moving = np.flatnonzero((delta != 0).any(axis=1))  # a stopped motion may end with ticks that change nothing
        t_ns, delta = t_ns[moving] - result.time_ns, delta[moving].astype("<i4")
        size = max(WINDOW_TICKS, -(-len(t_ns) // WINDOWS))
        cuts = [slice(first, first + size) for first in range(0, len(t_ns), size)]
        axes = range(delta.shape[1]) if len(t_ns) else ()
        self.moves.append(
            Move(
                line=result.number,
                sent=result.command,
                reply=result.reply,
                took_ns=result.end_ns - result.time_ns,
                counts=result.counts,
                ticks=tuple(int(np.count_nonzero(delta[:, i])) for i in axes),
                axes=tuple(_axis_digest(t_ns, delta[:, i]) for i in axes),
                windows=tuple(_digest(t_ns[cut], delta[cut]) for cut in cuts),
                spans_ns=tuple((int(t_ns[cut][0]), int(t_ns[cut][-1])) for cut in cuts),
                steps=tuple((part.time_ns - result.time_ns, part.text) for part in result.parts if part.position_mm),
            )
        )

    def back(self, number: int, lines: Mapping[int, int]) -> None:
        """Go on after so many moves, with the twin as it was then. lines: numbers of their lines now."""
        self._ticks = self._twin.steps.made
        self.moves[:] = [replace(move, line=lines[move.line]) for move in self.moves[:number]]

    def golden(self, verdict: Verdict) -> Golden:
        """The run of the whole job, at its end; without its call."""
        end = {
            "ok": verdict.ok,
            "cycle_s": verdict.cycle_s,
            "counts": list(verdict.counts),
            "position_mm": [round(round(mm, 6), 3) + 0.0 for mm in verdict.position_mm],
            "lost_steps": [round(round(steps, 3)) for steps in verdict.lost_steps],
        }
        if verdict.collisions:
            end["collisions"] = [collision.who for collision in verdict.collisions]
        return Golden({}, tuple(self.moves), end)


def _since(steps: Steps, ticks: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
    parts, left = [], steps.made - ticks
    for motion in reversed(steps.motions):
        if left <= 0:
            break
        count = min(left, motion.last - motion.first)
        parts.append(motion.window(motion.last - count, motion.last))
        left -= count
    if not parts:
        return np.empty(0, dtype=np.int64), np.empty((0, steps.axes), dtype=np.int32)
    times, changes = zip(*reversed(parts), strict=True)
    return np.concatenate(times), np.concatenate(changes)


def _digest(t_ns: NDArray[np.int64], delta: NDArray[Any]) -> str:
    data = t_ns.astype("<i8").tobytes() + delta.tobytes()
    return hashlib.sha256(data).hexdigest()[:DIGITS]


def _axis_digest(t_ns: NDArray[np.int64], delta: NDArray[Any]) -> str:
    own = np.flatnonzero(delta)
    return _digest(t_ns[own], delta[own]) if len(own) else "-"


def golden_file(job: Path) -> Path:
    return job.with_suffix(SUFFIX)


def called(run: Golden, call: TwinSpec, job: Path, file: Path, zero: Sequence[float] | None = None) -> Golden:
    """The run with its call; paths relative to the golden file. zero: of the work, if the call has asked for one."""

    def seen(path: Path) -> str:
        return Path(os.path.relpath(path.resolve(), file.resolve().parent)).as_posix()

    head: dict[str, Any] = {"job": job.name, "machine": call.machine_name, "controller": call.controller}
    head |= {"plant": call.plant, "seed": call.seed}
    if Path(call.machine_name).is_dir():
        head["machine"] = seen(Path(call.machine_name))
    if call.overrides:
        head["set"] = dict(call.overrides)
    if call.scenario is not None:
        head["scenario"] = seen(call.scenario)
    if not isinstance(call.line_speed, bool):
        head["line_speed"] = call.line_speed
    if call.adapter_ms:
        head["adapter_ms"] = call.adapter_ms
    if zero is not None:
        head["zero"] = list(zero)
    return replace(run, call=head)


def dumps(run: Golden) -> str:
    """The text of a golden file: TOML, one line for each line of the job."""
    lines = [
        "# What this job did once: `isel-twin golden compare` says what it does differently.",
        f"format = {FORMAT}",
        *(toml_line(key, run.call[key]) for key in _HEAD[1:] if run.call.get(key) not in (None, "")),
        "",
        "lines = [",
        *(f"  {_inline(move)}," for move in run.moves),
        "]",
        "",
        "[end]",
        *(toml_line(key, run.end[key]) for key in _END if key in run.end),
    ]
    return "\n".join(lines) + "\n"


def _inline(move: Move) -> str:
    values: dict[str, Any] = {"line": move.line, "sent": move.sent, "reply": move.reply}
    values |= {"took_s": f"{move.took_ns / SECOND_NS:.9f}", "counts": move.counts}
    if move.windows:
        values |= {"ticks": move.ticks, "axes": " ".join(move.axes), "windows": " ".join(move.windows)}
    return toml_value(values)


def load(path: str | Path) -> Golden:
    """Read a golden file. Raises GoldenError for anything wrong in it, OSError if it cannot be read."""
    place = Place(path, GoldenError)
    content = read_toml(place)
    known(content, (*_HEAD, "lines", "end"), place)
    for key in ("format", "job", "machine", "controller", "plant", "lines", "end"):
        if key not in content:
            raise place.at(key).wrong("missing; this is no golden file: make one with isel-twin golden record")
    if content["format"] != FORMAT:
        raise place.at("format").wrong(f"{content['format']!r}; allowed: {FORMAT}; make the file anew with --replace")
    call = {key: _checked(content, key, place) for key in _HEAD[1:] if key in content}
    lines = content["lines"]
    if not isinstance(lines, list):
        raise place.at("lines").wrong("must be a list of tables")
    moves = tuple(_move(entry, place.at(f"lines {number}")) for number, entry in enumerate(lines, 1))
    end = table(content["end"], place.at("end"))
    known(end, _END, place.at("end"))
    return Golden(call, moves, {key: _checked(end, key, place.at("end")) for key in _END if key in end})


# types of values that are not text
_KINDS: dict[str, tuple[type, ...]] = {
    "seed": (int,),
    "line_speed": (int,),
    "line": (int,),
    "set": (dict,),
    "ok": (bool,),
}
_KINDS |= {
    **dict.fromkeys(("cycle_s", "adapter_ms"), (int, float)),
    **dict.fromkeys(("counts", "ticks", "position_mm", "lost_steps", "zero"), (list,)),
}
_KINDS["collisions"] = (list,)


def _checked(content: Mapping[str, Any], key: str, place: Place) -> Any:
    """A value, checked for its type; lists must hold numbers, that of collisions texts."""
    value, kinds = content[key], _KINDS.get(key, (str,))
    right = isinstance(value, kinds) and (kinds == (bool,) or not isinstance(value, bool))
    if isinstance(value, list):
        kind = str if key == "collisions" else int | float
        right = right and all(isinstance(entry, kind) for entry in value)
    if not right:
        raise place.at(key).wrong(f"{value!r}; must be {' or '.join(kind.__name__ for kind in kinds)}")
    return value


def _move(entry: Any, place: Place) -> Move:
    content = table(entry, place)
    known(content, ("line", "sent", "reply", "took_s", "counts", "ticks", "axes", "windows"), place)
    for key in ("line", "sent", "reply", "took_s", "counts"):
        if key not in content:
            raise place.at(key).wrong("missing")
    values = {key: _checked(content, key, place) for key in content}
    try:
        values["took_ns"] = round(float(values.pop("took_s")) * SECOND_NS)
    except (ValueError, OverflowError):
        raise place.at("took_s").wrong(f"{content['took_s']!r}; must be a time in s") from None
    values |= {key: tuple(values.get(key, "").split()) for key in ("axes", "windows")}
    values |= {key: tuple(values.get(key, ())) for key in ("counts", "ticks")}
    return Move(**values)


@dataclass(frozen=True)
class Difference:
    """One difference between two runs."""

    line: int | None  # line of the job; None: the job as a whole
    what: str

    def __str__(self) -> str:
        return self.what if self.line is None else f"line {self.line}: {self.what}"


def differences(golden: Golden, run: Golden) -> Iterator[Difference]:
    """Differences of the run, in the order of the job."""
    for key in _HEAD[1:]:
        if (was := golden.call.get(key)) != (now := run.call.get(key)) and key != "job":
            a, b = ("none" if value in (None, "") else value for value in (was, now))
            yield Difference(None, f"{key}: {a} -> {b}")
    for was, now in zip(golden.moves, run.moves, strict=False):
        yield from _of_moves(was, now)
    for move in golden.moves[len(run.moves) :]:
        yield Difference(move.line, f"{move.sent}: no longer sent")
    for move in run.moves[len(golden.moves) :]:
        yield Difference(move.line, f"{move.sent}: is new")
    yield from _of_ends(golden.end, run.end)


def _of_moves(was: Move, now: Move) -> Iterator[Difference]:
    def told(what: str) -> Difference:
        return Difference(now.line, f"{now.sent}: {what}")

    if was.sent != now.sent:
        yield Difference(now.line, f"sent {was.sent} -> {now.sent}")
    if was.reply != now.reply:
        yield told(f"reply {was.reply!r} -> {now.reply!r}")
    if was.took_ns != now.took_ns:
        late_ms = (now.took_ns - was.took_ns) / 1e6
        yield told(f"time {was.took_ns / SECOND_NS:.6f} -> {now.took_ns / SECOND_NS:.6f} s ({late_ms:+.6g} ms)")
    if was.windows != now.windows:
        yield told(f"stream {_where(was, now)}")
    if was.counts != now.counts:
        yield told(f"counters {_listed(was.counts)} -> {_listed(now.counts)}")


def _where(was: Move, now: Move) -> str:
    """Which axes differ, and since when."""
    names = [
        f"{name} {a} -> {b} ticks" if a != b else f"{name} at other times"
        for name, (a, b), (x, y) in zip(
            AXIS_NAMES,
            zip_longest(was.ticks, now.ticks, fillvalue=0),  # a missing axis is at rest
            zip_longest(was.axes, now.axes, fillvalue="-"),
            strict=False,
        )
        if x != y
    ]
    first = next(k for k, (a, b) in enumerate(zip_longest(was.windows, now.windows)) if a != b)
    if first < len(now.spans_ns):
        begin_ns, end_ns = now.spans_ns[first]
        when = f"first from {begin_ns / SECOND_NS:.6f} to {end_ns / SECOND_NS:.6f} s after it was sent"
        ends = [*(begun_ns for begun_ns, _ in now.steps[1:]), math.inf]
        steps = zip(now.steps, ends, strict=False)
        made = [text for (begun_ns, text), over_ns in steps if begun_ns <= end_ns and over_ns > begin_ns]
        if made:
            when += f" ({made[0][:LONG_STEP]}{f' to {made[-1][:LONG_STEP]}' if len(made) > 1 else ''})"
    else:
        when = "ends before" if now.windows else "nothing moves any more"
    return f"{when}: {', '.join(names) or 'the axes apart are the same'}"


def _of_ends(was: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Difference]:
    if was.get("ok") != now["ok"]:
        a, b = ("ok" if run.get("ok") else "not ok" for run in (was, now))
        yield Difference(None, f"verdict: {a} -> {b}")
    if abs(was.get("cycle_s", 0.0) - now["cycle_s"]) > 0.5 / SECOND_NS:
        a, b = was.get("cycle_s", 0.0), now["cycle_s"]
        percent = f", {100.0 * (b - a) / a:+.2f} %" if a else ""
        yield Difference(None, f"cycle time {a:.6f} -> {b:.6f} s ({b - a:+.6f} s{percent})")
    if was.get("counts") != now["counts"]:
        yield Difference(None, f"counters at the end {_listed(was.get('counts', ()))} -> {_listed(now['counts'])}")
    for who in _only(was.get("collisions", ()), now.get("collisions", ())):
        yield Difference(None, f"{who} no more")
    for who in _only(now.get("collisions", ()), was.get("collisions", ())):
        yield Difference(None, f"{who} now")
    for name, a, b in zip(CARRIAGES, was.get("position_mm", ()), now["position_mm"], strict=False):
        if not abs(a - b) <= TOLERANCE_MM:
            yield Difference(None, f"position of {name} at the end {a:.3f} -> {b:.3f} mm")
    for name, a, b in zip(AXIS_NAMES, was.get("lost_steps", ()), now["lost_steps"], strict=False):
        if abs(a - b) > TOLERANCE_STEPS:
            yield Difference(None, f"lost steps of {name} {a} -> {b}")


def _only(these: Sequence[str], others: Sequence[str]) -> list[str]:
    """What is among these more often than among the others."""
    return list((Counter(these) - Counter(others)).elements())


def _listed(values: Sequence[Any]) -> str:
    return " ".join(str(value) for value in values) or "none"
