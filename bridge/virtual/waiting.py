"""Waiting for several things at once in virtual time: `select.select`, `select.poll` and the selectors of `selectors`.

The things are the twin's port and the host's sockets. Files of the system (pipes, the keyboard) would be waited for in
real time, and end the host; `select.select` may look at them without waiting.
"""

from __future__ import annotations

import select
import selectors
from collections.abc import Callable, Mapping
from typing import Any

from isel_twin.bridge.virtual.refusals import SERVE, refuse
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import Turns, here

READ, WRITE = selectors.EVENT_READ, selectors.EVENT_WRITE
_OTHERS = "something else than the port and the host's own sockets"

_real_select = select.select
_REAL_POLL = getattr(select, "poll", None)


def _number(file: Any) -> int:
    return file if isinstance(file, int) else int(file.fileno())


def _events(active: Turns, number: int) -> int | None:
    """What the port or a socket is ready for, of READ and WRITE; None: it is something else."""
    port = active.ports.open
    if port is not None and number == port.fileno():
        return WRITE | (READ if active.inbox else 0)
    found = active.network.find(number)
    if found is None:
        return None
    return (READ if found.readable else 0) | (WRITE if found.writable else 0)


def _hears(active: Turns, watched: Mapping[int, int]) -> bool:
    """True if bytes of the port are among what is waited for."""
    port = active.ports.open
    return port is not None and bool(watched.get(port.fileno(), 0) & READ)


def _ready(active: Turns, watched: Mapping[int, int]) -> dict[int, int]:
    """By file number, which of the wanted events have come."""
    return {number: now for number, wanted in watched.items() if (now := wanted & (_events(active, number) or 0))}


def _wait(active: Turns, watched: Mapping[int, int], timeout: float | None, why: str) -> dict[int, int]:
    active.fetch()
    if timeout is not None and timeout <= 0:
        active.look()
        active.fetch()
    elif not _ready(active, watched):
        until_ns, hears = active.deadline(timeout), _hears(active, watched)
        active.wait(lambda: bool(_ready(active, watched)), until_ns, why, hears=hears)
    else:
        active.free_look()
    return _ready(active, watched)


def _select(active: Turns, r: Any, w: Any, x: Any, timeout: float | None = None, /) -> Any:
    reading, writing, other = list(r), list(w), list(x)
    watched: dict[int, int] = {}
    real: list[list[Any]] = [[], [], []]
    for files, event, others in ((reading, READ, real[0]), (writing, WRITE, real[1]), (other, 0, real[2])):
        for file in files:
            if _events(active, number := _number(file)) is None:
                others.append(file)
            else:
                watched[number] = watched.get(number, 0) | event
    if timeout is None and any(real):
        refuse(f"select.select without timeout on {_OTHERS}", SERVE)
    found = _real_select(real[0], real[1], real[2], 0) if any(real) else ([], [], [])
    if any(found):
        timeout = 0
    ready = _wait(active, watched, timeout, "select")
    come = [file for file in reading if ready.get(_number(file), 0) & READ]
    free = [file for file in writing if ready.get(_number(file), 0) & WRITE]
    return found[0] + come, found[1] + free, found[2]


class VirtualSelector(selectors.BaseSelector):
    """A selector of a host: the port and the host's sockets can be registered.

    In a thread that is not the host's a real one is made.
    """

    real: Any = selectors.DefaultSelector

    def __new__(cls, active: Turns | None = None, name: str = "") -> Any:
        return cls.real() if active is None and here() is None else super().__new__(cls)

    def __init__(self, active: Turns | None = None, name: str = "a selector") -> None:
        """name: what waits, for the message about a deadlock."""
        self._active: Any = active or here()
        self._name = name
        self._keys: dict[int, selectors.SelectorKey] = {}

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        number = _number(fileobj)
        if _events(self._active, number) is None:
            refuse(f"a selector or an asyncio loop that watches {_OTHERS}", SERVE)
        if number in self._keys:
            raise KeyError(f"{fileobj!r} (FD {number}) is already registered")
        key = self._keys[number] = selectors.SelectorKey(fileobj, number, events, data)
        return key

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        return self._keys.pop(self._known(fileobj))

    def _known(self, fileobj: Any) -> int:
        for number, key in self._keys.items():
            if key.fileobj is fileobj or number == fileobj:  # a socket may have been closed meanwhile
                return number
        number = fileobj if isinstance(fileobj, int) else fileobj.fileno()
        if number not in self._keys:
            raise KeyError(f"{fileobj!r} is not registered")
        return int(number)

    def get_key(self, fileobj: Any) -> selectors.SelectorKey:
        return self._keys[self._known(fileobj)]

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return self._keys

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        active: Turns = self._active
        if here() is None:  # the host has ended
            return []
        active.fetch()
        watched = {number: key.events for number, key in self._keys.items()}
        if (timeout is not None and timeout <= 0) or _ready(active, watched):
            active.free_look()
        else:
            until_ns, hears = active.deadline(timeout), _hears(active, watched)
            active.wait(lambda: bool(_ready(active, watched)), until_ns, self._name, hears=hears)
        return [(self._keys[number], now) for number, now in _ready(active, watched).items() if number in self._keys]

    def close(self) -> None:
        self._keys.clear()


class VirtualPoll:
    """`select.poll()` of a host. Times are in ms."""

    def __init__(self, active: Turns) -> None:
        self._active = active
        self._wanted: dict[int, int] = {}

    def register(self, file: Any, events: int = 0, /) -> None:
        number = _number(file)
        if _events(self._active, number) is None:
            refuse(f"select.poll on {_OTHERS}", SERVE)
        events = events or select.POLLIN | select.POLLOUT
        self._wanted[number] = (READ if events & select.POLLIN else 0) | (WRITE if events & select.POLLOUT else 0)

    def modify(self, file: Any, events: int, /) -> None:
        if _number(file) not in self._wanted:
            raise FileNotFoundError(2, "No such file or directory")
        self.register(file, events)

    def unregister(self, file: Any, /) -> None:
        del self._wanted[_number(file)]

    def poll(self, timeout: float | None = None, /) -> list[tuple[int, int]]:
        seconds = None if timeout is None or timeout < 0 else timeout / 1000
        ready = _wait(self._active, self._wanted, seconds, "poll")
        names = ((READ, select.POLLIN), (WRITE, select.POLLOUT))
        return [(number, sum(flag for event, flag in names if now & event)) for number, now in ready.items()]


def stand_ins() -> list[tuple[Any, Any]]:
    pairs: list[tuple[Any, Callable[..., Any] | type]] = [(_real_select, StandIn(_real_select, _select))]
    if _REAL_POLL is not None:
        pairs.append((_REAL_POLL, StandIn(_REAL_POLL, VirtualPoll)))
    names = ("SelectSelector", "PollSelector", "EpollSelector", "DevpollSelector", "KqueueSelector")
    kinds = {id(kind): kind for name in names if (kind := getattr(selectors, name, None)) is not None}
    return pairs + [(kind, type(kind.__name__, (VirtualSelector,), {"real": kind})) for kind in kinds.values()]
