"""viser's server behind the panel's own socket, pages and gate, so that nothing else of it is reachable.

    listener, bound before anything else starts  --> gate --> GET: the panel's pages
                                                        '---> WebSocket: /operate, or viser's scene

viser has no option for this: it opens its own port without access control. So, while it starts, the name `websockets`
in its module is replaced by a `_Front`, which changes one call. That name is private, and a later viser may not have
it. So the start ends with a test, without which there is no panel: viser must serve at the panel's port, and refuse a
foreign host or page there. Sharing a scene through viser's public server is disabled (bridge/13).
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import http.client
import io
import logging
import socket
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet

import viser
import viser.infra._infra as viser_infra
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response
from websockets.protocol import State

from isel_twin.base.errors import CallError

MESSAGE_BYTES = 1 << 20  # longest message of a browser
FAREWELL_S = 1.0  # longest wait for a browser's answer at closing
PROOF_S = 60.0  # longest wait for the panel's own server at its start
FOREIGN = "elsewhere.invalid"  # a host that cannot exist (RFC 2606)

_quiet = logging.getLogger("isel_twin.panel.web")
_quiet.setLevel(logging.CRITICAL)  # malformed requests are answered, not logged

Handler = Callable[[ServerConnection], Awaitable[None]]
Respond = Callable[[ServerConnection, Request], Response | Coroutine[Any, Any, Response] | None]


class UnguardedError(CallError):
    def __init__(self, why: str) -> None:
        super().__init__(
            f"panel: not started, as this viser ({viser.__version__}) cannot be guarded: {why}; "
            "pip install 'isel-twin[panel]' takes one that can",
            option=True,
        )


def start(
    listener: socket.socket, respond: Respond, operate: Handler
) -> tuple[viser.ViserServer, asyncio.AbstractEventLoop, Callable[[], None]]:
    """viser's server at `listener`, in a thread of its own; the loop in that thread; and what to call in it before the
    server is stopped, which otherwise waits for the requests of browsers that have opened connections in advance.

    respond: answers each request before a WebSocket begins; None lets it begin. operate: serves those at /operate.
    Raises UnguardedError if the test fails that `respond` controls all access.
    """
    front = _Front(listener, respond, operate)
    with contextlib.redirect_stdout(io.StringIO()):  # viser prints to the standard output
        with front:
            server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            if front.loop is None or server.get_port() != listener.getsockname()[1]:
                raise UnguardedError("it opens a port of its own")
            _prove(listener)
        except BaseException:
            server.stop()
            raise
    server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]  # by a public server
    return server, front.loop, front.hang_up


def _prove(listener: socket.socket) -> None:
    """Ask as a foreign host and as a foreign page, for the page and for a WebSocket; each must be refused."""
    socket_words = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "aXNlbC10d2luIHByb29mIQ==",
    }
    address, port = listener.getsockname()[:2]
    address = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(address, address)
    for words in ({}, socket_words):
        for foreign in ({"Host": FOREIGN}, {"Host": f"localhost:{port}", "Origin": f"http://{FOREIGN}"}):
            connection = http.client.HTTPConnection(address, port, timeout=PROOF_S)
            try:
                connection.request("GET", "/", headers=words | foreign)
                status = connection.getresponse().status
            except (OSError, http.client.HTTPException) as error:
                raise UnguardedError(f"its server does not answer ({error})") from None
            finally:
                connection.close()
            if status != http.HTTPStatus.FORBIDDEN:
                raise UnguardedError("it lets a foreign page in")


class _Front:
    """Replaces the package `websockets` inside viser while it starts; other users of it are not affected."""

    def __init__(self, listener: socket.socket, respond: Respond, operate: Handler) -> None:
        self._listener, self._respond, self._operate = listener, respond, operate
        self._real: Any = None
        self._connections: WeakSet[ServerConnection] = WeakSet()
        self.loop: asyncio.AbstractEventLoop | None = None  # viser's loop, once it serves

    def __enter__(self) -> None:
        try:
            self._real = viser_infra.websockets
        except AttributeError:
            raise UnguardedError("its server has no such door") from None
        viser_infra.websockets = self  # type: ignore[assignment]

    def __exit__(self, *_: object) -> None:
        viser_infra.websockets = self._real

    @property
    def asyncio(self) -> _Front:
        """`websockets.asyncio`, and its `server`."""
        return self

    server = asyncio

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)

    def serve(self, scene: Handler, _host: str, _port: int, **options: Any) -> Any:
        """`websockets.asyncio.server.serve`, as viser calls it."""
        self.loop = asyncio.get_running_loop()

        async def handle(connection: ServerConnection) -> None:
            assert connection.request is not None
            own = urlsplit(connection.request.path).path == "/operate"
            await (self._operate(connection) if own else scene(connection))

        def connection(*arguments: Any, **settings: Any) -> ServerConnection:
            made = ServerConnection(*arguments, **settings)
            self._connections.add(made)
            return made

        options |= {
            "create_connection": connection,
            "process_request": self._respond,
            "max_size": MESSAGE_BYTES,
            "close_timeout": FAREWELL_S,
            "logger": _quiet,
        }
        return websockets.asyncio.server.serve(handle, sock=self._listener, **options)

    def hang_up(self) -> None:
        """Close all connections that have asked for nothing, or wait for an answer."""
        for connection in list(self._connections):
            if connection.state is State.CONNECTING:
                connection.transport.abort()
