"""A page of somebody else, in a real browser, tries to reach a machine that is served on this computer.

    browser --- Front --- port of the product
                   '--- until it is rebound: the stranger's own site, so that the page has the port's own origin

Each way is tried from another origin, and from the port's own (a name that first led to the site, then to this
computer). It is seen to arrive: its bytes have come to the front and gone on. No line hears anything, and nobody but
the readers beside the machine asks it for anything.
"""

from __future__ import annotations

import asyncio
import json
import logging
import re
import subprocess
import threading
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from asyncua import Server

from isel_twin import Twin
from isel_twin.bridge.mtconnect.adapter import Adapter
from isel_twin.bridge.opcua.access import Readers, secure
from isel_twin.bridge.operate.client import Client
from isel_twin.bridge.operate.control import Operator
from isel_twin.bridge.operate.control_port import ControlPort
from isel_twin.bridge.operate.panel.guest import Panel
from isel_twin.bridge.serve.borders import Endpoint
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec
from isel_twin.bridge.serve.server import Guest
from isel_twin.bridge.serve.server import Server as LineServer
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from isel_twin.bridge.tap.tap import Tap
from isel_twin.controller import SerialFormat
from isel_twin.language import create_language
from tests.panel.chromium import ARGUMENTS, find_browser, find_firefox
from tests.panel.conftest import LOOPBACK, WAIT_S

pytestmark = pytest.mark.long(seconds=25)

NAME = "rebound.test"  # leads to this computer
CONTROLLERS = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo", "external": "4030"}
KEEP = ("panel", "opcua")  # ports that keep a connection after a request, or for seconds
METHODS = ["PUT", "DELETE", "PATCH", "patch", "PROPFIND", "x", "P1", "D", "L1", "row", "state", "$HZXY", "*"]
BODY = (  # what each port would carry out
    "\r@07\r@0A1600,800,0,30,0,30,0,30\r\r\n$HZXY\r\nL1,X4000,Y4000\1\r"
    "\x68\x05\x05\x68\xe0\x81\xee\0\0\x4f\x16"
    "\r\nP1\r\nN10 G1 X10\r\n#\r\n\4\r\n"
    '\nrow 1000000 7 0 0\nout power_request=1 stages=1\n\n{"set": {"estop": "pressed"}}\n\n* PING\n'
)
COOKIE = re.escape(bytes.fromhex("2112a442"))  # of STUN (RFC 8489, 5)
SCRIPTS = """
    const body = Uint8Array.from(BODY, (letter) => letter.charCodeAt(0));
    const request = (path, options) => fetch(where + path, {body, ...options}).catch(() => 0);
    const peer = (...servers) => new RTCPeerConnection({iceServers: servers.map(
        (kind) => ({urls: kind + where.split('/')[2] + '?transport=tcp', username: '@07', credential: '@07'}))});
    const gather = (one) => {
        one.createDataChannel('moves');
        return one.createOffer().then((offer) => one.setLocalDescription(offer));
    };
    const candidate = async (protocol) => {
        const [here, there] = [peer(), peer()];
        await gather(here);
        await there.setRemoteDescription(here.localDescription);
        await here.setRemoteDescription(await there.createAnswer());
        await here.addIceCandidate({sdpMid: '0', candidate: 'candidate:1 1 ' + protocol + ' 1518280447 '
            + where.split('/')[2].replace(':', ' ').replace('NAME', '127.0.0.1') + ' typ host tcptype passive'});
    };
"""


@dataclass(frozen=True)
class Way:
    """script: in JavaScript; where: the origin of the port. evidence: of its bytes at the port."""

    script: str
    evidence: bytes
    own: bool = True  # tried from the port's own origin, too
    browsers: Sequence[str] = ("chromium", "firefox")


WAYS = {
    "a request": Way("request('/request', {method: 'POST', mode: 'no-cors'})", rb"POST /request "),
    "a request that asks first": Way("request('/asks', {method: 'row'})", rb"(OPTIONS|row) /asks "),
    "a beacon": Way("navigator.sendBeacon(where + '/beacon', body)", rb"POST /beacon "),
    "a socket": Way(
        "new WebSocket(where.replace('http', 'ws') + '/operate').onopen = (opened) => opened.target.send(body)",
        rb"GET /operate ",
    ),
    "an image": Way("new Image().src = where + '/image?@07'", rb"GET /image"),
    "a form": Way(
        """const [form, text, frame] = ['form', 'textarea', 'iframe'].map((name) => document.createElement(name));
        Object.assign(form, {action: where + '/form', method: 'POST', enctype: 'text/plain', target: where});
        frame.name = where;
        text.name = text.value = BODY;
        form.append(text);
        document.body.append(frame, form);
        form.submit()""",
        rb"POST /form ",
    ),
    "a stream of events": Way(
        "const events = new EventSource(where + '/events'); events.onerror = () => events.close()", rb"GET /events "
    ),
    "a frame": Way(
        "document.body.append(Object.assign(document.createElement('iframe'), {src: where + '/frame'}))",
        rb"GET /frame ",
    ),
    "https": Way("fetch(where.replace('http', 'https'), {mode: 'no-cors'}).catch(() => 0)", rb"\x16\x03", own=False),
    "a relay of WebRTC": Way("gather(peer('turn:'))", rb"\x00\x03.." + COOKIE, own=False),
    "a relay with TLS": Way("gather(peer('turns:'))", rb"\x16\x03", own=False, browsers=("chromium",)),
    "a candidate of WebRTC": Way("candidate('tcp')", rb"..\x00\x01.." + COOKIE, own=False, browsers=("chromium",)),
    "a candidate behind a greeting like TLS": Way(
        "candidate('ssltcp')", rb"\x80\x46\x01\x03\x01", own=False, browsers=("chromium",)
    ),
}
OWN = {
    "methods of any name": Way(  # one after the other, as a line takes one client; OPC UA keeps a connection for long
        f"""(async () => {{
            for (const method of {METHODS})
                await request('/own', {{method, signal: method === '*' ? null : AbortSignal.timeout(250)}})
        }})()""",
        rb"\* /own ",
    ),
    "a method and a header that are a frame": Way(
        """const head = Array.from(asked.head), end = 4 + 126, at = asked.head.indexOf('~~~~');
        const agent = [...'~'.repeat(200)];
        if (0 <= at && at <= end) {
            agent[end - at + 1] = '\\x16';
            const sum = head.slice(4, end).reduce((all, one) => all + one.charCodeAt(0), 0);
            agent[end - at] = String.fromCharCode(sum % 256);
        }
        request('/', {method: 'h~~h', headers: {'User-Agent': agent.join('')}})""",
        rb"h~~h / ",
    ),
}
SITE = f"""<!doctype html><title>cats</title><body><script>
const BODY = {json.dumps(BODY)};
const asked = {{}};
const attempt = (script, where) => (new Function('where', 'asked', 'BODY', `{SCRIPTS.replace("NAME", NAME)}` + script))(
    where, asked, BODY);
"""
FRAME = """
addEventListener('message', (message) => attempt(message.data, location.origin));
fetch('/', {method: 'h~~h', headers: {'User-Agent': '~'.repeat(200)}, body: 'x'.repeat(BODY.length)})
    .then((answer) => answer.text()).then((head) => { asked.head = head; parent.postMessage('ready', '*'); });
</script>"""
HEAD = """
const frames = PORTS.map((port) => {
    const frame = Object.assign(document.createElement('iframe'), {src: `http://NAME:${port}/`});
    document.body.append(frame);
    return frame;
});
let ready = 0;
addEventListener('message', () => { ready += 1; if (ready === PORTS.length) next('ready'); });
async function next(done) {
    for (;;) {
        const {script, own} = await (await fetch('/' + done)).json();
        done = 'next';
        PORTS.forEach((port, number) => own ? frames[number].contentWindow.postMessage(script, '*')
            : attempt(script, `http://127.0.0.1:${port}`));
    }
}
</script>"""


@dataclass
class Front:
    """A port for a browser: a site, then a relay to a port of the product."""

    name: str
    address: str
    keeps: bool = False
    port: int = 0
    rebound: bool = False
    came: list[bytes] = field(default_factory=list)
    open: set[asyncio.StreamWriter] = field(default_factory=set)  # to the product, which has not closed them

    def begin(self) -> None:
        """Let go of what is kept: a browser opens few connections at once."""
        self.came.clear()
        for writer in self.open if self.keeps else ():
            writer.transport.abort()

    async def listen(self) -> None:
        server = await asyncio.start_server(self._met, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]

    async def _met(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            if first := await reader.read(1 << 16):
                await (self._relay(first, reader, writer) if self.rebound else answer(first, SITE + FRAME, writer))
        writer.close()

    async def _relay(self, first: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, to = await asyncio.open_connection(*parse_address(self.address))
        self.open.add(to)
        to.write(first)
        self.came.append(first)
        onwards = asyncio.create_task(pump(reader, to))
        await pump(there, writer)
        onwards.cancel()
        to.close()
        self.open.remove(to)


async def pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(1 << 16):
            writer.write(data)
            await writer.drain()


async def answer(request: bytes, page: str, writer: asyncio.StreamWriter) -> None:
    """With the page; a method of one's own gets its own head back."""
    content = page.encode() if request.startswith(b"GET") else request
    kind = "text/html" if request.startswith(b"GET") else "text/plain; charset=latin-1"
    head = f"HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {len(content)}\r\nConnection: close\r\n\r\n"
    writer.write(head.encode() + content)
    await writer.drain()


class Stranger:
    """The site of the page, in a loop of its own. Raises nothing: what has come is in the fronts."""

    def __init__(self, fronts: Sequence[Front], heard: Mapping[str, list[Any]]) -> None:
        """heard: by the product; then nothing is waited for."""
        self.fronts, self._heard = fronts, heard
        self.loop = asyncio.new_event_loop()
        self._tries: asyncio.Queue[tuple[str, bool]] = asyncio.Queue()
        self.ready = threading.Event()
        self._thread = threading.Thread(target=self.loop.run_forever)
        self._thread.start()
        self.port = self.do(self._listen())

    def do(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(WAIT_S)

    async def _listen(self) -> int:
        for front in self.fronts:
            await front.listen()
        server = await asyncio.start_server(self._met, "127.0.0.1", 0)
        port: int = server.sockets[0].getsockname()[1]
        return port

    async def _met(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            request = await reader.read(1 << 16)
            if request.startswith((b"GET /ready", b"GET /next")):
                for front in self.fronts:
                    front.rebound = True
                self.ready.set()
                script, own = await self._tries.get()
                await answer(request, json.dumps({"script": script, "own": own}), writer)
            elif request:
                ports = json.dumps([front.port for front in self.fronts])
                await answer(request, SITE + HEAD.replace("PORTS", ports).replace("NAME", NAME), writer)
        writer.close()

    def attempt(self, way: Way, own: bool) -> list[str]:
        """Let the page try it at all ports; the names of those where it has not arrived."""
        return list(self.do(self._attempt(way, own)))

    async def _attempt(self, way: Way, own: bool) -> list[str]:
        for front in self.fronts:
            front.begin()
        await self._tries.put((way.script, own))
        evidence = re.compile(way.evidence, re.DOTALL)
        end_s = self.loop.time() + WAIT_S
        while missing := [
            front.name
            for front in self.fronts
            if not any(map(evidence.match, front.came)) or (front.open and not front.keeps)
        ]:
            if self.loop.time() > end_s or any(self._heard.values()):
                return missing
            await asyncio.sleep(0.01)
        return []

    def close(self) -> None:
        async def end() -> None:
            tasks = asyncio.all_tasks() - {asyncio.current_task()}
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        self.do(end())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(WAIT_S)
        self.loop.close()


@dataclass
class Product:
    """Its ports, and what has reached them."""

    ports: dict[str, str] = field(default_factory=dict)
    heard: dict[str, list[Any]] = field(default_factory=dict)
    twins: list[Twin] = field(default_factory=list)


@contextmanager
def in_thread(run: Callable[[], object], stop: Callable[[], object]) -> Iterator[None]:
    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop()
        thread.join(WAIT_S)
        assert not thread.is_alive()


def serve(product: Product, stack: ExitStack, controller: str, ends: Sequence[Endpoint], *guests: Guest) -> None:
    twin = Twin(CONTROLLERS[controller], controller, plant="kinematic")
    heard: list[Any] = product.heard.setdefault(controller, [])
    twin.write = heard.append
    server = LineServer(twin, Pacer(None), ends, guests=guests)
    product.twins.append(twin)
    stack.enter_context(in_thread(server.run, server.stop))


@contextmanager
def opcua_port(sessions: list[Any]) -> Iterator[str]:
    """The server as `isel_twin.bridge.opcua` has it, without the nodes of a machine, which take seconds to load."""
    loop = asyncio.new_event_loop()

    async def start() -> Server:
        server = Server(user_manager=Readers(None))
        await server.init()
        server.set_endpoint(f"opc.tcp://{LOOPBACK}/")
        await secure(server, None)
        internal: Any = server.iserver
        internal.create_session = lambda *session, **_: sessions.append(session)
        await server.start()
        return server

    server = loop.run_until_complete(start())
    with in_thread(loop.run_forever, lambda: loop.call_soon_threadsafe(loop.stop)):
        listening: Any = server.bserver
        yield "{}:{}".format(*listening._server.sockets[0].getsockname())
    loop.run_until_complete(server.stop())
    loop.close()


@pytest.fixture(scope="module")
def product() -> Iterator[Product]:
    """Every port that the product opens for others, in this process."""
    made = Product()
    with ExitStack() as stack, pytest.MonkeyPatch.context() as patch:
        asked = made.heard["operator"] = []
        ask = Operator.ask

        def listen_in(self: Operator, request: dict[str, Any]) -> Any:
            if request != {"state": True}:  # of the readers beside the machine
                asked.append(request)
            return ask(self, request)

        patch.setattr(Operator, "ask", listen_in)
        lines = {controller: TcpEndpoint(LOOPBACK) for controller in CONTROLLERS}
        terminals, taps = [PtyEndpoint(), PtyEndpoint()], [TcpEndpoint(LOOPBACK), TcpEndpoint(LOOPBACK)]
        telnet, control, panel = TcpEndpoint(LOOPBACK, "rfc2217", Rfc2217Codec), ControlPort(LOOPBACK), Panel(LOOPBACK)
        for controller, line in lines.items():
            if controller == "imc-s8":
                serve(made, stack, controller, [line, telnet, *terminals], control, panel)
            else:
                serve(made, stack, controller, [line])
        for terminal, end, language in zip(terminals, taps, (create_language("imc-s8"), None), strict=True):
            tap = Tap(terminal.address, [end], SerialFormat(19_200), language=language)
            stack.enter_context(in_thread(tap.run, tap.stop))
        client = stack.enter_context(Client(control.address))
        adapter = Adapter(LOOPBACK, lambda: client.ask({"state": True}))
        stack.enter_context(in_thread(adapter.run, adapter.stop))
        opcua = stack.enter_context(opcua_port(made.heard.setdefault("opcua", [])))
        made.ports = {controller: line.address for controller, line in lines.items()} | {
            "rfc2217": telnet.address,
            "tap": taps[0].address,
            "tap without a language": taps[1].address,
            "control": control.address,
            "panel": panel.address,
            "mtconnect": adapter.address,
            "opcua": opcua,
        }
        yield made


def command(browser: str, folder: Path) -> list[str]:
    """How it is started, without a profile of anybody."""
    if browser == "chromium":
        if (found := find_browser()) is None:
            pytest.skip("there is no Chromium or Chrome; `make browser` installs one")
        names = f"--host-resolver-rules=MAP {NAME} 127.0.0.1"
        return [found, *ARGUMENTS, "--headless", f"--user-data-dir={folder}", names]
    if (found := find_firefox()) is None:
        pytest.skip("there is no Firefox; `make browser` installs one")
    settings = {
        "network.dns.localDomains": NAME,
        "media.peerconnection.ice.loopback": True,
    }
    lines = (f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in settings.items())
    (folder / "user.js").write_text("".join(lines))
    return [found, "--headless", "--no-remote", "--profile", str(folder)]


@pytest.mark.parametrize("browser", ["chromium", "firefox"])
def test_whatever_a_page_tries_nothing_reaches_the_machine(
    browser: str, product: Product, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    call = command(browser, tmp_path)
    fronts = [Front(name, address, keeps=name in KEEP) for name, address in product.ports.items()]
    stranger = Stranger(fronts, product.heard)
    process = subprocess.Popen([*call, f"http://{NAME}:{stranger.port}/"], stderr=subprocess.DEVNULL)
    try:
        assert stranger.ready.wait(WAIT_S)
        with caplog.at_level(logging.CRITICAL, "isel_twin"):
            for own, ways in ((False, WAYS), (True, WAYS | OWN)):
                for name, way in ways.items():
                    if browser in way.browsers and (way.own or not own):
                        missing = stranger.attempt(way, own)
                        assert (name, own, [key for key, found in product.heard.items() if found]) == (name, own, [])
                        assert (name, own, missing) == (name, own, [])
        assert [twin.steps.made for twin in product.twins] == [0] * len(CONTROLLERS)
    finally:
        process.terminate()
        process.wait(WAIT_S)
        stranger.close()
