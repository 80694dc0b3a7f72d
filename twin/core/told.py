"""What a controller has been told, so that another one can be brought to where it is: for `Twin.save` and `restore`.

Goal: the state of any controller, in mid-motion too. A controller may keep it in places that nobody can copy (a
generator that is suspended in a loop, as in isel_twin.firmware.activity). But it is sans-I/O: what it is follows from
how it began and what it has been told since, bit for bit. So its state is

    beginning                 told since then
    |------------------------|-----------------|  now
    built by its factory,     power_on, receive, set_input, press, advance, and what its drives have answered
    or a pickle of it

A controller that can be pickled now needs no telling: its state is short, and what it has been told before is dropped.
Every so often that is tried, so that a twin that runs for weeks keeps little. A controller that never can be pickled
(or that was handed in and cannot) is saved by what it has been told up to MOST calls, and not any more after that.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

from isel_twin.controller import Controller, Drives, HasKeys, KeyValue, UsesDrives, offers

OFTEN = 1024
"""Calls after which it is tried to begin with a pickle, as soon as the controller is idle; that takes 50 us."""
MOST = 1 << 17
"""Calls that are kept at most: some 15 MB, and a second to tell them again."""
MOST_BYTES = 4 << 20
"""Bytes of a host that are kept at most in them: of a program that is fed without an end."""

_ANSWERS = frozenset(name for name, of in vars(Drives).items() if isinstance(of, property))
"""Properties of `Drives`."""


class StateError(ValueError):
    """A twin cannot be saved, or not be restored from a state; the message is one line that says why."""


@dataclass(frozen=True)
class Life:
    """What a controller is: how it began, and what it has been told since."""

    pickled: bytes | None
    """It began as this; None: as its factory builds it."""
    flash: bytes | None
    """With this flash image, if its factory built it."""
    calls: tuple[tuple[str, Any, Any], ...]
    """(method, time in ns, what else it takes), and among them (property of its drives, None, answer)."""


class Told:
    """Hands on to a controller what it is told, and remembers it. Everything else is asked of the controller itself."""

    def __init__(self, controller: Controller, flash: bytes | None, *, rebuilt: bool = True) -> None:
        """controller: one that has just been built, with this flash image.

        rebuilt: its factory would build it again; no if somebody has handed it in.
        """
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
        self._note(("receive", t_ns, data))
        self._bytes += len(data)
        self.controller.receive(t_ns, data)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._note(("set_input", t_ns, (terminal, level)))
        self.controller.set_input(t_ns, terminal, level)

    def press(self, t_ns: int, name: str, value: KeyValue) -> bool:
        """See HasKeys.press; return whether the controller has keys."""
        if not offers(self.controller, HasKeys):
            return False
        self._note(("press", t_ns, (name, value)))
        self.controller.press(t_ns, name, value)
        return True

    def advance(self, t_ns: int) -> None:
        if len(self._calls) >= self._try_at or self._bytes > MOST_BYTES:
            self._shorten_or_drop()
        self._calls.append(("advance", t_ns, None))
        self.controller.advance(t_ns)

    def save(self) -> Life:
        """What the controller is; its events have been taken. Raises StateError with one line if nobody can know."""
        if self._calls or self._life.pickled is None:
            reason = self._shorten()
            if reason and not self._whole:
                raise StateError(
                    f"the controller {type(self.controller).__name__} cannot be saved now: {reason}; one that can be "
                    "pickled can always be saved, see docs/controllers.md"
                )
        return Life(self._life.pickled, self._life.flash, tuple(self._calls))

    def restore(self, life: Life, build: Callable[[bytes | None], Controller] | None, drives: Drives) -> None:
        """Be where the controller was when `save` gave this life: `controller` is another one afterwards.

        build: its factory, given a flash image. drives: what it can ask from then on.
        """
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
            elif name in _ANSWERS:  # to a question between two calls
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
        self._bytes = 0
        """Of those that the host has sent, since then."""
        self._whole = whole
        """The calls are all there have been since the beginning."""
        self._try_at = len(self._calls) + OFTEN

    def _note(self, call: tuple[str, Any, Any]) -> None:
        self._calls.append(call)

    def _shorten_or_drop(self) -> None:
        """Between two calls: begin with a pickle if that can be had, and keep no more than MOST calls."""
        if self.controller.idle and self._shorten():
            self._try_at = len(self._calls) + OFTEN
        if len(self._calls) >= MOST or self._bytes > MOST_BYTES:
            self._calls.clear()
            self._try_at, self._bytes, self._whole = OFTEN, 0, False

    def _shorten(self) -> str:
        """Begin with a pickle of what the controller is now; if that cannot be, why."""
        try:
            pickled = _pickled(self.controller, self._drives)
        except Exception as error:  # whatever other people's code raises
            return " ".join(f"{type(error).__name__}: {error}".split())
        self._begin(Life(pickled, None, ()), whole=True)
        return ""


class _Asked:
    """Implements `Drives`: asks them, and remembers what they said; or says what they have said before."""

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
    """Leaves out the drives."""

    drives: _Asked

    def persistent_id(self, part: Any) -> str | None:
        return "drives" if part is self.drives else None


class _Unpickler(pickle.Unpickler):
    """Puts other drives in their place."""

    drives: _Asked

    def persistent_load(self, name: Any) -> Any:
        return self.drives


def _pickled(controller: Controller, drives: _Asked) -> bytes:
    """The controller without its drives."""
    out = io.BytesIO()
    pickler = _Pickler(out, pickle.HIGHEST_PROTOCOL)
    pickler.drives = drives
    pickler.dump(controller)
    return out.getvalue()


def _unpickled(data: bytes, drives: _Asked) -> Controller:
    """The controller with these drives."""
    unpickler = _Unpickler(io.BytesIO(data))
    unpickler.drives = drives
    return cast(Controller, unpickler.load())
