"""The operator's desk: moves by hand, in the words of the controller's language (`reference`, `move`, `break_off`).

    {"desk": {"home": true}}                                   reference runs of all axes
    {"desk": {"jog": {"axis": "x", "mm": -0.1, "mm_s": 20}}}   a step; more of them wait for each other
    {"desk": {"jog": {"axis": "x", "way": 1, "mm_s": 20}}}     towards the end of the travel, until stop
    {"desk": {"hold": true}}                                   its key is still down: said at least each HELD_S
    {"desk": {"go": {"x": 10, "y": 5}, "mm_s": 40}}            to a place of the workpiece
    {"desk": {"zero": {"x": 0}}}                               the tool is at this place of the workpiece
    {"desk": {"stop": true}}                                   break off, and forget what waits
    frame["desk"]                                              what is done, what was refused, place of the workpiece

No controller of the package can jog over its line. A continuous jog is a move that is broken off when the key is let
go, or when nothing more is heard of it (a browser that hangs). The ramps are those that the controller was delivered
with, so that a job behind it finds them; the speed of a move may stay set, as behind any host.

Places of the workpiece are in mm as a CAM file has them, Z upwards; its zero is that of [cam] until one is set here.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Limits, Place, known, plain, table
from isel_twin.bridge.operate.control import ControlError
from isel_twin.bridge.operate.panel.sender import Sender
from isel_twin.bridge.serve.server import Server
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Point
from isel_twin.controller import offers
from isel_twin.core.twin import Twin
from isel_twin.jobs.job import Line
from isel_twin.jobs.toolpaths import machine_axes
from isel_twin.language import Language, LanguageError, MoveSettings, RetimesJobs

HELD_S = 1.0  # wall time after which a key that nobody reports is let go
WAITING = 20  # most moves that wait
USUAL_MM_S = 20.0

_MM = Limits("mm", -1e5, 1e5)
_MM_S = Limits("mm/s", 1e-3, 1e4)

_Moves = Callable[[], Sequence[bytes]]


class Desk:
    """Moves by hand. Used in the thread of the server's loop only."""

    def __init__(self, server: Server, twin: Twin, language: Language, settings: CamSettings) -> None:
        self._server, self._twin, self._language = server, twin, language
        self._zero: Point = settings.zero
        self._set = False
        self._signs = (1, 1, settings.z_sign)
        self._travels_mm = machine_axes(twin.machine).travel_mm
        self._waiting: deque[tuple[str, _Moves]] = deque()
        self._doing = self._why = ""
        self._taken = 0  # moves, since the beginning
        self._held_s: float | None = None  # wall time until which a key is held
        self.sender = Sender(server, twin)

    @property
    def about(self) -> dict[str, Any]:
        """Constant data for the page."""
        low, high = self._language.ranges["speed_hz"]
        step_mm = float(max(self._twin.step_mm[:3]))
        lowest, highest = low * step_mm, high * float(min(self._twin.step_mm[:3]))
        return {
            "axes": list(CARRIAGES),
            "signs": list(self._signs),
            "mm_s": [lowest, highest, min(USUAL_MM_S, highest)],
            "pauses": self.sender.pauses,
        }

    @property
    def busy(self) -> bool:
        """True while it moves the machine, or is about to."""
        return self.sender.active or bool(self._waiting)

    def zero_mm(self) -> Point | None:
        """The zero of the workpiece as the counters tell it, mm, if it has been set here."""
        return self._zero if self._set else None

    def set_zero(self, counters_mm: Point) -> None:
        self._zero, self._set = counters_mm, True

    @property
    def shown(self) -> dict[str, Any]:
        counted = self._counted_mm()
        work = [s * (mm - zero) for s, mm, zero in zip(self._signs, counted, self._zero, strict=True)]
        return {
            "doing": self._doing if self.busy else "",
            "waiting": len(self._waiting),
            "taken": self._taken,
            "why": self._why,
            "zero_mm": list(self._zero),
            "work_mm": work,
        }

    # Requests

    def ask(self, request: Any, free: Callable[[Place], None]) -> dict[str, Any]:
        """Carry out a request. free: raises ControlError if the line is not the panel's now. Raises ControlError."""
        place = Place("request", ControlError).at("desk")
        content = dict(table(request, place))
        known(content, ("home", "jog", "hold", "go", "mm_s", "zero", "stop"), place)
        mm_s = content.pop("mm_s", USUAL_MM_S) if "go" in content else USUAL_MM_S
        if len(content) != 1:
            raise place.wrong("nothing to do; allowed: one of home, jog, hold, go, zero, stop")
        ((key, value),) = content.items()
        where = place.at(key)
        if key in ("home", "hold", "stop") and value is not True:
            raise where.wrong(f"{value!r}; allowed: true")
        if key == "stop":
            self.stop()
        elif key == "hold":
            if self._held_s is not None:
                self._held_s = self._server.pacer.wall_s + HELD_S
        elif key == "zero":
            self._set_zero(table(value, where), where)
        else:
            act = {"home": self._home, "jog": self._jog, "go": self._go}[key]
            name, moves = act(value, mm_s, where)
            free(where)
            self._take(name, moves, where)
        return self.shown

    def stop(self) -> None:
        """Forget what waits, and break off what moves."""
        self._waiting.clear()
        self._held_s = None
        self.sender.stop("")

    def _take(self, name: str, moves: _Moves, place: Place) -> None:
        if self._server.pacer.paused:
            raise place.wrong("virtual time stands still; allowed: when it goes on")
        if len(self._waiting) >= WAITING:
            raise place.wrong(f"{WAITING} moves are waiting already; allowed: when one of them has been made")
        self._why = ""
        self._taken += 1
        self._waiting.append((name, moves))
        self.advance()

    def _home(self, value: Any, mm_s: float, place: Place) -> tuple[str, _Moves]:
        return "home", self._language.reference

    def _jog(self, value: Any, _: float, place: Place) -> tuple[str, _Moves]:
        content = table(value, place)
        known(content, ("axis", "mm", "way", "mm_s"), place)
        axis = self._axis(content.get("axis"), place.at("axis"))
        settings = self._settings(content.get("mm_s", USUAL_MM_S), (axis,), place.at("mm_s"))
        if ("mm" in content) == ("way" in content):
            raise place.wrong("how far? allowed: one of mm, way")
        if "mm" in content:
            mm = plain(content["mm"], _MM, place.at("mm"))
            return f"{CARRIAGES[axis]} {mm:+g} mm", lambda: self._moved(axis, mm, settings)
        way = content["way"]
        if isinstance(way, bool) or way not in (1, -1):
            raise place.at("way").wrong(f"{way!r}; allowed: 1, -1")
        if self._server.pacer.speed is None:
            raise place.at("way").wrong("time does not pass at the speed max; allowed: steps, or another speed")
        end_mm = self._end_mm(axis, way)
        if (end_mm - self._counted_mm()[axis]) * way < self._twin.step_mm[axis]:
            raise place.at("way").wrong(f"{CARRIAGES[axis]} is at the end of its travel; allowed: steps")
        self._held_s = self._server.pacer.wall_s + HELD_S
        return f"{CARRIAGES[axis]} {'+' if way > 0 else '-'}", lambda: self._to({axis: end_mm}, settings)

    def _go(self, value: Any, mm_s: Any, place: Place) -> tuple[str, _Moves]:
        content = table(value, place)
        places = self._places(content, place)
        target = {axis: self._zero[axis] + self._signs[axis] * mm for axis, mm in places.items()}
        settings = self._settings(mm_s, tuple(places), place.at("mm_s"))
        name = " ".join(f"{CARRIAGES[axis]} {mm:g}" for axis, mm in places.items())
        return f"to {name}", lambda: self._to(target, settings)

    def _set_zero(self, content: Mapping[str, Any], place: Place) -> None:
        """The tool is at this place of the workpiece."""
        counted, zero = self._counted_mm(), list(self._zero)
        for axis, mm in self._places(content, place).items():
            zero[axis] = counted[axis] - self._signs[axis] * mm
        self.set_zero((zero[0], zero[1], zero[2]))

    def _places(self, content: Mapping[str, Any], place: Place) -> dict[int, float]:
        if not content:
            raise place.wrong("no axis; allowed: x, y, z with their places in mm")
        return {self._axis(name, place): plain(mm, _MM, place.at(name)) for name, mm in content.items()}

    def _axis(self, name: Any, place: Place) -> int:
        if name not in CARRIAGES:
            raise place.wrong(f"{name!r}; allowed: {', '.join(CARRIAGES)}")
        return CARRIAGES.index(name)

    # Moves

    def _counted_mm(self) -> list[float]:
        return (self._twin.counts[:3] * self._twin.step_mm[:3]).tolist()

    def _end_mm(self, axis: int, way: int) -> float:
        """End of the travel as the counters tell it, for a machine that has been referenced."""
        return self._travels_mm[axis][1 if way > 0 else 0]

    def _settings(self, mm_s: Any, axes: Sequence[int], place: Place) -> MoveSettings:
        """With the ramps of the controller as delivered."""
        language = self._language
        low, high = language.ranges["speed_hz"]
        step_mm = float(max(self._twin.step_mm[axis] for axis in axes))
        speed_hz = min(max(round(plain(mm_s, _MM_S, place) / step_mm), low), high)
        return MoveSettings(speed_hz, **(language.defaults if offers(language, RetimesJobs) else {}))

    def _moved(self, axis: int, mm: float, settings: MoveSettings) -> Sequence[bytes]:
        return self._to({axis: self._counted_mm()[axis] + mm}, settings)

    def _to(self, target_mm: Mapping[int, float], settings: MoveSettings) -> Sequence[bytes]:
        counts = self._twin.counts[:3].tolist()
        for axis, mm in target_mm.items():
            counts[axis] = round(mm / self._twin.step_mm[axis])
        return self._language.move(counts, settings)

    # In each round of the server

    @property
    def wait_s(self) -> float | None:
        waits = [self.sender.wait_s]
        if self._held_s is not None:
            waits.append(max(0.0, self._held_s - self._server.pacer.wall_s))
        return min((wait for wait in waits if wait is not None), default=None)

    def advance(self) -> None:
        """Send what is due."""
        if self._held_s is not None and self._server.pacer.wall_s >= self._held_s:
            self.stop()
        before = self.sender.active
        self.sender.advance()
        if before and not self.sender.active:
            self._ended()
        while self._waiting and not self.sender.active and self._twin.idle:
            name, moves = self._waiting.popleft()
            try:
                lines = [Line(0, "", (data,)) for data in moves()]
            except LanguageError as error:
                self._why = f"{name}: {error}"
                self._waiting.clear()
                return
            self._doing = name
            self.sender.begin(lines)
            self.sender.advance()
            if not self.sender.active:
                self._ended()

    def _ended(self) -> None:
        self._held_s = None
        if self.sender.state == "failed" or self.sender.why:
            self._why = f"{self._doing}: {self.sender.why}"
        elif self.sender.state == "done" and self._twin.fault:
            self._why = f"{self._doing}: the controller shows an error: {self._twin.fault_cause}"
        if self._why:
            self._waiting.clear()
