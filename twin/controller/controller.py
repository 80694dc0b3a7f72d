"""What a controller is: the border between a firmware and everything around it.

A controller does no input or output itself (sans-I/O). Calls tell it what happens and when (bytes from the host, input
levels, the passing of time); it returns reply bytes, output levels, counter settings and flash images, and shows the
motion it is making. Nothing above or below it knows which controller it is.

Protocol of time
----------------
Times are integer nanoseconds of virtual time and never run backwards. The caller must

1. call `power_on(t, levels)` once, then any of `receive`, `set_input` and `advance` with t that never decrease;
2. never let time pass `next_ns` without calling `advance(next_ns)`: then the controller acts by itself (end of a motion
or delay, next step of a reference run);
3. after each call fetch `take()`: the events of that instant, in their order.

Between two calls the controller makes the ticks of `run` (`isel_twin.motion.Motion`): after a call with t, all those
with a time <= t. An input edge at t therefore meets a controller that has made exactly the ticks up to and including t:
a limit switch ends the motion there, and no rollback is needed.

        t0            edge at t1          next_ns
        |--- ticks of run ----|- - - cancelled - - -|
        advance(t0)   set_input(t1, ...)

How `run` may change while it is made is in `isel_twin.motion.motion`. A controller that closes loops of its own reads
the drives: `UsesDrives` in roles.py. The meaning of its bytes for people and tools is a second, optional interface:
`isel_twin.language.Language`.

Several devices on one shared line are themselves a controller: one object that hands each byte to all of them, sends
their answers, and shows the motion of the one that has axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Protocol

from isel_twin.base.units import SECOND_NS
from isel_twin.controller.events import Event

if TYPE_CHECKING:  # importing a motion loads the compiler, too slow for a list of controllers
    from isel_twin.motion import Motion


@dataclass(frozen=True)
class SerialFormat:
    """Form of a byte on the line: speed in bit/s, data bits, parity (none, even, odd, mark, space), stop bits."""

    baud: int
    data_bits: int = 8
    parity: Literal["N", "E", "O", "M", "S"] = "N"
    stop_bits: int = 1

    @property
    def bits(self) -> int:
        """Bit times of a byte: start bit, data, parity, stop bits."""
        return 1 + self.data_bits + (self.parity != "N") + self.stop_bits

    @cached_property
    def byte_ns(self) -> int:
        return round(self.bits * SECOND_NS / self.baud)

    def __str__(self) -> str:
        return f"{self.baud} {self.data_bits}{self.parity}{self.stop_bits}"


class Controller(Protocol):
    """An emulated controller; the protocol of time is in the module docstring."""

    @property
    def serial_format(self) -> SerialFormat:
        """Line speed and form of a byte, at the time of the last call."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Counters at the time of the last call, one an axis (1 to 8, X Y Z A B C U V); their number is fixed."""

    @property
    def direction(self) -> tuple[int, ...]:
        """+1 or -1 for each axis: sense in which a positive count turns the motor. Changes only while `run` is None."""

    @property
    def run(self) -> Motion | None:
        """The motion in execution, in the sense of the counters, or None at rest."""

    @property
    def next_ns(self) -> int | None:
        """When the controller must be advanced next, or None if it waits for an input."""

    @property
    def idle(self) -> bool:
        """True when every command received so far has been answered and nothing moves or runs."""

    @property
    def fault(self) -> bool:
        """True while it stands in an error that host or operator must do something about, whether a reply has told it
        or not: emergency stop, a limit switch struck, drives off after a fault, a motion that it could not make. A
        controller that says which one is `TellsFault`."""

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        """Mains on at t_ns; `levels`: electrical level (True: high) of every wired terminal."""

    def receive(self, t_ns: int, data: bytes) -> None:
        """Take bytes that have arrived from the host by t_ns. Never raises, whatever they are."""

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """The level at one input terminal changes at t_ns."""

    def advance(self, t_ns: int) -> None:
        """Let time pass to t_ns, never beyond `next_ns`, and do what is due."""

    def take(self) -> list[Event]:
        """Events since the last call of `take`, in their order; they happened at the time of the last call."""

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """Input terminals and the contacts of machine and cabinet that lead to each (several: in series).

        Contacts that the machine lacks are left out; a terminal without any is not wired.
        """

    def machine_overrides(self) -> Mapping[str, Any]:
        """Machine parameters this controller sets, such as the microsteps of the stages it is built for.

        Keys as for `isel_twin.machine.with_overrides`: {"axes.all.steps_per_rev": 400}. Empty for none.
        """
