"""Page, scene and browsers: one port, in a thread of its own. Needs viser.

    GET /  /panel.css  /panel.js     the page                                    page/
    GET /recording                   what there is of the recording, if the server makes one
    GET /scene                       viser's client, which the page frames       of the package viser
    WebSocket /operate               requests of browsers, frames for them       JSON, one object a message
    WebSocket, any other path        the scene, in viser's own protocol

viser brings web server and thread. What it has no hook for is put round the function it serves with (`_Serving`): the
listening socket, which is bound before anything else starts, the page, and the gate. What it can do that nobody here
wants, to share a scene through a server of its makers, is taken out.

The gate: whoever does not name this server as his host, comes from a page of another origin, or lacks the token where
one is needed, gets 403 and a line that says why. On the loopback interface the host must be this computer by name or
number, or a page somewhere could have its own name point here. A browser is given the token by the link that `serve`
prints and keeps it in a cookie. A policy in the page keeps browsers from asking anybody else for anything.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import importlib.resources
import io
import ipaddress
import json
import logging
import socket
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import viser
import viser.infra._infra as viser_infra
import websockets
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from isel_twin.bridge.operate.control import ControlError
from isel_twin.bridge.operate.control_port import parse_request
from isel_twin.bridge.operate.panel.frame import COME, Asked, Frame
from isel_twin.bridge.operate.panel.scene import Poses, Trail, body_meshes
from isel_twin.bridge.operate.token import is_loopback, is_token
from isel_twin.bridge.serve.tcp import parse_address
from isel_twin.machine import Machine
from isel_twin.plant.model import load_model

log = logging.getLogger("isel_twin")
_quiet = logging.getLogger("isel_twin.panel.web")
_quiet.setLevel(logging.CRITICAL)  # whoever knocks in a strange way is answered, not written down

BROWSERS = 16
"""Pages open at once."""

UNANSWERED = 64
"""Requests of a browser that wait for their answers, or answers that it has not read; more is no page of ours."""

FAREWELL_S = 1.0
"""Longest wait for a browser that is let go to say so."""

MESSAGE_BYTES = 1 << 20
"""Longest message of a browser."""

FILE_BYTES = 1 << 28
"""Longest recording that goes through the page; all of it is in memory for a moment."""

HISTORY = 600
"""Frames whose plots a browser that comes later gets: half a minute of them."""

BAD_MM = 0.1
"""Deviation of the tool that is drawn red."""

TRAIL_M = 0.005
"""Thickness of the trail."""

TRAIL_FRAMES = 4
"""Frames from one growth of the trail to the next."""

LINES = 400
"""Messages of the line that it gets."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
"""What the page may load, and from whom: from here alone."""

SCENE_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' data: blob:; worker-src 'self' blob: data:; frame-ancestors 'self'; "
    "base-uri 'none'; form-action 'none'"
)
"""The same for viser's client, which is one file with everything in it, compressed."""

HIDDEN = "<style>[data-floating-window],.mantine-Notifications-root{display:none!important}</style>"
"""Of viser's client, what the page has itself."""

_Handler = Callable[[ServerConnection], Awaitable[None]]

_PLOTTED = ("time_s", "step_hz", "position_error_mm", "margin_now")


class Gate:
    """Who is let in; see the module."""

    def __init__(self, address: str, token: str | None) -> None:
        self._token = token
        self._local = is_loopback(address)
        self._cookie = f"panel_{parse_address(address)[1]}"

    def refusal(self, path: str, headers: Mapping[str, str]) -> str | None:
        """Why somebody is not let in; None: he is. Whatever the headers are, nothing is raised."""
        host = headers.get("Host", "")
        if self._local and not _is_this_computer(host):
            return "the host is not this computer"
        origin = headers.get("Origin")
        if origin is not None and origin != f"http://{host}":
            return "the page comes from another origin"
        if headers.get("Sec-Fetch-Site") in ("cross-site", "same-site") and headers.get("Sec-Fetch-Mode") != "navigate":
            return "the page comes from another origin"
        if not (is_token(self.given(path), self._token) or is_token(self._kept(headers), self._token)):
            return "the token is missing; open the link that serve has printed"
        return None

    def given(self, path: str) -> str | None:
        """The token in a link."""
        return parse_qs(urlsplit(path).query).get("token", [None])[0]

    def keep(self, path: str) -> str | None:
        """The cookie for a browser that has come with the token."""
        if self._token is None or not is_token(self.given(path), self._token):
            return None
        return f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"

    def _kept(self, headers: Mapping[str, str]) -> str | None:
        try:
            found = SimpleCookie(headers.get("Cookie", "")).get(self._cookie)
        except CookieError:
            return None
        return None if found is None else found.value


def _is_this_computer(host: str) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


class _Browser:
    """A page that is open: what it is still to be told. A frame that it was too slow for gives way to the next one."""

    def __init__(self) -> None:
        self.answers: deque[Mapping[str, Any]] = deque()
        self.asked = 0
        """Requests that have no answer yet."""
        self.frame: Frame | None = None
        self.lines: deque[Mapping[str, Any]] = deque(maxlen=LINES)
        self.plots: deque[list[Any]] = deque(maxlen=HISTORY)
        self.news = asyncio.Event()


class WebSite:
    """The panel's page (`isel_twin.bridge.operate.panel.guest.Site`)."""

    def __init__(
        self,
        listener: socket.socket,
        address: str,
        token: str | None,
        take: Callable[[Asked], None],
    ) -> None:
        """listener: bound and listening at `address`. take: is told, in another thread, what browsers want."""
        self._listener = listener
        self._gate = Gate(address, token)
        self._take = take
        self._viser: viser.ViserServer | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._browsers: dict[int, _Browser] = {}
        self._numbers = 0
        self._about: dict[str, Any] = {}
        self._plots: deque[list[Any]] = deque(maxlen=HISTORY)
        self._lines: deque[Mapping[str, Any]] = deque(maxlen=LINES)
        self._stage: _Stage | None = None
        self._files = _pages()
        self._recording: Path | None = None

    # Called by the server

    @property
    def watched(self) -> bool:
        """See Site."""
        return bool(self._browsers)

    def start(self, about: Mapping[str, Any], machine: Machine, recording: Path | None = None) -> None:
        """See Site."""
        self._recording = recording
        self._about = dict(about)
        with contextlib.redirect_stdout(io.StringIO()), _Serving(self):  # viser greets on the standard output
            self._viser = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self._viser.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]  # by a public server
        self._loop = self._viser._event_loop
        self._stage = _Stage(self._viser, machine)

    def show(self, frame: Frame) -> None:
        """See Site."""
        self._call(self._show, frame)

    def answer(self, client: int, answer: Mapping[str, Any]) -> None:
        """See Site."""
        self._call(self._answer, client, answer)

    def close(self) -> None:
        """See Site."""
        site, self._viser = self._viser, None
        if site is not None:
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
        plots = [frame[key] for key in _PLOTTED]
        self._plots.append(plots)
        for browser in self._browsers.values():
            browser.frame = frame
            browser.lines += lines
            browser.plots.append(plots)
            browser.news.set()
        if self._stage is not None:
            self._stage.show(frame)

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
                if browser.answers:
                    message["answers"] = list(browser.answers)
                    browser.answers.clear()
                if browser.frame is not None:
                    message["frame"], browser.frame = browser.frame, None
                if browser.lines:
                    message["lines"] = list(browser.lines)
                    browser.lines.clear()
                if browser.plots:
                    message["plots"] = list(browser.plots)
                    browser.plots.clear()
                if message:
                    await connection.send(_json(message))

    def respond(self, connection: ServerConnection, request: Request) -> Response | None:
        """What is asked for by GET; None: a WebSocket begins."""
        if (why := self._gate.refusal(request.path, request.headers)) is not None:
            return _response(http.HTTPStatus.FORBIDDEN, f"{why}\n".encode())
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        path = urlsplit(request.path).path
        if path == "/recording" and self._recording is not None:
            return _file(self._recording)
        found = self._files.get(path)
        if found is None:
            return _response(http.HTTPStatus.NOT_FOUND, b"there is no such page\n")
        kind, data = found
        response = _response(http.HTTPStatus.OK, data, kind, SCENE_POLICY if found is self._files["/scene"] else POLICY)
        if (cookie := self._gate.keep(request.path)) is not None:
            response.headers["Set-Cookie"] = cookie
        return response


class _Serving:
    """While it lasts, viser serves with what a site adds: socket, page, gate. Nobody else's websockets are touched."""

    def __init__(self, site: WebSite) -> None:
        self._site = site
        self._before = viser_infra.websockets

    def __enter__(self) -> None:
        viser_infra.websockets = self  # type: ignore[assignment]

    def __exit__(self, *_: object) -> None:
        viser_infra.websockets = self._before

    @property
    def asyncio(self) -> _Serving:
        """`websockets.asyncio`, and what is in it that viser calls."""
        return self

    @property
    def server(self) -> _Serving:
        """`websockets.asyncio.server`."""
        return self

    def __getattr__(self, name: str) -> Any:
        return getattr(self._before, name)

    def serve(
        self, scene: Callable[[ServerConnection], Awaitable[None]], _host: str, _port: int, **options: Any
    ) -> Any:
        """`websockets.asyncio.server.serve`, as viser calls it."""
        site = self._site

        async def handle(connection: ServerConnection) -> None:
            assert connection.request is not None
            own = urlsplit(connection.request.path).path == "/operate"
            await (site.serve(connection) if own else scene(connection))

        options |= {
            "process_request": site.respond,
            "max_size": MESSAGE_BYTES,
            "close_timeout": FAREWELL_S,
            "logger": _quiet,
        }
        return websockets.asyncio.server.serve(handle, sock=site._listener, **options)


class _Stage:
    """The scene of viser: the machine where it is now, and the trail of its tool."""

    def __init__(self, server: viser.ViserServer, machine: Machine) -> None:
        model = load_model(machine)
        self._server = server
        self._poses = Poses(model, [axis.name for axis in machine.axes])
        self._trail = Trail(BAD_MM)
        self._pieces: dict[int, viser.LineSegmentsHandle] = {}
        self._grown, self._wait = False, 0
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        scene = server.scene
        scene.configure_default_lights(cast_shadow=False)
        scene.add_grid(
            "/floor",
            width=4.0,
            height=4.0,
            cell_size=0.1,
            section_size=0.5,
            cell_color=(228, 231, 236),
            section_color=(205, 211, 219),
        )
        start = self._poses.at([0.0] * len(machine.axes))
        self._frames = {name: scene.add_frame(f"/{name}", show_axes=False) for name in start if name}
        self._shown: dict[str, bytes] = {}
        for number, mesh in enumerate(body_meshes(model)):
            red, green, blue, alpha = mesh.rgba
            scene.add_mesh_simple(
                f"/{mesh.body}/{number}",
                mesh.vertices,
                mesh.faces,
                color=(red, green, blue),
                opacity=alpha if alpha < 1.0 else None,
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )
        self._look_from(model)

    def _look_from(self, model: Any) -> None:
        """Put the camera in front, looking at the middle of the machine."""
        centre, extent = np.array(model.stat.center), float(model.stat.extent)
        camera = self._server.initial_camera
        camera.look_at = tuple(centre.tolist())
        towards = np.array([-0.60, -0.86, 0.55])
        camera.position = tuple((centre + 1.22 * extent * towards).tolist())

    def show(self, frame: Frame) -> None:
        """Move everything to where it is."""
        poses = self._poses.at(frame["machine_position_mm"])
        deviation_mm = float(np.linalg.norm(frame["position_error_mm"]))
        with self._server.atomic():
            for name, handle in self._frames.items():
                pose = poses[name]
                if self._shown.get(name) != (place := pose.position.tobytes() + pose.wxyz.tobytes()):
                    self._shown[name] = place
                    handle.position, handle.wxyz = pose.position, pose.wxyz
            self._draw_trail(deviation_mm)

    def _draw_trail(self, deviation_mm: float) -> None:
        """Show the piece that grows: not in every frame, as all of it is sent, but before the next one begins."""
        if self._trail.full and self._grown:
            self._send_trail()
        self._grown = self._trail.add(self._poses.tool, deviation_mm) or self._grown
        self._wait -= 1
        if self._grown and self._wait <= 0:
            self._send_trail()

    def _send_trail(self) -> None:
        self._wait, self._grown = TRAIL_FRAMES, False
        points, colours = self._trail.segments
        if (handle := self._pieces.get(self._trail.piece)) is None:
            name = f"/{self._poses.table_body}/trail_{self._trail.piece}"
            handle = self._server.scene.add_line_segments(name, points, colours, thickness=TRAIL_M)
            self._pieces[self._trail.piece] = handle
        else:
            handle.points, handle.colors = points, colours


def _pages() -> dict[str, tuple[str, bytes]]:
    """Kind and content of what can be had by GET."""
    page = importlib.resources.files("isel_twin.bridge.operate.panel") / "page"
    client = importlib.resources.files("viser") / "client" / "build" / "index.html"
    scene = client.read_text(encoding="utf-8").replace("</head>", f"{HIDDEN}</head>", 1)
    html, style, script = "text/html; charset=utf-8", "text/css; charset=utf-8", "text/javascript; charset=utf-8"
    return {
        "/": (html, (page / "panel.html").read_bytes()),
        "/panel.css": (style, (page / "panel.css").read_bytes()),
        "/panel.js": (script, (page / "panel.js").read_bytes()),
        "/scene": (html, scene.encode()),
    }


def _response(
    status: http.HTTPStatus, data: bytes, kind: str = "text/plain; charset=utf-8", policy: str = POLICY
) -> Response:
    headers = Headers()
    headers["Content-Type"] = kind
    headers["Content-Length"] = str(len(data))
    headers["Content-Security-Policy"] = policy
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Referrer-Policy"] = "no-referrer"
    headers["Cross-Origin-Resource-Policy"] = "same-origin"
    headers["Cache-Control"] = "no-store"
    return Response(status.value, status.phrase, headers, data)


def _file(path: Path) -> Response:
    """What there is of a file that is being written."""
    try:
        if path.stat().st_size > FILE_BYTES:
            return _response(http.HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"{path} is too large: copy it there\n".encode())
        data = path.read_bytes()
    except OSError as error:
        return _response(http.HTTPStatus.NOT_FOUND, f"{path.name}: {error.strerror}\n".encode())
    response = _response(http.HTTPStatus.OK, data, "application/octet-stream")
    response.headers["Content-Disposition"] = "attachment"
    return response


def _json(message: Mapping[str, Any]) -> str:
    return json.dumps(message, allow_nan=False)
