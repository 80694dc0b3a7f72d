"""When the events of a scenario happen: at a time, or on a condition. Messages, outputs, states and positions are
reported here when they change; nothing is polled, so the result does not depend on the calls.

    at                      t, and again after `every`, `repeat` times in all
    when, of a message      each message with this beginning
    when, of a state        each time the state begins; one that holds at power-on must end first
    when, after an event    this long after each time that event happens

                 state   ___|~~~~~~~~~~|____|~~|_|~~~~~~~~~~
           happens       ^ (delay)        ^    too soon                  next: REARM_NS after the last time

An event with a condition happens once, `times` times, or `always`, on rising edges (wiring/9). A condition met again
within REARM_NS is ignored, so that a bouncing switch is one event and two events that trigger each other do not loop
endlessly.

At one instant the ends of lasting events (`for`) come first, then events in the order of the file.
"""

from __future__ import annotations

import heapq
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.wiring.event import ScenarioEvent
from isel_twin.wiring.when import Trigger

REARM_NS = 1 * MILLISECOND_NS  # time after which a condition can trigger again
_END = -1  # number of an end in place of an event's: sorts first


class Said(Protocol):
    """A message from a language."""

    @property
    def text(self) -> str:
        """As in a job file."""


class Decoder(Protocol):
    """Finds the messages in the bytes of both directions, such as a fresh `isel_twin.language.Language`."""

    def messages(self, data: bytes, sent: bool) -> Iterator[Said]:
        """Messages completed by these bytes."""


class _Raw:
    """Finds texts anywhere in the raw bytes of a controller without a language."""

    def __init__(self, texts: Sequence[tuple[str, bool]]) -> None:
        self._wanted = [(text, _bytes(text), sent) for text, sent in texts]
        self._tail = {True: b"", False: b""}
        self._keep = max(len(data) for _, data, _ in self._wanted) - 1

    def found(self, data: bytes, sent: bool) -> Iterator[str]:
        """Texts in the order in which they end."""
        before = self._tail[sent]
        stream = before + data
        self._tail[sent] = stream[len(stream) - self._keep :] if self._keep else b""
        for end in range(len(before) + 1, len(stream) + 1):
            yield from (text for text, wanted, by in self._wanted if by == sent and stream[:end].endswith(wanted))


class Schedule:
    """The events still to come. Times are ns of virtual time and never decrease."""

    def __init__(self, events: Sequence[ScenarioEvent] = (), decoder: Decoder | None = None) -> None:
        """events: those with a time are sorted by it. decoder: for messages, if the controller has a language."""
        self.events = tuple(events)
        self._due: list[tuple[int, int, int, ScenarioEvent, int]] = []
        """Heap of time, number in the file, sequence, event and its place here (_END: none)."""
        self._sequence = 0
        self._met: list[int] = []  # indices of events whose conditions were met at this instant
        self._happened = [0] * len(self.events)
        self._begun = [0] * len(self.events)
        self._armed_ns = [0] * len(self.events)
        # whether the condition of each holds; None: not known yet
        self._so: list[bool | None] = [None] * len(self.events)
        self._by_kind: dict[str, list[int]] = defaultdict(list)
        for place, event in enumerate(self.events):
            if event.when is None:
                self._push(event.at_ns, place)
            else:
                self._by_kind[event.when.kind].append(place)
        self.conditional = bool(self._by_kind)  # some wait for something
        self.of_states = bool(self._of("output") or self._of("input"))
        self.of_messages = bool(self._of("sent") or self._of("replied"))
        self.left = sum(event.times if event.when is None else 1 for event in self.events)
        """Events that have not happened; each repeat of one with a time counts."""
        self._decoder = decoder
        texts = [
            (self._condition(place).name, kind == "sent") for kind in ("sent", "replied") for place in self._of(kind)
        ]
        self._raw = _Raw(texts) if texts and decoder is None else None

    # Queries

    @property
    def next_ns(self) -> int | None:
        """When the next event is due; None if all that are left wait for a condition."""
        return self._due[0][0] if self._due else None

    @property
    def positions(self) -> tuple[Trigger, ...]:
        """Conditions of positions, in the numbering of `passed`."""
        return tuple(self._condition(place) for place in self._of("position"))

    def take(self, t_ns: int) -> ScenarioEvent | None:
        """Remove and return the next event due at t_ns; None if there is none."""
        for place in self._met:
            self._begin(place, t_ns)
        self._met.clear()
        if not self._due or self._due[0][0] > t_ns:
            return None
        at_ns, _, _, event, place = heapq.heappop(self._due)
        if place != _END:
            self._happens(place, event, at_ns)
        return event

    def end_later(self, t_ns: int, event: ScenarioEvent) -> None:
        """Let `event`, the end of another one, happen at t_ns."""
        self._sequence += 1
        heapq.heappush(self._due, (t_ns, _END, self._sequence, event, _END))

    # Reports; `take` follows at the same instant. The first report of a state is the one at power-on.

    def heard(self, data: bytes, sent: bool) -> None:
        """Take bytes that have arrived from the host (sent) or from the controller."""
        if not self.of_messages:
            return
        kind = "sent" if sent else "replied"
        if self._decoder is not None:
            texts = [message.text for message in self._decoder.messages(data, sent)]
        else:
            texts = [] if self._raw is None else list(self._raw.found(data, sent))
        for text in texts:
            self._met += [place for place in self._of(kind) if text.startswith(self._condition(place).name)]

    def collided(self, first: str, second: str) -> None:
        """Two bodies have met; a condition names one of them, both, or none."""
        for place in self._of("collision"):
            names = self._condition(place).name.split()
            if not names or {first, second}.issuperset(names):
                self._met.append(place)

    def passed(self, number: int, beyond: bool) -> None:
        self._becomes(self._of("position")[number], beyond)

    def look(self, so: Callable[[Trigger], bool]) -> None:
        """Take changes of outputs or inputs; `so` tells whether a condition of one holds now."""
        for place in self._of("output") + self._of("input"):
            self._becomes(place, so(self._condition(place)))

    # Inside

    def _of(self, kind: str) -> list[int]:
        return self._by_kind.get(kind, [])

    def _condition(self, place: int) -> Trigger:
        condition = self.events[place].when
        assert condition is not None
        return condition

    def _becomes(self, place: int, so: bool) -> None:
        if so and self._so[place] is False:
            self._met.append(place)
        self._so[place] = so

    def _begin(self, place: int, t_ns: int, later_ns: int = 0) -> None:
        event = self.events[place]
        if t_ns >= self._armed_ns[place] and (not event.times or self._begun[place] < event.times):
            self._begun[place] += 1
            self._armed_ns[place] = t_ns + REARM_NS
            self._push(t_ns + later_ns + event.delay_ns, place)

    def _happens(self, place: int, event: ScenarioEvent, at_ns: int) -> None:
        self._happened[place] += 1
        if event.when is None and self._happened[place] < event.times:
            self._push(at_ns + event.every_ns, place)
        if event.when is None or self._happened[place] == 1:
            self.left -= 1
        for other in self._of("after") if event.name else ():
            condition = self._condition(other)
            if condition.name == event.name:
                self._begin(other, at_ns, round(float(condition.value) * 1e9))

    def _push(self, t_ns: int, place: int) -> None:
        self._sequence += 1
        event = self.events[place]
        heapq.heappush(self._due, (t_ns, event.number, self._sequence, event, place))


def _bytes(text: str) -> bytes:
    return re.sub(r"<(\d{1,3})>", lambda found: chr(int(found[1]) % 256), text).encode("latin-1", "replace")
