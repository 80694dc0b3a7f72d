"""Responses to GET: the page, viser's client for the scene, the recording. A policy in each response forbids loading
from other servers.
"""

from __future__ import annotations

import http
import importlib.resources
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Response

from isel_twin.base.errors import one_line
from isel_twin.bridge.operate.panel.recorded import HEADERS, SHOWN_BYTES
from isel_twin.recordings.reading import read
from isel_twin.report.playback import playback_page

FILE_BYTES = 1 << 28  # longest recording for download; it is in memory as a whole

# Content-Security-Policy of the page: load from here only.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
# The same for viser's client, which is one file with everything in it, compressed.

SCENE_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' data: blob:; worker-src 'self' blob: data:; frame-ancestors 'self'; "
    "base-uri 'none'; form-action 'none'"
)
# Hides controls of viser's client that the page has itself.
HIDDEN = "<style>[data-floating-window],.mantine-Notifications-root{display:none!important}</style>"  # in /scene


def pages() -> dict[str, tuple[str, bytes]]:
    """Type and content of each path for GET."""
    page = importlib.resources.files("isel_twin.bridge.operate.panel") / "page"
    client = importlib.resources.files("viser") / "client" / "build" / "index.html"
    scene = client.read_text(encoding="utf-8").replace("</head>", f"{HIDDEN}</head>", 1)
    html, style, script = "text/html; charset=utf-8", "text/css; charset=utf-8", "text/javascript; charset=utf-8"
    return {
        "/": (html, (page / "panel.html").read_bytes()),
        "/panel.css": (style, (page / "panel.css").read_bytes()),
        "/panel.js": (script, (page / "panel.js").read_bytes()),
        "/desk.js": (script, (page / "desk.js").read_bytes()),
        "/trigger.js": (script, (page / "trigger.js").read_bytes()),
        "/scene": (html, scene.encode()),
    }


def response(
    status: http.HTTPStatus, data: bytes, kind: str = "text/plain; charset=utf-8", policy: str = POLICY
) -> Response:
    headers = {
        "Content-Type": kind,
        "Content-Length": str(len(data)),
        "Content-Security-Policy": policy,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
    return Response(status.value, status.phrase, Headers(headers), data)


def session_response(path: Path) -> Response:
    """The present content of a recording as a page (report/playback.py)."""
    try:
        page, _ = playback_page(read(path), SHOWN_BYTES)
    except (OSError, ValueError) as error:
        return response(http.HTTPStatus.CONFLICT, f"{one_line(str(error))}\n".encode())
    return response(http.HTTPStatus.OK, page.encode(), "text/html; charset=utf-8", HEADERS["Content-Security-Policy"])


def file_response(path: Path) -> Response:
    """The present content of a file that is being written."""
    try:
        if path.stat().st_size > FILE_BYTES:
            return response(http.HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"{path} is too large: copy it there\n".encode())
        data = path.read_bytes()
    except OSError as error:
        return response(http.HTTPStatus.NOT_FOUND, f"{path.name}: {error.strerror}\n".encode())
    answer = response(http.HTTPStatus.OK, data, "application/octet-stream")
    answer.headers["Content-Disposition"] = "attachment"
    return answer
