"""Compares two recordings command by command, such as the twin's with the real controller's.

    A   @07 -> 0    @0R7 -> 0    @0A800,...       -> 0
        |  5 ms |      | 18.31 s |     | 0.42 s    |
    B   @07 -> 0    @0R7 -> 0    @0A800,...          -> 0       the same commands, at any time
        |  5 ms |      | 18.30 s |     | 0.48 s       |         duration: from the last byte of the command to that of
        the reply

A language (`isel_twin.language`) frames commands and replies. Replies come in the order of the commands that need one;
further bytes belong to the last command. Commands are matched like lines in a diff: those on one side only are listed,
the others are compared (judging.py says how). If both sides are twins, the counters at each reply are compared exactly,
too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher

import numpy as np

from isel_twin.language import Language, readable
from isel_twin.recordings.reading import Recorded, RecordingError

MOST_UNLIKE = 4000  # most commands that are matched like a text; longer stretches are compared in order


@dataclass(frozen=True)
class Exchange:
    """A command and its reply."""

    sent_ns: int  # when its last byte was sent
    command: bytes
    text: str
    explanation: str
    reply: bytes
    replied_ns: int | None  # when the last byte of the reply came; None: nothing came
    counts: tuple[int, ...] | None  # the controller's counters then; None if unknown
    meaning: str = ""  # the reply in words

    @property
    def duration_ns(self) -> int | None:
        return None if self.replied_ns is None else self.replied_ns - self.sent_ns


@dataclass(frozen=True)
class Pair:
    """The same command on both sides."""

    number: int  # of the command on side A, from 1
    a: Exchange
    b: Exchange

    @property
    def later_ns(self) -> int | None:
        """How much longer B took; None if one side has no reply."""
        a, b = self.a.duration_ns, self.b.duration_ns
        return None if a is None or b is None else b - a


@dataclass(frozen=True)
class Matched:
    """Two sessions laid over each other."""

    pairs: tuple[Pair, ...]
    only_a: tuple[Exchange, ...]
    only_b: tuple[Exchange, ...]

    @property
    def most(self) -> Pair | None:
        """The pair whose durations differ most."""
        timed = [pair for pair in self.pairs if pair.later_ns is not None]
        return max(timed, key=lambda pair: abs(pair.later_ns or 0), default=None)


def matched(side_a: Sequence[Exchange], side_b: Sequence[Exchange]) -> Matched:
    """Lay two sessions over each other."""
    pairs: list[Pair] = []
    only_a: list[Exchange] = []
    only_b: list[Exchange] = []
    for first_a, last_a, first_b, last_b, alike in _matched([e.command for e in side_a], [e.command for e in side_b]):
        if alike:
            both = zip(side_a[first_a:last_a], side_b[first_b:last_b], strict=True)
            pairs += [Pair(number, one, other) for number, (one, other) in enumerate(both, first_a + 1)]
        else:
            only_a += side_a[first_a:last_a]
            only_b += side_b[first_b:last_b]
    return Matched(tuple(pairs), tuple(only_a), tuple(only_b))


def _matched(a: Sequence[bytes], b: Sequence[bytes]) -> list[tuple[int, int, int, int, bool]]:
    """Stretches of both sides, in order: from and to in A, from and to in B, and whether the commands are equal."""
    head = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
    left = min(len(a), len(b)) - head
    back = zip(reversed(a), reversed(b), strict=False)
    tail = min(left, next((i for i, (x, y) in enumerate(back) if x != y), left))
    middle_a, middle_b = a[head : len(a) - tail], b[head : len(b) - tail]
    stretches = [(0, head, 0, head, True)]
    if max(len(middle_a), len(middle_b)) <= MOST_UNLIKE:
        at_a = at_b = 0
        for match in SequenceMatcher(None, middle_a, middle_b, autojunk=False).get_matching_blocks():
            stretches.append((head + at_a, head + match.a, head + at_b, head + match.b, False))
            at_a, at_b = match.a + match.size, match.b + match.size
            stretches.append((head + match.a, head + at_a, head + match.b, head + at_b, True))
    else:
        both = head + min(len(middle_a), len(middle_b))
        stretches += [(k, k + 1, k, k + 1, a[k] == b[k]) for k in range(head, both)]
        stretches.append((both, len(a) - tail, both, len(b) - tail, False))
    stretches.append((len(a) - tail, len(a), len(b) - tail, len(b), True))
    return [stretch for stretch in stretches if stretch[0] < stretch[1] or stretch[2] < stretch[3]]


def exchanges(recorded: Recorded, language: Language) -> list[Exchange]:
    """The commands of a recording, each with its reply. Raises RecordingError for messages without bytes."""
    found = paired(traffic(recorded), language)
    if not recorded.of_twin:
        return found
    counters = Counters(recorded)
    return [
        exchange if exchange.replied_ns is None else replace(exchange, counts=counters.at(exchange.replied_ns))
        for exchange in found
    ]


def paired(pieces: Iterable[tuple[int, bytes, bool, int]], language: Language) -> list[Exchange]:
    """The commands in pieces of `traffic`, each with its reply, without counters."""
    sent: list[tuple[int, bytes, str, str]] = []
    replies: list[list[tuple[int, bytes, str]]] = []
    waiting: list[int] = []
    for time_ns, data, by_host, byte_ns in pieces:
        left = len(data)
        for message in language.messages(data, by_host):
            left -= len(message.data)
            if by_host:
                if not language.accepted(message.data, b""):
                    waiting.append(len(sent))
                sent.append((time_ns, message.data, message.text or readable(message.data), message.explanation))
                replies.append([])
            elif replies:
                came_ns = time_ns - max(left, 0) * byte_ns
                replies[waiting.pop(0) if waiting else -1].append((came_ns, message.data, message.explanation))
    return [
        Exchange(
            *command,
            b"".join(data for _, data, _ in came),
            came[-1][0] if came else None,
            None,
            "; ".join(words for _, _, words in came),
        )
        for command, came in zip(sent, replies, strict=True)
    ]


def traffic(recorded: Recorded) -> list[tuple[int, bytes, bool, int]]:
    """Time, bytes, from the host or not, ns a byte: in the order of the last bytes, without those that never
    arrived."""
    lost = {(entry.time_ns, recorded.data(entry)) for entry in recorded.of("/host/lost")}
    found = []
    for entry in recorded.of("/host/sent", "/host/received"):
        data, byte_ns = recorded.data(entry), int(entry.content.get("byte_ns", 0))
        by_host = entry.channel == "/host/sent"
        if by_host or not lost:
            found.append((entry.time_ns, data, by_host, byte_ns))
        elif byte_ns:
            times = range(entry.time_ns - (len(data) - 1) * byte_ns, entry.time_ns + 1, byte_ns)
            bytewise = [(time_ns, bytes([byte])) for time_ns, byte in zip(times, data, strict=True)]
            found += [(time_ns, byte, False, 0) for time_ns, byte in bytewise if (time_ns, byte) not in lost]
        elif (entry.time_ns, data) not in lost:
            found.append((entry.time_ns, data, False, 0))
    return sorted(found, key=lambda piece: piece[0])


class Counters:
    """The controller's counters at any time of a twin's recording: the last setting plus the ticks since."""

    def __init__(self, recorded: Recorded) -> None:
        """Raises RecordingError if /runs is damaged."""
        self._motions = recorded.steps().motions
        self._starts = np.array([motion.start_ns for motion in self._motions], dtype=np.int64)
        made = [motion.displacement(motion.end_ns) for motion in self._motions]
        self._before = np.zeros((len(made) + 1, recorded.axes), dtype=np.int64)
        if made:
            self._before[1:] = np.cumsum(np.array(made, dtype=np.int64), axis=0)
        self._offsets: list[tuple[int, tuple[int, ...]]] = [(-1, (0,) * recorded.axes)]
        for entry in recorded.of("/counters"):
            try:
                axis, value = int(entry.content["axis"]), int(entry.content["value"])
                offset = list(self._offsets[-1][1])
                offset[axis] = value - self._total(entry.time_ns)[axis]
            except (KeyError, TypeError, ValueError, IndexError):
                raise RecordingError(f"{recorded.path}: /counters at {entry.time_ns} ns says nothing") from None
            self._offsets.append((entry.time_ns, tuple(offset)))
        self._offset_times = np.array([time_ns for time_ns, _ in self._offsets], dtype=np.int64)

    def at(self, time_ns: int) -> tuple[int, ...]:
        index = int(self._offset_times.searchsorted(time_ns, side="right")) - 1
        return tuple(n + o for n, o in zip(self._total(time_ns), self._offsets[index][1], strict=True))

    def _total(self, time_ns: int) -> list[int]:
        """All ticks made by then, of each axis."""
        index = int(self._starts.searchsorted(time_ns, side="right"))
        total = [int(n) for n in self._before[max(index - 1, 0)]]
        if index:
            total = [n + d for n, d in zip(total, self._motions[index - 1].displacement(time_ns), strict=True)]
        return total
