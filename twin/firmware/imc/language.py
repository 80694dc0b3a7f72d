"""The iMC's language. Implements `isel_twin.language.Language`, `RetimesJobs`, `TellsActs`, `HoldsMotion` and
`WritesToolpaths`.

It explains every command of commands.py and every reply code, and cuts both directions into messages.

    sent      a line up to its CR; 253, 254 and 255 by themselves, also in the middle of a line, which then goes on
    received  one character, except for queries, which determine the length of their answers

                 @0P CR   @0x CR                          queue of lines not answered yet:   @0P   @0x
                             0003E80001F4000000  5        oldest line -> form of the answer -> position, then 5

Replies come in the order of the commands, so a queue gives the command of an answer. The syntax of lines depends on the
axes that are set, the device number, and a data field between `@0i` and `9`. These are tracked twice: `_told` by the
answered lines, to read answers, and `_ahead` by the sent lines, as if all were accepted, to explain commands. Both are
equal whenever no answer is open.

Some bytes are ambiguous: a byte for a stored program that waits for one is taken for the beginning of a line, and a
reply code that a stored program sends for a reply. After a lost answer each answer is assigned to the command before,
until a reset.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath
from isel_twin.cam.writing import written
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.firmware.imc import acts, commands, grammar, replies, retiming
from isel_twin.firmware.imc.profile import Profile, load_profile
from isel_twin.firmware.imc.reading import LF, OK, AnswerForm, ReadingState
from isel_twin.firmware.imc.wording import line_words
from isel_twin.language import (
    Act,
    Example,
    FlashSetting,
    JobMove,
    Message,
    MoveSettings,
    Pieces,
    Ranges,
    check_ranges,
    encoded,
    integers,
    readable,
)

CR = bytes([grammar.CR])

# control bytes (2.2.31) in words
CONTROL: Mapping[int, str] = {
    grammar.STOP: "stop with the ramp; can be resumed",
    grammar.RESET: "reset",
    grammar.BREAK: "break: stop with the ramp and forget the rest",
}

REFERENCE_HZ = 5000  # of the runs of `reference`
LONGEST = 4096  # bytes after which an incomplete message is returned; no line or answer is that long
_STORED = re.compile(rf"[9{''.join((*commands.CNC, *commands.CNC_ALIASES))}][-+0-9., \n]*".encode())
MOST_UNANSWERED = 65_536  # most unanswered lines remembered; then the oldest is dropped


def create(name: str) -> ImcLanguage:
    """Entry point of `isel_twin.languages`; `name` is a profile of profiles.toml."""
    return ImcLanguage(load_profile(name, {}))


class ImcLanguage:
    """Implements `isel_twin.language.Language`."""

    idle = CR + LF

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
        self._profile = profile
        self._pieces = Pieces(ends=CR, alone=bytes(CONTROL), longest=LONGEST)
        self._begun = b""
        self._unanswered: deque[bytes] = deque(maxlen=MOST_UNANSWERED)
        self._told, self._ahead = self._unread(), self._unread()
        self._answer = bytearray()
        self._answered = b""
        self._form = AnswerForm()

    # ---- the host's side --------------------------------------------------------------------------------------------

    def example(self) -> Example:
        return Example.kept(__package__, "square.txt", "4030")

    def frame(self, text: str) -> bytes:
        return encoded(text) + CR

    def knows(self, line: str) -> bool:
        return line[:1] == "@" and line[1:2].isdigit()

    def begins(self, data: bytes) -> bool | None:
        """With a control byte, a line to one of the devices, or one of a program that is being stored: hosts open the
        port anew for each line (bridge/22)."""
        if data[0] in CONTROL:
            return True
        if re.match(rb"@([0-9]|\Z)", data):
            return True if not {*CR, *CONTROL}.isdisjoint(data) else None
        stored = _STORED.match(data)
        rest = data[stored.end() :] if stored else data
        return rest[0] in grammar.ENDS if rest else None

    def text(self, reply: bytes) -> str:
        return reply.decode("latin-1")

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """A refusal is a single printable character other than `0`, or no reply to a line of text. Queries answer with
        several characters; single control bytes need no reply.
        """
        if not reply:
            return not any(32 <= byte < 127 for byte in sent)
        text = self.text(reply).strip("\r\n")
        return len(text) != 1 or text == replies.OK or not text.isprintable()

    def reference(self) -> Sequence[bytes]:
        """Axes X, Y, Z; reference speed; reference run; all axes together from now on, which a reference run ends."""
        return [self.frame(line) for line in _reference_lines(3)]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """`@0j`, `@0J`, `@0M` with the speed for every axis; the fourth pair is ignored (2.2.18)."""
        check_ranges(settings, self.ranges)
        ways = ",".join(f"{steps},{settings.speed_hz}" for steps in integers(target, 3))
        lines = (f"@0j{settings.start_stop_hz}", f"@0J{settings.acceleration_hz_per_ms}", f"@0M{ways},0,30")
        return [self.frame(line) for line in lines]

    def ask_counters(self) -> Sequence[bytes]:
        """Not part of `Language`, for callers that know this language."""
        return [self.frame("@0P")]

    def break_off(self) -> bytes:
        return bytes([grammar.BREAK])

    def hold(self) -> bytes:
        return bytes([grammar.STOP])

    def held(self, reply: bytes) -> bool:
        """The command of a stopped motion is answered (2.2.31)."""
        return self.text(reply).endswith(replies.STOPPED)

    def go_on(self) -> bytes:
        return self.frame("@0S")

    give_up = break_off

    def written(self, path: Toolpath, axes: MachineAxes, settings: CamSettings) -> Iterator[Written]:
        from isel_twin.firmware.imc.writing import ImcCommands  # with the circle of the step streams

        begin = _reference_lines(axes.count)
        return written(path, axes, settings, ImcCommands(self._profile, axes, settings, begin))

    # ---- jobs with other settings: retiming.py ----------------------------------------------------------------------

    def job_moves(self, lines: Sequence[str]) -> Sequence[JobMove]:
        """Straight moves have variable speeds; arcs, helices, moves until a port and programs keep theirs."""
        return retiming.job_moves(lines, self.defaults)

    def retimed(
        self, lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int
    ) -> Sequence[Sequence[str]]:
        return retiming.retimed(lines, settings, rapid_hz)

    def faster(self, lines: Sequence[str], factor: float) -> Sequence[str]:
        return retiming.faster(lines, factor)

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        """`@0IL` first, so that other unsaved values are not stored; then `@0Ij`, `@0IJ`, `@0IW` (4.2.3, 4.2.4,
        4.2.18)."""
        return ["@0IL", f"@0Ij{settings.start_stop_hz}", f"@0IJ{settings.acceleration_hz_per_ms}", "@0IW"]

    # ---- what a session did: acts.py ---------------------------------------------------------------------------------

    def act(self, sent: bytes) -> Act:
        return acts.act(sent)

    def counters(self, sent: bytes, reply: bytes) -> tuple[Mapping[int, int], bytes] | None:
        return acts.counters(sent, reply)

    @property
    def flash_settings(self) -> Mapping[str, FlashSetting]:
        return acts.flash_settings(self._profile)

    def flash_lines(self, values: Mapping[str, int]) -> Sequence[str]:
        return acts.flash_lines(self._profile, values)

    # ---- the line ---------------------------------------------------------------------------------------------------

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        return iter([self._command(piece) for piece in self._pieces.cut(data)] if sent else self._answers(data))

    def rest(self, sent: bool) -> bytes:
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
        """Note that this line needs an answer, and explain it."""
        if not line.strip():
            return "an empty line, no command"
        if len(line) > self._profile.line_bytes:
            line = b""  # of a corrupted line only the answer is known
        words = line_words(line, self._ahead) if line else "a line that is too long"
        self._unanswered.append(line)
        self._ahead.follow(line, accepted=True)
        return words

    def _unread(self) -> ReadingState:
        return ReadingState(self._profile.set_axes_only)

    def _reset(self) -> None:
        """Lines sent before get no answer any more; no axes are set, the device number is 0."""
        self._begun = b""
        self._unanswered.clear()
        self._told, self._ahead = self._unread(), self._unread()

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
        """Find the line of the answer that begins with this byte, and the answer's length."""
        self._form, self._answered = AnswerForm(), b""
        while self._unanswered:
            form = self._told.form(self._unanswered[0])
            if form is None:  # that line was for another device
                self._unanswered.popleft()
            elif chr(byte) in replies.WORDS or form.code_last:
                self._form, self._answered = form, self._unanswered.popleft()
                return
            else:  # a byte of a stored program
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
        if len(data) == 1 and chr(data[0]) in replies.WORDS:
            return f"reply: {replies.WORDS[chr(data[0])]}"
        if self._form.words is None:
            return "a character sent by a stored program"
        if not self._form.whole(data):
            return "an answer that breaks off"
        _, text = self._told.split(self._answered) or ("", "")
        return self._form.words(data.decode("latin-1").removeprefix(replies.OK), text)


def _reference_lines(axes: int) -> list[str]:
    """For X, for X and Y, or for all."""
    mask = (1 << axes) - 1
    speeds = ",".join([str(REFERENCE_HZ)] * axes)
    return [f"@0{mask}", f"@0d{speeds}", f"@0R{mask}", *(["@0z1"] if axes == 3 else [])]
