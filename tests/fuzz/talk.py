"""Who talks to the product: an editor (LSP), an agent and a state (SHDR), another control (rows), a control client."""

from __future__ import annotations

import io
import json
import logging
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

from isel_twin.bridge.mtconnect import adapter
from isel_twin.bridge.mtconnect.items import ITEMS, devices, values
from isel_twin.bridge.pytest.kept import ServedTwin
from isel_twin.core.spec import TwinSpec
from tests.fuzz.mutate import either, in_turn, reshaped
from tests.fuzz.shown import HOSTILE, STEERS
from tests.fuzz.trial import Reader

JOB = "@07\n@0N7\n@0A1600,800,0,30,0,30,0,30\n"


# ---- an editor -------------------------------------------------------------------------------------------------------


def _session(_: Path) -> bytes:
    """All that an editor sends, as a list of JSON."""
    document = {"uri": "file:///job.txt"}
    start, end = {"line": 1, "character": 0}, {"line": 2, "character": 3}
    text = {**document, "languageId": "imc", "version": 1, "text": JOB}
    change = {"range": {"start": start, "end": end}, "text": "@0R1\n"}
    asked = [
        ("initialize", {"processId": None, "rootUri": None, "capabilities": {}}, 1),
        ("initialized", {}, None),
        ("textDocument/didOpen", {"textDocument": text}, None),
        ("textDocument/hover", {"textDocument": document, "position": {"line": 2, "character": 1}}, 2),
        ("textDocument/didChange", {"textDocument": {**document, "version": 2}, "contentChanges": [change]}, None),
        ("textDocument/inlayHint", {"textDocument": document, "range": {"start": start, "end": end}}, 3),
        ("textDocument/didSave", {"textDocument": document}, None),
        ("textDocument/didClose", {"textDocument": document}, None),
    ]
    told = [{"method": method, "params": params, **({"id": id_} if id_ else {})} for method, params, id_ in asked]
    return json.dumps([{"jsonrpc": "2.0", **one} for one in told]).encode()


def _framed(message: object) -> bytes:
    body = json.dumps(message).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(body), body)


def _edited(path: Path) -> None:
    """The server answers a question of its life's end, whatever came before."""
    from isel_twin.bridge.editor.server import JobServer

    data = path.read_bytes()
    try:
        messages = json.loads(data)
        sent = b"".join(map(_framed, messages if isinstance(messages, list) else [messages]))
    except ValueError:  # changed bytes go as they are
        sent = _framed({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}}) + data
    last = {"jsonrpc": "2.0", "id": 99, "method": "shutdown"}
    server = JobServer(options={"plant": "kinematic"})
    out = io.BytesIO()
    out.close = lambda: None  # type: ignore[method-assign]
    with _logged() as records:
        try:
            server.start_io(io.BytesIO(sent + _framed(last) + _framed({"jsonrpc": "2.0", "method": "exit"})), out)
        except SystemExit:
            pass
        finally:
            server.end()
    for record in records:
        if record.exc_info and record.exc_info[2] is not None:
            _check_not_ours(record.exc_info[2], record)
    answers = _answers(out.getvalue())
    if not any(answer.get("id") == 99 for answer in answers):
        raise ValueError("the session ended before its end")


def _check_not_ours(trace: Any, record: logging.LogRecord) -> None:
    """The editor's mistakes are told by pygls; a traceback that passes through the package is ours."""
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        assert "bridge/editor" not in name, f"{record.getMessage()}: {record.exc_info[1]!r}"  # type: ignore[index]
        trace = trace.tb_next


def _answers(data: bytes) -> list[dict[str, Any]]:
    """The messages of the server, each in its frame."""
    found = []
    while data:
        head, _, data = data.partition(b"\r\n\r\n")
        length = int(re.findall(rb"Content-Length: (\d+)", head)[0])
        found.append(json.loads(data[:length]))
        data = data[length:]
    return found


@contextmanager
def _logged() -> Iterator[list[logging.LogRecord]]:
    records: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = records.append  # type: ignore[method-assign,assignment]
    root, before = logging.getLogger(), logging.getLogger().handlers
    root.handlers = [handler]
    try:
        yield records
    finally:
        root.handlers = before


# ---- an agent --------------------------------------------------------------------------------------------------------


def _machine_state(_: Path) -> bytes:
    """The answer of a control port to {"state": true}."""
    server = ServedTwin(TwinSpec(plant="kinematic").build(), "tcp", "max")
    try:
        return json.dumps(server.ask({"state": True})).encode()
    finally:
        server.stop()


def _texts_changed(data: bytes, seed: int) -> bytes:
    """Hostile words in the texts of a state, and texts where there were none."""
    draw, state = Random(seed), json.loads(data)
    words = "".join(draw.choice((*HOSTILE, "|", '"', "\\", "\n", "|Xact|9")) for _ in range(draw.randint(1, 3)))
    state[draw.choice(("fault_cause", "unfinished", "machine", "controller"))] = words
    state["fault"] = draw.random() < 0.5
    state["drive_faults"] = [[draw.randrange(3), draw.choice((words, ""))] for _ in range(3)]
    state["lost_steps"] = [draw.choice((0, 64, -7)) for _ in range(3)]
    return json.dumps(state).encode()


def _told_to_agents(path: Path) -> None:
    """Lines that an agent splits as the standard says, with the items of the machine and no others."""
    state = json.loads(path.read_bytes())
    told = adapter.lines(values(state), {}, "2026-11-22T12:00:00.123456Z")
    conditions = {item.key for item in ITEMS if item.category == "CONDITION"}
    for line in told:
        assert STEERS.search(line) is None, f"{line!r} has a character that steers"
        assert "\n" not in line
        stamp, *fields = split(line)
        assert stamp.startswith("2026-"), line
        if fields[0] in conditions:
            assert len(fields) == 6, line
            assert fields[1] in ("NORMAL", "FAULT", "UNAVAILABLE"), line
        else:
            assert set(fields[::2]) <= {item.key for item in ITEMS} - conditions, line
    ElementTree.fromstring(devices(state))


def split(line: str) -> list[str]:
    """Fields between bars; a quoted field may hold escaped ones."""
    fields = re.findall(r'(?:^|\|)("(?:\\.|[^"\\])*"|[^|]*)', line)
    return [re.sub(r"\\(.)", r"\1", one[1:-1]) if one.startswith('"') else one for one in fields]


def _agent(path: Path) -> None:
    """Each agent gets whole lines with PONG for each PING, and a stranger is dropped."""
    made = adapter.Adapter("127.0.0.1:0", dict)
    made._tell(dict.fromkeys(item.key for item in ITEMS))
    host, _, port = made.address.rpartition(":")
    try:
        with socket.create_connection((host, int(port)), timeout=5.0) as agent:
            made._wait(1.0)
            data = path.read_bytes()
            agent.sendall(data)
            agent.shutdown(socket.SHUT_WR)
            while made._agents:
                made._wait(1.0)
            told = b""
            try:
                while piece := agent.recv(65536):
                    told += piece
            except ConnectionResetError:  # a stranger, with bytes that nobody has read
                pass
        answers = [line for line in told.split(b"\n") if line.startswith(b"*")]
        assert set(answers) <= {b"* PONG 10000"}, told
        if not answers:
            raise ValueError("turned away")
    finally:
        made._listener.close()
        made._wake.close()


# ---- another control -------------------------------------------------------------------------------------------------

ROWS = b"""names
form led
tell encoder index
out power_request=1 stages=1 brake=1
set 0 0 0
row 1000000 10 0 0
row 1000000 20 5 0 spindle=1 spindle_speed=500
row 2000000 30 10 -5
go 5000 100 50 20
state
form steps
row 1000000 110 50 20
out stages=0
state
"""


def _rows(path: Path) -> None:
    """Each line is answered by one line, and time goes on."""
    twin = TwinSpec(controller="external", plant="kinematic").build()
    data = path.read_bytes()
    twin.write(data)
    twin.run_until_idle()
    *answers, rest = twin.read().split(b"\n")
    assert rest == b"", rest
    for answer in answers:
        assert re.fullmatch(rb"(ok \d+ [0-9a-f]+ [0-9a-f]+[ \d-]*|names [ -~]*|error [ -~]*)", answer), answer
    if answers and all(answer.startswith(b"error") for answer in answers):
        raise ValueError("all lines are errors")


TALK = (
    Reader("shdr.json", _machine_state, _told_to_agents, _texts_changed),
    Reader("lsp.json", _session, _edited, in_turn(either, *[reshaped] * 3), "ended before", 20),
    Reader("agent.bin", lambda _: b"* PING\r\n* PING\n* PONG 1\n* PING\n", _agent, either, "turned away", 60),
    Reader("rows.txt", lambda _: ROWS, _rows, either, "all lines"),
)
