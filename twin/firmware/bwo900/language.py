"""The control's language. Implements `isel_twin.language.Language` and `TellsCounters`.

A host sends lines of files (transfer.py); the control never answers. A program file is a job: it is transferred, the
axes are referenced, the program is started; a long one is fed while it is executed (feed.py):

    P1 ... #  EOT     D  P8683: 1, P12130: 1 ...  #  EOT     D  P8811: 0, P8800: 1, P8683: 2, P8684: 1  #  EOT
                      D  P8683: 1, P12130: 1 ...  #  EOT     D  P8811: 1, P8800: 1, P8683: 2, P8684: 1  #  EOT   P1 ...
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, Final

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath
from isel_twin.cam.writing import written
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.firmware.bwo900 import retiming
from isel_twin.firmware.bwo900.geometry.groups import BEYOND
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, G, M, P, Q
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE, MOST_AXES, of_axis
from isel_twin.firmware.bwo900.programs.lines import BLANK, END, HANDSHAKE, PARAMETERS, program_name
from isel_twin.language import (
    SETTINGS_RANGES,
    Example,
    LanguageError,
    Message,
    MoveSettings,
    Pieces,
    Ranges,
    check_ranges,
    encoded,
    integers,
    readable,
)

if TYPE_CHECKING:
    from isel_twin.firmware.bwo900.programs.words import ProgramBlock

END_OF_LINE: Final = b"\r\n"
END_OF_FILE: Final = b"\x04"
AXES: Final = ("X", "Y", "Z")
PER_MM: Final = 1000.0
MOVE: Final = 9_999  # the program that `move` starts
WORDS: Final = (4_990, 4_991, 4_992, 4_993)  # parameters that hold its feed in mm/min, and X, Y, Z in mm
NUMBER: Final = 1  # program number of a file without one

_PUT_OUT: Final = re.compile(rb"q(\d+): *(-?[\d.]+)")
# of an axis: where it is, and what follows from that
_MEASURED: Final = frozenset((
    Axis.MACHINE_PLACE, Axis.SET_PLACE, Axis.ACTUAL_PLACE, Axis.SHOWN_PLACE, Axis.DELTA_PLACE, Axis.LAG,
    Axis.ACTUAL_SPEED, Axis.SPEED_NOW,
))  # fmt: skip

G_WORDS: Final[Mapping[int, str]] = {
    G.RAPID: "rapid", G.LINE: "line", G.CIRCLE_CLOCKWISE: "circle clockwise",
    G.CIRCLE_COUNTER_CLOCKWISE: "circle counter-clockwise", G.DWELL: "dwell", G.EXACT_STOP_HERE: "exact stop",
    G.NO_EXACT_STOP_HERE: "no exact stop", G.POLAR_ON: "polar coordinates", G.POLAR_OFF: "no polar coordinates",
    G.CORNER: "chamfer or rounding", G.PLANE_XY: "plane XY", G.PLANE_ZX: "plane ZX", G.PLANE_YZ: "plane YZ",
    G.EXACT_STOP_ON: "exact stops on", G.EXACT_STOP_OFF: "exact stops off", G.RADIUS_OFF: "radius correction off",
    G.RADIUS_LEFT: "radius correction left", G.RADIUS_RIGHT: "radius correction right",
    G.AXIS_CORRECTION_OFF: "axis correction off", G.AXIS_CORRECTION_ON: "axis correction", G.ROTATION_ON: "rotation",
    G.ROTATION_OFF: "rotation off", G.MACHINE_COORDINATES: "machine coordinates",
    G.TOOL_COORDINATES: "tool coordinates", G.WORKPIECE_COORDINATES: "workpiece coordinates",
    G.MACHINE_ZERO: "machine zero", G.MIRROR_OFF: "mirror off", G.MIRROR_FIRST: "mirror first axis",
    G.MIRROR_SECOND: "mirror second axis", G.OVERRIDE_FIXED: "override 100 %", G.OVERRIDE_FREE: "override free",
    G.BARE: "without corrections", G.RECTANGLE: "rectangular pocket", G.RECTANGLE_ZIGZAG: "rectangular pocket, zigzag",
    G.RECTANGLE_FINISHED: "rectangular pocket, finished", G.CIRCULAR_POCKET: "circular pocket",
    G.CIRCULAR_POCKET_FINISHED: "circular pocket, finished", G.DRILLING: "drill", G.DEEP_HOLE: "deep hole",
    G.TAPPING: "tap", G.BORING: "bore", G.RAY: "ray of places", G.PERIMETER: "parallelogram of places",
    G.GRID: "grid of places", G.CIRCLE_OF_PLACES: "circle of places", G.ABSOLUTE: "absolute",
    G.INCREMENTAL: "incremental", G.SHIFT: "shift of zero", G.FEED_PER_MINUTE: "feed in mm/min",
    G.FEED_PER_TURN: "feed in mm a revolution", G.CUTTING_SPEED: "constant cutting speed",
    G.TURNS_PER_MINUTE: "speed in 1/min", G.THREE_POINTS: "line or circle by three points",
    G.NO_TRANSFORMATION: "no transformation", G.NO_ZERO: "no zero point",
}  # fmt: skip
M_WORDS: Final[Mapping[int, str]] = {
    M.HALT: "measuring stop", M.SYNCHRONISE: "synchronise", M.RETURN: "return", M.SPINDLE_RIGHT: "spindle right",
    M.SPINDLE_LEFT: "spindle left", M.SPINDLE_OFF: "spindle off", M.TOOL_CHANGE: "tool change",
    M.COOLANT_1_ON: "coolant 1 on", M.COOLANT_2_ON: "coolant 2 on", M.COOLANT_OFF: "coolant off",
    M.TOOL_DATA: "tool data", M.JUMP: "jump", M.LOOP: "loop", M.LOOP_END: "end of the loop", M.CALL: "call",
    M.REPEAT: "end, again", M.END: "end",
}  # fmt: skip
KEYS: Final[Mapping[int, str]] = {
    P.FED: "dripfeed", P.MODE_TO_PLC: "mode", P.START_TO_PLC: "start (1) or stop (0)", P.ABORT: "abort",
    P.PROGRAM: "program", P.START_BLOCK: "start block", P.SKIP: "skip blocks with /", P.OVERRIDE: "feed override, %",
    P.ACKNOWLEDGE: "acknowledge messages",
}  # fmt: skip
KEPT: Final = 4 << 20  # most bytes of a program that is stored; a longer linear one is fed
PIECE: Final = 1 << 16  # characters encoded at a time
MARKS: Final = frozenset("PZD#%\x04")  # first characters of lines that may not be blocks
_LINE = re.compile(r"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+\Z")
_ROW = re.compile(r"[^\r\n]+")  # may be blank
_ENDS = re.compile(r"(?<![ \t])[ \t]*(?:\r\n|\r|\n)(?:[ \t]*(?:\r\n|\r|\n))*")
_BLOCK = re.compile(r"\s*+/?\s*+N\s*(\d+)")
# what makes a program not linear: M23, M24, M25, M29, jumps by comparison
_LEADS_BACK = re.compile(r"M\s*0*2[3459](?!\d)|[<>=]")
SURE: Final = 100  # lines examined to recognise a program
SHOWN: Final = 40  # characters of a line quoted in an error
_KNOWN = re.compile(r"\s*+(?:/?\s*+N\s*\d+\s*(?:[A-Za-z_!({/]|$)|;)")  # almost certainly a block or a remark
_JOB = re.compile(r"\s*[<#!]")  # beginnings of a job file: bytes, a remark
_PARAMETERS: Final = ("D", "D+")
_PARAMETER = re.compile(r"\s*+(?:K\d+\s*+:?\s*+)?([Pq])\s*(\d+)\s*:\s*(\S+)")


def create(name: str) -> Bwo900Language:
    """Entry point of `isel_twin.languages`."""
    return Bwo900Language()


class Bwo900Language:
    """Implements `isel_twin.language.Language`, `RunsPrograms`, `RetimesJobs`, `HoldsMotion` and `WritesToolpaths`."""

    idle = b"\r\n\t " + END_OF_FILE + HANDSHAKE

    def __init__(self) -> None:
        # ramps begin at 0: there is no start-stop frequency
        self.ranges: Ranges = {
            "speed_hz": (SETTINGS_RANGES["speed_hz"][0], round(retiming.RAPID_HZ)),
            "acceleration_hz_per_ms": SETTINGS_RANGES["acceleration_hz_per_ms"],
        }
        self.defaults = retiming.DEFAULTS
        self._sent = Pieces(ends=b"\n\x04")
        self._received = Pieces(ends=b"\n\x04")

    def example(self) -> Example:
        return Example.kept(__package__, "square.nc", "4030-servo")

    def frame(self, text: str) -> bytes:
        return encoded(text) + END_OF_LINE

    def begins(self, data: bytes) -> bool | None:
        """With the first line of a file."""
        line = re.split(b"[\r\n\4]", data, maxsplit=1)
        word = line[0].translate(None, HANDSHAKE).decode("latin-1").strip(BLANK)
        if not word.startswith(("P", "Z", *PARAMETERS)):
            return False
        return word in PARAMETERS or bool(program_name(word)) if len(line) > 1 else None

    def text(self, reply: bytes) -> str:
        return readable(reply)

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """Always True: the control never refuses on the line; errors are messages and `Controller.fault`."""
        return True

    def written(self, path: Toolpath, axes: MachineAxes, settings: CamSettings) -> Iterator[Written]:
        from isel_twin.firmware.bwo900.writing import Bwo900Commands

        return written(path, axes, settings, Bwo900Commands(axes, settings.outputs, settings.rapid_mm_s))

    def counters(self, sent: bytes, reply: bytes) -> tuple[Mapping[int, int], bytes] | None:
        """Of a file with all parameters (P11181): P12151 of each axis, in 0.001 mm; without the places, following
        errors and speeds that are measured, which differ with it."""
        found: dict[int, int] = {}
        rest = []
        for line in reply.split(b"\r\n"):
            match = _PUT_OUT.match(line)
            axis, offset = divmod(int(match[1]) - Q.AXES_FIRST, AXIS_SIZE) if match else (-1, 0)
            if match is None or not 0 <= axis < len(AXES) or offset not in _MEASURED:
                rest.append(line)
            elif offset == Axis.SET_PLACE:
                found[axis] = round(float(match[2]) * PER_MM)
        return (found, b"\r\n".join(rest)) if found else None

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        for piece in (self._sent if sent else self._received).cut(data):
            text = piece.rstrip(b"\r\n\x04").decode("latin-1")
            words = "end of the file" if piece.endswith(END_OF_FILE) else explain(text)
            yield Message(piece, text, words, sent=sent)

    def rest(self, sent: bool) -> bytes:
        return (self._sent if sent else self._received).rest

    def reference(self) -> Sequence[bytes]:
        """The program that `move` starts, and the reference runs of all axes. The program takes its target from
        parameters, as replacing a program gives a remark each time."""
        words = " ".join(f"{word}:P{number}" for word, number in zip(("F", *AXES), WORDS, strict=True))
        return [_file([f"P{MOVE}", f"N10 G90 G1 {words}", "N20 M30"]), _REFERENCE]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """In HAND the ramps and target parameters, then the start; servo drives have no start-stop frequency. A count
        is 0.001 mm; the ramp time is that to 100 mm/s (default P12012 and P12004) (bwo900/75)."""
        check_ranges(settings, self.ranges)
        counts = integers(target, len(AXES))
        values = settings.speed_hz / PER_MM * 60.0, *(count / PER_MM for count in counts)
        words = [f"K1:P{number}: {value:.3f}" for number, value in zip(WORDS, values, strict=True)]
        ramp_ms = retiming.RAPID_HZ / settings.acceleration_hz_per_ms
        words += [f"K1:P{of_axis(axis, Axis.DYNAMICS_1)}: {ramp_ms:.3f}" for axis in range(len(AXES))]
        return [_file(["D", f"K1:P{P.MODE_TO_PLC}: 1", *words]), _file(["D", *_started(MOVE)])]

    def break_off(self) -> bytes:
        return _file(["D", f"K1:P{P.ABORT}: 1"])

    def hold(self) -> bytes:
        return _file(["D", f"K1:P{P.START_TO_PLC}: 0"])

    def held(self, reply: bytes) -> bool:
        """Nothing tells it: the control never answers."""
        return False

    def go_on(self) -> bytes:
        return _file(["D", f"K1:P{P.START_TO_PLC}: 1"])

    give_up = break_off

    job_moves = staticmethod(retiming.job_moves)
    retimed = staticmethod(retiming.retimed)
    faster = staticmethod(retiming.faster)

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        """None: what the program sets stays in the control."""
        return ()

    def claims(self, text: str) -> bool:
        """True for a text of only program names and numbered blocks."""
        rows = [row[0] for row in islice(_significant(text), SURE)]
        plain = (END, "\x04", *_PARAMETERS)
        known = all(program_name(row) or row.strip() in plain or _is_known(row) for row in rows)
        return known and any(map(_is_known, rows))

    def knows(self, line: str) -> bool:
        return bool(program_name(line) or _BLOCK.match(line) or line.strip() in _PARAMETERS or _is_known(line))

    def job(self, text: str) -> Sequence[tuple[str, Iterable[bytes]]] | None:
        """None for a text that begins like a job. The first program is started; a linear one longer than KEPT is fed
        (P8811)."""
        beginning = next(_significant(text), None)
        if beginning is None or _JOB.match(beginning[0]):
            return None
        _check_beginning(beginning[0])
        if not text.isascii():
            encoded(text)  # raises if it cannot be sent
        files = list(_programs(text))
        first = next((file for file in files if file.name[0] == "P"), None)
        if first is None and any(file.name[0] == "Z" for file in files):
            others = ", ".join(file.name for file in files)
            raise LanguageError(f"there is no program in it to be started, a line P and its number, but {others}")
        if first is None:
            return [(f"{file.name}, {file.blocks}", file) for file in files]
        number = int(first.name[1:])
        feeds = first.size > KEPT and not any(_LEADS_BACK.search(text, *span) for span in first.spans)
        steps: list[tuple[str, Iterable[bytes]]] = [
            (f"{file.name}, {file.blocks}", file) for file in files if not (feeds and file is first)
        ]
        steps.append(("reference", [_REFERENCE]))
        if feeds:
            data = replace(first, before=_file(["D", *_started(number, fed=1)]))
            return [*steps, (f"start {first.name}, fed: {first.blocks}", data)]
        return [*steps, (f"start {first.name}", [_file(["D", *_started(number)])])]

    def lines(self, text: str, names: Collection[str]) -> Mapping[str, int]:
        found: dict[str, int] = {}
        wanted = {name.partition(" N")[2] for name in names}
        name = ""
        for number, found_row in enumerate(_LINE.finditer(text), 1):
            row = found_row[0]
            if block := _BLOCK.match(row):
                if (digits := block[1].lstrip("0") or "0") in wanted:
                    found.setdefault(f"{name or f'P{NUMBER}'} N{digits}", number)
            elif program := program_name(word := row.strip()):
                name = program
            elif word == END:
                name = ""
        for name in names:
            program, _, sent = name.partition(" line ")
            if sent and (line := _line_of(text, program, int(sent))):
                found[name] = line
        return {name: line for name, line in found.items() if name in names}

    def place(self, said: str, step: str) -> tuple[str, int]:
        """A block as "P1 N30"; of a file that cannot be stored a line as it is sent, "P1 line 4"."""
        if found := re.match(r"M\d+ ([PZ]\d+ N\d+)(?: column (\d+))?", said):
            return found[1], int(found[2] or 1)
        program, line = re.search(r"\b([PZ]\d+|[DT])\b", step), re.search(r"\bline (\d+)", said)
        return (f"{program[1]} line {line[1]}", 1) if program and line else ("", 0)


def _significant(text: str) -> Iterator[re.Match[str]]:
    """Lines without blank ones and without remarks and tape marks (%) before the first program."""
    began = False
    for row in _ROW.finditer(text):
        word = row[0].lstrip()[:1]
        began = began or word not in ("", ";", "%")
        if began and word:
            yield row


def _line_of(text: str, name: str, sent: int) -> int | None:
    """Line of the text that is line `sent` of that program as it is sent, without blank ones; line 1 is its name."""
    program = next((each for each in _programs(text) if each.name == name), None)
    if program is None:
        return None
    left = sent - 1
    for number, row in enumerate(_LINE.finditer(text), 1):
        left -= bool(row[0].strip()) and any(begin <= row.start() < end for begin, end in program.spans)
        if left == 0:
            return number
    return None


def _is_known(row: str) -> bool:
    return _KNOWN.match(row) is not None or _PARAMETER.match(row) is not None


def _check_beginning(row: str) -> None:
    """Raise LanguageError for a line that begins no program."""
    if not (program_name(row) or _BLOCK.match(row) or row.strip() in _PARAMETERS):
        try:
            _parsed(row)
        except ProgramError:
            begins = f"{row.strip()[:SHOWN]!r} begins neither a program (P1), a block (N10 ...)"
            raise LanguageError(f"{begins}, nor a file of parameters (D)") from None


@dataclass(frozen=True)
class _Program:
    """A program in a text, or parameters (D). Iteration gives its file for the line in pieces."""

    text: str
    name: str
    spans: tuple[tuple[int, int], ...]  # [begin, end) of its blocks in the text
    count: int  # blocks; chained lines are one
    before: bytes = b""  # sent ahead of it

    @property
    def blocks(self) -> str:
        what = "line" if self.name in _PARAMETERS else "block"
        return f"{self.count} {what}{'' if self.count == 1 else 's'}"

    @property
    def size(self) -> int:
        return sum(end - begin for begin, end in self.spans)

    def __iter__(self) -> Iterator[bytes]:
        yield self.before + encoded(f"\r\n{self.name}\r\n")
        for begin, end in self.spans:
            while begin < end:
                cut = self.text.rfind("\n", begin, begin + PIECE) + 1 if begin + PIECE < end else end
                cut = cut or min(begin + PIECE, end)
                yield encoded(_ENDS.sub("\r\n", self.text[begin:cut]))
                begin = cut
        ended = self.text.endswith(("\n", "\r"), 0, self.spans[-1][1])  # a file may lack its last line end
        yield encoded(("" if ended else "\r\n") + f"{END}\r\n") + END_OF_FILE + END_OF_LINE


def _programs(text: str) -> Iterator[_Program]:
    name, spans, count, begin = "", list[tuple[int, int]](), 0, -1
    for row in _significant(text):
        if (mark := row[0].lstrip()[0]) not in MARKS:
            begin = row.start() if begin < 0 else begin
            count += mark != ";" and not row[0].rstrip().endswith("\\")
            continue
        word = row[0].strip()
        found = word if word in _PARAMETERS else program_name(word)
        if not (found or word == END or word[0] in "%\x04"):
            begin = row.start() if begin < 0 else begin
            count += 1
            continue
        if begin >= 0:
            spans.append((begin, row.start()))
            begin = -1
        if (found and spans) or (word == END and (name or spans)):
            yield _Program(text, name or f"P{NUMBER}", tuple(spans), count)
            name, spans, count = "", [], 0
        name = found or name
    if begin >= 0:
        spans.append((begin, len(text)))
    if spans:
        yield _Program(text, name or f"P{NUMBER}", tuple(spans), count)


def _file(lines: Sequence[str]) -> bytes:
    text = "".join(f"{line}\r\n" for line in ("", *lines, END))
    return encoded(text) + END_OF_FILE + END_OF_LINE


def _started(program: int, fed: int = 0) -> list[str]:
    """Parameters that start a program; fed: 1 if it is sent while it runs."""
    values = {P.FED: fed, P.PROGRAM: program, P.MODE_TO_PLC: 2, P.START_TO_PLC: 1}
    return [f"K1:P{number}: {value}" for number, value in values.items()]


_REFERENCE: Final = _file(
    ["D", f"K1:P{P.MODE_TO_PLC}: 1", *(f"K1:P{of_axis(axis, Axis.REFERENCE_RUN)}: 1" for axis in (2, 1, 0))]
)


def explain(text: str) -> str:
    """A line of a file in a few words."""
    word = text.strip()
    if not word:
        return "blank line"
    if word == END:
        return "end of a program or of parameters"
    if word in _PARAMETERS:
        return "parameters"
    if word.startswith(";"):
        return "a remark"
    if name := program_name(word):
        return f"{'program' if name[0] == 'P' else 'cycle'} {name[1:]}"
    if (match := _PARAMETER.match(word)) is not None and not re.match(r"\s*+/?\s*+N", word):
        number = int(match[2])
        known = KEYS.get(number, "") if match[1] == "P" else ""
        axis, offset = divmod(number - P.AXES_FIRST, AXIS_SIZE)
        if 0 <= axis < MOST_AXES and offset == Axis.REFERENCE_RUN:
            known = f"reference run of axis {axis + 1}"
        return f"{known or 'parameter'}: {match[3]}"
    try:
        return _explained(_parsed(word))
    except ProgramError as error:
        return f"no block: M{error.number} {error.detail}".rstrip()


def _parsed(text: str) -> ProgramBlock:
    """Imports the parser: every job of any controller asks this language whether it is a program, and needs none."""
    from isel_twin.firmware.bwo900.programs.syntax import parse_block

    return parse_block(text)


def _explained(block: ProgramBlock) -> str:
    parts = [] if block.number is None else [f"block {block.number}"]
    if block.skip:
        parts.append("may be skipped")
    parts += [G_WORDS.get(g.number, BEYOND.get(g.number, f"G{g.number}")) for g in block.g]
    axes = [word.name for word in block.words if word.name[0] not in "FSTIJKRft"]
    if axes:
        parts.append(f"to {' '.join(axes)}")
    named = {"F": "feed", "S": "speed", "T": "tool", "R": "radius"}
    parts += [named[word.name[0]] for word in block.words if word.name[0] in named]
    parts += [M_WORDS.get(m.number, f"M{m.number}") for m in block.m]
    parts += ["sets parameters"] * bool(block.assignments) + ["jumps by comparison"] * bool(block.jumps)
    if block.wait is not None:
        parts.append("waits for a condition")
    if block.message is not None:
        parts.append("clears its text" if block.message.text is None else "shows a text")
    return ", ".join(filter(None, parts)) or "nothing"
