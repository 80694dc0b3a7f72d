"""The iMC's language: what its bytes mean to people and tools. Implements `isel_twin.language.Language`, `RetimesJobs`.

Goal: every command of the tables in commands.py and every reply code in words, and both directions cut into messages.

    sent      a line up to its CR; 253, 254 and 255 by themselves, also in the middle of a line, which then goes on
    received  one character, but for the queries: how long an answer is follows from the query

                 @0P CR   @0x CR                          queue of lines not answered yet:   @0P   @0x
                             0003E80001F4000000  5        oldest line -> form of the answer -> position, then 5

Replies come in the order of the commands, so a queue tells which of them an answer belongs to. A few things change how
lines are read: the axes that are set, the device number, and a data field between `@0i` and `9`. They are followed
twice: `_told` by what has been answered, which decides about answers, and `_ahead` by what has been sent, as if all of
it were accepted, which explains commands. Both are the same whenever nothing is left to be answered.

What is not known from the bytes alone: a byte for a stored program that waits for one is taken for the beginning of a
line, and a character that a stored program sends for a reply code, if it is one. An answer that is lost on the way
leaves its command to the answer after it, until a reset.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from isel_twin.firmware.imc import commands, grammar, moves, replies, retiming
from isel_twin.firmware.imc.profile import Profile, load_profile
from isel_twin.firmware.imc.query import AXIS_NAMES, END
from isel_twin.language import JobMove, Message, MoveSettings, Pieces, Ranges, encoded, integers, readable

CR, LF = bytes([grammar.CR]), bytes([grammar.LF])
OK = replies.OK.encode()

CODES: Mapping[str, str] = {
    replies.OK: "done",
    replies.BAD_NUMBER: "not a number, or out of range",
    replies.LIMIT_SWITCH: "limit switch struck, or none found",
    replies.BAD_AXES: "axes that are not set, or may not be named together",
    replies.NO_AXES: "axes have not been set",
    replies.SYNTAX: "no such command",
    replies.MEMORY_FULL: "program memory full",
    replies.PARAMETER_COUNT: "wrong number of parameters",
    replies.NOT_STORABLE: "cannot be stored",
    replies.FAULT: "safety chain open, or not initialised since",
    replies.BAD_SPEED: "speed out of range",
    replies.STOPPED: "stopped or broken off",
    replies.INVALID_FIELD: "nothing to start, or program memory not empty",
    replies.HOOD_OPEN: "hood open in automatic",
    replies.NOT_REFERENCED: "not referenced",
}
"""Reply codes (section 5) in words."""

CONTROL: Mapping[int, str] = {
    grammar.STOP: "stop with the ramp; can be resumed",
    grammar.RESET: "reset",
    grammar.BREAK: "break: stop with the ramp and forget the rest",
}
"""Control bytes (2.2.31) in words."""

FLOW: Mapping[str, str] = {"i": "store a program: the lines that follow", "S": "go on, or start the stored program"}
"""`@0i` (2.2.13) and `@0S` (2.2.23), which concern the flow of commands and stand in no table."""
END_OF_FIELD = "9"
"""Ends the data field (3.2.9)."""

LONGEST = 4096
"""Bytes after which a message is given out as it stands; no line and no answer has so many."""
MOST_UNANSWERED = 65_536
"""Lines that are remembered; the oldest is forgotten if nobody answers."""


def create(name: str) -> ImcLanguage:
    """Entry point of `isel_twin.languages`; `name` is a profile of profiles.toml."""
    return ImcLanguage(load_profile(name, {}))


class ImcLanguage:
    """Implements `isel_twin.language.Language`."""

    def __init__(self, profile: Profile) -> None:
        self.ranges: Ranges = {
            "speed_hz": (profile.min_speed_hz, profile.max_speed_hz),
            "acceleration_hz_per_ms": (commands.ACCELERATION.low, commands.ACCELERATION.high),
            "start_stop_hz": (commands.START_STOP_HZ.low, commands.START_STOP_HZ.high),
        }
        self.defaults: Mapping[str, int] = {
            "acceleration_hz_per_ms": profile.acceleration_hz_per_ms,
            "start_stop_hz": profile.start_stop_hz,
        }
        self._line_bytes = profile.line_bytes
        self._pieces = Pieces(ends=CR, alone=bytes(CONTROL), longest=LONGEST)
        self._begun = b""
        self._unanswered: deque[bytes] = deque(maxlen=MOST_UNANSWERED)
        self._told, self._ahead = _Mode(), _Mode()
        self._answer = bytearray()
        self._answered = b""
        self._form = _Form()

    # ---- what a host says -------------------------------------------------------------------------------------------

    def frame(self, text: str) -> bytes:
        """The text and CR."""
        return encoded(text) + CR

    def text(self, reply: bytes) -> str:
        """One character a byte."""
        return reply.decode("latin-1")

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """A refusal is a single printable character other than `0`, or no reply to a line of text.

        Queries answer with several characters; control bytes by themselves demand nothing.
        """
        if not reply:
            return not any(32 <= byte < 127 for byte in sent)
        text = self.text(reply).strip("\r\n")
        return len(text) != 1 or text == replies.OK or not text.isprintable()

    def reference(self) -> Sequence[bytes]:
        """Axes X, Y, Z; reference speed; reference run; all axes together from now on, which a reference run ends."""
        return [self.frame(line) for line in ("@07", "@0d5000,5000,5000", "@0R7", "@0z1")]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """`@0j`, `@0J`, `@0M` with the speed at every axis; the fourth pair counts for nothing (2.2.18)."""
        ways = ",".join(f"{steps},{settings.speed_hz}" for steps in integers(target, 3))
        lines = (f"@0j{settings.start_stop_hz}", f"@0J{settings.acceleration_hz_per_ms}", f"@0M{ways},0,30")
        return [self.frame(line) for line in lines]

    def ask_counters(self) -> Sequence[bytes]:
        """What a host sends to be told the counters; beyond the protocol of languages, for who asks for it by name."""
        return [self.frame("@0P")]

    def break_off(self) -> bytes:
        """Byte 255."""
        return bytes([grammar.BREAK])

    # ---- jobs with other settings -----------------------------------------------------------------------------------

    def job_moves(self, lines: Sequence[str]) -> Sequence[JobMove]:
        """Straight moves, whose speeds can be others; arcs, helices, moves until a port and programs keep theirs."""
        return retiming.job_moves(lines, self.defaults)

    def retimed(
        self, lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int
    ) -> Sequence[Sequence[str]]:
        """`@0j` and `@0J` where they stand or before the moves, speeds in the moves; see retiming.py."""
        return retiming.retimed(lines, settings, rapid_hz)

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        """`@0IL`, so that nothing else is stored that was only tried; `@0Ij`, `@0IJ`, `@0IW` (4.2.3, 4.2.4, 4.2.18)."""
        return ["@0IL", f"@0Ij{settings.start_stop_hz}", f"@0IJ{settings.acceleration_hz_per_ms}", "@0IW"]

    # ---- what goes over the line ------------------------------------------------------------------------------------

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        """Lines and control bytes one way, answers the other; see the module."""
        return iter([self._command(piece) for piece in self._pieces.cut(data)] if sent else self._answers(data))

    def rest(self, sent: bool) -> bytes:
        """What has been begun and not ended."""
        return self._pieces.rest if sent else bytes(self._answer)

    def _command(self, piece: bytes) -> Message:
        if piece[0] in CONTROL:
            if piece[0] == grammar.RESET:
                self._reset()
            return Message(piece, readable(piece), CONTROL[piece[0]], sent=True)
        line = self._begun + piece.replace(LF, b"")
        text = readable(piece.strip(CR + LF)) or readable(piece)
        if not piece.endswith(CR):
            self._begun = line[:LONGEST]
            return Message(piece, text, "beginning of a line", sent=True)
        self._begun = b""
        return Message(piece, text, self._line(line.removesuffix(CR)), sent=True)

    def _line(self, line: bytes) -> str:
        """A line begun and ended: remember that it wants an answer, and say what it means."""
        if not line.strip():
            return "an empty line, no command"
        if len(line) > self._line_bytes:
            line = b""  # nothing is left of it but that it is answered
        words = _line_words(line, self._ahead) if line else "a line that is too long"
        self._unanswered.append(line)
        self._ahead.follow(line, accepted=True)
        return words

    def _reset(self) -> None:
        """What was sent before is not answered any more; the axes are not set, the number is 0."""
        self._begun = b""
        self._unanswered.clear()
        self._told, self._ahead = _Mode(), _Mode()

    def _answers(self, data: bytes) -> list[Message]:
        messages = []
        for byte in data:
            if self._answer and not self._form.fits(byte):
                messages.append(self._answer_ended())
            if not self._answer:
                self._begin_answer(byte)
            self._answer.append(byte)
            if self._form.whole(self._answer) or len(self._answer) >= LONGEST:
                messages.append(self._answer_ended())
        return messages

    def _begin_answer(self, byte: int) -> None:
        """Find out what the answer that begins with this byte is to, and how long it is."""
        self._form, self._answered = _Form(), b""
        while self._unanswered:
            form = self._told.form(self._unanswered[0])
            if form is None:  # that line was for another device
                self._unanswered.popleft()
            elif chr(byte) in CODES or form.code_last:
                self._form, self._answered = form, self._unanswered.popleft()
                return
            else:  # a stored program speaks
                return

    def _answer_ended(self) -> Message:
        data = bytes(self._answer)
        words = self._answer_words(data)
        if self._answered:
            self._told.follow(self._answered, accepted=data.startswith(OK))
        if not self._unanswered:
            self._ahead = replace(self._told)
        self._answer.clear()
        self._answered = b""
        return Message(data, readable(data), words, sent=False)

    def _answer_words(self, data: bytes) -> str:
        if len(data) == 1 and chr(data[0]) in CODES:
            return f"reply: {CODES[chr(data[0])]}"
        if self._form.words is None:
            return "a character sent by a stored program"
        if not self._form.whole(data):
            return "an answer that breaks off"
        _, text = self._told.split(self._answered) or ("", "")
        return self._form.words(data.decode("latin-1").removeprefix(replies.OK), text)


# ---- how lines are read and answered ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Form:
    """How long an answer is: the code and so many hexadecimal digits or lines; or lines and, `code_last`, the code."""

    digits: int = 0
    lines: int = 0
    code_last: bool = False
    words: Callable[[str, str], str] | None = None
    """What an answer (without a code before it) to a query with these parameters means; None: it is only a code."""

    def whole(self, answer: bytes | bytearray) -> bool:
        """Nothing more belongs to this answer."""
        if self.code_last:
            last = answer.rpartition(LF)[2]
            return len(last) == 1 and chr(last[0]) in CODES
        if not answer.startswith(OK):
            return True
        return len(answer) > self.digits and answer.count(LF) >= self.lines

    def fits(self, byte: int) -> bool:
        """The byte may be the next one of an answer begun."""
        return not self.digits or chr(byte) in "0123456789ABCDEF"


@dataclass
class _Mode:
    """What changes how lines are read: axes set (a mask, 0: not known), device number, data field begun."""

    axes: int = 0
    number: int = 0
    storing: bool = False

    def split(self, line: bytes) -> tuple[str, str] | None:
        """Code and parameters of a DNC line, ("", "") if it is none; None: for another device."""
        try:
            parts = grammar.split_dnc(line, self.number, commands.DNC_ALIASES)
        except replies.Refusal:
            return "", ""
        return None if parts is None else parts[1:]

    def form(self, line: bytes) -> _Form | None:
        """How the line is answered; None: not at all."""
        if self.storing:
            return _Form()
        parts = self.split(line)
        if parts is None:
            return None
        if parts[0] == "P":
            return _Form(digits=6 * (4 if self.axes & 8 else 3), words=_position_words)
        return QUERIES.get(parts[0], _Form())

    def follow(self, line: bytes, *, accepted: bool) -> None:
        """The line has been answered, or will be."""
        if self.storing:
            self.storing = accepted and _stored(line)[0] != END_OF_FIELD
            return
        code, text = self.split(line) or ("", "")
        match code, _numbers(text):
            case _ if not accepted:
                return
            case commands.AXES_CODE, [1 | 3 | 7 as mask]:
                self.axes = mask
            case commands.AXES_CODE, [8]:
                self.axes |= 8
            case "G", [number]:
                self.number = number
            case "i", []:
                self.storing = True


def _stored(line: bytes) -> tuple[str, str]:
    return grammar.split_cnc(line, commands.CNC_ALIASES)


def _numbers(text: str) -> list[int] | None:
    """The numbers of a command; None if they are none."""
    try:
        return [grammar.read_number(field) for field in text.split(",")] if text.strip(" ") else []
    except replies.Refusal:
        return None


# ---- commands in words -----------------------------------------------------------------------------------------------

Details = Callable[[Sequence[int], int], str | None]
"""(parameters, axes set) -> what they say, to stand after the command's purpose; None: not so many are expected."""


def _line_words(line: bytes, mode: _Mode) -> str:
    """A line in words."""
    if mode.storing and not line.lstrip().startswith(b"@"):
        code, text = _stored(line)
        if code == END_OF_FIELD:
            return "end of the program"
        command = commands.CNC.get(code)
        if command is None:
            return "cannot be stored"
        return f"to store: {command.purpose}{_parameters(CNC_DETAILS.get(code), text, mode.axes)}"
    parts = mode.split(line)
    if parts is None:
        return "for another device"
    code, text = parts
    if code in FLOW:
        return FLOW[code]
    command = commands.DNC.get(code) or commands.INITIALISATION.get(code)
    if command is None:
        return "no such command"
    if command.parameters is None:
        return f"{command.purpose}: {_plain(text) or 'nothing'}"
    return f"{command.purpose}{_parameters(DNC_DETAILS.get(code), text, mode.axes)}"


def _parameters(details: Details | None, text: str, axes: int) -> str:
    """The parameters in words if they are as expected, as they are if not."""
    values = _numbers(text)
    if values == []:
        return ""
    words = details(values, axes) if details is not None and values is not None else None
    return words if words is not None else f": {_plain(text)}"


def _plain(text: str) -> str:
    return readable(text.strip(" ").encode("latin-1"))


def _one(words: Callable[[int], str]) -> Details:
    return lambda values, axes: f": {words(values[0])}" if len(values) == 1 else None


def _choice(*names: str, first: int = 0) -> Details:
    """One of so many names, the first for the number `first`."""
    return _one(lambda value: names[value - first] if 0 <= value - first < len(names) else str(value))


def _letters(mask: int) -> str:
    """Axes of a mask."""
    return " ".join(name for axis, name in enumerate(AXIS_NAMES) if mask >> axis & 1) or "none"


def _names(axes: int, count: int) -> list[str]:
    """Names of the axes that `count` numbers are for: those set, or if that is not known, the first ones."""
    return _letters(axes).split() if axes else list(AXIS_NAMES[:count])


def _each(unit: str) -> Details:
    """A number for each axis that is set."""

    def words(values: Sequence[int], axes: int) -> str | None:
        names = _names(axes, len(values))
        if len(values) != len(names):
            return None
        return ": " + ", ".join(f"{name} {value}{unit}" for name, value in zip(names, values, strict=True))

    return words


def _four(unit: str) -> Details:
    """A number for each of the four axes, set or not."""
    return lambda values, axes: _each(unit)(values, 15)


def _ways(preposition: str, fourth: str | None) -> Details:
    """Pairs of steps and speed. With X, Y, Z there are four: the fourth is the second way of Z, or nothing (2.2.2)."""

    def words(values: Sequence[int], axes: int) -> str | None:
        pairs = list(zip(values[0::2], values[1::2], strict=False))
        names = _names(axes, len(pairs))
        if len(pairs) == 4 and axes in (0, moves.XYZ):
            names = [*AXIS_NAMES[:3], *([fourth] if fourth else [])]
            pairs = pairs[: len(names)]
        if len(pairs) != len(names) or len(values) % 2:
            return None
        ways = (f"{name} {steps} at {speed} Hz" for name, (steps, speed) in zip(names, pairs, strict=True))
        return f" {preposition} {', '.join(ways)}"

    return words


def _arc(values: Sequence[int], axes: int) -> str | None:
    if len(values) not in (7, 8):
        return None
    length, speed, d, xs, ys, rx, ry = values[:7]
    third = f", {values[7]} steps of the third axis" if len(values) == 8 else ""
    return f" of {length} steps at {speed} Hz, D {d}, start {xs} {ys}, directions {rx} {ry}{third}"


def _until_port(values: Sequence[int], axes: int) -> str | None:
    if len(values) < 5:
        return None
    port, mask, value, speed, *steps = values
    ways = _each("")(steps, axes)
    return ways and f", port {port} with mask {mask} at {value}, at {speed} Hz{ways}"


def _watch(values: Sequence[int], axes: int) -> str | None:
    return ": port {}, mask {}, value {}".format(*values) if len(values) == 3 else None


def _bit(values: Sequence[int], axes: int) -> str | None:
    """Port, bit or 128 for all of them, value, and for a branch where to."""
    if len(values) not in (3, 4):
        return None
    port, bit, value = values[:3]
    where = f", then {values[3]:+d} commands" if len(values) == 4 else ""
    return f": port {port}, {'all bits' if bit == 128 else f'bit {bit}'} at {value}{where}"


def _loop(values: Sequence[int], axes: int) -> str | None:
    if len(values) != 2:
        return None
    count, offset = values
    return f": {offset:+d} commands, {count} times" if count else f": {offset:+d} commands"


def _await(values: Sequence[int], axes: int) -> str | None:
    return f": {_character(values[0])}, then {values[1]:+d} commands" if len(values) == 2 else None


def _character(code: int) -> str:
    return repr(chr(code)) if 32 <= code < 127 else str(code)


_axes, _hz, _ramp = _one(_letters), _one(lambda value: f"{value} Hz"), _one(lambda value: f"{value} Hz/ms")
_switch, _plane = _choice("off", "on"), _choice("XY", "XZ", "YZ")
_turn = _choice("counter-clockwise", "clockwise", first=-1)
_number = _one(str)

DNC_DETAILS: Mapping[str, Details] = {
    commands.AXES_CODE: _axes,
    "A": _ways("by", "then Z"),
    "b": _number,
    "B": lambda values, axes: ": port {}, value {}".format(*values) if len(values) == 2 else None,
    "d": _each(" Hz"),
    "e": _plane,
    "f": _turn,
    "F": _axes,
    "g": _switch,
    "G": _number,
    "j": _hz,
    "J": _ramp,
    "M": _ways("to", None),
    "n": _axes,
    "N": _axes,
    "R": _axes,
    "T": _switch,
    "w": _arc,
    "y": _arc,
    "z": _switch,
    "Z": _until_port,
    "Id": _four(" Hz"),
    "IF": _four(""),
    "IJ": _ramp,
    "Ij": _hz,
    "IO": _switch,
    "IE": _number,
    "Ie": _axes,
    "ID": _axes,
    "IR": _axes,
    "IT": _axes,
    "IA": _watch,
    "Ia": _watch,
    "IH": _watch,
    "IN": _watch,
    "IC": _switch,
}
"""Parameters of DNC and initialisation commands in words; those that have none are left out."""

CNC_DETAILS: Mapping[str, Details] = {
    **{code: DNC_DETAILS[code] for code in "efgjJnNTwyz"},
    "0": _ways("by", "then Z"),
    "1": _one(_character),
    "2": _await,
    "3": _loop,
    "5": _one(lambda tenths: f"{tenths / 10:g} s"),
    "6": _bit,
    "7": _axes,
    "d": _four(" Hz"),
    "m": _ways("to", None),
    "o": _bit,
    "p": _bit,
}
"""Parameters of storable commands in words."""


# ---- answers in words ------------------------------------------------------------------------------------------------


def _position_words(answer: str, text: str) -> str:
    """24 bits an axis, two's complement (2.2.21)."""
    counts = [(int(answer[at : at + 6], 16) ^ 1 << 23) - (1 << 23) for at in range(0, len(answer), 6)]
    return "position " + " ".join(f"{name} {count}" for name, count in zip(AXIS_NAMES, counts, strict=False))


def _byte_words(about: str) -> Callable[[str, str], str]:
    """Two hexadecimal digits."""
    return lambda answer, text: f"{about} {_plain(text)}: {int(answer, 16)} (bits {int(answer, 16):08b})"


def _lines_words(about: str) -> Callable[[str, str], str]:
    """The lines of the answer, without the code after them."""

    def words(answer: str, text: str) -> str:
        return f"{about}: {', '.join(_plain(line) for line in answer.split(END)[:-1])}"

    return words


QUERIES: Mapping[str, _Form] = {
    "b": _Form(digits=2, words=_byte_words("port")),
    "D": _Form(digits=2, words=_byte_words("diagnosis")),
    "h": _Form(code_last=True, words=_lines_words("limit switches, 1 struck")),
    "H": _Form(code_last=True, words=_lines_words("state")),
    "U": _Form(lines=1, words=_lines_words("answer")),
    "V": _Form(lines=2, words=_lines_words("version")),
}
"""Queries that answer with more than a code, by their own code; `@0P` needs to know the axes: `_Mode.form`."""
