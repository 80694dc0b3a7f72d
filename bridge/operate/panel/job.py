"""A job file opened in the panel: its lines are sent as a host sends them, each when the one before is over.

    browser --- {"job": {"open": {"name": "part.nc", "text": ...}}} --->  a job, or a file of a CAM program as one
            --- {"job": {"start": true}}, {"job": {"stop": true}} ----->  PanelJob.advance, in each round of the server
            <-- frame["job"]: state, line of the file, command ---------

    ready --- start ---> running --- all lines well ---> done
      ^                     |------- a refusal, a condition that is not met ---> failed
      '------- start -------+------- stop, or a host that takes the line ------> stopped

The panel does not hurry time: a line is over when virtual time has come so far. After a stop the motion is broken off,
in the words of the controller's language.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from isel_twin.base.errors import one_line
from isel_twin.base.parameters import Place, known, table, text
from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.operate.control import ControlError
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.server import Server
from isel_twin.core.twin import Twin
from isel_twin.jobs import project
from isel_twin.jobs.job import Line, Sent, Wait, check_conditions, conversation, ends_job, look
from isel_twin.jobs.result import Result
from isel_twin.jobs.toolpaths import Source, lines_of, source_of

MOST_CHARACTERS = 500_000  # of a file: a message of a browser has 1 MiB
TIMEOUT_S = 86_400.0  # virtual seconds: somebody stands beside it
SHOWN = 120  # characters of a command
LOOK_S = 0.02  # wall time between looks at a controller that is idle, and a line that is not over


class PanelJob:
    """The job of the panel, and the endpoint that sends it. Used in the thread of the server's loop only."""

    kind = "panel"
    address = ""
    gathers = False
    busy = False
    waiting = 0
    settings: Mapping[str, Any] = MappingProxyType({})  # as those of the line

    def __init__(self, server: Server, twin: Twin, settings: Path | None = None) -> None:
        """settings: the file with a [cam] table, beside that of the machine's folder."""
        self._server, self._twin, self._settings = server, twin, settings
        self.state = "none"
        self._name = self._text = self._title = self._why = ""
        self._lines: Sequence[Line] = ()
        self._index = 0
        self._opened = self._started = 0
        self._begin_ns = self._end_ns = 0
        # of the line that is being sent
        self._sent: Sent | None = None
        self._steps: Iterator[bytes | int | Wait] = iter(())
        self._due: bytes | int | Wait | None = None
        self._until_ns: int | None = None
        self._reply = b""
        self._last: Result | None = None

    # As an endpoint

    def attach(self, line: object) -> None:
        return

    def watches(self, listening: bool) -> Sequence[FileWatch]:
        return ()

    def send(self, data: bytes) -> None:
        self._reply += data

    def give_way(self) -> None:
        return

    def close(self) -> None:
        return

    # Requests

    @property
    def running(self) -> bool:
        return self.state == "running"

    def ask(self, request: Any) -> dict[str, Any]:
        """Carry out a request. Raises ControlError."""
        place = Place("request", ControlError).at("job")
        content = table(request, place)
        known(content, ("open", "start", "stop", "text"), place)
        if len(content) != 1:
            raise place.wrong("nothing to do; allowed: one of open, start, stop, text")
        ((key, value),) = content.items()
        if key == "open":
            return self._open(table(value, place.at("open")), place.at("open"))
        if value is not True:
            raise place.at(key).wrong(f"{value!r}; allowed: true")
        if key == "text":
            return {"opened": self._opened, "text": self._text}
        if key == "start":
            self._start(place.at(key))
        else:
            self.stop("stopped by hand")
        return self.shown

    def _open(self, content: Mapping[str, Any], place: Place) -> dict[str, Any]:
        known(content, ("name", "text"), place)
        name, told = (text(content.get(key, ""), place.at(key)) for key in ("name", "text"))
        if self.running:
            raise place.wrong("a job is running; allowed: when it has been stopped or is over")
        if len(told) > MOST_CHARACTERS:
            raise place.wrong(f"{len(told)} characters; allowed: up to {MOST_CHARACTERS}, isel-twin run takes more")
        try:
            source, lines = self._read(name, told.encode())
            check_conditions(lines, self._twin)
        except (OSError, ValueError) as error:  # of the file, of the settings beside it, of characters that are none
            raise ControlError(f"{name}: {one_line(str(error))}".encode(errors="replace").decode()) from None
        if not lines:
            raise ControlError(f"{name}: there is no command in it")
        self.state, self._name, self._text, self._lines = "ready", name, told, lines
        self._title = "" if source is None else source.title
        self._why, self._index, self._begin_ns, self._end_ns = "", 0, 0, 0
        self._opened += 1
        return self.shown | {"cautions": [] if source is None else list(source.cautions)}

    def _read(self, name: str, data: bytes) -> tuple[Source | None, Sequence[Line]]:
        twin = self._twin
        language, controller = twin.language, twin.controller_name
        settings = project.cam(self._settings, twin.machine)
        source = source_of(data, Path(name).suffix, language, controller, lambda: twin.machine, settings)
        return source, lines_of(source, data, language, controller)

    def _start(self, place: Place) -> None:
        if not self._lines:
            raise place.wrong("there is no job; allowed: when a file has been opened")
        if self.running:
            raise place.wrong("it is running already; allowed: when it is over")
        if (kind := self._host()) is not None:
            raise place.wrong(f"a host holds the line ({kind}); allowed: when it has gone")
        self._server.present()
        if not self._twin.idle:
            raise place.wrong("the controller is at work; allowed: when it is idle")
        self.state, self._why, self._index, self._last = "running", "", 0, None
        self._started += 1
        self._begin_ns, self._sent = self._twin.time_ns, None

    def stop(self, why: str) -> None:
        """Send no more, and break off what moves."""
        if not self.running:
            return
        self._over("stopped", why)
        if self._host() is None and self._twin.language is not None:
            self._server.receive(self, self._twin.language.break_off())

    @property
    def shown(self) -> dict[str, Any]:
        """What browsers are told of it; {} without one."""
        if self.state == "none":
            return {}
        line = self._lines[min(self._index, len(self._lines) - 1)]
        end_ns = self._twin.time_ns if self.running else self._end_ns
        return {
            "opened": self._opened,
            "started": self._started,
            "name": self._name,
            "format": self._title,
            "state": self.state,
            "made": self._index,
            "commands": len(self._lines),
            "line": line.number,
            "command": line.command[:SHOWN],
            "seconds": (end_ns - self._begin_ns) / SECOND_NS,
            "why": self._why,
        }

    # In each round of the server

    @property
    def wait_s(self) -> float | None:
        """Wall seconds until it has to be looked at though nothing happens."""
        if not self.running or self._server.pacer.paused:
            return None
        if self._until_ns is None:
            return LOOK_S if self._twin.idle else None
        return 0.0 if self._server.pacer.speed is None else max(0.0, self._server.pacer.until_s(self._until_ns))

    def advance(self) -> None:
        """Send what is due."""
        if not self.running:
            return
        if (kind := self._host()) is not None:
            self.stop(f"a host has taken the line ({kind})")
            return
        while self.running and not self._server.pacer.paused and self._step():
            pass

    def _step(self) -> bool:
        """One step of the job; False if there is nothing to do now."""
        twin = self._twin
        if self._index == len(self._lines):
            self._over("done", "")
            return False
        line = self._lines[self._index]
        if line.condition is not None:
            self._judge(line, look(twin, line, line.condition, self._last))
            return True
        if self._sent is None:
            self._sent, self._steps, self._reply = Sent(twin, line), conversation(twin, line), b""
            self._due, self._until_ns = next(self._steps, None), None
        if self._due is None:
            self._judge(line, self._sent.result(True, self._reply, TIMEOUT_S))
            return True
        if not self._done(self._due):
            return False
        self._due, self._until_ns = next(self._steps, None), None
        return True

    def _done(self, due: bytes | int | Wait) -> bool:
        twin = self._twin
        if isinstance(due, bytes):
            if not self._server.listening:
                return False
            self._server.receive(self, due)
            return True
        for_ns = due if isinstance(due, int) else due.for_ns
        if for_ns is not None:
            self._until_ns = twin.time_ns + for_ns if self._until_ns is None else self._until_ns
            if self._server.pacer.speed is None:  # at this speed time stands still while all wait
                twin.run_until(self._until_ns)
            return twin.time_ns >= self._until_ns
        assert isinstance(due, Wait)
        return due.so() and not (twin.replies_due or twin.commands_due or twin.reply_waiting)

    def _judge(self, line: Line, result: Result) -> None:
        self._sent = None
        if not result.condition:
            self._last = result
        if not result.ok:
            self._over("failed", f"{result.command[:SHOWN]}: {result.shown_reply or 'no reply'}")
        elif ends_job(line, result):
            self._over("failed", result.why)
        else:
            self._index += 1

    def _over(self, state: str, why: str) -> None:
        self.state, self._why, self._end_ns, self._sent, self._until_ns = state, why, self._twin.time_ns, None, None

    def _host(self) -> str | None:
        """The kind of an endpoint whose host holds the line."""
        return next((endpoint.kind for endpoint in self._server.endpoints if endpoint.busy), None)
