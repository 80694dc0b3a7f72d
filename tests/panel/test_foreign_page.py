"""A page of somebody else, in a real browser, tries to move a machine that is served on this computer."""

from __future__ import annotations

import http.server
import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page

from isel_twin import Twin
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.tcp import TcpEndpoint
from tests.panel.conftest import LOOPBACK, WAIT_S

COMMANDS = r"\r@07\r@0A1600,800,0,30,0,30,0,30\r"
TRIES = {
    "a request": f"fetch(where, {{method: 'POST', mode: 'no-cors', body: '{COMMANDS}'}}).catch(() => 0)",
    "a beacon": f"navigator.sendBeacon(where, '{COMMANDS}')",
    "a socket": f"new WebSocket(where.replace('http', 'ws')).onopen = (opened) => opened.target.send('{COMMANDS}')",
    "an image": "new Image().src = where + '/@07'",
    "a form": f"""
        const [form, text, frame] = ['form', 'textarea', 'iframe'].map((name) => document.createElement(name));
        Object.assign(form, {{action: where, method: 'POST', enctype: 'text/plain', target: 'unseen'}});
        frame.name = 'unseen';
        text.name = text.value = '{COMMANDS}';
        form.append(text);
        document.body.append(frame, form);
        form.submit()""",
    **{
        f"the method {method}": f"fetch(where, {{method: '{method}', body: '{COMMANDS}'}}).catch(() => 0)"
        for method in ("patch", "PROPFIND", "x", "P1", "$HZXY")
    },
    "a stream of events": "new EventSource(where + '/@07')",
    "WebRTC": """
        const peer = new RTCPeerConnection({iceServers: [
            {urls: 'turn:' + where.replace('http://', '') + '?transport=tcp', username: '@07', credential: '@07'}]});
        peer.createDataChannel('moves');
        peer.createOffer().then((offer) => peer.setLocalDescription(offer))""",
    "WebRTC, framed": """
        const [here, there] = [new RTCPeerConnection(), new RTCPeerConnection()];
        here.createDataChannel('moves');
        here.createOffer().then((offer) => here.setLocalDescription(offer))
            .then(() => there.setRemoteDescription(here.localDescription))
            .then(() => there.createAnswer())
            .then((answer) => here.setRemoteDescription(answer))
            .then(() => here.addIceCandidate({sdpMid: '0', candidate: 'candidate:1 1 tcp 1518280447 '
                + where.replace('http://', '').replace(':', ' ') + ' typ host tcptype passive'}))""",
    "https": "fetch(where.replace('http', 'https'), {mode: 'no-cors'}).catch(() => 0)",
}


class _Foreign(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>cats</title>")

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(scope="module")
def page(chromium: Browser) -> Iterator[Page]:
    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Foreign)
    thread = threading.Thread(target=site.serve_forever)
    thread.start()
    with chromium.new_page() as page:
        page.goto(f"http://127.0.0.1:{site.server_port}/")
        yield page
    site.shutdown()
    thread.join(WAIT_S)
    site.server_close()


@contextmanager
def heard_at(endpoint: TcpEndpoint) -> Iterator[list[bytes]]:
    """What a machine that is served there hears; it must not move."""
    twin = Twin(plant="kinematic")
    heard: list[bytes] = []
    write = twin.write

    def hear(data: bytes) -> None:
        heard.append(data)
        write(data)

    twin.write = hear  # type: ignore[method-assign]
    server = Server(twin, Pacer(None), [endpoint])
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield heard
    finally:
        server.stop()
        thread.join(WAIT_S)
    assert twin.steps.made == 0


def strangers(caplog: pytest.LogCaptureFixture) -> int:
    return sum("no host begins so" in record.getMessage() for record in caplog.records)


@pytest.mark.parametrize("method", ["patch", "PROPFIND", "x", "P1", "$HZXY", "row"])
def test_a_page_that_was_loaded_from_the_ports_own_address_is_a_stranger(
    chromium: Browser, method: str, caplog
) -> None:
    """The browser asks nobody before it uses a method of any name, as page and port have one origin."""
    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Foreign)
    thread = threading.Thread(target=site.serve_forever)
    thread.start()
    with chromium.new_page() as page:
        page.goto(f"http://127.0.0.1:{site.server_port}/")
        site.shutdown()
        thread.join(WAIT_S)
        site.server_close()
        endpoint = TcpEndpoint(f"127.0.0.1:{site.server_port}")
        with caplog.at_level(logging.WARNING, "isel_twin"), heard_at(endpoint) as heard:
            page.evaluate(f"fetch('/', {{method: '{method}', body: '{COMMANDS}'}}).catch(() => 0)")
            end_s = time.monotonic() + WAIT_S
            while not strangers(caplog) and not heard and time.monotonic() < end_s:
                page.wait_for_timeout(100)
            assert (strangers(caplog) > 0, heard) == (True, [])


@pytest.mark.parametrize("kind", ["tcp", "rfc2217"])
def test_whatever_a_page_tries_the_machine_hears_nothing(page: Page, kind: str, caplog) -> None:
    endpoint = TcpEndpoint(LOOPBACK) if kind == "tcp" else TcpEndpoint(LOOPBACK, "rfc2217", Rfc2217Codec)
    with caplog.at_level(logging.WARNING, "isel_twin"), heard_at(endpoint) as heard:
        for name, script in TRIES.items():
            before, end_s = strangers(caplog), time.monotonic() + WAIT_S
            while strangers(caplog) == before and not heard and time.monotonic() < end_s:
                # again, as Chromium drops a connection on which Telnet greets before it has sent its request
                page.evaluate(f"(where) => {{ {script}; }}", f"http://{endpoint.address}")
                page.wait_for_timeout(500)
            assert (strangers(caplog) > before, heard) == (True, []), name
