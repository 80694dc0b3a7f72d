"""`isel-twin serve`: a twin behind a serial port."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TextIO

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.bridge.serve.endpoints import addresses, open_endpoints, ports
from isel_twin.cli import options
from isel_twin.cli.files import RecordPath

if TYPE_CHECKING:
    from isel_twin.bridge.operate.control_port import ControlPort
    from isel_twin.bridge.operate.panel.guest import Panel
    from isel_twin.bridge.serve.borders import WireTap
    from isel_twin.bridge.serve.server import Guest

KEPT_MOTIONS = 1000  # motions that a server's record keeps for its panel; recordings have all
PANEL = "127.0.0.1:8217"  # default address of the panel


def serve(
    *,
    twin: options.TwinOptions = options.DEFAULT_TWIN,
    pty: options.Ptys = None,
    tcp: options.Tcps = None,
    rfc2217: options.Rfc2217s = None,
    control: Annotated[
        str | None, Parameter(help="HOST:PORT for clients that operate the machine, see `ctl`; port 0: a free one.")
    ] = None,
    panel: Annotated[
        str | None, Parameter(help="HOST:PORT for the operator panel, a page for browsers; alone: 127.0.0.1:8217.")
    ] = None,
    token_file: Annotated[
        Path | None,
        Parameter(help="Holds what clients and browsers have to know; beyond the loopback interface one is made up."),
    ] = None,
    speed: Annotated[str, Parameter(help="Times real time, or max: as fast as possible.")] = "1",
    strict_baud: Annotated[
        bool, Parameter(help="A host that sets another speed, parity or data bits is garbled, as on a real line.")
    ] = False,
    record: RecordPath = None,
    interval: options.Interval = 0.01,
    end_with_stdin: Annotated[
        bool,
        Parameter(help="End when standard input, a pipe, does: with the program that has started it."),
    ] = False,
    log: Annotated[
        Literal["events", "wire"], Parameter(help="events: who comes and goes. wire: every message, in words, too.")
    ] = "events",
) -> int:
    """Put a twin behind a serial port and let host programs drive it until it is told to stop (Ctrl-C).

    Prints one line of JSON with the addresses once everything listens. Logs go to stderr.
    """
    from isel_twin.bridge.serve.keeping import serve_and_keep
    from isel_twin.bridge.serve.log import log_to
    from isel_twin.bridge.serve.loop import on_signals
    from isel_twin.bridge.serve.pacing import Pacer, parse_speed
    from isel_twin.bridge.serve.recording import Freshness, TimeTap
    from isel_twin.bridge.serve.registry import registered
    from isel_twin.bridge.serve.server import Server
    from isel_twin.bridge.serve.wire_log import Taps, WireLog
    from isel_twin.cli.files import begin, keep, now_in_words
    from isel_twin.cli.outputs import say_json
    from isel_twin.language import create_language
    from isel_twin.native import core

    options.check_seconds("interval", interval, 1e-9)
    if token_file is not None and control is None and panel is None:
        raise CallError("token-file: goes with --control HOST:PORT or --panel", option=True)
    token = options.token(token_file)
    with call_errors():
        factor = parse_speed(speed)
    options.check_writable(record, kept=twin.files)
    call = twin.spec(line_speed=factor is not None)
    with ExitStack() as stack:
        if (stderr := file_number(sys.stderr)) is not None:
            stack.enter_context(log_to(stderr, count=log != "wire"))
        endpoints = open_endpoints(pty, tcp, rfc2217, stack)
        parent = _parent() if end_with_stdin else None
        port = _control_port(control, token, stack)
        page = _panel(panel, token, stack)
        served = call.build(keep_motions=KEPT_MOTIONS)
        said = {"speed": speed, "began": now_in_words()}
        recording = None if record is None else begin(record, served, interval, said, stack)
        if page is not None and recording is not None:
            page.recording = recording.path
        core.load()
        taps: list[WireTap] = [WireLog(create_language(twin.controller))] if log == "wire" else []
        taps += [] if page is None else [page.monitor]
        guests: list[Guest] = [guest for guest in (port, page, parent) if guest is not None]
        if recording is not None:
            taps.append(TimeTap(recording))
            guests.insert(0, Freshness(recording))  # before the page tells where time stands
        pacer, tapped = Pacer(factor, served.time_ns), Taps(taps) if taps else None
        server = Server(served, pacer, endpoints, tapped, guests, strict_baud)
        stack.enter_context(on_signals(server.stop))
        where = addresses(endpoints)
        if port is not None:
            where["control"] = port.address
            if port.token is not None and token is None:
                where["control_token"] = port.token
        if page is not None:
            where["panel"] = page.url
        who = {"machine": served.machine.name, "controller": twin.controller}
        stack.enter_context(registered({"command": "serve", **who, "ports": ports(endpoints)}))
        say_json({**where, **who})
        if record is None or recording is None:
            return serve_and_keep(server)
        if record.suffix.lower() == options.RECORDING:
            code = serve_and_keep(server)
            return code if recording.close() else 1
        return serve_and_keep(server, record, lambda path: keep(recording, path))


def _control_port(address: str | None, token: str | None, stack: ExitStack) -> ControlPort | None:
    if address is None:
        return None
    from isel_twin.bridge.operate.control_port import ControlPort

    with call_errors():
        port = ControlPort(address, token)
    stack.callback(port.close)
    return port


def _panel(address: str | None, token: str | None, stack: ExitStack) -> Panel | None:
    if address is None:
        return None
    from isel_twin.bridge.operate.panel.guest import Panel

    try:
        with call_errors():
            page = Panel(address or PANEL, token)
    except ImportError:
        raise CallError("panel needs viser: pip install 'isel-twin[panel]'", option=True) from None
    stack.callback(page.close)
    return page


def _parent() -> Guest:
    from isel_twin.bridge.serve.parent import Parent

    file = file_number(sys.stdin)
    if file is None:
        raise CallError("end-with-stdin: there is no standard input", option=True)
    with call_errors():
        return Parent(file)


def file_number(stream: TextIO) -> int | None:
    """File descriptor of a stream; None if it was replaced by an object without one."""
    try:
        return stream.fileno()
    except (OSError, ValueError):
        return None
