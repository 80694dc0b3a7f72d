"""The adapter: lines of SHDR to every agent that connects, and the answer to its heartbeat.

    2026-11-22T12:00:00.123456Z|Xact|101.2500|exec|ACTIVE        samples and events that have changed
    2026-11-22T12:00:00.123456Z|Xpos|FAULT|Xpos|||x has lost 96 steps        a condition, alone on its line
    * PING  ->  * PONG 10000

A new agent gets everything once, then changes. Stamps are wall time: virtual time may go at any speed. The adapter
reads nothing but PING; whatever else an agent sends is dropped (bridge/28), and who does not begin with it is no agent
and is turned away (bridge/22).
"""

from __future__ import annotations

import datetime
import logging
import re
import selectors
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial

from isel_twin.base.printable import shown_line
from isel_twin.bridge.mtconnect.items import ITEMS, values
from isel_twin.bridge.operate.client import ClientError
from isel_twin.bridge.operate.conditions import State
from isel_twin.bridge.serve.loop import Wake, woken_by_signals
from isel_twin.bridge.serve.outbox import OUTBOX_BYTES, Outbox
from isel_twin.bridge.serve.tcp import keep_alive, listen
from isel_twin.language import readable

log = logging.getLogger("isel_twin")

UNAVAILABLE = "UNAVAILABLE"
HEARTBEAT_MS = 10_000
AGENTS = 16  # connections at once
LINE_BYTES = 4096  # most bytes of an agent without an end of line
GREETING = b"* PING"  # what an agent says first
SHOWN = 40  # bytes of a stranger in the log


def lines(now: Mapping[str, str | None], before: Mapping[str, str | None], stamp: str) -> list[str]:
    """Lines of SHDR for what differs from before. None: not available, a word that a fault may have for its cause."""
    changed = [item for item in ITEMS if item.key not in before or now[item.key] != before[item.key]]
    plain = [f"{item.key}|{_quoted(now[item.key])}" for item in changed if item.category != "CONDITION"]
    told = [f"{stamp}|{'|'.join(plain)}"] if plain else []
    for item in changed:
        if item.category == "CONDITION":
            text = now[item.key]
            if text is None:
                told.append(f"{stamp}|{item.key}|{UNAVAILABLE}||||")
            elif text:
                told.append(f"{stamp}|{item.key}|FAULT|{item.key}|||{_quoted(text)}")
            else:
                told.append(f"{stamp}|{item.key}|NORMAL||||")
    return told


def _quoted(text: str | None) -> str:
    """A value, in quotes if it has bars or quotes: there a backslash makes the next character plain. A line end in it
    would be the end of its line."""
    text = UNAVAILABLE if text is None else shown_line(text)
    return '"' + re.sub(r'([\\"|])', r"\\\1", text) + '"' if "|" in text or '"' in text else text


def _stamp() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


class _Agent:
    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.outbox = Outbox(connection.send)
        self.buffer = b""
        self.known = False  # has begun as an agent does


class Adapter:
    """Serves agents until the machine's server ends. Raises ValueError, OSError for an address as `listen`."""

    def __init__(self, address: str, state: Callable[[], State], interval_s: float = 0.1) -> None:
        """state: asks the machine for its state; raises ClientError once it has gone."""
        self._listener, self.address = listen(address)
        self._state, self._interval_s = state, interval_s
        self._agents: list[_Agent] = []
        self._known: Mapping[str, str | None] = {}
        self._stopped = False
        self._wake = Wake()

    def stop(self) -> None:
        """End `run` soon; for signal handlers."""
        self._stopped = True
        self._wake()

    def run(self) -> None:
        """Until `stop`, or until the machine has gone: the agents are told that nothing is available."""
        due_s = 0.0
        try:
            with woken_by_signals(self._wake):
                while not self._stopped:
                    if (now_s := time.monotonic()) >= due_s:
                        due_s = now_s + self._interval_s
                        self._tell(values(self._state()))
                    self._wait(max(0.0, due_s - time.monotonic()))
        except ClientError:
            pass
        finally:
            self._tell(dict.fromkeys(item.key for item in ITEMS))
            for agent in list(self._agents):
                self._drop(agent)
            self._listener.close()
            self._wake.close()

    def _tell(self, now: Mapping[str, str | None]) -> None:
        told = lines(now, self._known, _stamp())
        self._known = now
        for agent in list(self._agents):
            self._put(agent, told)

    def _wait(self, wait_s: float) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ, self._accept)
            selector.register(self._wake.watch.file, self._wake.watch.events, self._wake.watch.handler)
            for agent in self._agents:
                events = selectors.EVENT_READ | (selectors.EVENT_WRITE if agent.outbox else 0)
                selector.register(agent.connection, events, partial(self._serve, agent))
            for key, _ in selector.select(wait_s):
                key.data()

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return  # it has gone
        if len(self._agents) >= AGENTS:
            connection.close()
            return
        connection.setblocking(False)
        keep_alive(connection)
        agent = _Agent(connection)
        self._agents.append(agent)
        self._put(agent, lines(self._known, {}, _stamp()))

    def _serve(self, agent: _Agent) -> None:
        try:
            agent.outbox.flush()
            data = agent.connection.recv(LINE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(agent)
            return
        data = agent.buffer + data
        if not agent.known and data[: len(GREETING)] != GREETING[: len(data)]:
            log.warning("mtconnect: %s: no agent begins so, and it is turned away", readable(data[:SHOWN]))
            self._drop(agent)
            return
        agent.known = agent.known or data.startswith(GREETING)
        *whole, agent.buffer = data.split(b"\n")
        agent.buffer = agent.buffer[:LINE_BYTES]
        self._put(agent, [f"* PONG {HEARTBEAT_MS}" for line in whole if line.strip() == b"* PING"])

    def _put(self, agent: _Agent, told: Iterable[str]) -> None:
        """Send lines. An agent that leaves too much unread is dropped: it would miss some, and gets everything anew."""
        data = "".join(f"{line}\n" for line in told).encode()
        try:
            if len(agent.outbox) + len(data) > OUTBOX_BYTES:
                self._drop(agent)
            elif data:
                agent.outbox.put(data)
        except OSError:
            self._drop(agent)

    def _drop(self, agent: _Agent) -> None:
        if agent in self._agents:
            self._agents.remove(agent)
            agent.connection.close()
