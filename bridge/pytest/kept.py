"""The twins of tests, and the files that a failing test leaves. Passing tests cost almost nothing: of each twin only
the causes are kept, the bytes of the host and operations, with their times. When a test fails, another twin is built
from the same call, gets the same causes at the same times, behaves the same to the bit, and is recorded:

    causes  --- again ---> twin.mcap    isel-twin replay twin.mcap
                           twin.png     path and errors, where matplotlib is installed

A twin belongs to the node of pytest it was made for, and to all tests below it: a class, a module.
"""

from __future__ import annotations

import errno
import hashlib
import json
import re
import shlex
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.errors import CallError, one_line
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.core.journal import SETTINGS
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    import pytest

    from isel_twin.core.twin import Twin

INTERVAL_NS = 10 * MILLISECOND_NS  # from sample to sample of a recording
MOST_SAMPLES = 20_000  # for longer tests the interval is longer
STOP_S = 30.0  # wall time for a server to end, and to answer requests other than waits
NAME_CHARACTERS = 80  # of the name of a test, in the name of a folder


@dataclass(eq=False)
class _Kept:
    twin: Twin
    node: pytest.Item | pytest.Collector
    call: TwinSpec
    causes: list[tuple[int, str, Any]] = field(default_factory=list)
    restored: bool = False  # it was restored (`Twin.restore`): the causes do not determine its behaviour

    def note(self, time_ns: int, kind: str, what: Any) -> None:
        if kind in ("sent", "operated"):
            self.causes.append((time_ns, kind, what))
        elif kind == "restored":
            self.restored = True
            self.causes.clear()


def called(call: Mapping[str, Any], *, line_speed: bool = False) -> TwinSpec:
    """What the keys of a marker ask for."""
    names = {field.name for field in fields(TwinSpec)}
    known = {key: value for key, value in call.items() if key in names}
    known |= {key: Path(value) for key, value in known.items() if key == "scenario" and value is not None}
    known |= {key: str(value) for key, value in known.items() if key in ("machine", "controller", "plant")}
    return TwinSpec(**known, line_speed=line_speed)


def built(wanted: TwinSpec) -> Twin:
    """The twin. A wrong call fails the test with one line."""
    import pytest

    try:
        twin, wrong = wanted.build(), ""
    except (CallError, TypeError, AttributeError) as error:
        twin, wrong = None, one_line(str(error))
    if twin is None:  # outside of the `except`, which would add a traceback
        pytest.fail(f"twin: {wrong}", pytrace=False)
    return twin


class KeptTwins:
    """All twins of a session."""

    def __init__(self, folder: Path | None, temporary: Callable[[str], Path]) -> None:
        """folder: for files of failing tests; None: the temporary folder of each. temporary: makes one."""
        self._folder = folder
        self._temporary = temporary
        self._kept: list[_Kept] = []
        self._left: dict[str, Path] = {}  # folder of each test that has failed before

    def build(self, node: Any, call: Mapping[str, Any], *, line_speed: bool = False) -> Twin:
        """A twin for a node, switched on. A wrong call fails the test with one line."""
        wanted = called(call, line_speed=line_speed)
        twin = built(wanted)
        kept = _Kept(twin, node, wanted)
        twin.listen(kept.note)
        self._kept.append(kept)
        return twin

    def forget(self, twin: Twin) -> None:
        self._kept = [kept for kept in self._kept if kept.twin is not twin]

    def tell(self, item: pytest.Item, tmp_path: Path | None) -> tuple[str, list[Path]]:
        """Record the twins of a failing test again; return lines for its report, and the recordings. Never raises."""
        chain = item.listchain()
        mine = [kept for kept in self._kept if kept.node in chain]
        if not mine:
            return "", []
        lines: list[str] = []
        recordings: list[Path] = []
        try:
            folder = self._folder_of(item, tmp_path)
        except OSError as error:
            folder = None
            lines.append(f"no recording: {_of(error, self._folder)}")
        for number, kept in enumerate(mine, 1):
            name = "twin" if number == 1 else f"twin-{number}"
            lines.append(f"{name}: {_said(kept)}, {kept.twin.time_ns / SECOND_NS:.6f} s of virtual time")
            if kept.restored:
                lines.append("  no recording: it was restored from a state, and cannot be played again")
            elif folder is not None:
                recording, told = _leave(kept, folder, name)
                recordings += [] if recording is None else [recording]
                lines += [f"  {line}" for line in told]
        lines.append(f"the test again: {Path(sys.executable).name} -m pytest {shlex.quote(item.nodeid)}")
        return "\n".join(lines), recordings

    def _folder_of(self, item: pytest.Item, tmp_path: Path | None) -> Path:
        """A folder for each test, also with parallel runs. Raises OSError."""
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", item.nodeid).strip("_.")[-NAME_CHARACTERS:]
        name += "-" + hashlib.sha256(item.nodeid.encode("utf-8", "surrogatepass")).hexdigest()[:8]
        if self._folder is not None:
            folder = self._folder / name
        else:
            if item.nodeid not in self._left:
                self._left[item.nodeid] = tmp_path or self._temporary(name)
            folder = self._left[item.nodeid] / "isel-twin" if tmp_path else self._left[item.nodeid]
        folder.mkdir(parents=True, exist_ok=True)
        return folder


def _said(kept: _Kept) -> str:
    call = kept.call
    text = f"machine={call.machine_name} controller={call.controller} plant={call.plant} seed={call.seed}"
    text += "" if call.scenario is None else f" scenario={call.scenario}"
    return f"{text} overrides={dict(call.overrides)}" if call.overrides else text


def _leave(kept: _Kept, folder: Path, name: str) -> tuple[Path | None, list[str]]:
    """Repeat a twin's run with a recording; return the recording and lines for the report, including errors."""
    recording, picture = folder / f"{name}.mcap", folder / f"{name}.png"
    try:
        told = _record(kept, recording, picture)
    except OSError as error:
        return None, [f"no recording: {_of(error, recording)}"]
    except Exception as error:  # a failing test must show its own error, not that of the recording
        return None, [f"no recording: {type(error).__name__}: {one_line(str(error))}"]
    again = f"once more: isel-twin replay {shlex.quote(str(recording))}"
    return recording, [f"recording: {recording}", again, *told]


def _of(error: OSError, path: Path | None) -> str:
    return f"{error.filename or path}: {error.strerror or error}"


def _record(kept: _Kept, recording: Path, picture: Path) -> list[str]:
    """Play the causes again; return lines about the picture and about differences. Raises OSError."""
    from isel_twin.base.parameters import Place
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.recorder import Recorder
    from isel_twin.recordings.recording import FileRecording
    from isel_twin.wiring import ScenarioError, event_now

    end_ns, causes = kept.twin.time_ns, list(kept.causes)
    seen = _place(kept.twin)
    interval_ns = max(INTERVAL_NS, end_ns // MOST_SAMPLES)
    twin = Twin.of(kept.twin.origin, keep_motions=1)
    place = Place("the test", ScenarioError)
    zeros_ns = [0]
    twin.listen(lambda time_ns, kind, what: zeros_ns.append(time_ns) if kind == "counter" else None)
    with Recorder(twin, interval_ns) as recorder:
        written = FileRecording(recording, twin, interval_ns)
        try:
            for time_ns, kind, what in causes:
                twin.run_until(time_ns)
                if kind == "sent":
                    twin.write(what)
                elif not set(what) <= set(SETTINGS):
                    twin.carry_out(event_now(what, place, twin.settable, twin.keys))
                elif "line_speed" in what:
                    twin.line_speed = what["line_speed"]
                else:
                    twin.watch_margin()
            twin.run_until(end_ns)
        finally:
            whole = written.close()
        if not whole:
            raise OSError(errno.ENOSPC, "there was no room for it", str(recording))
        same = kept.twin.time_ns != end_ns or _place(twin) == seen  # a served twin may have gone on
        other = "the recording ends elsewhere than the test: something was done past the functions of the twin"
        return [_draw(twin, recorder, picture, zeros_ns[-1]), *([] if same else [other])]


def _place(twin: Twin) -> tuple[list[int], list[float]]:
    return twin.counts.tolist(), twin.machine_position_mm.tolist()


def _draw(twin: Twin, recorder: Any, picture: Path, zero_ns: int) -> str:
    try:
        from isel_twin.report.sketch import write_sketch
    except ImportError:
        return "no picture: it needs matplotlib: pip install 'isel-twin[report]'"
    try:
        write_sketch(picture, twin, recorder, zero_ns)
    except OSError as error:
        return f"no picture: {_of(error, picture)}"
    return f"picture:   {picture}"


# A served twin


class ServedTwin:
    """A twin served in a thread of this process: a host connects to `address`, the test operates it by `ask`."""

    def __init__(self, twin: Twin, endpoint: str = "tcp", speed: str = "max") -> None:
        """endpoint: tcp, rfc2217 or pty. speed: times real time, or max. Raises ValueError for another one."""
        from isel_twin.bridge.operate.control_port import ControlPort
        from isel_twin.bridge.serve.pacing import Pacer, parse_speed
        from isel_twin.bridge.serve.server import Server

        factor = parse_speed(speed)
        self.endpoint = endpoint
        made = _endpoint(endpoint)
        self._control = ControlPort("127.0.0.1:0")
        self._twin = twin
        self.address: str = made.address  # HOST:PORT, or the device of a pseudo terminal
        self.control: str = self._control.address  # HOST:PORT of the control port, for `isel-twin ctl`
        self._server = Server(twin, Pacer(factor, twin.time_ns), [made], guests=[self._control])
        self._broken: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="twin_server", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """For `serial.serial_for_url`."""
        return {"tcp": "socket://", "rfc2217": "rfc2217://", "pty": ""}[self.endpoint] + self.address

    def ask(self, request: Mapping[str, Any]) -> Any:
        """Ask the control port, {"set": {"hood": "open"}}, {"state": True}, {"wait": {"idle": True}}; its answer.

        Raises ValueError for what it refuses, TimeoutError if what was waited for did not come.
        """
        host, _, port = self.control.rpartition(":")
        with socket.create_connection((host, int(port)), timeout=STOP_S) as connection:
            connection.settimeout(None if {"wait", "step"} & request.keys() else STOP_S)
            connection.sendall(json.dumps(request).encode() + b"\n")
            with connection.makefile("rb") as stream:
                line = stream.readline()
        if not line:
            raise ConnectionError(f"the server at {self.control} has ended")
        answer = json.loads(line)
        if "error" in answer:
            raise (TimeoutError if answer.get("timeout") else ValueError)(answer["error"])
        return answer["ok"]

    def stop(self) -> Twin:
        """End the server and return the twin. May be called again. Raises an error that ended it before."""
        self._server.stop()
        self._thread.join(STOP_S)
        if self._thread.is_alive():
            raise RuntimeError(f"the server did not end within {STOP_S:g} s")
        if self._broken is not None:
            broken, self._broken = self._broken, None
            raise broken
        return self._twin

    def _run(self) -> None:
        try:
            self._server.run()
        except BaseException as error:
            self._broken = error


def _endpoint(kind: str) -> Any:
    from isel_twin.bridge.serve.endpoints import open_endpoints

    free = ["127.0.0.1:0"]
    asked = {"tcp": (None, free, None), "rfc2217": (None, None, free), "pty": ([""], None, None)}
    if kind not in asked:
        raise ValueError(f"endpoint={kind!r}; there are: tcp, rfc2217, pty")
    return open_endpoints(*asked[kind], ExitStack())[0]
