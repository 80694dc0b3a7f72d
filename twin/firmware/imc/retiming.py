"""Change the settings in a job: speeds in the moves, ramps in `@0j` and `@0J` before them.

    @0j300        -->  @0j800                    a line that sets a ramp gets the value of the next move
    @0M0,9000,... -->  @0J900                    other ramps are set before the move
                       @0M0,22000,...            speeds from `rapid_hz` upwards; slower ones are feeds

Ramps hold until the next reset (2.2.15, 2.2.16), so a move with the ramps of the one before gets no extra line. They
are set again after a line with <...>, which may be a reset, and after commands that change defaults (`@0IJ`, `@0Ij`,
`@0IL`, `@0IX`). Lines between `@0i` and `9` are a stored program, whose branches count lines; it stays unchanged and
moves with the ramps in force at its start.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from isel_twin.firmware.imc import commands, grammar, replies
from isel_twin.language import JobMove, MoveSettings

# commands that set a ramp (2.2.15, 2.2.16), and the setting it is
RAMPS: Mapping[str, str] = {"j": "start_stop_hz", "J": "acceleration_hz_per_ms"}
STRAIGHT = frozenset("AM")  # moves with pairs of steps and speed (2.2.2, 2.2.18)
# motions with fixed speed: arcs, helices, until a port, stored programs (2.2.23, 2.2.27, 2.2.28, 2.2.30)
OTHER_MOTIONS = frozenset("ywZS")
OTHER_WAYS = frozenset("ywS")  # which may end where they began
SECOND_Z = slice(6, 7)  # its steps among the values of a move
PAUSES = re.compile(r"(<[^<>]*s>\s*)+")  # lines that send nothing
FORGETTING = frozenset(("IJ", "Ij", "IL", "IX"))  # commands after which other ramps may be in force


@dataclass(frozen=True)
class _Told:
    """The meaning of a line for speeds and ramps."""

    code: str = ""
    head: str = ""  # the text before the parameters: `@0M`
    values: tuple[int, ...] = ()
    forgets: bool = False

    @property
    def moves(self) -> bool:
        return self.code in STRAIGHT or self.code in OTHER_MOTIONS

    @property
    def straight(self) -> bool:
        """Can its way be told from where it ends? Not if Z goes and comes back (2.2.2)."""
        return self.code not in OTHER_WAYS and not (self.code == "A" and any(self.values[SECOND_Z]))


def job_moves(lines: Sequence[str], defaults: Mapping[str, int]) -> list[JobMove]:
    """The motions with ramps; `defaults` are in force at the beginning."""
    in_force = dict(defaults)
    found = []
    for number, told in enumerate(_told(lines)):
        if told.code in RAMPS:
            in_force[RAMPS[told.code]] = told.values[0]
        elif told.moves:
            speeds_hz = told.values[1::2] if told.code in STRAIGHT else ()
            ramps = in_force["acceleration_hz_per_ms"], in_force["start_stop_hz"]
            found.append(JobMove(number, speeds_hz, *ramps, straight=told.straight))
    return found


def retimed(lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int) -> list[list[str]]:
    """The replacement of each line."""
    in_force: dict[str, int] = {}
    made = []
    for number, (line, told) in enumerate(zip(lines, _told(lines), strict=True)):
        own = [line]
        if told.forgets:
            in_force.clear()
        elif told.code in RAMPS:
            following = min((move for move in settings if move > number), default=None)
            value = told.values[0] if following is None else _value(settings[following], told.code)
            in_force[told.code] = value
            own = [f"{told.head}{value}"]
        elif told.moves and number in settings:
            wanted = {code: _value(settings[number], code) for code in RAMPS}
            before = [f"{told.head[:2]}{code}{value}" for code, value in wanted.items() if in_force.get(code) != value]
            in_force.update(wanted)
            own = [*before, _faster(line, told, settings[number].speed_hz, rapid_hz)]
        made.append(own)
    return made


def faster(lines: Sequence[str], factor: float) -> list[str]:
    """The lines with all speeds of straight moves times a factor; a profile refuses those beyond its range."""
    made = []
    for line, told in zip(lines, _told(lines), strict=True):
        if told.code in STRAIGHT:
            scaled = (round(value * factor) for value in told.values[1::2])
            values = [number for pair in zip(told.values[::2], scaled, strict=False) for number in pair]
            line = f"{told.head}{','.join(map(str, values))}"
        made.append(line)
    return made


def _value(settings: MoveSettings, code: str) -> int:
    return int(getattr(settings, RAMPS[code]))


def _faster(line: str, told: _Told, speed_hz: int, rapid_hz: int) -> str:
    if told.code not in STRAIGHT or max(told.values[1::2], default=0) < rapid_hz:
        return line
    values = [speed_hz if at % 2 and value >= rapid_hz else value for at, value in enumerate(told.values)]
    return f"{told.head}{','.join(map(str, values))}"


def _told(lines: Sequence[str]) -> Iterator[_Told]:
    """The meaning of each line; none for lines of a stored program and other text."""
    storing = False
    for line in lines:
        text = line.strip()
        if storing:
            storing = text != "9"
            yield _Told()
        elif PAUSES.fullmatch(text):
            yield _Told()
        else:
            told = _Told(forgets=True) if "<" in text else _read(text)
            storing = told.code == "i"
            yield told


def _read(text: str) -> _Told:
    try:
        parts = grammar.split_dnc(text.encode("latin-1"), int(text[1]), commands.DNC_ALIASES)
        if parts is None:
            return _Told()
        letter, code, parameters = parts
        if code in FORGETTING:
            return _Told(code, forgets=True)
        wanted = code in STRAIGHT or code in RAMPS
        values = tuple(grammar.read_number(field) for field in parameters.split(",")) if wanted else ()
    except (replies.Refusal, ValueError, IndexError):
        return _Told()
    if code in RAMPS and len(values) != 1:
        return _Told()
    return _Told(code, f"{text[:2]}{letter}", values)
