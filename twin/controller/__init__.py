"""What a controller is: the border between a firmware and everything around it.

A controller is sans-I/O. It is told what happens and when (bytes from the host, input levels, the passing of time) and
says what it does (reply bytes, output levels, counter settings, flash images) and which motion it is making. It never
reads a clock, a socket or a file, and nothing above or below it knows which controller it is.

Protocol of time
----------------
Times are integer nanoseconds of virtual time and never run backwards. Whoever drives a controller must

1. call `power_on(t, levels)` once, then any of `receive`, `set_input` and `advance` with t that never decrease;
2. never let time pass `next_ns` without calling `advance(next_ns)`: that is where the controller acts by itself
   (end of a motion, end of a delay, next step of a reference run);
3. after each call fetch `take()`: the events of that instant, in their order.

Between two calls the controller makes the ticks of `run` (see `isel_twin.motion.Motion`), all those with a time <= t
once it has been called with t. An input edge at t therefore meets a controller that has made exactly the ticks up to
and including t: a limit switch ends the motion there, and no rollback is needed.

        t0            edge at t1          next_ns
        |--- ticks of run ----|- - - cancelled - - -|
        advance(t0)   set_input(t1, ...)

What `run` may become while it is made is stated in `isel_twin.motion.motion`.

What drives report
------------------
A controller that closes loops of its own asks for it: see `UsesDrives`. One that does not is not burdened.

What its bytes mean to people and tools is a second, optional border: `isel_twin.language.Language`.

Several devices on one shared line are themselves a controller: one object that hands each byte to all of them, sends
what they answer, and shows the motion of the one that has axes. Third parties add a controller by an entry point in the
group `isel_twin.controllers`; see docs/controllers.md.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, TypeVar, runtime_checkable

from isel_twin.base.parameters import Limits
from isel_twin.base.plugins import installed
from isel_twin.base.units import SECOND_NS

if TYPE_CHECKING:  # a list of the installed controllers takes a moment, the compiler behind a motion much longer
    from isel_twin.motion import Motion


@dataclass(frozen=True)
class SerialFormat:
    """How a byte goes over the line: speed in bit/s, data bits, parity (none, even, odd, mark, space), stop bits."""

    baud: int
    data_bits: int = 8
    parity: Literal["N", "E", "O", "M", "S"] = "N"
    stop_bits: int = 1

    @property
    def bits(self) -> int:
        """Bit times of a byte: start bit, data, parity, stop bits."""
        return 1 + self.data_bits + (self.parity != "N") + self.stop_bits

    @property
    def byte_ns(self) -> int:
        """Time of a byte on the line in ns."""
        return round(self.bits * SECOND_NS / self.baud)

    def __str__(self) -> str:
        return f"{self.baud} {self.data_bits}{self.parity}{self.stop_bits}"


@dataclass(frozen=True)
class Reply:
    """Bytes for the host, sent at the instant of the call that produced them (line speed is the line's business)."""

    data: bytes


OUTPUTS: Mapping[str, int] = {
    "stages": 0,
    "power_request": 0,
    "current_lowering": 0,
    "brake": 0,
    "moving": 0,
    "spindle": 0,
    "hood_release": 1,
    "analog": 0,
    "lamp_start": 0,
    "lamp_stop": 0,
    "lamp_fault": 0,
    "software_ok": 0,
    "user": 0,
    "flash_fault": 0,
    "drive_reset": 0,
}
"""Outputs that every controller may use, and what each is until the controller says otherwise; see `Output`."""


@dataclass(frozen=True)
class Output:
    """A new level of a named output.

    Names every controller may use, so that drives and cabinet understand them, as in OUTPUTS until it says so:
    `stages` (1: motor currents on), `power_request` (rising edge: close the safety relay),
    `current_lowering` (1: reduced current at rest), `brake` (1: brake energised, that is, released),
    `moving` (1 during a motion: a hood opened then is an emergency), `spindle`, `hood_release` (1: the hood may be
    opened), `analog` (0..255 for 0..10 V), `lamp_start`, `lamp_stop`, `lamp_fault`, `software_ok`, `user` (byte of user
    outputs), `flash_fault` (1: the flash image handed in cannot be read), `drive_reset` (rising edge: drives that have
    switched themselves off forget why). Other names are recorded and shown, no more.
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
    """One line for people: why something has failed that the host is told by a code only. Changes nothing."""

    text: str


@dataclass(frozen=True)
class Step:
    """A program that the controller carries out by itself has come to the next of its steps. Changes nothing.

    t_ns: when, now or before; name: what people call it; text: as it stands in the program; counts: counters then.
    plane: axes in which it cuts; tool_mm: radius of the tool, 0 if it cuts nothing or nobody knows.
    """

    t_ns: int
    name: str
    text: str
    counts: tuple[int, ...]
    plane: tuple[int, int] = (0, 1)
    tool_mm: float = 0.0


Event = Reply | Output | CounterSet | FlashWrite | Remark | Step


class Controller(Protocol):
    """An emulated controller. See the module for the protocol of time."""

    @property
    def serial_format(self) -> SerialFormat:
        """Line speed and form of a byte, at the time of the last call."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Counters at the time of the last call, one an axis (1 to 8, X Y Z A B C U V); always as many."""

    @property
    def direction(self) -> tuple[int, ...]:
        """+1 or -1 for each axis: sense in which a positive count turns the motor. Changes only while `run` is None."""

    @property
    def run(self) -> Motion | None:
        """The motion in execution, in the sense of the counters, or None at rest."""

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

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """Input terminals and the contacts of machine and cabinet that lead to each (several: in series).

        A contact that the machine lacks is left out; a terminal left without any is not wired.
        """

    def machine_overrides(self) -> Mapping[str, Any]:
        """Machine parameters this controller sets, such as the microsteps of the stages it is built for.

        Keys as for `isel_twin.machine.with_overrides`: {"axes.all.steps_per_rev": 400}. Empty for none.
        """


class Drives(Protocol):
    """What the drives know now. Good during a call of the border, and then about the time of that call."""

    @property
    def encoder(self) -> tuple[int, ...]:
        """Measured position of each axis, in increments of the commands, in zero and sense of the counters."""

    @property
    def lag(self) -> tuple[float, ...]:
        """Following error of each axis in increments: command (as led by now) minus measured position."""

    @property
    def on(self) -> tuple[bool, ...]:
        """Whether each axis has current."""

    @property
    def fault(self) -> tuple[bool, ...]:
        """Whether the drive of each axis has switched itself off; a servo drive stays so until the output `drive_reset`
        rises, or the stages come on anew."""

    @property
    def in_position(self) -> tuple[bool, ...]:
        """Whether the following error of each axis has been within the drive's window for its time."""

    @property
    def overloaded(self) -> tuple[bool, ...]:
        """Whether the drive of each axis holds the current down to the rated one (I2t)."""

    @property
    def speed(self) -> tuple[float, ...]:
        """Measured speed of each axis in increments/s, in the sense of the counters."""

    @property
    def past_zero_pulse(self) -> tuple[int, ...]:
        """Increments of each encoder past its last zero pulse, which comes once a revolution at the same place of the
        machine: 0 to one less than a revolution has, rising in the sense of the counters; 0 for axes without."""


@dataclass(frozen=True)
class DriveInput:
    """An input terminal fed by a drive: high while a quantity of one axis is beyond a limit.

    `lag`: size of the following error in increments, high above `limit`, low again at `limit - hysteresis`: a following
    error, or with a small limit the opposite of "in position". `fault`: high while the drive is faulty; no limit.
    """

    terminal: str
    axis: int
    quantity: Literal["lag", "fault"]
    limit: float = 0.0
    hysteresis: float = 0.0


@runtime_checkable
class UsesDrives(Protocol):
    """What a controller offers beside `Controller` if it wants to know what its drives know.

    An encoder follows the counter's zero by `CounterSet`: one is due after a change of `direction`, too.
    """

    def drive_inputs(self) -> Sequence[DriveInput]:
        """Terminals that drives feed; their edges come by `set_input` like those of any switch, at the sub-step in
        which the limit is passed. Asked once, before `power_on`."""

    def use_drives(self, drives: Drives) -> None:
        """The drives to be asked during later calls. Handed over once, before `power_on`."""


@runtime_checkable
class NamesOutputs(Protocol):
    """What a controller offers beside `Controller` if it has outputs beyond OUTPUTS: events can wait for them."""

    @property
    def output_names(self) -> Sequence[str]:
        """Their names."""


KeyValue: TypeAlias = float | str | bool


@dataclass(frozen=True)
class Key:
    """A key of the operator's panel of a control, or a switch or knob there; see HasKeys."""

    meaning: str
    """In a few words, for people."""
    value: Setting | None = None
    """What it can be put to; None: it is a push-button, and the value is True."""
    held: bool = False
    """It springs back to the first of its words when it is let go."""

    @property
    def allowed(self) -> str:
        """Its values in words."""
        if isinstance(self.value, tuple):
            return ", ".join(self.value)
        return "true" if self.value is None else str(self.value) if isinstance(self.value, Limits) else "true, false"


@runtime_checkable
class HasKeys(Protocol):
    """What a controller offers beside `Controller` if people operate it by keys of its own, not by the cabinet's.

    They are pressed by an event, `key = { mode = "auto" }`, and shown by panels from this table.
    """

    @property
    def keys(self) -> Mapping[str, Key]:
        """By name; the same as long as the controller lives."""

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        """What each one is put to now, at the time of the last call; push-buttons are left out."""

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        """Somebody presses a key at t_ns, or puts it to this value; both have been checked."""


@runtime_checkable
class HoldsHost(Protocol):
    """What a controller offers beside `Controller` if its line has a handshake (RTS/CTS) by which its host waits.

    Such a controller is handed bytes in pieces of at most BYTES_AT_ONCE, and asked after each.
    """

    @property
    def clear_to_send(self) -> bool:
        """Whether it takes bytes, at the time of the last call. While it does not it gets none: the host keeps them,
        and goes on with them, in their order, when it does."""


BYTES_AT_ONCE = 4096
"""Bytes that arrive at one instant and are handed over in one piece to a controller that `HoldsHost`."""


@runtime_checkable
class EndsPrograms(Protocol):
    """What a controller offers beside `Controller` if programs that it runs by itself can stand before their end."""

    @property
    def unfinished(self) -> str:
        """Where the program that was started last stands, and who it waits for or that it was broken off, in a few
        words; "" while it runs, when it has come to its end, and if there was none. At the time of the last call."""


ControllerFactory = Callable[..., Controller]
"""factory(name, *, flash: bytes | None, settings: Mapping[str, Any]) -> Controller, `name` being the entry point's."""


class UnknownNameError(ValueError):
    """A controller, machine or other named thing does not exist; the message lists what there is."""


Setting: TypeAlias = Limits | tuple[str, ...] | type[bool]
"""What a setting may be: a number within limits, one of some words (none: any text), or true and false."""

Factory = TypeVar("Factory", bound=Callable[..., Any])


def takes(settings: Mapping[str, Setting]) -> Callable[[Factory], Factory]:
    """Tell which settings a factory takes, so that machine files with a misspelt one can be refused when they are read.

    @takes({"program_memory_bytes": Limits("byte", 1, 1e9, whole=True)})
    def create(name, *, flash, settings): ...
    """

    def told(factory: Factory) -> Factory:
        factory.settings = settings  # type: ignore[attr-defined]
        return factory

    return told


class PluginError(ValueError):
    """A controller or language that is installed does not work; the message is one line that names it and says why."""


_GROUP = "isel_twin.controllers"


def controller_names() -> list[str]:
    """Names of all installed controllers, sorted."""
    return sorted(entry.name for entry in installed(_GROUP))


def create_controller(
    name: str, *, flash: bytes | None = None, settings: Mapping[str, Any] | None = None
) -> Controller:
    """Build the controller called `name`, with the flash image it had at its last power-off (None: a new device).

    Raises UnknownNameError if no installed controller has that name, PluginError if the one that has does not work, and
    ValueError for settings that it does not take.
    """
    return controller_factory(name)(flash, settings or {})


def controller_factory(name: str) -> Callable[[bytes | None, Mapping[str, Any]], Controller]:
    """What builds the controller called `name` from a flash image and settings, again and again; it raises, and this
    does, as `create_controller` does."""
    for entry in installed(_GROUP):
        if entry.name == name:
            with plugin_errors("controller", entry):
                factory: ControllerFactory = entry.load()
            return partial(_build, entry, factory)
    raise UnknownNameError(f"unknown controller {name!r}; installed: {', '.join(controller_names())}")


def _build(
    entry: importlib.metadata.EntryPoint, factory: ControllerFactory, flash: bytes | None, settings: Mapping[str, Any]
) -> Controller:
    with plugin_errors("controller", entry, ValueError):
        return factory(entry.name, flash=flash, settings=settings)


def controller_settings(wanted: Iterable[str]) -> Mapping[str, Setting]:
    """The settings that installed controllers take, by name; looked for until those `wanted` have been found.

    A controller that does not work takes none.
    """
    if not set(wanted) <= _settings.keys():
        for entry in installed(_GROUP):
            with suppress(PluginError), plugin_errors("controller", entry):
                _settings.update(getattr(entry.load(), "settings", {}))
            if set(wanted) <= _settings.keys():
                break
    return _settings


_settings: dict[str, Setting] = {}


@contextmanager
def plugin_errors(what: str, entry: importlib.metadata.EntryPoint, *passed: type[Exception]) -> Iterator[None]:
    """Whatever other people's code raises is a PluginError of one line, but for the errors that it may well raise."""
    try:
        yield
    except passed:
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise PluginError(f"{what} {entry.name!r} ({entry.value}) does not work: {reason}") from error
