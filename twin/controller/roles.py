"""Roles: optional protocols beside `Controller`; `offers` tells whether a controller has one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, TypeGuard, TypeVar

from isel_twin.base.parameters import Limits
from isel_twin.controller.registry import PluginError, Setting

Role = TypeVar("Role")


def offers(thing: object, role: Callable[..., Role]) -> TypeGuard[Role]:
    """True if a controller or language has all members that a role adds. Raises PluginError if it has only some.

    Unlike `isinstance` it also sees members that `__getattr__` passes on.
    """
    members: list[str] = [name for name in vars(role) if not name.startswith("_")]
    missing = [name for name in members if not hasattr(type(thing), name) and not hasattr(thing, name)]
    if missing and len(missing) < len(members):
        had = ", ".join(name for name in members if name not in missing)
        what = f"{type(thing).__name__} has {had} but not {', '.join(missing)}"
        raise PluginError(f"{what}: {getattr(role, '__name__', role)} wants all of them")
    return not missing


class Drives(Protocol):
    """The state of the drives, to be read only during a call of the controller, at the time of that call."""

    @property
    def encoder(self) -> tuple[int, ...]:
        """Measured position of each axis, in increments of the commands, with the zero and sense of the counters."""

    @property
    def lag(self) -> tuple[float, ...]:
        """Following error of each axis in increments: momentary command minus measured position."""

    @property
    def on(self) -> tuple[bool, ...]:
        """Whether each axis has current."""

    @property
    def fault(self) -> tuple[bool, ...]:
        """Which drives have switched themselves off: a servo drive until `drive_reset` rises or the stages come on."""

    @property
    def in_position(self) -> tuple[bool, ...]:
        """Which axes have had a following error within the drive's window for its settling time."""

    @property
    def overloaded(self) -> tuple[bool, ...]:
        """Which drives are limited to the rated current by their I2t."""

    @property
    def speed(self) -> tuple[float, ...]:
        """Measured speed of each axis in increments/s, in the sense of the counters."""

    @property
    def spindle_rev_min(self) -> float | None:
        """Measured speed of the spindle in rev/min, positive clockwise (M03); None if the machine file has none."""

    @property
    def past_zero_pulse(self) -> tuple[int, ...]:
        """Increments of each encoder since its last zero pulse, one a revolution, rising in the sense of the counters.

        Less than one revolution; 0 for axes without an encoder.
        """


@dataclass(frozen=True)
class DriveInput:
    """An input terminal fed by a drive: high while a quantity of one axis is beyond a limit.

    `lag`: size of the following error in increments, high above `limit`, low again at `limit - hysteresis`: a
    following-error alarm, or with a small limit the opposite of "in position". `fault`: high while the drive is faulty;
    no limit.
    """

    terminal: str
    axis: int
    quantity: Literal["lag", "fault"]
    limit: float = 0.0
    hysteresis: float = 0.0


class UsesDrives(Protocol):
    """A controller that reads its drives. `CounterSet` also sets the encoder's zero, so it must be sent after a change
    of `direction`, too.
    """

    def drive_inputs(self) -> Sequence[DriveInput]:
        """Terminals that drives feed, read once before `power_on`; an edge comes in the sub-step that passes its
        limit."""

    def use_drives(self, drives: Drives) -> None:
        """Take the drives to read during later calls; called once, before `power_on`."""


@dataclass(frozen=True)
class Arrival:
    """A controller waits until its drives are in position, and looks at them on a grid of time. A look at which they
    are not changes nothing: it may be left out, and the controller called at another time later on (core/9). It makes
    no tick meanwhile."""

    next_ns: int  # the next look, as long as none is left out
    period_ns: int
    until_ns: int  # when it has to be called in any case

    def look_ns(self, t_ns: int) -> int:
        """The first look at or after t_ns."""
        return self.next_ns - min(self.next_ns - t_ns, 0) // self.period_ns * self.period_ns


class AwaitsArrival(Protocol):
    """A controller that says so: who owns the clock need not call it at each look."""

    @property
    def arrival(self) -> Arrival | None:
        """What it waits for at the time of the last call; None: not for its drives."""


class NamesOutputs(Protocol):
    """A controller with outputs beyond OUTPUTS, for which scenario events can wait."""

    @property
    def output_names(self) -> Sequence[str]: ...


KeyValue: TypeAlias = float | str | bool


@dataclass(frozen=True)
class Key:
    """A key, switch or knob of a control's operator panel."""

    meaning: str  # in a few words, for people
    value: Setting | None = None  # allowed values; None: a push-button, whose value is True
    held: bool = False  # released, it springs back to the first of its words

    @property
    def allowed(self) -> str:
        if isinstance(self.value, tuple):
            return ", ".join(self.value)
        return "true" if self.value is None else str(self.value) if isinstance(self.value, Limits) else "true, false"


class HasKeys(Protocol):
    """A controller with keys beside those of the cabinet. Events press them, `key = { mode = "auto" }`, and panels show
    them from this table.
    """

    @property
    def keys(self) -> Mapping[str, Key]:
        """Keys by name; the table never changes."""

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        """Position of each key but push-buttons at the time of the last call."""

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        """Press a key at t_ns or set it to this value; name and value are valid."""


class KeepsBytes(Protocol):
    """A controller that only keeps most of the bytes it gets until another one comes. Who owns the clock need not call
    it for each of them when it arrives: it may get them later, with the time of the last one, in one piece, before it
    is called for anything else."""

    @property
    def acting_bytes(self) -> Set[int] | None:
        """All that it does not only keep, as far as it has been called; None: any byte may have an effect."""


class HoldsHost(Protocol):
    """A controller whose line has a handshake (RTS/CTS) that makes its host wait. It gets bytes in pieces of at most
    BYTES_AT_ONCE, and `clear_to_send` is read after each (bwo900/78).
    """

    @property
    def clear_to_send(self) -> bool:
        """True if it took more bytes at the time of the last call. While False the host keeps them, in their order."""


BYTES_AT_ONCE = 4096  # most bytes of one instant that a controller that `HoldsHost` gets in one piece


class TellsFault(Protocol):
    """A controller that says which error it stands in."""

    @property
    def fault_cause(self) -> str:
        """The cause in a few words; "" exactly while `Controller.fault` is False."""


class EndsPrograms(Protocol):
    """A controller whose programs can stop before their end."""

    @property
    def unfinished(self) -> str:
        """Why and where the last program stopped before its end, in a few words. "" while it runs, after its end, and
        if there was none.
        """
