"""Waiting for words: a message of the host or of the controller, or a remark, that contains a text.

    Messages(twin).watch("replied", "error") -> Watch      met from the instant at which such a message is complete

A message is what the controller's language makes of the bytes, with its explanation: what `serve --log wire` and the
panel's log show. Upper and lower case are the same. A reply is complete with its last byte on the line, whoever reads.
"""

from __future__ import annotations

import weakref
from typing import Any

from isel_twin.core.twin import Twin
from isel_twin.language import create_language

KINDS = ("sent", "replied", "remark")


class Watch:
    """Waits for one text."""

    def __init__(self, twin: Twin, kind: str, text: str) -> None:
        self.kind, self._twin, self._text = kind, twin, text.lower()
        self._begun_ns = twin.time_ns
        self._first_ns: int | None = None

    def hear(self, text: str, time_ns: int) -> None:
        """A message that is complete at that time."""
        if self._first_ns is None and self._text in text.lower():
            self._first_ns = time_ns

    def met(self) -> bool:
        return self._first_ns is not None and self._first_ns <= self._twin.time_ns

    def look_ns(self) -> int:
        """When it will be met, if that is known; else a time that is over."""
        return self._begun_ns if self._first_ns is None else self._first_ns


class Messages:
    """Hears all that is said from now on."""

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._watches: weakref.WeakSet[Watch] = weakref.WeakSet()
        self._language = create_language(twin.controller_name)
        twin.listen(self._note)

    def watch(self, kind: str, text: str) -> Watch:
        watch = Watch(self._twin, kind, text)
        self._watches.add(watch)
        return watch

    def _note(self, time_ns: int, kind: str, what: Any) -> None:
        if kind == "remark":
            self._tell("remark", what, time_ns)
        elif kind == "restored":
            self._language = create_language(self._twin.controller_name)  # what had begun is no more
        elif kind == "sent":
            self._decode("sent", what, time_ns, 0)
        elif kind == "received":
            self._decode("replied", what.data, what.arrival_ns, what.byte_ns)

    def _decode(self, kind: str, data: bytes, arrival_ns: int, byte_ns: int) -> None:
        """Bytes whose last one is there at arrival_ns."""
        if self._language is None:
            return
        for i in range(len(data)):
            for message in self._language.messages(data[i : i + 1], kind == "sent"):
                self._tell(kind, f"{message.text} {message.explanation}", arrival_ns - (len(data) - 1 - i) * byte_ns)

    def _tell(self, kind: str, text: str, time_ns: int) -> None:
        for watch in self._watches:
            if watch.kind == kind:
                watch.hear(text, time_ns)
