"""A client of the control port: one request, one answer.

    with Client("127.0.0.1:4002") as client:
        client.ask({"state": True})["position_mm"]

Used by `ctl`, and by everything that stands beside a served twin: Robot Framework, OPC UA, MTConnect.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Mapping
from typing import Any, Self

from isel_twin.base.parameters import parse_json
from isel_twin.bridge.operate.conditions import NEEDED

CONNECT_S = 10.0  # wall time for the server to accept the connection, and to answer behind the time of a wait
PATIENCE_S = 60.0  # default limit of a wait, in wall time


def _limit_s(request: Mapping[str, Any]) -> float | None:
    """Wall time within which an answer comes; None: a step of virtual time takes what it takes."""
    if "step" in request:
        return None
    wait = request.get("wait")
    patience = wait.get("wall_s", PATIENCE_S) if isinstance(wait, Mapping) else 0.0
    return CONNECT_S + (float(patience) if isinstance(patience, int | float) else 0.0)


class ClientError(Exception):
    """A request was refused, or there is no server; one line."""


class WaitError(ClientError):
    """What was waited for has not come in time."""


class Client:
    """A connection. Raises ClientError if there is no control port at the address HOST:PORT."""

    def __init__(self, address: str, token: str | None = None) -> None:
        host, _, port = address.rpartition(":")
        if not (port.isascii() and port.isdigit() and len(port) <= 5 and int(port) < 65_536):
            raise ClientError(f"address {address!r} is not HOST:PORT, what serve prints as control")
        self.address = address
        self._received = b""
        host = host.removeprefix("[").removesuffix("]") or "127.0.0.1"
        try:
            self._socket = socket.create_connection((host, int(port)), timeout=CONNECT_S)
        except TimeoutError:
            raise ClientError(f"{address}: does not answer") from None
        except OSError as error:
            raise ClientError(f"{address}: {error.strerror or error}; is there a serve --control?") from None
        if token is not None:
            self.ask({"token": token})

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to a request (bridge/operate/control.py). Raises ClientError with the server's reason."""
        try:
            self._socket.settimeout(_limit_s(request))
            self._socket.sendall(json.dumps(request).encode() + b"\n")
            line = self._line()
        except TimeoutError:
            raise ClientError(f"{self.address}: does not answer") from None
        except OSError as error:
            raise ClientError(f"{self.address}: {error.strerror or error}; is there a serve --control?") from None
        try:
            answer = parse_json(line)
            if not isinstance(answer, dict) or ("error" not in answer and not isinstance(answer.get("ok"), dict)):
                raise ValueError
        except ValueError:
            raise ClientError(f"{self.address}: is no control port; it answers {line[:40]!r}") from None
        if "error" in answer:
            text = str(answer["error"]).removeprefix("request: ")
            raise WaitError(text) if answer.get("timeout") else ClientError(text)
        return dict(answer["ok"])

    def state(self) -> dict[str, Any]:
        """The answer to {"state": true}. Raises ClientError also for one of another version, or of another program."""
        state = self.ask({"state": True})
        if lacking := sorted(NEEDED - state.keys()):
            raise ClientError(f"{self.address}: is served by another version, which does not say {', '.join(lacking)}")
        return state

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _line(self) -> bytes:
        while b"\n" not in self._received:
            try:
                piece = self._socket.recv(65_536)
            except ConnectionError:
                piece = b""
            if not piece:
                raise OSError("closes the connection without an answer")
            self._received += piece
        line, _, self._received = self._received.partition(b"\n")
        return line
