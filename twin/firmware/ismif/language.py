"""The iSMIF's language. Implements `isel_twin.language.Language`, `RetimesJobs`, `HoldsMotion`, `TellsCounters` and
`WritesToolpaths`.

    sent      a line ends with CR, or with 01h, which also starts the job
    received  a line ends with CR and identifies itself

                #E1,1200 CR    L1,X4000,Y4000 01h                 @X CR
                           CR                     CR  02h CR            @X000001 CR

The interface never refuses (ismif/1): errors are in the third character of the status, and in `Controller.fault`.

A ramp is set by its duration, not by an acceleration (ismif/5). From the start speed f0 to the end speed V it takes

    R = (V - f0) / a        in whole ms, rounded up: the ramp is never steeper than wanted

and `move` uses the end speed at INDEX of the table, which reference runs do not use by default.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath
from isel_twin.cam.writing import written
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.firmware.ismif import commands, retiming
from isel_twin.firmware.ismif.commands import AXIS_LETTERS, LINE_LIMIT, SPEEDS_HZ, CommandError
from isel_twin.language import (
    SETTINGS_RANGES,
    Example,
    Message,
    MoveSettings,
    Pieces,
    Ranges,
    check_ranges,
    encoded,
    integers,
    readable,
)

CR, LF, START, READY, FULL = b"\r", b"\n", b"\x01", b"\x02", b"\x03"
INDEX = 0  # entry of the table of end speeds (6.9) that `move` sets

# answers without text, their CR left out (5.2), in words
ANSWERS: Mapping[bytes, str] = {
    b"": "acknowledged",
    READY: "the job is over, or the memory has room again",
    FULL: "acknowledged; the memory is full, wait",
}

# in half steps. There is no range of accelerations: the steepest ramp takes 1 ms.
RANGES: Ranges = {
    "speed_hz": (SPEEDS_HZ[0], SPEEDS_HZ[-1]),
    "acceleration_hz_per_ms": SETTINGS_RANGES["acceleration_hz_per_ms"],
    "start_stop_hz": (SPEEDS_HZ[0], min(SPEEDS_HZ[-1], SETTINGS_RANGES["start_stop_hz"][1])),
}

_POSITION = re.compile(rb"@L([XYZ])(-?\d+)\r")

# meaning of a 1 at each place of the status (6.3)
STATUS = ("moving", "waiting time", "error", "not referenced", "reference run", "job in progress")


def create(name: str) -> IsmifLanguage:
    """Entry point of `isel_twin.languages`."""
    return IsmifLanguage()


class IsmifLanguage:
    """Implements `isel_twin.language.Language`."""

    idle = CR + LF

    def __init__(self) -> None:
        self.ranges = RANGES
        self.defaults = retiming.defaults()
        self._sent, self._received = Pieces(ends=CR + START), Pieces(ends=CR)
        self._begun = b""

    def example(self) -> Example:
        return Example.kept(__package__, "square.txt", "4030")

    def frame(self, text: str) -> bytes:
        """The text and CR; a text that ends in 01h starts the job, and the CR after it is an empty line."""
        return encoded(text) + CR

    def knows(self, line: str) -> bool:
        return commands.code_of(line) in commands.COMMANDS

    def begins(self, data: bytes) -> bool | None:
        """With a line of a known code, whatever its numbers are. A 01h alone starts nothing."""
        line = re.split(b"[\r\1]", data, maxsplit=1)
        text = line[0].decode("latin-1").replace(" ", "")
        if not any(code.startswith(commands.code_of(text)) for code in commands.COMMANDS) or not text:
            return False
        if not re.fullmatch(r"[@#$]?[A-Z]?[0-9A-Za-z,+-]*", text) or len(line[0]) >= LINE_LIMIT:
            return False
        return self.knows(text) if len(line) > 1 else None

    def text(self, reply: bytes) -> str:
        return reply.decode("latin-1")

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """Every answer is an acceptance and ends with CR; text needs one."""
        if not reply:
            return not any(32 <= byte < 127 for byte in sent)
        return reply.endswith(CR)

    def reference(self) -> Sequence[bytes]:
        """Z first, so that nothing is in the way of X and Y."""
        return [b"$HZXY" + START]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """`#S`, `#E`, `#R` are stored, `L` with 01h carries out all four; in half steps, the factory's setting."""
        check_ranges(settings, self.ranges)
        end_hz, start_hz = settings.speed_hz, settings.start_stop_hz
        ramp_ms = max(0, -(-(end_hz - start_hz) // settings.acceleration_hz_per_ms))
        ways = (f"{letter}{steps}" for letter, steps in zip(AXIS_LETTERS, integers(target, 3), strict=True))
        stored = (f"#S{start_hz}", f"#E{INDEX},{end_hz}", f"#R{ramp_ms}")
        return [*(self.frame(line) for line in stored), encoded(f"L{INDEX},{','.join(ways)}") + START]

    job_moves = staticmethod(retiming.job_moves)
    retimed = staticmethod(retiming.retimed)
    faster = staticmethod(retiming.faster)

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        """None: without power the interface forgets all of them (ismif/13)."""
        return ()

    def break_off(self) -> bytes:
        """`@B`: the vector is over; nothing else is stored when it comes from `move`."""
        return self.frame("@B")

    def hold(self) -> bytes:
        return self.frame("@A")

    def held(self, reply: bytes) -> bool:
        """The job has not told its end."""
        return READY not in reply

    def go_on(self) -> bytes:
        return self.frame("@C")

    def give_up(self) -> bytes:
        """`@B` forgets the vector and stays in the pause (ismif/10), which `@C` ends."""
        return self.break_off() + self.go_on()

    def written(self, path: Toolpath, axes: MachineAxes, settings: CamSettings) -> Iterator[Written]:
        from isel_twin.firmware.ismif.writing import IsmifCommands

        return written(path, axes, settings, IsmifCommands(axes, settings.outputs))

    def counters(self, sent: bytes, reply: bytes) -> tuple[Mapping[int, int], bytes] | None:
        """Of `@LX`, `@LY`, `@LZ` (6.4): one axis."""
        if (found := _POSITION.search(reply)) is None:
            return None
        rest = reply[: found.start()] + reply[found.end() :]
        return {AXIS_LETTERS.index(found[1].decode()): int(found[2])}, rest

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        pieces = (self._sent if sent else self._received).cut(data)
        return iter([self._command(piece) if sent else _answer(piece) for piece in pieces])

    def rest(self, sent: bool) -> bytes:
        return (self._sent if sent else self._received).rest

    def _command(self, piece: bytes) -> Message:
        line = self._begun + piece.replace(LF, b"")
        text = readable(piece.removesuffix(CR).strip(LF)) or readable(piece)
        if not piece.endswith((CR, START)):
            self._begun = line[:LINE_LIMIT]
            return Message(piece, text, "beginning of a line that is too long", sent=True)
        self._begun = b""
        return Message(piece, text, _line_words(line[:-1], starts=piece.endswith(START)), sent=True)


def _line_words(line: bytes, starts: bool) -> str:
    """A line without its end in words; `starts`: it came with 01h."""
    if not line.strip(b" "):
        return "start the job" if starts else "an empty line, no command"
    try:
        if len(line) >= LINE_LIMIT:
            raise CommandError(f"a line of {LINE_LIMIT} bytes or more")
        words = _command_words(commands.parse(line))
    except CommandError as error:
        words = f"no command: {readable(str(error).encode('latin-1'))}"
    return f"{words}; start the job" if starts else words


def _command_words(command: commands.Instruction) -> str:
    match command.code, command.arguments:
        case "@L", (axis,):
            return f"ask for the position of {AXIS_LETTERS[axis]}"
        case "T", (on,):
            return f"drive signals: {'clock and direction' if on else 'PBL'}"
        case "F", (on,):
            return f"{'full' if on else 'half'} steps"
        case "Z", (mode,):
            return f"Z axis: {'a motor' if mode == 1 else 'the relay of a plotter'}"
        case "#S", (speed_hz,):
            return f"start speed: {speed_hz} Hz"
        case "#E", (index, speed_hz):
            return f"end speed {index}: {speed_hz} Hz"
        case "#R", (ms,):
            return f"ramp length: {ms} ms"
        case "#D", (axis, positive, search, free, offset):
            way = "plus" if positive else "minus"
            return f"reference run of {AXIS_LETTERS[axis]}: towards {way}, end speeds {search}, {free}, {offset}"
        case "#O", (axis, steps):
            return f"offset of {AXIS_LETTERS[axis]} after the reference run: {steps} steps"
        case "$H", (axes,):
            return f"reference run of {', '.join(AXIS_LETTERS[axis] for axis in axes)}"
        case "L", (index, *targets):
            return f"move {', '.join(map(_target, targets))} at end speed {index}"
        case "A", (on,):
            return f"pin 12: {'on' if on else 'off'}"
        case "W", (ms,):
            return f"wait {ms} ms"
    return commands.COMMANDS[command.code].meaning


def _target(target: commands.Target) -> str:
    return f"{AXIS_LETTERS[target.axis]} {'by' if target.relative else 'to'} {target.steps}"


def _answer(piece: bytes) -> Message:
    line = piece.removesuffix(CR)
    return Message(piece, readable(line) or readable(piece), _answer_words(line), sent=False)


def _answer_words(line: bytes) -> str:
    """An answer without its CR in words."""
    if line in ANSWERS:
        return f"reply: {ANSWERS[line]}"
    code, text = line[:2], readable(line[2:])
    if code == b"@X" and len(text) == len(STATUS) and set(text) <= {"0", "1"}:
        words = [words for words, bit in zip(STATUS, text, strict=True) if bit == "1"]
        return f"status: {', '.join(words) or 'ready'}"
    if code == b"@L" and text:
        return f"position {text[0]} {text[1:]}"
    if code == b"@V":
        return f"version: {text.strip()}"
    return "no answer of this interface"
