"""Hosts: what a program at the other end of the line may do, well behaved or not.

A host is a generator. It yields what it wants and is sent what it hears:

    None  = yield Send(data)             the host sends bytes now
    Heard = yield Pass(seconds)          it lets time pass
    Heard = yield Listen(seconds)        it waits until the controller is idle and has answered, at most so long

It sees the twin as its operator would, never changes it, and draws whatever it does. What it can say depends on the
controller: its language (isel_twin.language) says what any host says, its `Dialect` here the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from golden.random_sessions import (
    IMC_FIELDS,
    IMC_MOVES,
    ISMIF_FIELDS,
    ISMIF_MASTER,
    ISMIF_REFERENCE,
    ISMIF_STORED,
    Draw,
    chance,
    fill,
    imc_line,
    imc_program,
    ismif_line,
    pick,
    spoil,
)

from isel_twin.core.twin import Twin
from isel_twin.jobs.verdict import lost
from isel_twin.language import Language, MoveSettings

HOUR_S = 3600.0
"""Limit of what must be done in the end."""
LONGEST_MOVE_S = 3.0
"""About how long moves of a host that keeps to the rules take."""
CLEAR_MM = 1.0
"""A carriage nearer to a switch than this, or beyond it, is brought away from it before a reference run."""
NEAR_MM = 5.0
"""Where it is brought to: near its reference switch."""
FAR_MM = 15.0
"""With physics, one that stands farther away is brought there too: it saves computing."""
MISSED_MM = 0.5
"""Most by which a carriage may miss its target after a reference run, elasticity and errors of the screw included."""
ZERO_MM = 2.0
"""Most by which the zero that a reference run has found may be away from the nominal trip point of the switch."""


@dataclass(frozen=True)
class Send:
    """The host sends bytes."""

    data: bytes


@dataclass(frozen=True)
class Pass:
    """The host lets time pass."""

    seconds: float


@dataclass(frozen=True)
class Listen:
    """The host waits for answers until the controller is idle."""

    seconds: float


@dataclass(frozen=True)
class Heard:
    """What has come since the host last sent something, and whether the controller is idle now."""

    data: bytes
    idle: bool


Host = Generator[Send | Pass | Listen, Heard, None]


class NotDone(Exception):
    """Something was asked that had to be done and was not."""


@dataclass(frozen=True)
class Dialect:
    """What hosts of a family of controllers say beside its language."""

    line: Callable[[Draw], str]
    """Any command, mostly legal."""
    move: Callable[[Draw], str]
    """What an impatient host sends: something that takes time."""
    interruptions: Sequence[bytes]
    """What it interrupts them with."""
    ready: bytes
    """What makes moves possible, wherever the carriages are."""
    reset: bytes
    """What an operator resets the controller with."""
    restore: Sequence[bytes]
    """What brings its settings back to those of the factory; each is answered, and then it is reset again."""
    jog: Callable[[Sequence[int]], Sequence[bytes]]
    """Move by so many steps, X, Y, Z, referenced or not; each is answered."""
    program: Callable[[Draw], Sequence[str]] | None = None
    """Lines that store a program and start it."""


def _imc_jog(steps: Sequence[int]) -> Sequence[bytes]:
    x, y, z = steps
    return (b"@07\r", b"@0N7\r", f"@0A{x},8000,{y},8000,{z},8000,0,30\r".encode())


def _imc_move(draw: Draw) -> str:
    return fill(draw, pick(draw, IMC_MOVES), IMC_FIELDS)


def _ismif_any(draw: Draw) -> str:
    kind = int(draw.integers(8))
    if kind == 0:
        return str(pick(draw, ISMIF_MASTER))
    lines = "\r".join(ismif_line(draw, _ISMIF) for _ in range(int(draw.integers(1, 4))))
    return lines + ("\x01" if kind < 7 else "")


def _ismif_move(draw: Draw) -> str:
    return fill(draw, pick(draw, _ISMIF_MOVES), ISMIF_FIELDS)


def _ismif_jog(steps: Sequence[int]) -> Sequence[bytes]:
    x, y, z = steps
    return (f"#E0,1000\rL0,x{x},y{y},z{z}\x01".encode(),)


_ISMIF_MOVES = ("L1,x{s}\x01", "L1,x{s},y{s},z{s}\rL1,x{s}\x01", "$HZXY\x01", "W250\rL1,y{s}\x01")
_ISMIF = [*ISMIF_STORED, *ISMIF_REFERENCE, "F1"]
_ISMIF_FACTORY = "T0\rF0\rZ1\r#S200\r#R500\r#E2,600\r" + "".join(f"#D{a},0,2,2,2\r#O{a},25\r" for a in "XYZ") + "\x01"

IMC = Dialect(
    line=imc_line,
    move=_imc_move,
    interruptions=(b"\xfd", b"\xfd", b"\xff", b"\xfe", b"@0S\r", b"@0P\r", b"@0?\r", b"@0h\r", b"\xfd@0S\r"),
    ready=b"\xff\r@07\r@0N7\r",
    reset=b"\xfe",
    restore=(b"@0IX\r", b"@0IW\r"),
    jog=_imc_jog,
    program=imc_program,
)
ISMIF = Dialect(
    line=_ismif_any,
    move=_ismif_move,
    interruptions=(b"@B\r", b"@A\r", b"@C\r", b"@S\r", b"@R\r", b"@X\r", b"@LX\r", b"@A\r@C\r"),
    ready=b"\r@R\r",
    reset=b"\r@R\r",
    restore=(_ISMIF_FACTORY.encode(),),
    jog=_ismif_jog,
)


def dialect_of(controller: str) -> Dialect:
    """What hosts of this controller say."""
    return ISMIF if controller == "ismif" else IMC


@dataclass(frozen=True)
class Seat:
    """What a host has before it: its dice, its words, and a view of the machine."""

    draw: Draw
    dialect: Dialect
    language: Language
    twin: Twin
    strict: bool
    """Whatever it asks for must be done."""
    physics: bool

    def line(self) -> bytes:
        """A random line as it is sent."""
        return self.frame(self.dialect.line(self.draw))

    def frame(self, text: str) -> bytes:
        """A line as it is sent; one that carries its own end is left as it is."""
        data = text.encode("latin-1")
        return data if data.endswith(b"\x01") else self.language.frame(text)


Habit = Callable[[Seat], Host]


def habitual(seat: Seat, habits: Sequence[str], times: int) -> Host:
    """A host that goes from one of its habits to another, so many times."""
    for _ in range(times):
        if not seat.strict and chance(seat.draw, 0.3):
            yield Send(seat.dialect.ready)
        yield Pass(_pause_s(seat.draw))
        yield from _HABITS[pick(seat.draw, habits)](seat)


def _pause_s(draw: Draw) -> float:
    """Anything from an instant to a few seconds, short ones as often as long ones."""
    return 0.0 if chance(draw, 0.1) else float(10.0 ** draw.uniform(-7.0, 0.5))


_TESTED_HZ = (400, 900, 2000, 2000)
_ANY_HZ = (400, 1000, 3000, 5000, 10_000, 40_000)


def _legal(seat: Seat) -> Host:
    """References, then moves within the travel, waits for every answer, and now and then breaks a move off."""
    draw, language = seat.draw, seat.language
    for data in language.reference():
        yield from _ask(seat, data, demanded=seat.strict)
    for _ in range(int(draw.integers(1, 6))):
        speed_hz = int(pick(draw, _TESTED_HZ if seat.physics else _ANY_HZ))
        low_hz, high_hz = language.ranges["speed_hz"]
        settings = MoveSettings(min(max(speed_hz, low_hz), high_hz), int(pick(draw, (5, 40, 100))), 250)
        travel_mm = np.array([axis.travel_mm for axis in seat.twin.machine.axes])
        reach = np.minimum(LONGEST_MOVE_S * speed_hz, (travel_mm - CLEAR_MM) / seat.twin.step_mm)
        target = [round(float(x)) for x in draw.uniform(0.0, 1.0, 3) * reach]
        *before, move = language.move(target, settings)
        for data in before:
            yield from _ask(seat, data, demanded=seat.strict)
        if chance(draw, 0.15):
            yield Send(move)
            yield Pass(float(draw.uniform(0.0, 2.0)))
            yield Send(language.break_off())
            yield Listen(HOUR_S)
            continue
        yield from _ask(seat, move, demanded=seat.strict)
        if seat.strict and seat.twin.counts[:3].tolist() != target:
            raise NotDone(f"{move!r} ended at {seat.twin.counts.tolist()}, not at {target}")
        if chance(draw, 0.5):
            yield Pass(_pause_s(draw))


def _orderly(seat: Seat) -> Host:
    """One random command at a time, its answer awaited."""
    for _ in range(int(seat.draw.integers(1, 8))):
        yield Send(seat.line())
        yield Listen(float(seat.draw.uniform(0.1, 5.0)))
        if chance(seat.draw, 0.3):
            yield Pass(_pause_s(seat.draw))


def _illegal(seat: Seat) -> Host:
    """Lines with something wrong about them."""
    for _ in range(int(seat.draw.integers(1, 8))):
        line = seat.dialect.line(seat.draw)
        for _ in range(int(seat.draw.integers(1, 4))):
            line = spoil(seat.draw, line)
        yield Send(seat.frame(line))
        yield Pass(_pause_s(seat.draw))


def _pipelined(seat: Seat) -> Host:
    """Many lines in one write."""
    yield Send(b"".join(seat.line() for _ in range(int(seat.draw.integers(2, 25)))))
    yield Listen(float(seat.draw.uniform(0.1, 8.0)))


def _impatient(seat: Seat) -> Host:
    """Things that take time, interrupted."""
    for _ in range(int(seat.draw.integers(1, 5))):
        yield Send(seat.frame(seat.dialect.move(seat.draw)))
        for _ in range(int(seat.draw.integers(1, 5))):
            yield Pass(_pause_s(seat.draw))
            yield Send(pick(seat.draw, seat.dialect.interruptions))
        yield Pass(_pause_s(seat.draw))


def _torn(seat: Seat) -> Host:
    """Lines in pieces, some of which never come; line ends too many or too few."""
    data = b"".join(seat.line() for _ in range(int(seat.draw.integers(1, 4))))
    cuts = sorted(seat.draw.integers(0, len(data) + 1, int(seat.draw.integers(1, 6))).tolist())
    for first, last in zip([0, *cuts], [*cuts, len(data)], strict=True):
        if chance(seat.draw, 0.1):
            continue
        yield Send(data[first:last] + pick(seat.draw, (b"", b"", b"", b"", b"\n", b"\r", b"\r\n\r\n")))
        yield Pass(_pause_s(seat.draw) / 10.0)


def _raw(seat: Seat) -> Host:
    """Bytes that mean nothing, or what chance will have them mean."""
    length = int(pick(seat.draw, (1, 3, 20, 300)))
    highest = int(pick(seat.draw, (256, 253, 128)))
    yield Send(seat.draw.integers(0, highest, length).astype("u1").tobytes())
    yield Pass(_pause_s(seat.draw))


def _flood(seat: Seat) -> Host:
    """More than the controller can keep, and no look at the answers."""
    line = seat.line()
    yield Send(line * int(pick(seat.draw, (3, 50, 400))))
    yield Pass(_pause_s(seat.draw))


def _program(seat: Seat) -> Host:
    """A stored program, if there are such, with bytes for it while it runs."""
    if seat.dialect.program is None:
        yield from _pipelined(seat)
        return
    yield Send("".join(f"{line}\r" for line in seat.dialect.program(seat.draw)).encode("latin-1"))
    yield Pass(2.2)
    for _ in range(int(seat.draw.integers(1, 6))):
        yield Send(pick(seat.draw, (b"", b"!", b"A", b"B", b"\xfd", b"@0S\r")))
        yield Pass(_pause_s(seat.draw))


_HABITS: Mapping[str, Habit] = {
    "legal": _legal,
    "orderly": _orderly,
    "illegal": _illegal,
    "pipelined": _pipelined,
    "impatient": _impatient,
    "torn": _torn,
    "raw": _raw,
    "flood": _flood,
    "program": _program,
}
HABITS = tuple(_HABITS)


def _ask(seat: Seat, data: bytes, *, demanded: bool) -> Generator[Send | Pass | Listen, Heard, bytes]:
    """Send, listen, and if it is demanded insist on an answer that refuses nothing. Raises NotDone."""
    yield Send(data)
    heard = yield Listen(HOUR_S)
    if demanded and not heard.idle:
        raise NotDone(f"{data!r} has no end: {HOUR_S:g} s after it the controller is not idle")
    if demanded and not seat.language.accepted(data, heard.data):
        raise NotDone(f"{data!r} was refused: {heard.data!r}")
    return heard.data


# ---- once the faults are over ----------------------------------------------------------------------------------------


def recovery(seat: Seat) -> Host:
    """Reset, factory settings, carriages off their switches, reference run, a move. Raises NotDone.

    Whatever happened before, the operator has put everything right by now.
    """
    dialect, language = seat.dialect, seat.language
    yield from _reset(seat)
    for data in dialect.restore:
        yield from _ask(seat, data, demanded=True)
    yield from _reset(seat)
    yield from _off_the_switches(seat)
    for data in language.reference():
        yield from _ask(seat, data, demanded=True)
    if seat.twin.fault:
        raise NotDone("the reference run has left an error in the controller")
    target = [round(NEAR_MM / step_mm) for step_mm in seat.twin.step_mm]
    for data in language.move(target, MoveSettings(1000, 10, 250)):
        yield from _ask(seat, data, demanded=True)
    yield Pass(0.5)
    twin = seat.twin
    if twin.counts[:3].tolist() != target:
        raise NotDone(f"a move to {target} after the reference run ended at {twin.counts.tolist()}")
    if lost(twin.lost_steps, twin.slip_steps).any() or abs(twin.position_error_mm).max() > MISSED_MM:
        raise NotDone(
            f"a move after the reference run misses its target by {twin.position_error_mm.tolist()} mm, "
            f"steps lost: {twin.lost_steps.tolist()}"
        )
    zero_mm = twin.machine_position_mm - twin.position_mm
    if abs(zero_mm).max() > ZERO_MM:
        raise NotDone(f"the reference run has found its zero at {zero_mm.tolist()} mm of the machine")


def _reset(seat: Seat) -> Host:
    yield Send(seat.dialect.reset)
    heard = yield Listen(HOUR_S)
    if not heard.idle:
        raise NotDone("the controller is not idle after a reset")


def _off_the_switches(seat: Seat) -> Host:
    """Carriages on a switch or beyond are jogged to where the operator wants them."""
    twin = seat.twin
    steps = [0, 0, 0]
    for number, axis in enumerate(twin.machine.axes):
        position_mm = float(twin.machine_position_mm[number])
        far_mm = min(FAR_MM, axis.travel_mm - CLEAR_MM) if seat.physics else axis.travel_mm - CLEAR_MM
        if not CLEAR_MM < position_mm < far_mm:
            steps[number] = round((NEAR_MM - position_mm) / axis.step_mm)
    if not any(steps):
        return
    for data in seat.dialect.jog(steps):
        yield from _ask(seat, data, demanded=True)
    yield Pass(0.5)
    for number, way in enumerate(steps):
        if way and not 0.0 < twin.machine_position_mm[number] < 2.0 * NEAR_MM:
            raise NotDone(f"jogged by {steps} steps, the carriages stand at {twin.machine_position_mm.tolist()} mm")


def words(data: bytes) -> str:
    """Bytes for a report, long ones shortened."""
    text = repr(data)
    return text if len(text) < 200 else f"{text[:150]} ... {len(data)} bytes"
