"""Roles: what a controller may offer beside `Controller`. Whoever needs one asks `offers` for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, TypeGuard, TypeVar

from isel_twin.base.parameters import Limits
from isel_twin.controller.registry import PluginError, Setting

Role = TypeVar("Role")


def offers(thing: object, role: Callable[..., Role]) -> TypeGuard[Role]:
    """True if a controller or language has all members that a role adds. Raises PluginError if it has only some.

    Members that `__getattr__` passes on count, which `isinstance` would not see.
    """
    members: list[str] = [name for name in vars(role) if not name.startswith("_")]
    missing = [name for name in members if not hasattr(type(thing), name) and not hasattr(thing, name)]
    if missing and len(missing) < len(members):
        had = ", ".join(name for name in members if name not in missing)
        what = f"{type(thing).__name__} has {had} but not {', '.join(missing)}"
        raise PluginError(f"{what}: {getattr(role, '__name__', role)} wants all of them")
    return not missing


class Drives(Protocol):
    """What the drives know. To be asked during a call of the controller only; the answers are those of that time."""

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
        """Whether each drive has switched itself off: a servo drive until `drive_reset` rises or the stages come on."""

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
        """Increments of each encoder since its last zero pulse, one a revolution, rising in the sense of the counters.

        Less than a revolution has; 0 for axes without an encoder.
        """


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


class UsesDrives(Protocol):
    """Offered by a controller that wants to know what its drives know.

    An encoder follows the counter's zero by `CounterSet`: one is due after a change of `direction`, too.
    """

    def drive_inputs(self) -> Sequence[DriveInput]:
        """Terminals that drives feed, asked once before `power_on`; edges come in the sub-step that passes it."""

    def use_drives(self, drives: Drives) -> None:
        """The drives to be asked during later calls. Handed over once, before `power_on`."""


class NamesOutputs(Protocol):
    """Offered by a controller that has outputs beyond OUTPUTS: events can wait for them."""

    @property
    def output_names(self) -> Sequence[str]: ...


KeyValue: TypeAlias = float | str | bool


@dataclass(frozen=True)
class Key:
    """A key of the operator's panel of a control, or a switch or knob there; see HasKeys."""

    meaning: str  # in a few words, for people
    value: Setting | None = None  # what it can be put to; None: it is a push-button, and the value is True
    held: bool = False  # let go, it springs back to the first of its words

    @property
    def allowed(self) -> str:
        if isinstance(self.value, tuple):
            return ", ".join(self.value)
        return "true" if self.value is None else str(self.value) if isinstance(self.value, Limits) else "true, false"


class HasKeys(Protocol):
    """Offered by a controller with keys of its own, beside the cabinet's.

    They are pressed by an event, `key = { mode = "auto" }`, and shown by panels from this table.
    """

    @property
    def keys(self) -> Mapping[str, Key]:
        """By name; the same as long as the controller lives."""

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        """Position of each one at the time of the last call; push-buttons are left out."""

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        """Somebody presses a key at t_ns or puts it to this value; name and value have been checked."""


class HoldsHost(Protocol):
    """Offered by a controller whose line has a handshake (RTS/CTS) that makes its host wait (bwo900/78).

    Such a controller is handed bytes in pieces of at most BYTES_AT_ONCE, and asked after each.
    """

    @property
    def clear_to_send(self) -> bool:
        """True if it takes bytes, at the time of the last call. While False the host keeps them, in their order."""


# bytes that arrive at one instant and are handed over in one piece to a controller that `HoldsHost`
BYTES_AT_ONCE = 4096


class EndsPrograms(Protocol):
    """Offered by a controller whose programs can stand before their end."""

    @property
    def unfinished(self) -> str:
        """Why the program started last stands before its end, and where, in a few words, at the time of the last call.

        "" while it runs, after its end, and if there was none.
        """
