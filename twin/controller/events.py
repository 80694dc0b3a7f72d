"""What a controller says between two calls: events, in their order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Reply:
    """Bytes for the host, sent at the instant of the call that produced them (line speed is the line's business)."""

    data: bytes


# outputs that every controller may use, and their levels at the beginning; see `Output`
OUTPUTS: Mapping[str, int] = {
    **dict.fromkeys(("stages", "power_request", "current_lowering", "brake", "moving", "spindle"), 0),
    "hood_release": 1,
    **dict.fromkeys(("analog", "lamp_start", "lamp_stop", "lamp_fault", "software_ok", "user"), 0),
    **dict.fromkeys(("flash_fault", "drive_reset"), 0),
}


@dataclass(frozen=True)
class Output:
    """A new level of a named output. Names that drives and cabinet understand (others are recorded and shown, no more):

    `stages` (1: motor currents on), `power_request` (rising edge: close the safety relay), `current_lowering` (1: lower
    current at rest), `brake` (1: energised, that is, released), `moving` (1 during a motion: a hood opened then is an
    emergency), `spindle`, `hood_release` (1: the hood may be opened), `analog` (0..255 for 0..10 V), `lamp_start`,
    `lamp_stop`, `lamp_fault`, `software_ok`, `user` (byte of user outputs), `flash_fault` (1: the flash image handed in
    cannot be read), `drive_reset` (rising edge: drives that have switched themselves off forget why).
    """

    name: str
    value: int


@dataclass(frozen=True)
class CounterSet:
    """The controller has set the counter of one axis (0 X, 1 Y ...) without a motion: reference, reset."""

    axis: int
    value: int


@dataclass(frozen=True)
class FlashWrite:
    """The flash now holds this image; whoever keeps it stores it atomically and hands it back at the next power-on."""

    image: bytes


@dataclass(frozen=True)
class Remark:
    """One line for people: why a command failed, where the host gets only a code (core/3). Changes nothing."""

    text: str


@dataclass(frozen=True)
class Step:
    """A program that the controller runs by itself has come to its next step. Changes nothing.

    t_ns: when, now or before; name: for people; text: the step as the program has it; counts: counters at t_ns.
    plane: axes in which it cuts; tool_mm: radius of the tool, 0 if it cuts nothing or nobody knows.
    """

    t_ns: int
    name: str
    text: str
    counts: tuple[int, ...]
    plane: tuple[int, int] = (0, 1)
    tool_mm: float = 0.0


Event = Reply | Output | CounterSet | FlashWrite | Remark | Step
