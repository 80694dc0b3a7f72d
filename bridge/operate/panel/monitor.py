"""The traffic of the line for people: each message with time, direction and meaning.

    bytes as they go by --- kept, the last PIECES ---> lines() --- the controller's language ---> messages

Explaining bytes is slow, so it is done only when a browser looks; until then the last ones are kept, and lost ones are
counted (bridge/15).
"""

from __future__ import annotations

from collections import deque
from typing import Any

from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.serve.wire_log import WireLine, WireLog
from isel_twin.language import create_language

PIECES = 2000  # most pieces of bytes kept
LINES = 300  # messages shown at once, the last ones


class Monitor(WireTap):
    """Keeps the last of the traffic."""

    def __init__(self) -> None:
        self._pieces: deque[tuple[int, bytes | str, bool]] = deque()
        self._lost = 0
        self._now_ns = 0
        self._controller = ""
        self._begun: list[WireLine] = []
        self._log = WireLog(None, say=self._begun.append)

    def begin(self, controller: str) -> None:
        self._controller = controller
        self._log = WireLog(create_language(controller), say=self._begun.append)

    # As a tap

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        self._keep((time_ns, data, sent))

    def look(self, time_ns: int) -> None:
        self._now_ns = time_ns

    def act(self, time_ns: int, text: str) -> None:
        self._keep((time_ns, text, False))

    def _keep(self, piece: tuple[int, bytes | str, bool]) -> None:
        if len(self._pieces) >= PIECES:
            self._pieces.popleft()
            self._lost += 1
        self._pieces.append(piece)

    # For browsers

    def lines(self) -> list[dict[str, Any]]:
        """Messages since the last call, LINES at most: `s` (virtual time), `who` (host, twin, ctl), `text`, `means`."""
        lost, self._lost = self._lost, 0
        if lost:
            self.begin(self._controller)  # the beginning of the first message is lost
        for time_ns, data, sent in self._pieces:
            if isinstance(data, str):
                self._log.act(time_ns, data)
            else:
                self._log.carry(time_ns, data, sent)
        self._pieces.clear()
        self._log.look(self._now_ns)
        lines = [{"s": line.time_s, "who": line.who, "text": line.text, "means": line.meaning} for line in self._begun]
        self._begun.clear()
        if len(lines) > LINES:
            lost, lines = lost + len(lines) - LINES, lines[-LINES:]
        if lost:
            when = lines[0]["s"] if lines else self._now_ns / 1e9
            lines.insert(0, {"s": when, "who": "", "text": "", "means": f"{lost} messages before are not shown"})
        return lines
