"""Page, scene and browsers: one port, in a thread of its own. Needs viser.

    GET /  /panel.css  /*.js         the page                                    page/
    GET /recording                   the recording so far, if the server makes one
    GET /session                     the same as a page with a scope                report/playback.py
    GET /scene                       viser's client, which the page frames       of the package viser
    WebSocket /operate               requests of browsers, frames for them       JSON, one object a message
    WebSocket, any other path        the scene, in viser's own protocol

viser has web server and thread; guarded.py puts it behind the gate.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import io
import json
import socket
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.exceptions
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from isel_twin.bridge.operate.control import ControlError
from isel_twin.bridge.operate.control_port import parse_request
from isel_twin.bridge.operate.panel import guarded
from isel_twin.bridge.operate.panel.frame import COME, Asked, Frame
from isel_twin.bridge.operate.panel.gate import Gate
from isel_twin.bridge.operate.panel.pages import (
    POLICY,
    SCENE_POLICY,
    file_response,
    pages,
    response,
    session_response,
)
from isel_twin.bridge.operate.panel.view import MachineView
from isel_twin.machine import Machine

BROWSERS = 16  # pages open at once
UNANSWERED = 64  # most unanswered requests and unread answers of a browser; the page itself never has more
HISTORY = 600  # frames for the plots of a new browser: half a minute
LINES = 400  # messages of the line for a new browser


class _Browser:
    """An open page and what it must still get. A new frame replaces an unsent one."""

    def __init__(self) -> None:
        self.answers: deque[Mapping[str, Any]] = deque()
        self.asked = 0  # requests that have no answer yet
        self.frame: Frame | None = None
        self.lines: deque[Mapping[str, Any]] = deque(maxlen=LINES)
        self.plots: deque[list[Any]] = deque(maxlen=HISTORY)
        self.news = asyncio.Event()


class WebSite:
    """The panel's page (`guest.Site`)."""

    def __init__(self, listener: socket.socket, address: str, token: str | None, take: Callable[[Asked], None]) -> None:
        """listener: bound and listening at `address`. take: called with requests, in another thread."""
        self._listener, self._take = listener, take
        self._gate = Gate(address, token)
        self._viser: viser.ViserServer | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._browsers: dict[int, _Browser] = {}
        self._numbers = 0
        self._about: dict[str, Any] = {}
        self._plots: deque[list[Any]] = deque(maxlen=HISTORY)
        self._lines: deque[Mapping[str, Any]] = deque(maxlen=LINES)
        self._view: MachineView | None = None
        self._files = pages()
        self._recording: Path | None = None

    # Called by the server

    @property
    def watched(self) -> bool:
        return bool(self._browsers)

    def start(self, about: Mapping[str, Any], machine: Machine, recording: Path | None = None) -> None:
        self._recording = recording
        self._about = dict(about)
        self._viser, self._loop, self._hang_up = guarded.start(self._listener, self.respond, self.serve)
        self._view = MachineView(self._viser, machine)

    def show(self, frame: Frame) -> None:
        self._call(self._show, frame)

    def answer(self, client: int, answer: Mapping[str, Any]) -> None:
        self._call(self._answer, client, answer)

    def close(self) -> None:
        site, self._viser = self._viser, None
        if site is not None:
            self._call(self._hang_up)
            with contextlib.redirect_stdout(io.StringIO()):
                site.stop()
        self._listener.close()

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(function, *arguments)

    # In viser's thread

    def _show(self, frame: Frame) -> None:
        lines = frame.pop("lines")
        self._lines += lines
        plots = frame.pop("plot")
        self._plots.append(plots)
        for browser in self._browsers.values():
            browser.frame = frame
            browser.lines += lines
            browser.plots.append(plots)
            browser.news.set()
        if self._view is not None:
            self._view.show(frame)

    def _answer(self, client: int, answer: Mapping[str, Any]) -> None:
        if (browser := self._browsers.get(client)) is not None:
            browser.asked -= 1
            browser.answers.append(answer)
            browser.news.set()

    async def serve(self, connection: ServerConnection) -> None:
        """A browser at /operate."""
        if len(self._browsers) >= BROWSERS:
            await connection.close(1013, f"the panel is open {BROWSERS} times already; close one of them")
            return
        self._numbers += 1
        number, browser = self._numbers, _Browser()
        browser.lines += self._lines
        browser.plots += self._plots
        browser.news.set()
        self._browsers[number] = browser
        self._take(Asked(number, COME))
        telling = asyncio.create_task(self._tell(connection, browser))
        try:
            async for text in connection:
                if browser.asked + len(browser.answers) >= UNANSWERED:
                    await connection.close(1008, f"more than {UNANSWERED} requests at once")
                    break
                browser.asked += 1
                self._hear(number, text)
        except websockets.exceptions.ConnectionClosed:
            pass
        finally:
            del self._browsers[number]
            telling.cancel()
            self._take(Asked(number, None))

    def _hear(self, number: int, text: str | bytes) -> None:
        try:
            request = parse_request(text.encode() if isinstance(text, str) else text)
        except ControlError as error:
            self._answer(number, {"id": None, "error": str(error)})
            return
        self._take(Asked(number, request))

    async def _tell(self, connection: ServerConnection, browser: _Browser) -> None:
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            await connection.send(_json({"about": self._about}))
            while True:
                await browser.news.wait()
                browser.news.clear()
                message: dict[str, Any] = {}
                if browser.frame is not None:
                    message["frame"], browser.frame = browser.frame, None
                for name in ("answers", "lines", "plots"):
                    if queue := getattr(browser, name):
                        message[name] = list(queue)
                        queue.clear()
                if message:
                    await connection.send(_json(message))

    def respond(
        self, connection: ServerConnection, request: Request
    ) -> Response | Coroutine[Any, Any, Response] | None:
        """The response to GET; None: a WebSocket begins."""
        if (why := self._gate.refusal(request.path, request.headers)) is not None:
            return response(http.HTTPStatus.FORBIDDEN, f"{why}\n".encode())
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        path = urlsplit(request.path).path
        if path == "/recording" and self._recording is not None:
            return file_response(self._recording)
        if path == "/session" and self._recording is not None:
            return asyncio.to_thread(session_response, self._recording)
        if path not in self._files:
            return response(http.HTTPStatus.NOT_FOUND, b"there is no such page\n")
        kind, data = self._files[path]
        answer = response(http.HTTPStatus.OK, data, kind, SCENE_POLICY if path == "/scene" else POLICY)
        if (cookie := self._gate.keep(request.path)) is not None:
            answer.headers["Set-Cookie"] = cookie
        return answer


def _json(message: Mapping[str, Any]) -> str:
    return json.dumps(message, allow_nan=False)
