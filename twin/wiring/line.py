"""The serial line between host and controller, in virtual time.

With `timed` each byte takes `SerialFormat.byte_ns`, one after the other in each direction; without, bytes arrive at the
instant they are sent (for tests of logic, where the line does not matter; wiring/6). `bytes_ns` counts what they take,
timed or not.

    host sends  |b0|b1|b2|            at 19200 baud, 8N1: 520.833 us a byte
    arrives        b0 b1 b2           each at the end of its stop bit

A USB adapter between line and host hands on what has arrived on the beat of its timer, `beat_ns` (wiring/14).

Faults of each byte in both directions, with a chance each: a bit is flipped (`noise`), the byte is lost (`dropped`) or
comes twice (`doubled`). While the line is cut, bytes that would arrive are lost; those that arrive later are not.

A controller with a handshake may make its host wait: until it is clear to send again, bytes of that direction do not
move, cut or not.

Bytes that a controller only keeps until another one comes (`acting`) need not be taken when they arrive, but before
anything else happens after that: a command on a timed line is one event.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Set
from itertools import islice, takewhile
from typing import Final, NamedTuple

import numpy as np

from isel_twin.controller import KeepsBytes

LONGEST_RUN: Final = 128  # bytes after which one is taken to act, so that a look at what comes costs little


class LineFaults(NamedTuple):
    """Bytes of both directions that have not arrived as they were sent."""

    altered: int = 0
    lost: int = 0
    doubled: int = 0

    def since(self, before: LineFaults) -> LineFaults:
        """Faults that have come since there were so many."""
        return LineFaults(*(now - then for now, then in zip(self, before, strict=True)))

    def in_words(self) -> str:
        """In words; "" if all have arrived."""
        return ", ".join(f"bytes {what} on the line: {number}" for what, number in self._asdict().items() if number)


class _Direction:
    """One direction of the line: a queue of (arrival time, bytes that arrive then), and its number of bytes."""

    def __init__(self) -> None:
        self.queue: deque[tuple[int, bytes]] = deque()
        self.landed: deque[tuple[int, bytes]] = deque()  # arrived before the line was cut, not taken yet
        self.due = 0
        self._free_ns = 0
        self.held_ns: int | None = None  # since when the sender has to wait

    def hold(self, t_ns: int) -> None:
        if self.held_ns is None:
            self.held_ns = t_ns

    def release(self, t_ns: int) -> None:
        """End the wait of the sender; bytes on their way arrive later by the time of the wait."""
        if self.held_ns is None:
            return
        later, self.held_ns = t_ns - self.held_ns, None
        if later:
            self.queue = deque((arrival + later, data) for arrival, data in self.queue)
            self._free_ns += later if self.queue else 0

    def send(self, t_ns: int, data: bytes, byte_ns: int, at_once: int | None = None, beat_ns: int = 1) -> int:
        """Put bytes on the line, in pieces of at most at_once; return when the last of them arrives: on a beat."""
        arrival = max(t_ns if self.held_ns is None else self.held_ns, self._free_ns)
        size = 1 if byte_ns else at_once
        if size is not None:
            for at in range(0, len(data), size):
                arrival += byte_ns
                self.queue.append((-(-arrival // beat_ns) * beat_ns, data[at : at + size]))
        elif data:
            self.queue.append((arrival, data))
        self.due += len(data)
        self._free_ns = arrival
        return -(-arrival // beat_ns) * beat_ns

    def receive(self, t_ns: int, at_once: int | None = None) -> bytes:
        """Take at most at_once bytes of those that have arrived by t_ns."""
        pieces, size = [], 0
        while (queue := self.landed or self.queue) and queue[0][0] <= t_ns:
            if at_once is not None and size + len(queue[0][1]) > at_once:
                break
            pieces.append(queue.popleft()[1])
            size += len(pieces[-1])
        self.due -= size
        return b"".join(pieces)

    def land(self, t_ns: int) -> None:
        """Keep what has arrived by t_ns, so that a cut cannot lose it."""
        while self.queue and self.queue[0][0] <= t_ns:
            self.landed.append(self.queue.popleft())

    def lose(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Remove and return what arrives by t_ns."""
        lost = []
        while self.queue and self.queue[0][0] <= t_ns:
            lost.append(self.queue.popleft())
            self.due -= len(lost[-1][1])
        return lost

    def arrived(self, t_ns: int) -> int:
        """Bytes that have arrived by t_ns."""
        return sum(len(data) for _, data in takewhile(lambda one: one[0] <= t_ns, self.queue))

    def overtaken(self, t_ns: int) -> tuple[int, bytes]:
        """Take what has arrived before t_ns: when the last of it did, and the bytes."""
        pieces, at_ns = [], 0
        while not self.landed and self.queue and self.queue[0][0] < t_ns:
            at_ns, data = self.queue.popleft()
            pieces.append(data)
            self.due -= len(data)
        return at_ns, b"".join(pieces)

    @property
    def next_ns(self) -> int | None:
        return self.landed[0][0] if self.landed else self.queue[0][0] if self.queue else None

    def next_acting_ns(self, acting: Set[int]) -> int | None:
        """When the next byte of these arrives, or the last one of all or of many."""
        if self.landed or not self.queue:
            return self.next_ns
        run = list(islice(self.queue, LONGEST_RUN))
        return next((at_ns for at_ns, data in run if not acting.isdisjoint(data)), run[-1][0])


class SerialLine:
    """Both directions of the line. All methods take the present time and never look ahead of it."""

    def __init__(self, timed: bool, random: np.random.Generator, beat_ns: int = 0) -> None:
        self.timed = timed  # bytes sent from now on take the time of their bits
        self.bytes_ns = 0  # time that the bits of all bytes since power-on take, one after the other
        self._beat_ns = beat_ns
        self._random = random
        self.noise = 0.0  # chance of one flipped bit in each byte
        self.dropped = 0.0  # chance that a byte is lost
        self.doubled = 0.0  # chance that a byte comes twice
        self._chances = random.spawn(1)[0]  # only for these two, so that they do not change which bits a seed flips
        self.keeps: KeepsBytes | None = None
        """The controller, if it says which bytes have an effect on it when they arrive; None: any may."""
        self.is_cut = False
        self.faults = LineFaults()  # since power-on
        self.on_reply: Callable[[int, bytes, int], None] | None = None
        """Called with what is on its way to the host: when its last byte arrives, the bytes, ns from byte to byte."""
        self.on_lost: Callable[[int, bytes], None] | None = None
        """Called with what is lost on its way to the host, and when it would have arrived."""
        self._to_controller = _Direction()
        self._to_host = _Direction()

    def clear_to_send(self, t_ns: int, clear: bool) -> None:
        """From t_ns on the controller takes bytes, or makes its host wait."""
        if clear:
            self._to_controller.release(t_ns)
        else:
            self._to_controller.hold(t_ns)

    def from_host(self, t_ns: int, data: bytes, byte_ns: int, at_once: int | None = None) -> None:
        """The host sends bytes at t_ns; at_once: most bytes in one piece."""
        self.bytes_ns += len(data) * byte_ns
        self._to_controller.send(t_ns, self._disturbed(data), byte_ns if self.timed else 0, at_once)

    def from_controller(self, t_ns: int, data: bytes, byte_ns: int) -> None:
        self.bytes_ns += len(data) * byte_ns
        data, spacing_ns = self._disturbed(data), byte_ns if self.timed else 0
        beat_ns = self._beat_ns if self.timed else 0
        arrival_ns = self._to_host.send(t_ns, data, spacing_ns, beat_ns=beat_ns or 1)
        if data and self.on_reply is not None:
            self.on_reply(arrival_ns, data, 0 if beat_ns else spacing_ns)

    def at_controller(self, t_ns: int, at_once: int | None = None) -> bytes:
        """Take what has arrived at the controller by t_ns, at most at_once bytes; to be called at each `next_ns`."""
        if self.is_cut:
            self._lose(t_ns)
        if not self._to_controller.due or self._to_controller.held_ns is not None:
            return b""
        return self._to_controller.receive(t_ns, at_once)

    def at_host(self, t_ns: int) -> bytes:
        if self.is_cut:
            self._lose(t_ns)
        return self._to_host.receive(t_ns) if self._to_host.due else b""

    def miss(self, number: int) -> None:
        """Count bytes as lost that have arrived where nobody has supply to take them."""
        self._count(lost=number)

    def cut(self, t_ns: int, is_cut: bool) -> None:
        """Cut the line at t_ns, or join it again."""
        if is_cut and not self.is_cut:
            self._to_controller.land(t_ns)
            self._to_host.land(t_ns)
        elif self.is_cut and not is_cut:
            self._lose(t_ns)
        self.is_cut = is_cut

    def overtaken(self, t_ns: int) -> tuple[int, bytes]:
        """Take what has arrived at the controller before t_ns and was not taken then, because it acts on nothing: when
        the last of it did, and the bytes."""
        first_ns = self._to_controller.next_ns
        if first_ns is None or first_ns >= t_ns or self.is_cut or self._acting is None:
            return 0, b""
        return self._to_controller.overtaken(t_ns)

    @property
    def next_ns(self) -> int | None:
        """When the next byte that acts arrives at the controller, or any byte would without a cut."""
        line = self._to_controller
        held = line.held_ns is not None
        if self.is_cut:  # do not count replies that are lost
            directions = (self._to_host,) if held else (line, self._to_host)
            times = [direction.queue[0][0] for direction in directions if direction.queue]
            landed = () if held else line.landed
            return min((*times, *(time for time, _ in landed)), default=None)
        if held or not line.due:
            return None
        acting = self._acting
        return line.next_ns if acting is None else line.next_acting_ns(acting)

    @property
    def next_reply_ns(self) -> int | None:
        return self._to_host.next_ns

    @property
    def replies_due(self) -> int:
        """Bytes on their way to the host."""
        return self._to_host.due

    @property
    def commands_due(self) -> int:
        """Bytes that the controller has not taken, including those held back by the handshake."""
        return self._to_controller.due

    def commands_due_at(self, t_ns: int) -> int:
        """Those of them that have not arrived by t_ns, the present, or are held back."""
        taken = 0 if self._acting is None or self.is_cut else self._to_controller.arrived(t_ns)
        return self._to_controller.due - taken

    @property
    def quiet_ns(self) -> int:
        """Time at which everything sent so far has arrived at the host."""
        return self._to_host.queue[-1][0] if self._to_host.queue else 0

    @property
    def _acting(self) -> Set[int] | None:
        """Bytes that have an effect on the controller when they arrive, as far as is known now; None: any."""
        return None if self.keeps is None else self.keeps.acting_bytes

    def _lose(self, t_ns: int) -> None:
        if self._to_controller.held_ns is None:
            self._count(lost=sum(len(data) for _, data in self._to_controller.lose(t_ns)))
        for arrival_ns, data in self._to_host.lose(t_ns):
            self._count(lost=len(data))
            if self.on_lost is not None:
                self.on_lost(arrival_ns, data)

    def _count(self, altered: int = 0, lost: int = 0, doubled: int = 0) -> None:
        had = self.faults
        self.faults = LineFaults(had.altered + altered, had.lost + lost, had.doubled + doubled)

    def _disturbed(self, data: bytes) -> bytes:
        if self.noise > 0.0 and data:
            hit = self._random.random(len(data)) < self.noise
            bit = self._random.integers(0, 8, len(data))
            data = bytes(byte ^ (1 << int(b)) if h else byte for byte, h, b in zip(data, hit, bit, strict=True))
            self._count(altered=int(hit.sum()))
        if self.dropped <= 0.0 and self.doubled <= 0.0:
            return data
        chances = self._chances.random((len(data), 2)).tolist()
        times = [0 if lost < self.dropped else 2 if twice < self.doubled else 1 for lost, twice in chances]
        self._count(lost=times.count(0), doubled=times.count(2))
        return b"".join(bytes([byte]) * often for byte, often in zip(data, times, strict=True))
