"""The language of the GMI99: frames as text in the manual's notation, and explanations. Implements
`isel_twin.language.Language`, `RetimesJobs`, `LoadsPlc`, `TellsCounters` and `WritesToolpaths`.

    p3;100;0      a letter and its parameters             68 0B 0B 68 E0 70 03 ... 16
    81h 238       a move: its code, one number an axis    68 05 05 68 E0 81 EE 00 00 4F 16
    a 0 53 35 01  data of a PLC program: offset, bytes in hexadecimal
    #1, #9 50     short records, with their bytes         10 E0 01 E1 16
    5: #1         to the device with address 5: a drive
    f5000 | 81h 9 | 81h 0       several at once: only these join, as lines of a job wait for each other

Replies have the same notation: `E5` received, `#90` an information character, `@-5` an answer to T. Frames are for the
default address 224 and variant E.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath
from isel_twin.cam.writing import written
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.firmware.gmi99 import directly, link, retiming
from isel_twin.firmware.gmi99.commands import COMMANDS, PLC_DATA_BYTES, command_of, parse
from isel_twin.firmware.gmi99.instruction import MOVE_BIT, Instruction, signed
from isel_twin.firmware.gmi99.link import Frame, Receiver
from isel_twin.firmware.gmi99.settings import HIGHEST, LOWEST
from isel_twin.language import (
    SETTINGS_RANGES,
    Example,
    LanguageError,
    Message,
    MoveSettings,
    Ranges,
    check_ranges,
    integers,
)

ADDRESS = link.FIRST_ADDRESS
VARIANT: link.Variant = "E"
BUFFER_FULL = 0x08

# the card's ramps begin at 0: there is no start-stop frequency
RANGES: Ranges = {name: SETTINGS_RANGES[name] for name in ("speed_hz", "acceleration_hz_per_ms")}

_SHORT = re.compile(r"#([0-9A-Fa-f]{1,2})((?:\s+\d{1,5})*)")
_MOVE = re.compile(r"([0-9A-Fa-f]{2})h((?:[\s;]+-?\d+)*)")
_LONG = re.compile(r"([A-Za-z])\s*((?:-?\d+)?(?:\s*[;,]\s*-?\d+)*)")
_DATA = re.compile(r"a\s*(\d+)((?:\s+[0-9A-Fa-f]{2})+)")
_ADDRESSED = re.compile(r"(\d{1,3}):\s*(.+)")

SHORT_WORDS = {0: "break off, normalise", 1: "ask for the status", 8: "spindle speed in rpm", 9: "override in percent"}
# bits of the information character (3.2)
STATUS: Mapping[int, str] = {3: "emergency stop", 4: "moving", 6: "indexer not ready", 7: "busy"}
G_WORDS = {
    0: "rapid",
    2: "circle clockwise: centre and end follow",
    3: "circle counter-clockwise: centre and end follow",
    36: "shortest way for rotary axes",
    90: "absolute coordinates",
    91: "relative coordinates",
    94: "speed in increments per second",
    95: "speed in increments per revolution",
}
P_WORDS = {
    (1, 1): "start the PLC",
    (1, 2): "stop the PLC",
    (1, 100): "begin to load the PLC",
    (1, 101): "end of the PLC's program",
    (3, 1): "start program {}",
    (3, 2): "end of the program",
    (3, 100): "begin to record program {}",
    (3, 101): "end of recording",
}
T_WORDS = {
    0: "ask for the set position of axis {}",
    3: "ask for a status",
    5: "ask for parameter N{}",
    8: "ask for a zero point",
    11: "ask for the counter input",
    12: "ask for the PLC's program",
}
AXIS_WORDS = {0: "wait for the program of axis {0}", 1: "axis {0} runs program {1}", 2: "axis {0} turns with {2} 1/min"}
ANSWERS = {"@": "position", "V": "version", "I": "two bytes", "N": "parameter", "Z": "zero point", "C": "counter"}


def create(name: str) -> Gmi99Language:
    """Entry point of `isel_twin.languages`."""
    return Gmi99Language()


class Gmi99Language:
    ranges = RANGES
    idle = b""

    def __init__(self) -> None:
        self.defaults = retiming.defaults()
        self._receivers = {True: Receiver(VARIANT, from_host=True), False: Receiver(VARIANT, from_host=False)}

    def example(self) -> Example:
        return Example.kept(__package__, "square.txt", "4030-servo")

    def frame(self, text: str) -> bytes:
        """One frame, or several between which | stands."""
        return b"".join(map(self._frame, text.split("|")))

    def knows(self, line: str) -> bool:
        """By the first frame."""
        text = line.partition("|")[0].strip()
        text = text if (match := _ADDRESSED.fullmatch(text)) is None else match[2]
        long = _LONG.fullmatch(text)
        return bool(
            _SHORT.fullmatch(text) or _MOVE.fullmatch(text) or _DATA.fullmatch(text) or (long and long[1] in COMMANDS)
        )

    def _frame(self, text: str) -> bytes:
        line = text.strip()
        address = ADDRESS
        if (match := _ADDRESSED.fullmatch(line)) is not None:
            address, line = int(match[1]), match[2]
            if address > 255:
                raise LanguageError(f"{text!r}: an address is 0 to 255")
        if (match := _SHORT.fullmatch(line)) is not None:
            return _short(text, address, int(match[1], 16), [int(number) for number in match[2].split()])
        if (match := _MOVE.fullmatch(line)) is not None and int(match[1], 16) & MOVE_BIT:
            return _move(text, address, int(match[1], 16), [int(n) for n in re.split(r"[\s;]+", match[2].strip()) if n])
        if (match := _DATA.fullmatch(line)) is not None:
            content = b"a" + _three(text, int(match[1])) + bytes.fromhex(match[2])
            return _checked(text, address, content)
        if (match := _LONG.fullmatch(line)) is not None:
            numbers = [int(number) for number in re.split(r"[;,]", match[2].replace(" ", "")) if number]
            if match[1] not in COMMANDS or match[1] == "a":
                raise LanguageError(f"{text!r}: the card has no command {match[1]}")
            return _checked(text, address, match[1].encode() + b"".join(_three(text, number) for number in numbers))
        raise LanguageError(f"{text!r} is no command of the card; examples: #1, T1;0, 81h 238, p3;100;0")

    def begins(self, data: bytes) -> bool | None:
        """With a frame to a card, of either variant: the switches choose one. The addresses are bytes that no HTTP
        request has where a frame has them: its method may be `h~~h`, and any checksum may stand in a header."""
        variants: tuple[link.Variant, ...] = ("E", "S")
        cut = [Receiver(variant, from_host=True).take(data) for variant in variants]
        firsts = [pieces[0] for pieces in cut if pieces]
        if any(isinstance(first, Frame) and first.address in link.ADDRESSES for first in firsts):
            return True
        return None if not all(cut) else False

    def text(self, reply: bytes) -> str:
        """Frames as text, separated by blanks; other bytes in hexadecimal."""
        receiver = Receiver(VARIANT, from_host=False)
        pieces = [*receiver.take(reply), receiver.rest]
        return " ".join(_reply_text(piece) for piece in pieces if piece)

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """One answer for each frame sent, none of them "buffer full"."""
        receiver = Receiver(VARIANT, from_host=False)
        answers = receiver.take(reply)
        full = any(isinstance(a, Frame) and a.short and a.command == BUFFER_FULL for a in answers)
        frames = [piece for piece in Receiver(VARIANT, from_host=True).take(sent) if isinstance(piece, Frame)]
        return not full and not receiver.rest and (bool(answers) or not frames)

    def reference(self) -> Sequence[bytes]:
        """A reference run of the first three axes, Z first; absolute coordinates."""
        return [self.frame(line) for line in ("Q4;1", "Q3;1", "G90")]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """Top speed, acceleration and speed, then the move of axes 0 to 2."""
        numbers = integers(target, 3)
        if not all(LOWEST <= number <= HIGHEST for number in numbers):
            raise LanguageError(f"the target is {numbers}; the card takes {LOWEST} to {HIGHEST}")
        check_ranges(settings, RANGES)
        speed = settings.speed_hz
        lines = (f"M{speed}", f"B{settings.acceleration_hz_per_ms}", f"f{speed}", "G90")
        return [*(self.frame(line) for line in lines), self.frame("87h " + " ".join(map(str, numbers)))]

    def break_off(self) -> bytes:
        return self.frame("#0")

    job_moves = staticmethod(retiming.job_moves)
    retimed = staticmethod(retiming.retimed)
    faster = staticmethod(retiming.faster)

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        return retiming.permanent(settings)

    def plc_lines(self, image: bytes) -> Sequence[str]:
        """Lines of a job that stop the PLC, load this image and start it."""
        parts = ((at, image[at : at + PLC_DATA_BYTES]) for at in range(0, len(image), PLC_DATA_BYTES))
        return ["p1;2", "p1;100", *(f"a {at} {_hex(part)}" for at, part in parts), "p1;101", "p1;1"]

    def written(self, path: Toolpath, axes: MachineAxes, settings: CamSettings) -> Iterator[Written]:
        from isel_twin.firmware.gmi99.writing import Gmi99Commands

        return written(path, axes, settings, Gmi99Commands(axes, settings.outputs, settings.rapid_mm_s))

    def counters(self, sent: bytes, reply: bytes) -> tuple[Mapping[int, int], bytes] | None:
        """Of `T0;axis`: one axis, and the other frames of the reply."""
        asked = Receiver(VARIANT, from_host=True).take(sent)
        frame = asked[0] if len(asked) == 1 else b""
        instruction = None if isinstance(frame, bytes) else parse(frame.command, frame.content)
        if instruction is None or instruction.code != ord("T") or instruction.values[0] != 0:
            return None
        answers = Receiver(VARIANT, from_host=False).take(reply)
        told = [one for one in answers if isinstance(one, Frame) and not one.short and one.command == ord("@")]
        if len(told) != 1 or not told[0].content:
            return None
        rest = b"".join(one if isinstance(one, bytes) else one.data for one in answers if one is not told[0])
        return {instruction.values[1]: int.from_bytes(told[0].content, "little", signed=True)}, rest

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        pieces = self._receivers[sent].take(data)
        return iter([_command(piece) if sent else _answer(piece) for piece in pieces])

    def rest(self, sent: bool) -> bytes:
        """The incomplete frame."""
        return self._receivers[sent].rest


def _short(text: str, address: int, command: int, numbers: list[int]) -> bytes:
    size = link.SHORT_COMMANDS.get(command)
    if size is None or len(numbers) != (1 if size else 0):
        raise LanguageError(f"{text!r}: short records are #0, #1, #8 and a speed, #9 and a percentage")
    if numbers and numbers[0] >= 1 << 8 * size:
        raise LanguageError(f"{text!r}: {numbers[0]} has no room in {size} bytes")
    extension = numbers[0].to_bytes(size, "little") if numbers else b""
    return link.short_record(VARIANT, address, command, extension)


def _move(text: str, address: int, code: int, numbers: list[int]) -> bytes:
    count = (code & 0x3F).bit_count()
    if len(numbers) != count:
        raise LanguageError(f"{text!r}: {code:02X}h moves {count} axes and wants as many numbers")
    return _checked(text, address, bytes([code]) + b"".join(_three(text, number) for number in numbers))


def _checked(text: str, address: int, content: bytes) -> bytes:
    if parse(content[0], content[1:]) is None:
        raise LanguageError(f"{text!r}: the card takes at most three parameters, or 1 to 128 bytes behind a")
    return link.long_record(VARIANT, address, content, from_card=False)


def _three(text: str, number: int) -> bytes:
    if not -(1 << 23) <= number < 1 << 24:
        raise LanguageError(f"{text!r}: {number} has no room in 24 bits")
    return (number & 0xFFFFFF).to_bytes(3, "little")


# ---- frames in words -------------------------------------------------------------------------------------------------


def _hex(data: bytes) -> str:
    return data.hex(" ").upper()


def _to(frame: Frame) -> str:
    return "" if frame.address == ADDRESS else f"{frame.address}: "


def _command(piece: Frame | bytes) -> Message:
    if isinstance(piece, bytes):
        return Message(piece, _hex(piece), "no frame", sent=True)
    device = f"drive {piece.address}: " if piece.address < 64 else "" if piece.address == ADDRESS else "other card: "
    if piece.short:
        value = int.from_bytes(piece.content, "little")
        text = f"#{piece.command:X}" + (f" {value}" if piece.content else "")
        words = SHORT_WORDS[piece.command] + (f": {value}" if piece.content else "")
        return Message(piece.data, _to(piece) + text, device + words, sent=True)
    instruction = parse(piece.command, piece.content)
    if instruction is None:
        return Message(piece.data, _hex(piece.data), f"{device}no command", sent=True)
    return Message(piece.data, _to(piece) + _text(instruction, len(piece.content)), device + _words(instruction), True)


def _text(instruction: Instruction, size: int) -> str:
    if instruction.code & MOVE_BIT:
        return " ".join([f"{instruction.code:02X}h", *map(str, instruction.values)])
    letter = chr(instruction.code)
    if letter == "a":
        return f"a {instruction.p1} {_hex(instruction.raw)}"
    return letter + ";".join(str(signed(value)) for value in instruction.values[: size // 3])


def _words(instruction: Instruction) -> str:
    letter, (p1, p2, p3) = chr(instruction.code), (*instruction.values, 0, 0, 0)[:3]
    if instruction.is_move:
        to = ", ".join(f"{axis} {n}" for axis, n in zip(instruction.axes, instruction.values, strict=False))
        return f"move axes: {to}" if to else "move no axis"
    low = p1 & 0xFF
    match letter:
        case "B" | "M" | "R" | "f":
            return f"{command_of(instruction).words}: {p1} {'Hz/ms' if letter == 'B' else 'Hz'}" + _of_axis(p2)
        case "G" if p1 in G_WORDS:
            return G_WORDS[p1]
        case "G" if 53 <= low <= 59:
            return f"{'enter' if p3 else 'select'} zero point or correction G{low}"
        case "N":
            return f"parameter N{p2}: {signed(p1)}"
        case "O":
            return f"position counter of axis {p2}: {signed(p1)}"
        case "Q":
            axes = ", ".join(str(axis) for axis in range(6) if p1 >> axis & 1)
            return f"{'reference run' if p2 else 'counters to 0'}: axes {axes}"
        case "T" if p1 in T_WORDS:
            return T_WORDS[p1].format(p2)
        case "T":
            return "ask for the version" if (p1, p2) == (1, 0) else "ask for two bytes of an image"
        case "W":
            return f"tool speed control {'on' if p1 else 'off'}" + _of_axis(p3)
        case "m":
            return f"M function M{p1}" if p1 < 100 else "spindle speed" if p1 == 100 else "tool change"
        case "p" if (p1, p2) in P_WORDS:
            return P_WORDS[p1, p2].format(p3)
        case "p" if p1 == 4 and p3 & 0xFF in AXIS_WORDS:
            return AXIS_WORDS[p3 & 0xFF].format(p3 >> 8, p2, signed(p2))
        case "p" if p1 == 10 and p2 in directly.WORDS:
            return f"{directly.WORDS[p2]}: {p3}"
        case "p" if p1 == 11:
            return f"flag byte MB{p2}: {p3}"
        case "s":
            return "save the settings"
    return command_of(instruction).words


def _of_axis(slot: int) -> str:
    return f", axis {slot - 1}" if slot else ""


def _reply_text(piece: Frame | bytes) -> str:
    if isinstance(piece, bytes):
        return _hex(piece)
    if piece.short:
        text = f"#{piece.command:02X}" + (f" {_hex(piece.content)}" if piece.content else "")
    elif not piece.content:
        text = f"{piece.command:02X}h"
    elif chr(piece.command) in ("I", "x", "e"):
        text = f"{chr(piece.command)} {_hex(piece.content)}"
    else:
        number = int.from_bytes(piece.content, "little", signed=chr(piece.command) != "V")
        text = f"{chr(piece.command)}{number}" if 32 < piece.command < 127 else _hex(piece.data)
    return _to(piece) + text


def _answer(piece: Frame | bytes) -> Message:
    text = _reply_text(piece)
    if isinstance(piece, bytes):
        return Message(piece, text, "reply: received" if piece == link.ACKNOWLEDGED else "no frame", sent=False)
    if piece.short:
        if piece.command == BUFFER_FULL:
            return Message(piece.data, text, "reply: buffer full, send it again", sent=False)
        words = [words for bit, words in STATUS.items() if piece.command >> bit & 1]
        words += [f"message {piece.content[0]}"] if piece.content else []
        return Message(piece.data, text, f"status: {', '.join(words) or 'ready'}", sent=False)
    return Message(piece.data, text, ANSWERS.get(chr(piece.command), "status or code"), sent=False)
