"""The panel in the server's loop: carries out requests of browsers, and samples the twin for them.

    browser --- request ---> site (its thread) --- queue, wake ---> Panel.look --- Operator.ask ---> the twin
            <-- frame ------                   <-- at most FRAMES_PER_S -------'

Requests are those of the control port (bridge/operate/control.py) with a number, which answers repeat:

    {"id": 7, "ask": {"set": {"estop": "pressed"}}}    -->  {"id": 7, "ok": {...}} or {"id": 7, "error": "one line"}
    {"id": 8, "ask": {...}, "gone": {"set": {...}}}    `gone` is carried out if the browser leaves before its next
    request
    {"id": 9, "say": "@0P"}                            as a host: commands as in a job file (`PanelEnd`)
    {"id": 10, "job": {"start": true}}                 a job file: job.py
    {"id": 11, "desk": {"home": true}}                 moves by hand: desk.py
    {"id": 12, "trigger": {"level": "p1.0", "is": 1}}  pause when it becomes so (`Operator.trigger`); false: no more

A frame is the state of the control port with further data for the panel; there are none without browsers. Sampling does
not change the twin by a bit.
"""

from __future__ import annotations

import logging
import math
import socket
import time
from collections import deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Protocol

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.errors import one_line
from isel_twin.base.parameters import Place, known
from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.operate.control import ControlError, Operator, Pending
from isel_twin.bridge.operate.panel.desk import Desk
from isel_twin.bridge.operate.panel.frame import COME, Asked, Frame
from isel_twin.bridge.operate.panel.job import PanelJob
from isel_twin.bridge.operate.panel.menu import key_menu, menu
from isel_twin.bridge.operate.panel.monitor import Monitor
from isel_twin.bridge.operate.panel.plots import Plots
from isel_twin.bridge.operate.panel.sender import PanelEnd
from isel_twin.bridge.operate.token import token_for
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.server import Guest, Server
from isel_twin.bridge.serve.tcp import listen, parse_address
from isel_twin.cam.settings import CamSettings
from isel_twin.core.twin import Twin
from isel_twin.jobs import project
from isel_twin.jobs.decode import DecodeError, typed
from isel_twin.language import LanguageError, needed
from isel_twin.machine import Machine
from isel_twin.version import VERSION
from isel_twin.wiring import FAULTS
from isel_twin.wiring.acts import BESIDE

log = logging.getLogger("isel_twin")

FRAMES_PER_S = 20.0  # samples of the twin in a wall second, at most
ROUND = 32  # requests dealt with in one round of the server's loop
PACE_S = 1.0  # wall seconds over which it is measured how fast virtual time runs
SAID_BYTES = 4096  # longest text typed at once, as bytes on the line


class Site(Protocol):
    """The page (site.py) for the panel, called from the server's thread."""

    @property
    def watched(self) -> bool:
        """True while a browser has the page open."""

    def start(self, about: Mapping[str, Any], machine: Machine, recording: Path | None) -> None:
        """Accept browsers. about: constant data; recording: a file for download."""

    def show(self, frame: Frame) -> None:
        """Show this frame."""

    def answer(self, client: int, answer: Mapping[str, Any]) -> None:
        """Send the answer to a request."""

    def close(self) -> None:
        """Close all connections."""


class Panel(Guest):
    """Shows a server's twin on a page. Raises ValueError, or OSError for a taken address."""

    kind = "panel"

    def __init__(self, address: str, token: str | None = None, site: Site | None = None) -> None:
        """token: needed by browsers; None: none on the loopback interface, elsewhere a random one.

        site: None for the page itself. Raises ImportError without the extra `panel`.
        """
        self.monitor = Monitor()
        self.recording: Path | None = None  # the server's recording, for download; set it before the start
        self._asked: SimpleQueue[Asked] = SimpleQueue()
        self._server: Server | None = None
        self._line = PanelEnd()  # of who types
        self._pending: list[tuple[int, Any, Pending]] = []
        self._gone: dict[int, Mapping[str, Any]] = {}
        self._trigger: tuple[Mapping[str, Any], Pending] | None = None  # of all browsers together
        self._next_s = 0.0
        self._last: Frame = {}
        self._paces: deque[tuple[float, int]] = deque()  # wall time in s and virtual time in ns of the last samples
        self._met = 0  # collisions that have been shown
        if site is not None:
            self.address, self.token, self._site = address, token, site
            return
        from isel_twin.bridge.operate.panel.site import WebSite

        listener, self.address = listen(address)
        self.token = token_for(self.address, token)
        self._site = WebSite(listener, self.address, self.token, self.take)

    @property
    def url(self) -> str:
        host, port = parse_address(self.address)
        if host in ("0.0.0.0", "::"):  # all interfaces: use this computer's name
            host = socket.gethostname()
        where = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        return f"http://{where}/" + (f"?token={self.token}" if self.token else "")

    def take(self, asked: Asked) -> None:
        """Called from any thread."""
        self._asked.put(asked)
        if self._server is not None:
            self._server.wake()

    # As a guest

    def attach(self, server: Server) -> None:
        """Take the server whose twin is shown. Raises TypeError if it serves something else, CallError if the page is
        not safe."""
        if not isinstance(server.twin, Twin):
            raise TypeError("a panel shows a Twin")
        self._server, self._twin, self._plots = server, server.twin, Plots(server.twin)
        self._operator = Operator(server, server.twin)
        settings = project.find(Path.cwd() / "job")
        self._desk = _desk(server, server.twin, settings)
        self._job = PanelJob(server, server.twin, settings, self._desk)
        self.monitor.begin(server.twin.controller_name)
        self._site.start(self._about(), self._twin.machine, self.recording)

    def watches(self) -> Iterable[FileWatch]:
        return ()  # browsers wake the server

    def wait_s(self) -> float | None:
        if not self._asked.empty():
            return 0.0
        waits = [self._operator.wait_s, self._job.sender.wait_s]
        if self._desk is not None:
            waits.append(self._desk.wait_s)
        if self._site.watched:
            waits.append(max(0.0, self._next_s - time.monotonic()))
        return min((wait for wait in waits if wait is not None), default=None)

    def look(self) -> None:
        self._operator.look()
        for _ in range(ROUND):
            try:
                asked = self._asked.get_nowait()
            except Empty:
                break
            self._deal_with(asked)
        self._operator.look()  # the last request may have met the condition of a wait
        self._answer_pending()
        self._job.sender.advance()
        if self._desk is not None:
            self._desk.advance()
        self._plots.watch(self._site.watched)
        if self._site.watched and (now := time.monotonic()) >= self._next_s:
            self._next_s = now + 1.0 / FRAMES_PER_S
            self._sample()

    def close(self) -> None:
        """End all waits and close all connections. May be called again, and before there is a server."""
        if self._server is not None:
            self._operator.end()
            self._plots.watch(False)
            self._answer_pending()
        self._site.close()

    # Requests

    def _deal_with(self, asked: Asked) -> None:
        if asked.request is None:
            self._leave(asked.client)
            return
        if asked.request is COME:
            self._last = {}
            return
        number = asked.request.get("id")
        try:
            self._gone.pop(asked.client, None)
            result = self._ask(asked.client, dict(asked.request))
        except ControlError as error:
            self._site.answer(asked.client, {"id": number, "error": str(error)})
            return
        if isinstance(result, Pending):
            self._pending.append((asked.client, number, result))
        else:
            self._site.answer(asked.client, {"id": number, "ok": result})

    def _ask(self, client: int, request: dict[str, Any]) -> dict[str, Any] | Pending:
        place = Place("request", ControlError)
        kinds = ("ask", "say", "job", "desk", "trigger")
        known(request, ("id", "gone", *kinds), place)
        if len([key for key in kinds if key in request]) != 1:
            raise place.wrong(f"nothing to do; allowed: one of {', '.join(kinds)}")
        if "say" in request:
            return self._say(request["say"])
        if "job" in request:
            return self._job.ask(request["job"])
        if "desk" in request:
            if self._desk is None:
                raise place.at("desk").wrong("the controller's language is not known; allowed: with one")
            return self._desk.ask(request["desk"], self._free)
        if "trigger" in request:
            return self._set_trigger(request["trigger"], place.at("trigger"))
        result = self._operator.ask(request["ask"])
        if isinstance(gone := request.get("gone"), dict):
            self._gone[client] = gone
        return result

    def _set_trigger(self, content: Any, place: Place) -> dict[str, Any]:
        assert self._server is not None
        self._server.present()
        armed = None if content is False else (content, self._operator.trigger(content, place))
        if self._trigger is not None:
            self._operator.forget(self._trigger[1])
        self._trigger = armed
        return {"trigger": self._shown_trigger()}

    def _shown_trigger(self) -> dict[str, Any] | None:
        """What the trigger waits for, and the virtual time of its pause; None: there is none."""
        if self._trigger is None:
            return None
        content, pending = self._trigger
        return {"when": content, "hit_s": None if pending.answer is None else pending.answer["time_s"]}

    def _say(self, text: Any) -> dict[str, Any]:
        """Send text to the controller like a host that takes the line. Raises ControlError while a network host holds
        the line, as it would lose its replies to the panel (bridge/14).
        """
        if not isinstance(text, str):
            raise ControlError("request: say: no text; allowed: commands as in a job file")
        assert self._server is not None
        place = Place("request", ControlError).at("say")
        self._free(place)
        if self._desk is not None and self._desk.busy:
            raise place.wrong("the machine is moved by hand; allowed: when that is over")
        name = self._twin.controller_name
        if not self._server.listening:
            raise place.wrong("the line is full; allowed: when the controller has taken what is on it")
        try:
            data = b"".join(piece.data for piece in typed(text, True, needed(self._twin.language, name), name))
        except (DecodeError, LanguageError) as error:
            raise ControlError(f"request: say: {error}") from None
        if len(data) > SAID_BYTES:
            raise ControlError(f"request: say: {len(data)} bytes; allowed: up to {SAID_BYTES} at once")
        self._server.receive(self._line, data)
        return {"sent": len(data)}

    def _free(self, place: Place) -> None:
        """Raises ControlError while a host or the job has the line."""
        if (kind := self._job.sender.host()) is not None:
            raise place.wrong(f"a host holds the line ({kind}); allowed: when it has gone")
        if self._job.running:
            raise place.wrong("a job is running; allowed: when it has been stopped or is over")

    def _leave(self, client: int) -> None:
        """A browser has gone: drop its waits, and release what it held down."""
        for entry in [entry for entry in self._pending if entry[0] == client]:
            self._pending.remove(entry)
            self._operator.forget(entry[2])
        if (gone := self._gone.pop(client, None)) is not None:
            try:
                self._operator.ask(gone)
            except ControlError as error:
                log.warning("panel: %s", error)

    def _answer_pending(self) -> None:
        for entry in [entry for entry in self._pending if entry[2].over]:
            self._pending.remove(entry)
            client, number, pending = entry
            said = {"error": pending.error} if pending.error else {"ok": pending.answer}
            self._site.answer(client, {"id": number, **said})

    # Frames

    def _about(self) -> dict[str, Any]:
        twin = self._twin
        return {
            "version": VERSION,
            "machine": twin.machine.name,
            "controller": twin.controller_name,
            "physics": twin.physics,
            "axes": list(AXIS_NAMES[: len(twin.counts)]),
            "step_mm": twin.step_mm.tolist(),
            "slip_steps": [steps if math.isfinite(steps) else None for steps in twin.slip_steps.tolist()],
            "closed_loop": twin.closed_loop.tolist(),
            "settable": {name: list(states) for name, states in twin.settable.items()},
            "fault_states": list(FAULTS),
            "terminals": {terminal: list(names) for terminal, names in twin.terminals.items()},
            "acts": menu(),
            "keys": key_menu(twin.keys),
            "beside": list(BESIDE),
            "recording": None if self.recording is None else self.recording.name,
            "language": twin.language is not None,
            "desk": None if self._desk is None else self._desk.about,
        }

    def _reached(self) -> float | None:
        """Times real time that virtual time has run in the last second of samples; None before there is one."""
        (began_s, began_ns), (now_s, now_ns) = self._paces[0], self._paces[-1]
        past_s = now_s - began_s
        return None if past_s < PACE_S / 2.0 else (now_ns - began_ns) / SECOND_NS / past_s

    def _sample(self) -> None:
        assert self._server is not None
        twin, pacer = self._twin, self._server.pacer
        if not pacer.behind or (self._paces and pacer.wall_s - self._paces[-1][0] > PACE_S):
            self._paces.clear()
        self._paces.append((pacer.wall_s, twin.time_ns))
        while self._paces[-1][0] - self._paces[0][0] > PACE_S:
            self._paces.popleft()
        frame = self._operator.state()
        frame["step_hz"] = twin.step_hz.tolist()
        frame["supply_v"] = twin.supply_v if math.isfinite(twin.supply_v) else None
        frame["velocity_mm_s"] = twin.velocity_mm_s.tolist()
        frame["behind"] = pacer.behind
        frame["reached"] = self._reached() if pacer.behind else None
        frame["hosts"] = [endpoint.kind for endpoint in self._server.endpoints if endpoint.busy]
        lines = self.monitor.lines()
        for collision in twin.collisions[self._met :]:
            lines.append({"s": collision.time_ns / SECOND_NS, "who": "", "text": "", "means": str(collision)})
        frame["met"] = self._met = len(twin.collisions)
        frame["trigger"] = self._shown_trigger()
        frame["job"] = self._job.shown
        frame["desk"] = None if self._desk is None else self._desk.shown
        if lines or frame != self._last:
            self._last = frame
            self._site.show({**frame, "wall_s": pacer.wall_s, "lines": lines, "plot": self._plots.point()})


def _desk(server: Server, twin: Twin, settings: Path | None) -> Desk | None:
    """A desk, for a controller whose language is known."""
    if twin.language is None:
        return None
    try:
        cam = project.cam(settings, twin.machine)
    except (OSError, ValueError) as error:
        log.warning("panel: %s", one_line(str(error)))
        cam = CamSettings()
    return Desk(server, twin, twin.language, cam)
