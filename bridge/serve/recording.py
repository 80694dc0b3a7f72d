"""A served twin's recording, flushed often: a killed process loses only the last moment.

    the twin records itself (recordings/recording.py) --> gathered in memory --> flush: FLUSH_S after the first of it,
                                                                                 at once while virtual time stands

The twin records all operations itself; changes of its time (pause, speed, steps) are recorded here.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from contextlib import suppress

from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.server import Guest, Server
from isel_twin.recordings.recording import FileRecording

FLUSH_S = 0.5  # wall time for which what has been recorded stays in memory


class Freshness(Guest):
    """A guest of the server that flushes a recording every FLUSH_S, if there is anything new. While virtual time stands
    somebody looks at what was recorded up to there: it is flushed at once."""

    def __init__(self, recording: FileRecording) -> None:
        self._recording = recording
        self._server: Server | None = None
        self._since_s: float | None = None

    def attach(self, server: Server) -> None:
        self._server = server

    def watches(self) -> Iterable[FileWatch]:
        return ()

    def wait_s(self) -> float | None:
        if self._since_s is None:
            return None
        return max(0.0, self._since_s + FLUSH_S - time.monotonic())

    def look(self) -> None:
        now_s, since_s = time.monotonic(), self._since_s
        stands = self._server is not None and self._server.pacer.paused
        if not self._recording.unwritten or self._recording.writer.ended:
            self._since_s = None
        elif stands or (since_s is not None and now_s - since_s >= FLUSH_S):
            self._recording.flush()
            self._since_s = None
        elif since_s is None:
            self._since_s = now_s

    def close(self) -> None:
        self._recording.flush()


class TimeTap(WireTap):
    """Records changes of virtual time; the twin records the rest itself."""

    def __init__(self, recording: FileRecording) -> None:
        self._recording = recording

    def act(self, time_ns: int, text: str) -> None:
        with suppress(ValueError):
            request = json.loads(text)
            if isinstance(request, dict) and {"pause", "resume", "speed", "step"} & request.keys():
                self._recording.tell_time(text)
