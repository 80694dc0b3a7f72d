"""A week of virtual time: a host that works, an open panel, a client of the control port, and all of it is recorded.

The host moves X to and fro and asks for the position; the others ask for the state of the machine now and then, and the
panel hears every frame. Memory is that of the server, looked at every virtual hour; the physics is compiled before, in
a server that goes again: the one that compiles keeps 65 MB of that.
"""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tests.reliability.figures import REPLY_S, Figure, ask, main, resident_mb, serving

NUMBER = 168
LIMIT_MB = 180.0
GROWTH_MB = 10.0
SPEED = "2000"
INTERVAL_S = "1"  # between two samples of the recording: 600 000 in a week
STEPS = 3200
ROUNDS = 20  # of the host, after which the others ask


class Control:
    """A client of the control port."""

    def __init__(self, address: str) -> None:
        host, port = address.rsplit(":", 1)
        self._socket = socket.create_connection((host, int(port)), REPLY_S)
        self._lines = self._socket.makefile("r", encoding="utf-8")

    def state(self) -> dict[str, Any]:
        self._socket.sendall(b'{"state": true}\n')
        answer: dict[str, Any] = json.loads(self._lines.readline())
        return answer["ok"]  # type: ignore[no-any-return]

    def close(self) -> None:
        self._lines.close()
        self._socket.close()


class Page:
    """What a page of the panel does: it hears everything."""

    def __init__(self, url: str) -> None:
        self._socket: ClientConnection = connect(f"ws://{urlsplit(url).netloc}/operate", max_size=None)
        self.frames = 0
        self.answers = 0
        self.asked = 0
        self._reader = threading.Thread(target=self._hear)
        self._reader.start()

    def _hear(self) -> None:
        try:
            for message in self._socket:
                content = json.loads(message)
                self.frames += "frame" in content
                self.answers += len(content.get("answers", ()))
        except ConnectionClosed:
            pass

    def ask(self) -> None:
        self.asked += 1
        self._socket.send(json.dumps({"id": self.asked, "ask": {"state": True}}))

    def close(self) -> None:
        self._socket.close()
        self._reader.join(REPLY_S)


def measure(number: int) -> list[Figure]:
    with serving():
        pass
    began = time.monotonic()
    memory_mb: list[float] = []
    moves = wrong = 0
    with TemporaryDirectory() as folder:
        file = Path(folder) / "week.mcap"
        ports = ("--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0", "--panel", "127.0.0.1:0")
        with (
            serving(*ports, "--record", str(file), "--interval", INTERVAL_S, speed=SPEED) as served,
            closing(Control(served.info["control"])) as control,
            closing(Page(served.info["panel"])) as page,
            served.open("tcp") as host,
        ):
            for command in ("@07", "@0R7"):
                wrong += ask(host, command) != "0"
            while len(memory_mb) < number:
                for _ in range(ROUNDS):
                    for steps in (STEPS, -STEPS):
                        wrong += ask(host, f"@0A{steps},4000,0,30,0,30,0,30") != "0"
                        wrong += ask(host, "@0P", 19) != f"0{max(steps, 0):06X}{0:012X}"
                        moves += 1
                page.ask()
                while control.state()["time_s"] >= 3600.0 * (len(memory_mb) + 1):
                    memory_mb.append(resident_mb(served.pid))
            page.ask()
            waited_s = time.monotonic()
            while page.answers < page.asked and time.monotonic() < waited_s + REPLY_S:
                time.sleep(0.01)
            heard, unanswered = page.frames, page.asked - page.answers
            recorded_mb = file.stat().st_size / 1e6
    settled_mb = memory_mb[len(memory_mb) // 10]
    return [
        Figure(f"most memory of the server in {number} virtual hours", max(memory_mb), "MB", LIMIT_MB),
        Figure("growth after the first tenth", max(0.0, memory_mb[-1] - settled_mb), "MB", GROWTH_MB),
        Figure(f"replies to {moves} moves and questions that were wrong", wrong, "", 0),
        Figure("questions of the panel without an answer", unanswered, "", 0),
        Figure("frames that the panel heard", heard, ""),
        Figure("size of the recording", recorded_mb, "MB"),
        Figure("computed in", (time.monotonic() - began) / 60.0, "min"),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
