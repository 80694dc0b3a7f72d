"""Outputs of a controller as data: events, fetched after each call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Reply:
    """Bytes for the host, sent at the instant of the call that produced them (the line adds the time of
    transmission)."""

    data: bytes


# outputs that every controller may use, and their first levels; meaning: `Output`
OUTPUTS: Mapping[str, int] = {
    **dict.fromkeys(("stages", "power_request", "current_lowering", "brake", "moving", "spindle"), 0),
    "hood_release": 1,
    **dict.fromkeys(("analog", "lamp_start", "lamp_stop", "lamp_fault", "software_ok", "user"), 0),
    **dict.fromkeys(("flash_fault", "drive_reset"), 0),
}


@dataclass(frozen=True)
class Output:
    """A new level of a named output. Names with an effect on drives and cabinet (others are only recorded and shown):

    `stages` (1: motor currents on), `power_request` (rising edge: close the safety relay), `current_lowering` (1: lower
    current at rest), `brake` (1: energised, that is, released), `moving` (1 during a motion: a hood opened then is an
    emergency), `spindle`, `hood_release` (1: the hood may be opened), `analog` (0..255 for 0..10 V), `spindle_speed`
    (1/min, positive clockwise, of controls whose spindle drive takes a number in place of a voltage), `lamp_start`,
    `lamp_stop`, `lamp_fault`, `software_ok`, `user` (byte of user outputs), `flash_fault` (1: the flash image handed in
    cannot be read), `drive_reset` (rising edge: clear the faults of drives that have switched themselves off).
    """

    name: str
    value: int


@dataclass(frozen=True)
class CounterSet:
    """The controller has set the counter of one axis (0 X, 1 Y ...) without a motion: reference, reset."""

    axis: int
    value: int


@dataclass(frozen=True)
class ReferenceSearch:
    """The controller begins to seek the reference switch of an axis, or has taken its reference point (`found`). No
    effect on the twin, which sees whether a switch was struck meanwhile (jobs/14)."""

    axis: int
    found: bool = False


@dataclass(frozen=True)
class FlashWrite:
    """The flash now holds this image. The caller stores it atomically and passes it in at the next power-on."""

    image: bytes


@dataclass(frozen=True)
class Remark:
    """One line for people: why a command failed, if the host gets only a code (core/3). No effect on the twin."""

    text: str


@dataclass(frozen=True)
class Step:
    """A program that the controller runs by itself has reached its next step. No effect on the twin.

    t_ns: when, now or before; name: for people; text: the step as the program has it; counts: counters at t_ns.
    plane: axes in which it cuts; tool_mm: radius of the tool, 0 if it does not cut or the radius is unknown.
    """

    t_ns: int
    name: str
    text: str
    counts: tuple[int, ...]
    plane: tuple[int, int] = (0, 1)
    tool_mm: float = 0.0


Event = Reply | Output | CounterSet | ReferenceSearch | FlashWrite | Remark | Step
