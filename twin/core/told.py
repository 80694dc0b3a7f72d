"""Saves and restores any controller, in mid-motion too: by a log of its calls, for `Twin.save` and `restore`.

A controller may keep state that cannot be copied, such as a suspended generator (isel_twin.firmware.activity). But it
is sans-I/O: its first state and the calls since determine its state, to the bit. So this is saved: (core/7)

    beginning                 told since then
    |------------------------|-----------------|  now
    built by its factory,     power_on, receive, set_input, press, advance, and answers of its drives
    or a pickle of it

Every OFTEN calls a pickle is tried, which replaces the calls before it, so that the log stays short. A controller that
can never be pickled can be saved only up to MOST calls.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

from isel_twin.controller import Controller, Drives, HasKeys, KeyValue, UsesDrives, offers

OFTEN = 1024  # calls between two attempts to pickle an idle controller; each takes 50 us
MOST = 1 << 17  # most calls kept: some 15 MB, and a second to repeat them
MOST_BYTES = 4 << 20  # most bytes received in them: a program may be endless

_ANSWERS = frozenset(name for name, of in vars(Drives).items() if isinstance(of, property))


class StateError(ValueError):
    """A twin cannot be saved or restored; the message is one line that says why."""


@dataclass(frozen=True)
class Life:
    """A controller's state: its first state, and the calls since."""

    pickled: bytes | None  # the first controller; None: one that its factory builds, with `flash`
    flash: bytes | None
    # (method, time in ns, further arguments), and between them (property of its drives, None, answer)
    calls: tuple[tuple[str, Any, Any], ...]


class Told:
    """Passes calls on to a controller, and logs them."""

    def __init__(self, controller: Controller, flash: bytes | None, *, rebuilt: bool) -> None:
        """controller: new, with this flash image. rebuilt: its factory can build it again."""
        self.controller = controller
        self._drives = _Asked(self._note)
        self._begin(Life(None, flash, ()), whole=rebuilt)

    def use_drives(self, drives: Drives) -> None:
        self._drives.asked = drives
        if offers(self.controller, UsesDrives):
            self.controller.use_drives(cast(Drives, self._drives))

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._note(("power_on", t_ns, dict(levels)))
        self.controller.power_on(t_ns, levels)

    def receive(self, t_ns: int, data: bytes) -> None:
        self._keep_short()  # who only asks makes no time pass, and nothing is advanced
        self._note(("receive", t_ns, data))
        self._bytes += len(data)
        self.controller.receive(t_ns, data)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._note(("set_input", t_ns, (terminal, level)))
        self.controller.set_input(t_ns, terminal, level)

    def press(self, t_ns: int, name: str, value: KeyValue) -> bool:
        """Returns False if the controller has no keys."""
        if not offers(self.controller, HasKeys):
            return False
        self._note(("press", t_ns, (name, value)))
        self.controller.press(t_ns, name, value)
        return True

    def advance(self, t_ns: int) -> None:
        self._keep_short()
        self._calls.append(("advance", t_ns, None))
        self.controller.advance(t_ns)

    def save(self) -> Life:
        """The controller's state, after its events have been taken. Raises StateError with one line."""
        if self._calls or self._life.pickled is None:
            reason = self._shorten()
            if reason and not self._whole:
                raise StateError(
                    f"the controller {type(self.controller).__name__} cannot be saved now: {reason}; one that can be "
                    "pickled can always be saved, see docs/controllers.md"
                )
        return Life(self._life.pickled, self._life.flash, tuple(self._calls))

    def restore(self, life: Life, build: Callable[[bytes | None], Controller] | None, drives: Drives) -> None:
        """Replace `controller` by one in the saved state. build: its factory, a function of a flash image."""
        replies = iter(life.calls)
        asked = _Asked(None, replies)
        if life.pickled is not None:
            controller = _unpickled(life.pickled, asked)
        elif build is None:
            raise StateError("a controller that was handed in cannot be built again")
        else:
            controller = build(life.flash)
            if offers(controller, UsesDrives):
                controller.use_drives(cast(Drives, asked))
        for name, t_ns, value in replies:
            if name == "advance":
                controller.advance(t_ns)
            elif name in ("set_input", "press"):
                getattr(controller, name)(t_ns, *value)
            elif name in _ANSWERS:  # read between two calls
                continue
            else:
                getattr(controller, name)(t_ns, value)
            controller.take()
        self.controller, self._drives = controller, asked
        asked.asked, asked.note, asked.again = drives, self._note, None
        self._begin(life, whole=True)

    def _begin(self, life: Life, *, whole: bool) -> None:
        self._life = life
        self._calls: list[tuple[str, Any, Any]] = list(life.calls)
        self._bytes = 0  # received in calls since `life`
        self._whole = whole  # the calls go back to the beginning
        self._try_at = len(self._calls) + OFTEN

    def _note(self, call: tuple[str, Any, Any]) -> None:
        self._calls.append(call)

    def _keep_short(self) -> None:
        """To be called when the controller's events have been taken."""
        if len(self._calls) < self._try_at and self._bytes <= MOST_BYTES:
            return
        if self.controller.idle and self._shorten():
            self._try_at = len(self._calls) + OFTEN
        if len(self._calls) >= MOST or self._bytes > MOST_BYTES:
            self._calls.clear()
            self._try_at, self._bytes, self._whole = OFTEN, 0, False

    def _shorten(self) -> str:
        """Replace the calls by a pickle of the controller; return why that failed, "" if done."""
        try:
            pickled = _pickled(self.controller, self._drives)
        except Exception as error:  # a plug-in may raise anything
            return " ".join(f"{type(error).__name__}: {error}".split())
        self._begin(Life(pickled, None, ()), whole=True)
        return ""


class _Asked:
    """Implements `Drives`: reads them and logs the answers, or repeats logged answers."""

    def __init__(
        self, note: Callable[[tuple[str, Any, Any]], None] | None, again: Iterator[tuple[str, Any, Any]] | None = None
    ) -> None:
        self.asked: Drives | None = None
        self.note = note
        self.again = again

    def __getattr__(self, name: str) -> Any:
        if name not in _ANSWERS:
            raise AttributeError(name)
        if self.again is not None:
            return next(self.again)[2]
        value = getattr(self.asked, name)
        if self.note is not None:
            self.note((name, None, value))
        return value


class _Pickler(pickle.Pickler):
    drives: _Asked

    def persistent_id(self, part: Any) -> str | None:
        return "drives" if part is self.drives else None


class _Unpickler(pickle.Unpickler):
    drives: _Asked

    def persistent_load(self, name: Any) -> Any:
        return self.drives


def _pickled(controller: Controller, drives: _Asked) -> bytes:
    out = io.BytesIO()
    pickler = _Pickler(out, pickle.HIGHEST_PROTOCOL)
    pickler.drives = drives
    pickler.dump(controller)
    return out.getvalue()


def _unpickled(data: bytes, drives: _Asked) -> Controller:
    unpickler = _Unpickler(io.BytesIO(data))
    unpickler.drives = drives
    return cast(Controller, unpickler.load())
