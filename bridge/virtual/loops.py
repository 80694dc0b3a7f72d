"""asyncio in virtual time (bridge/24): a loop that waits in the turns of the host's threads, and watches the port
and the host's sockets.

    loop.select(timeout)  -->  Turns.wait: until a timer, a byte at the port, or another thread wakes the loop

It wakes itself by a pair of sockets, as usual, which are virtual ones (sockets.py). No signals of its own. Executors
work: their threads take turns.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from typing import Any

from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import UPTIME_NS, here
from isel_twin.bridge.virtual.waiting import VirtualSelector


class VirtualLoop(asyncio.SelectorEventLoop):
    in_virtual_time = True  # not refused

    def __init__(self) -> None:
        active = here()
        assert active is not None
        self._active = active
        super().__init__(VirtualSelector(active, "asyncio loop"))

    def time(self) -> float:
        """Seconds of the host's monotonic clock; a look costs nothing."""
        return (UPTIME_NS + self._active.now_ns) / SECOND_NS

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
