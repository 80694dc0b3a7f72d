"""asyncio in virtual time (bridge/24): a loop that waits in the turns of the host's threads, and watches the port.

    loop.select(timeout)  -->  Turns.wait: until a timer, a byte at the port, or another thread wakes the loop

No sockets, pipes or signals of its own: `call_soon_threadsafe` sets a flag. Executors work: their threads take turns.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import UPTIME_NS, Turns, here

READ, WRITE = selectors.EVENT_READ, selectors.EVENT_WRITE


class VirtualSelector(selectors.BaseSelector):
    """Only the twin's port can be registered."""

    def __init__(self, active: Turns) -> None:
        self._active = active
        self._keys: dict[int, selectors.SelectorKey] = {}
        self._woken = False

    def wake(self) -> None:
        self._woken = True

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        from isel_twin.bridge.virtual.refusals import SERVE, refuse

        fd = fileobj if isinstance(fileobj, int) else fileobj.fileno()
        port = self._active.ports.open
        if port is None or fd != port.fileno():
            refuse("an asyncio loop that watches something else than the port", SERVE)
        key = self._keys[fd] = selectors.SelectorKey(fileobj, fd, events, data)
        return key

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        return self._keys.pop(fileobj if isinstance(fileobj, int) else fileobj.fileno())

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return self._keys

    def _ready(self) -> list[tuple[selectors.SelectorKey, int]]:
        come = READ if self._active.inbox else 0
        return [(key, now) for key in self._keys.values() if (now := key.events & (WRITE | come))]

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        active = self._active
        if here() is not active:  # the host has ended
            return []
        active.fetch()
        if self._woken or (timeout is not None and timeout <= 0) or self._ready():
            active.free_look()
        else:
            hears = any(key.events & READ for key in self._keys.values())
            until_ns = None if timeout is None else active.deadline(timeout)
            active.wait(lambda: self._woken or (hears and bool(active.inbox)), until_ns, "asyncio loop", hears=hears)
        self._woken = False
        return self._ready()

    def close(self) -> None:
        self._keys.clear()


class VirtualLoop(asyncio.SelectorEventLoop):
    in_virtual_time = True  # not refused

    def __init__(self) -> None:
        active = here()
        assert active is not None
        self._active, self._waits = active, VirtualSelector(active)
        super().__init__(self._waits)

    def time(self) -> float:
        """Seconds of the host's monotonic clock; a look costs nothing."""
        return (UPTIME_NS + self._active.now_ns) / SECOND_NS

    def _make_self_pipe(self) -> None: ...
    def _close_self_pipe(self) -> None: ...

    def _write_to_self(self) -> None:
        self._waits.wake()

    def add_signal_handler(  # type: ignore[override]
        self, sig: int, callback: Callable[..., object], *args: Any
    ) -> None:
        """As on Windows, for which hosts have to be prepared anyway."""
        raise NotImplementedError("a loop in virtual time has no signal handlers; use signal.signal")


def stand_ins() -> list[tuple[Any, Any]]:
    real = asyncio.new_event_loop
    return [(real, StandIn(real, lambda _: VirtualLoop()))]


def methods() -> Iterator[tuple[type, str, Callable[..., Any]]]:
    """Of the policy, by which `asyncio.get_event_loop` makes a loop (until Python 3.13)."""
    policy: Any = getattr(asyncio, "DefaultEventLoopPolicy", None)
    if policy is None:
        return
    real = policy.new_event_loop
    yield policy, "new_event_loop", lambda self: real(self) if here() is None else VirtualLoop()
