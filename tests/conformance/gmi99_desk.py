"""The GMI99 on the test desk: frames as hexadecimal text, what they must be, and closed forms of its moves.

Frames are put together here once more from DIN 19244; PLC programs are assembled by the twin.
"""

from __future__ import annotations

from isel_twin.firmware.plc.assembler import assemble
from isel_twin.testing import Desk, PositionSwitch

OK = "E5"
STATUS = "10 E0 01 E1 16"
READY = "10 E0 00 E0 16"
NOT_READY = "10 E0 40 20 16"
BUSY_MOVING = "10 E0 90 70 16"
BUSY = "10 E0 80 60 16"
ABORT = "10 E0 00 E0 16"

Q = "68 08 08 68 E0 51 07 00 00 00 00 00 38 16"
PRE = (Q, "68 05 05 68 E0 4D 50 C3 00 40 16", "68 05 05 68 E0 66 10 27 00 7D 16")
"""Counters 0 and ready, M 50000 Hz, f 10000 Hz."""
TO_20000 = "68 05 05 68 E0 81 20 4E 00 CF 16"
TO_10000 = "68 05 05 68 E0 81 10 27 00 98 16"
TO_238 = "68 05 05 68 E0 81 EE 00 00 4F 16"
TO_0 = "68 05 05 68 E0 81 00 00 00 61 16"
G91 = "68 05 05 68 E0 47 5B 00 00 82 16"

PLC_STOP = "68 0B 0B 68 E0 70 01 00 00 02 00 00 00 00 00 53 16"
PLC_BEGIN = "68 0B 0B 68 E0 70 01 00 00 64 00 00 00 00 00 B5 16"
PLC_END = "68 0B 0B 68 E0 70 01 00 00 65 00 00 00 00 00 B6 16"
PLC_START = "68 0B 0B 68 E0 70 01 00 00 01 00 00 00 00 00 52 16"
"""Of the PLC: stop it, begin to load it, end that, start it."""

TICK_NS = 4_000_000


def short(command: int, *extension: int, address: int = 0xE0) -> str:
    """A short record, variant E."""
    body = bytes([address, command, *extension])
    return (b"\x10" + body + bytes([sum(body) % 256, 0x16])).hex(" ").upper()


def long(content: bytes, address: int = 0xE0) -> str:
    """A long record, variant E."""
    body = bytes([address]) + content
    return (bytes([0x68, len(body), len(body), 0x68]) + body + bytes([sum(body) % 256, 0x16])).hex(" ").upper()


def command(letter: str | int, *values: int, address: int = 0xE0) -> str:
    """A long record of a command with parameters of 24 bits."""
    code = ord(letter) if isinstance(letter, str) else letter
    numbers = b"".join((value & 0xFFFFFF).to_bytes(3, "little") for value in values)
    return long(bytes([code]) + numbers, address)


class CardDesk(Desk):
    """A desk that speaks in hexadecimal."""

    def tell(self, *frames: str) -> list[str]:
        """Send frames at this instant; the answer of each, in hexadecimal."""
        answers = []
        for frame in frames:
            seen = len(self.replies)
            self.send(bytes.fromhex(frame))
            answers.append(b"".join(data for _, data in self.replies[seen:]).hex(" ").upper())
        return answers

    def ask(self, frame: str) -> str:
        """The answer to one frame, now."""
        return self.tell(frame)[0]

    def status(self) -> int:
        """The information character."""
        return int(self.ask(STATUS).split()[2], 16)

    def set_position(self, axis: int = 0) -> int:
        """T0."""
        answer = bytes.fromhex(self.ask(command("T", 0, axis)))
        assert answer[5:6] == b"@"
        return int.from_bytes(answer[6:9], "little", signed=True)

    def at_ms(self, start_ns: int, ms: float) -> None:
        """Let time pass to so many ms after a time."""
        self.advance_to(start_ns + round(ms * 1e6))


TRAVEL = (395_000, 300_000, 140_000)
"""The 4030 in increments of 1 um."""


def switches() -> list[PositionSwitch]:
    """Both switches of X, Y and Z."""
    return [
        PositionSwitch(f"limit_{'xyz'[axis]}{end}", axis, trip, side)
        for axis, far in enumerate(TRAVEL)
        for end, trip, side in ((1, 0, -1), (2, far, 1))
    ]


def fresh(**settings: object) -> CardDesk:
    """A card that has just been switched on."""
    desk = CardDesk.of("gmi99", settings=settings, carriage=(100_000, 100_000, 50_000), position_switches=switches())
    assert isinstance(desk, CardDesk)
    return desk


def prepared(*frames: str) -> CardDesk:
    """Ready, with M 50000 Hz and f 10000 Hz, and what these frames say."""
    desk = fresh()
    assert desk.tell(*PRE, *frames) == [OK] * (3 + len(frames))
    return desk


def moved_s(desk: CardDesk, *frames: str) -> float:
    """Seconds from now, a time of the grid, until nothing moves any more."""
    assert desk.time_ns % TICK_NS == 0
    start_ns = desk.time_ns
    assert desk.tell(*frames) == [OK] * len(frames)
    desk.finish()
    return (desk.time_ns - start_ns) / 1e9


# ---- the PLC ---------------------------------------------------------------------------------------------------------


def load(desk: CardDesk, *data: str) -> None:
    """Stop, load, start."""
    assert desk.tell(PLC_STOP, PLC_BEGIN, *data, PLC_END, PLC_START) == [OK] * (len(data) + 4)


def assembled(text: str) -> tuple[str, ...]:
    """Telegrams that load a program."""
    image = assemble(text).image
    parts = [image[at : at + 128] for at in range(0, len(image), 128)]
    return tuple(long(b"a" + (128 * n).to_bytes(3, "little") + part) for n, part in enumerate(parts))


def running(text: str) -> CardDesk:
    """A card whose PLC runs this program."""
    desk = prepared()
    load(desk, *assembled(text))
    return desk


def word(desk: CardDesk, byte: int) -> int:
    """A flag word."""
    return int.from_bytes(bytes.fromhex(desk.ask(command("T", 1, 3, byte)))[6:8], "little")
