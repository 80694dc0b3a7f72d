"""`isel-twin tap`: records the line between a real host and a real controller."""

from __future__ import annotations

import re
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.bridge.serve.endpoints import addresses, open_endpoints, ports
from isel_twin.cli.files import now_in_words
from isel_twin.cli.options import (
    RECORDING,
    ControllerName,
    Ptys,
    Replace,
    Rfc2217s,
    Tcps,
    Whole,
    check_writable,
    written,
)
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    from isel_twin.bridge.tap.tap import BookWriter
    from isel_twin.controller import SerialFormat

SWITCH_S = 0.0005  # Python's thread switch interval, so that bytes get their time stamps soon; the default is 5 ms


def tap(
    device: Annotated[
        str, Parameter(help="The controller's port: /dev/ttyUSB0, COM3, tcp://HOST:PORT, rfc2217://HOST:PORT.")
    ],
    *,
    controller: ControllerName = TwinSpec.controller,
    pty: Ptys = None,
    tcp: Tcps = None,
    rfc2217: Rfc2217s = None,
    baud: Annotated[
        Whole, Parameter(help="Speed of the controller's line in bit/s until the host sets another.")
    ] = 19_200,
    frame: Annotated[str, Parameter(help="Its data bits, parity and stop bits.")] = "8N1",
    record: Annotated[Path | None, written("FILE.mcap for both directions with their times.", RECORDING)] = None,
    replace: Replace = False,
    log: Annotated[
        Literal["events", "wire"], Parameter(help="events: who comes and goes. wire: every message, in words, too.")
    ] = "events",
) -> int:
    """Sit between a host program and a real controller: pass every byte on at once, record both directions.

    Prints one line of JSON with the addresses for the host once everything is open. Ends with Ctrl-C. Exit code 1 if
    bytes of the host went nowhere, as the controller's port was gone, or if the recording is not whole.
    """
    from isel_twin.bridge.serve.log import log_to
    from isel_twin.bridge.serve.loop import on_signals
    from isel_twin.bridge.serve.registry import registered
    from isel_twin.bridge.serve.wire_log import WireLog
    from isel_twin.bridge.tap.real_port import refusal
    from isel_twin.bridge.tap.tap import Tap
    from isel_twin.cli.outputs import say_json
    from isel_twin.cli.serve import file_number
    from isel_twin.language import create_language

    form = _format(baud, frame)
    _check(record, replace)
    with call_errors():
        language = create_language(controller)  # refuses an unknown name before anything is opened
    with ExitStack() as stack:
        if (stderr := file_number(sys.stderr)) is not None:
            stack.enter_context(log_to(stderr, count=log != "wire"))
        endpoints = open_endpoints(pty, tcp, rfc2217, stack)
        wire = WireLog(create_language(controller), "real", "port") if log == "wire" else None
        try:
            between = Tap(device, endpoints, form, wire, language)
        except (OSError, ValueError) as error:
            raise CallError(refusal(device, error)) from None
        stack.callback(between.close)
        stack.enter_context(on_signals(between.stop))
        writer = _book_writer(record, device, controller, form) if record is not None else None
        between.writer = writer
        who = {"tap": device, "controller": controller}
        stack.enter_context(registered({"command": "tap", **who, "ports": ports(endpoints)}))
        say_json({**addresses(endpoints), **who})
        whole = True
        sys.setswitchinterval(SWITCH_S)
        try:
            between.run()
        finally:
            if writer is not None:
                whole = writer.close()
        return 0 if whole and not between.lost_bytes else 1


def _format(baud: int, frame: str) -> SerialFormat:
    from isel_twin.controller import SerialFormat

    if not 0 < baud <= 10_000_000:
        raise CallError(f"baud {baud}: must be from 1 to 10000000 bit/s", option=True)
    if not (found := re.fullmatch(r"([5-8])([NEO])([12])", frame.upper())):
        raise CallError(f"frame {frame!r}: write data bits, parity (N, E, O), stop bits: 8N1, 7E1", option=True)
    parity = cast('Literal["N", "E", "O"]', found[2])
    return SerialFormat(baud, int(found[1]), parity, int(found[3]))


def _check(record: Path | None, replace: bool) -> None:
    """Check the file: a recording of a real machine cannot be made again, so none is replaced by mistake
    (bridge/10)."""
    if record is None:
        return
    if record.is_file() and not replace:
        raise CallError(f"{record}: exists already; choose another name, or add --replace")
    check_writable(record)


def _book_writer(record: Path, device: str, controller: str, form: SerialFormat) -> BookWriter:
    from isel_twin.bridge.tap.tap import BookWriter
    from isel_twin.language import create_language
    from isel_twin.recordings.mcap import RecordingWriter

    metadata = {"kind": "tap", "controller": controller, "device": device, "line": str(form), "began": now_in_words()}
    with call_errors(record):
        return BookWriter(RecordingWriter(record, metadata, language=create_language(controller)))
