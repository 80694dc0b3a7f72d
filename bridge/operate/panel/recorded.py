"""A recording in a browser: its page (report/playback.py), behind the gate of the panel.

It needs nothing but Python's own server: the page holds everything, and asks for nothing more.
"""

from __future__ import annotations

import http
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from isel_twin.bridge.operate.panel.gate import Gate
from isel_twin.bridge.operate.token import token_for
from isel_twin.bridge.serve.tcp import listen, parse_address

SHOWN_BYTES = 64_000_000  # longest page of a recording that is not handed on
HEADERS = {  # the page says itself which scripts and styles may act
    "Content-Security-Policy": "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class RecordedSite(ThreadingHTTPServer):
    """Serves one page at / by `serve_forever`. Raises ValueError for a bad address, OSError for a taken one."""

    daemon_threads = True

    def __init__(self, address: str, page: str, token: str | None = None) -> None:
        """token: needed by browsers; None: none on the loopback interface, elsewhere a random one."""
        listener, self.address = listen(address)
        listener.setblocking(True)
        self.token = token_for(self.address, token)
        self.gate, self.page = Gate(self.address, self.token), page.encode()
        super().__init__(parse_address(self.address), _Handler, bind_and_activate=False)
        self.socket.close()
        self.socket = listener

    @property
    def url(self) -> str:
        return f"http://{self.address}/" + (f"?token={self.token}" if self.token else "")


class _Handler(BaseHTTPRequestHandler):
    server: RecordedSite
    timeout = 60.0  # wall seconds for a request

    def do_GET(self) -> None:
        gate = self.server.gate
        if (why := gate.refusal(self.path, dict(self.headers.items()))) is not None:
            self._answer(http.HTTPStatus.FORBIDDEN, f"{why}\n".encode(), "text/plain; charset=utf-8")
        elif urlsplit(self.path).path != "/":
            self._answer(http.HTTPStatus.NOT_FOUND, b"there is no such page\n", "text/plain; charset=utf-8")
        else:
            cookie = gate.keep(self.path)
            more = {} if cookie is None else {"Set-Cookie": cookie}
            self._answer(http.HTTPStatus.OK, self.server.page, "text/html; charset=utf-8", more)

    def _answer(self, status: http.HTTPStatus, data: bytes, kind: str, more: dict[str, str] | None = None) -> None:
        self.send_response(status)
        words = {"Content-Type": kind, "Content-Length": str(len(data)), **HEADERS, **(more or {})}
        for name, value in words.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: Any) -> None:
        """Nothing is logged: who looks at a recording changes nothing."""
