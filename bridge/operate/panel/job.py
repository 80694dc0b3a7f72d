"""A job file opened in the panel.

    browser --- {"job": {"open": {"name": "part.nc", "text": ...}}} --->  a job, or a file of a CAM program as one
            --- {"job": {"open": {..., "zero": "fit"}}} ------------>  the same, its zero chosen to fit the travel
            --- {"job": {"start": true}}, {"job": {"stop": true}} ----->  Sender.advance, in each round of the server
            --- {"job": {"pause": true}}, {"job": {"go_on": true}},
                {"job": {"line": true}}: one line of the file --------->
                {"job": {"part": {"from_line": 42}}} ------------------>
            <-- frame["job"]: state, line of the file, command ---------

A file of a CAM program is made with the zero of the workpiece that was set at the desk, and anew if that has changed;
of a part of it until another file is opened.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from isel_twin.base.errors import one_line
from isel_twin.base.parameters import Limits, Place, known, plain, table, text
from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.operate.control import ControlError
from isel_twin.bridge.operate.panel.desk import Desk
from isel_twin.bridge.operate.panel.sender import SHOWN, Sender
from isel_twin.bridge.serve.server import Server
from isel_twin.cam.fitting import FIT, BeyondError, in_words, with_zero
from isel_twin.cam.section import WHOLE, LineRange
from isel_twin.cam.toolpath import Point
from isel_twin.core.twin import Twin
from isel_twin.jobs import project
from isel_twin.jobs.job import Line, check_conditions
from isel_twin.jobs.toolpaths import Reading, Source, lines_of, source_of

MOST_CHARACTERS = 500_000  # of a file: a message of a browser has 1 MiB
_LINE = Limits("", 1, MOST_CHARACTERS, whole=True)


class PanelJob:
    """The job of the panel. Used in the thread of the server's loop only."""

    def __init__(self, server: Server, twin: Twin, settings: Path | None, desk: Desk | None) -> None:
        """settings: the file with a [cam] table, beside that of the machine's folder."""
        self._server, self._twin, self._settings, self._desk = server, twin, settings, desk
        self.sender = Sender(server, twin)
        self._name = self._text = self._title = ""
        self._lines: Sequence[Line] = ()
        self._cautions: list[str] = []  # what the file may mean otherwise
        self._not_made = ""  # lines of the file that the part leaves out
        self._made_for: Point | None = None
        self._part = WHOLE
        self._fresh = True
        self._opened = self._started = 0

    @property
    def _zero_mm(self) -> Point | None:
        return None if self._desk is None else self._desk.zero_mm()

    @property
    def running(self) -> bool:
        return self.sender.active

    def ask(self, request: Any) -> dict[str, Any]:
        """Carry out a request. Raises ControlError."""
        place = Place("request", ControlError).at("job")
        content = table(request, place)
        acts = {
            "start": self._start,
            "line": self._line,
            "pause": self._pause,
            "go_on": self._go_on,
            "stop": lambda _: self.sender.stop("stopped by hand"),
        }
        known(content, ("open", "text", "part", *acts), place)
        if len(content) != 1:
            raise place.wrong(f"nothing to do; allowed: one of open, text, part, {', '.join(acts)}")
        ((key, value),) = content.items()
        if key == "open":
            return self._open(table(value, place.at("open")), place.at("open"))
        if key == "part":
            return self._choose(table(value, place.at("part")), place.at("part"))
        if value is not True:
            raise place.at(key).wrong(f"{value!r}; allowed: true")
        if key == "text":
            return {"opened": self._opened, "text": self._text}
        acts[key](place.at(key))
        return self.shown

    def _open(self, content: Mapping[str, Any], place: Place) -> dict[str, Any]:
        known(content, ("name", "text", "zero"), place)
        if content.get("zero", FIT) != FIT:
            raise place.at("zero").wrong(f"{content['zero']!r}; allowed: {FIT!r}")
        name, told = (text(content.get(key, ""), place.at(key)) for key in ("name", "text"))
        if self.running:
            raise place.wrong("a job is running; allowed: when it has been stopped or is over")
        if len(told) > MOST_CHARACTERS:
            raise place.wrong(f"{len(told)} characters; allowed: up to {MOST_CHARACTERS}, isel-twin run takes more")
        self._take(name, told, Reading(zero=content.get("zero")))
        self._fresh = True
        self._opened += 1
        return self.shown

    def _choose(self, content: Mapping[str, Any], place: Place) -> dict[str, Any]:
        """Take a part of the file; without any line all of it."""
        known(content, ("from_line", "to_line"), place)
        if not self._lines:
            raise place.wrong("there is no job; allowed: when a file has been opened")
        if self.running:
            raise place.wrong("a job is running; allowed: when it has been stopped or is over")
        asked = {key: plain(value, _LINE, place.at(key)) for key, value in content.items() if value is not None}
        if broken := [key for key, value in asked.items() if value % 1.0]:
            raise place.at(broken[0]).wrong(f"{asked[broken[0]]:g}; allowed: a whole number")
        try:
            part = LineRange(int(asked.get("from_line", 1)), int(asked["to_line"]) if "to_line" in asked else None)
        except ValueError as error:
            raise ControlError(str(error)) from None
        self._take(self._name, self._text, Reading(part=part))
        self._fresh = True
        return self.shown

    def _take(self, name: str, told: str, reading: Reading) -> None:
        """Make the lines of a text; a zero that was chosen is the desk's then. Raises ControlError, and then nothing
        has changed."""
        try:
            source, lines = self._read(name, told.encode(), reading)
            check_conditions(lines, self._twin)
        except (OSError, ValueError) as error:  # of the file, of the settings beside it, of characters that are none
            raise ControlError(f"{name}: {one_line(_in_words(error))}".encode(errors="replace").decode()) from None
        if not lines:
            raise ControlError(f"{name}: there is no command in it")
        if reading.zero is not None and (source is None or source.zero is None or self._desk is None):
            raise ControlError(f"{name}: is a job of commands, which no zero moves")
        if source is not None and source.zero is not None and self._desk is not None:
            self._desk.set_zero(source.zero)
        self._name, self._text, self._lines = name, told, lines
        self._title, self._made_for = "" if source is None else source.title, self._zero_mm
        self._part, self._not_made = reading.part, "" if source is None else source.not_made
        self._cautions = [] if source is None else list(map(str, source.cautions))

    def _read(self, name: str, data: bytes, reading: Reading) -> tuple[Source | None, Sequence[Line]]:
        twin = self._twin
        language, controller = twin.language, twin.controller_name
        settings = project.cam(self._settings, twin.machine)
        if (zero_mm := self._zero_mm) is not None:
            settings = with_zero(settings, zero_mm)
        source = source_of(data, Path(name).suffix, language, controller, lambda: twin.machine, settings, reading)
        return source, lines_of(source, data, language, controller)

    def _start(self, place: Place, single: bool = False) -> None:
        if not self._lines:
            raise place.wrong("there is no job; allowed: when a file has been opened")
        if self.running:
            raise place.wrong("it is running already; allowed: when it is over")
        if (kind := self.sender.host()) is not None:
            raise place.wrong(f"a host holds the line ({kind}); allowed: when it has gone")
        self._server.present()
        if not self._twin.idle or (self._desk is not None and self._desk.busy):
            raise place.wrong("the controller is at work; allowed: when it is idle")
        if self._title and self._made_for != self._zero_mm:
            self._take(self._name, self._text, Reading(part=self._part))
        self._fresh = False
        self._started += 1
        self.sender.begin(self._lines, single)

    def _line(self, place: Place) -> None:
        """One line of the file: the first, or the next one."""
        if self.sender.state in ("running", "pausing"):
            raise place.wrong("it is running; allowed: when it is paused or over")
        if self.sender.state == "paused":
            self.sender.go_on(single=True)
        else:
            self._start(place, single=True)

    def _pause(self, place: Place) -> None:
        if self.sender.state != "running":
            raise place.wrong("it is not running; allowed: while it is")
        self._server.present()
        if why := self.sender.hold():
            raise place.wrong(why)

    def _go_on(self, place: Place) -> None:
        if self.sender.state != "paused":
            raise place.wrong("it is not paused; allowed: while it is")
        self._server.present()
        self.sender.go_on()

    @property
    def shown(self) -> dict[str, Any]:
        """State of the job for browsers; {} without one."""
        if not self._opened:
            return {}
        sender = self.sender
        index = 0 if self._fresh else sender.index
        line = self._lines[min(index, len(self._lines) - 1)]
        end_ns = self._twin.time_ns if sender.active else sender.end_ns
        return {
            "opened": self._opened,
            "started": self._started,
            "name": self._name,
            "format": self._title,
            "state": "ready" if self._fresh else sender.state,
            "made": index,
            "commands": len(self._lines),
            "line": line.number if self._fresh else sender.number,
            "command": line.command[:SHOWN],
            "seconds": 0.0 if self._fresh else (end_ns - sender.begin_ns) / SECOND_NS,
            "why": "" if self._fresh else sender.why,
            "cautions": self._cautions,
            "from_line": self._part.first,
            "to_line": self._part.last,
            "not_made": self._not_made,
        }


def _in_words(error: Exception) -> str:
    """An error of a file; the remedy is that of the page."""
    beyond = error.__cause__
    if not isinstance(beyond, BeyondError) or beyond.zero is None:
        return str(error)
    return f"{beyond.why}: Fit zero puts the zero of the workpiece to {in_words(beyond.zero)}"
