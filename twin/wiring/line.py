"""The serial line between host and controller, in virtual time.

With `timed` a byte takes its time (`SerialFormat.byte_ns`), one after the other in each direction; without, bytes
arrive at the instant they are sent (right for tests of logic, where the line is not what is looked at).

    host sends  |b0|b1|b2|            at 19200 baud, 8N1: 520.833 us a byte
    arrives        b0 b1 b2           each at the end of its stop bit
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np


class _Direction:
    """One direction of the line: a queue of (arrival time, bytes that arrive then), and how many bytes that are."""

    def __init__(self) -> None:
        self.queue: deque[tuple[int, bytes]] = deque()
        self.due = 0
        self._free_ns = 0

    def send(self, t_ns: int, data: bytes, byte_ns: int) -> int:
        """Put bytes on the line; return when the last of them arrives."""
        arrival = max(t_ns, self._free_ns)
        if byte_ns:
            for number in range(len(data)):
                arrival += byte_ns
                self.queue.append((arrival, data[number : number + 1]))
        elif data:
            self.queue.append((arrival, data))
        self.due += len(data)
        self._free_ns = arrival
        return arrival

    def receive(self, t_ns: int) -> bytes:
        queue = self.queue
        if not queue or queue[0][0] > t_ns:
            return b""
        data = queue.popleft()[1]
        while queue and queue[0][0] <= t_ns:
            data += queue.popleft()[1]
        self.due -= len(data)
        return data

    @property
    def next_ns(self) -> int | None:
        return self.queue[0][0] if self.queue else None


class SerialLine:
    """Both directions of the line. All methods take the present time and never look ahead of it."""

    def __init__(self, timed: bool, random: np.random.Generator) -> None:
        self.timed = timed
        """Bytes sent from now on take their time."""
        self._random = random
        self.noise = 0.0
        """Chance of one flipped bit in each byte."""
        self.on_reply: Callable[[int, bytes, int], None] | None = None
        """Called with what is on its way to the host: when its last byte arrives, the bytes, ns from byte to byte."""
        self._to_controller = _Direction()
        self._to_host = _Direction()

    def from_host(self, t_ns: int, data: bytes, byte_ns: int) -> None:
        """The host sends bytes at t_ns."""
        self._to_controller.send(t_ns, self._disturbed(data), byte_ns if self.timed else 0)

    def from_controller(self, t_ns: int, data: bytes, byte_ns: int) -> None:
        """The controller sends bytes at t_ns."""
        data, spacing_ns = self._disturbed(data), byte_ns if self.timed else 0
        arrival_ns = self._to_host.send(t_ns, data, spacing_ns)
        if data and self.on_reply is not None:
            self.on_reply(arrival_ns, data, spacing_ns)

    def at_controller(self, t_ns: int) -> bytes:
        """Take the bytes that have arrived at the controller by t_ns."""
        return self._to_controller.receive(t_ns)

    def at_host(self, t_ns: int) -> bytes:
        """Take the bytes that have arrived at the host by t_ns."""
        return self._to_host.receive(t_ns)

    @property
    def next_ns(self) -> int | None:
        """When the next byte arrives at the controller."""
        return self._to_controller.next_ns

    @property
    def next_reply_ns(self) -> int | None:
        """When the next byte arrives at the host."""
        return self._to_host.next_ns

    @property
    def replies_due(self) -> int:
        """Bytes on their way to the host."""
        return self._to_host.due

    @property
    def quiet_ns(self) -> int:
        """Time at which everything sent so far has arrived at the host."""
        return self._to_host.queue[-1][0] if self._to_host.queue else 0

    def _disturbed(self, data: bytes) -> bytes:
        if self.noise <= 0.0 or not data:
            return data
        hit = self._random.random(len(data)) < self.noise
        bit = self._random.integers(0, 8, len(data))
        return bytes(byte ^ (1 << int(b)) if h else byte for byte, h, b in zip(data, hit, bit, strict=True))
