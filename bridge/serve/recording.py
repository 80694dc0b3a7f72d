"""A served twin's recording, kept fresh on the disk: what is lost when the process is killed is the last moment only.

    the twin records itself (recordings/recording.py) --> gathered in memory --> flush, FLUSH_S after the first of it

What is done to the twin it records itself; what is done to its time (pause, speed, steps) is written down here.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from contextlib import suppress

from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.server import Guest
from isel_twin.recordings.recording import FileRecording

FLUSH_S = 0.5  # wall time for which what has been recorded stays in memory


class Freshness(Guest):
    """A guest of the server that hands a recording to the operating system every FLUSH_S, if there is anything."""

    def __init__(self, recording: FileRecording) -> None:
        self._recording = recording
        self._since_s: float | None = None

    def watches(self) -> Iterable[FileWatch]:
        return ()

    def wait_s(self) -> float | None:
        if self._since_s is None:
            return None
        return max(0.0, self._since_s + FLUSH_S - time.monotonic())

    def look(self) -> None:
        if not self._recording.unwritten or self._recording.writer.ended:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = time.monotonic()
        elif time.monotonic() - self._since_s >= FLUSH_S:
            self._recording.flush()
            self._since_s = None

    def close(self) -> None:
        self._recording.flush()


class TimeTap(WireTap):
    """Writes down what is done to virtual time; bytes and the rest the twin records itself."""

    def __init__(self, recording: FileRecording) -> None:
        self._recording = recording

    def act(self, time_ns: int, text: str) -> None:
        with suppress(ValueError):
            request = json.loads(text)
            if isinstance(request, dict) and {"pause", "resume", "speed", "step"} & request.keys():
                self._recording.tell_time(text)
