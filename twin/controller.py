"""What a controller is: the border between a firmware and everything around it.

A controller is sans-I/O. It is told what happens and when (bytes from the host, input levels, the passing of time) and
says what it does (reply bytes, output levels, counter settings, flash images) and which steps it is making. It never
reads a clock, a socket or a file, and nothing above or below it knows which controller it is.

Protocol of time
----------------
Times are integer nanoseconds of virtual time and never run backwards. Whoever drives a controller must

1. call `power_on(t, levels)` once, then any of `receive`, `set_input` and `advance` with t that never decrease;
2. never let time pass `next_ns` without calling `advance(next_ns)`: that is where the controller acts by itself
   (end of a motion, end of a delay, next step of a reference run);
3. after each call fetch `take()`: the events of that instant, in their order.

Between two calls the controller makes the pulses of `run` (see `isel_twin.motion.Run`), all those with a time <= t
once it has been called with t. An input edge at t therefore meets a controller that has made exactly the pulses up to
and including t: a limit switch ends the stream there, and no rollback is needed.

        t0            edge at t1          next_ns
        |--- pulses of run ---|- - - cancelled - - -|
        advance(t0)   set_input(t1, ...)

Third parties add a controller by an entry point in the group `isel_twin.controllers`; see docs/controllers.md.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from isel_twin.motion import Run

AXES = 4
"""Number of axes of a step stream: X, Y, Z, A."""

NANOSECOND = 1_000_000_000
"""Nanoseconds in a second."""


@dataclass(frozen=True)
class Reply:
    """Bytes for the host, sent at the instant of the call that produced them (line speed is the line's business)."""

    data: bytes


@dataclass(frozen=True)
class Output:
    """A new level of a named output.

    Names every controller may use, so that the cabinet understands them:
    `stages` (1: motor currents on), `power_request` (rising edge: reset and close the safety relay),
    `current_lowering` (1: reduced current at rest), `brake` (1: brake energised, that is, released),
    `moving` (1 during a motion: a hood opened then is an emergency), `spindle`, `hood_release` (1: the hood may be
    opened), `analog` (0..255 for 0..10 V), `lamp_start`, `lamp_stop`, `lamp_fault`, `software_ok`, `user` (byte of user
    outputs), `flash_fault` (1: the flash image handed in cannot be read). Other names are recorded and shown, no more.
    """

    name: str
    value: int


@dataclass(frozen=True)
class CounterSet:
    """The controller has set the step counter of one axis (0 X .. 3 A) without making a step: reference, reset."""

    axis: int
    value: int


@dataclass(frozen=True)
class FlashWrite:
    """The flash now holds this image; whoever keeps it stores it atomically and hands it back at the next power-on."""

    image: bytes


Event = Reply | Output | CounterSet | FlashWrite


class Controller(Protocol):
    """An emulated controller. See the module for the protocol of time."""

    @property
    def baud(self) -> int:
        """Line speed in bit/s (8N1: ten bits a byte)."""

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Step counters X, Y, Z, A at the time of the last call."""

    @property
    def direction(self) -> tuple[int, int, int, int]:
        """+1 or -1 for each axis: sense in which a positive count turns the motor. Changes only while `run` is None."""

    @property
    def run(self) -> Run | None:
        """The step stream in execution, in the sense of the counters, or None at rest."""

    @property
    def next_ns(self) -> int | None:
        """When the controller must be advanced next, or None if it only waits for the outside."""

    @property
    def idle(self) -> bool:
        """True when every command received so far has been answered and nothing moves or runs."""

    @property
    def fault(self) -> bool:
        """An error stands that no reply has told the host, who would have to ask for it; False if replies tell all."""

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        """Mains on at t_ns; `levels` holds the electrical level (True: high) of every terminal that is wired."""

    def receive(self, t_ns: int, data: bytes) -> None:
        """Bytes that have arrived from the host by t_ns. Never raises, whatever they are."""

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """The level at one input terminal changes at t_ns."""

    def advance(self, t_ns: int) -> None:
        """Let time pass to t_ns (never beyond `next_ns`): make the pulses up to it, act on what is due."""

    def take(self) -> list[Event]:
        """Events since the last call of `take`, in their order; they happened at the time of the last call."""

    def wiring(self) -> Mapping[str, tuple[str, ...]] | None:
        """Terminals of this controller and the contacts of the machine wired to each (several: in series).

        None: the terminals that the machine's own wiring table names.
        """

    def machine_overrides(self) -> Mapping[str, Any]:
        """Machine parameters this controller sets, such as the microsteps of the stages it is built for.

        Keys as for `isel_twin.machine.with_overrides`: {"axes.all.steps_per_rev": 400}. Empty for none.
        """


ControllerFactory = Callable[..., Controller]
"""factory(name, *, flash: bytes | None, settings: Mapping[str, Any]) -> Controller, `name` being the entry point's."""


class UnknownNameError(ValueError):
    """A controller, machine or other named thing does not exist; the message lists what there is."""


def controller_names() -> list[str]:
    """Names of all installed controllers, sorted."""
    return sorted(entry.name for entry in importlib.metadata.entry_points(group="isel_twin.controllers"))


def create_controller(
    name: str, *, flash: bytes | None = None, settings: Mapping[str, Any] | None = None
) -> Controller:
    """Build the controller called `name`, with the flash image it had at its last power-off (None: a new device).

    Raises UnknownNameError if no installed controller has that name.
    """
    for entry in importlib.metadata.entry_points(group="isel_twin.controllers"):
        if entry.name == name:
            factory: ControllerFactory = entry.load()
            return factory(name, flash=flash, settings=settings or {})
    raise UnknownNameError(f"unknown controller {name!r}; installed: {', '.join(controller_names())}")
