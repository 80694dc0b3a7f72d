"""A served twin in a process of its own, for who needs one beside them."""

from __future__ import annotations

import json
import select
import signal
import subprocess
import sys
from typing import Any

from isel_twin.bridge.operate.client import ClientError

START_S = 120.0  # wall time in which a server must listen: it may have to compile first
STOP_S = 30.0


class Started:
    """`isel-twin serve` with these options, a free port for its host and one for control. info: what it prints. It ends
    with this process, also if that is killed.

    Raises ClientError if it does not start; why is on standard error by then.
    """

    def __init__(self, *options: str) -> None:
        call = [sys.executable, "-m", "isel_twin", "serve", *options]
        call += ["--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0", "--end-with-stdin"]
        self._process = subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], START_S)
        line = self._process.stdout.readline() if ready else ""
        if not line:
            self.stop()
            raise ClientError(f"the twin does not start: {' '.join(call[3:])}; its reason is on standard error")
        self.info: dict[str, Any] = json.loads(line)

    def stop(self) -> int:
        """End it, as SIGTERM does: recordings are finished. May be called again. Returns its exit code."""
        self._process.send_signal(signal.SIGTERM)
        try:
            code = self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        return code
