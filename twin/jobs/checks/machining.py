"""The spindle over time, and what the tool does meanwhile: cuts with a standing spindle, rapids through stock.

    file   --- drawing (contour.py) --->  pieces: cut or rapid, speed of the spindle, line    changes of tools
    twin   --- Machining.look --------->  contactor, speed, command, whenever they change
    a line of the job is over: the carriages while the spindle was not as it should be  --->  piece  --->  finding
    the job is over:           what the words of the file alone say, and its pieces through the stock

What stands by the file's own words is found in the words, so it is the same on all controllers; what stands although
the file has switched it on (hood, wire, converter without a command, no time to run up) is found in the twin (jobs/17).
Commands of a controller do not say which motions cut: with stock, those in it do; without, nothing is judged.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.jobs.checks.contour import Drawing
from isel_twin.jobs.checks.rules import Bounds, Finding
from isel_twin.jobs.result import Result
from isel_twin.jobs.toolpaths import times

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.motion.record import Steps
    from isel_twin.plant.stock import Stock

Floats = NDArray[np.float64]

LOOK_NS = 5 * MILLISECOND_NS  # between two places that are looked at while the spindle is not as it should be
MOST_LOOKS = 1000  # of them in a line
SPEED_SHARE = 0.9  # of the speed that it should have, at which it has reached it: slip takes a few per cent
SURFACE_MM = 0.05  # below the surface that still counts as on it: steps, load angle, chords
ALIKE_MM = 0.02  # of two pieces that are so near to each other the first is made
AHEAD_LINES = 64  # that may be made with a command: those that a controller joins
MOST_FINDINGS = 200  # of the twin's spindle, behind which nobody looks
NEAR_MM = 0.05  # from a piece, besides the tolerance of chords and three steps
NO_STOCK = "nothing that is clamped is stock"
NO_CUTS = "no file of a CAM program that cuts, and no stock"
UNSWITCHED = (
    "nothing in it switches a spindle on, so it stands in every cut; check with spindle = false if that is meant"
)


class State(NamedTuple):
    """The spindle from t_ns on."""

    t_ns: int
    runs: bool  # contactor
    speed_rpm: float = -1.0  # below 0: the machine file does not say how fast it turns
    wanted_rpm: float = -1.0  # command of the converter


@dataclass(frozen=True)
class MachiningMark:
    """Progress of a `Machining`; what is behind it can be played anew."""

    t_ns: int
    queued: tuple[int, ...]
    findings: int
    ran: bool
    origin_mm: Floats = field(repr=False)


class Machining:
    """Follows the spindle of a twin through a job."""

    def __init__(self, twin: Twin, bounds: Bounds) -> None:
        self._twin, self._bounds = twin, bounds
        self._states: list[State] = []
        self._queued: tuple[int, ...] = ()  # lines whose motions may still be made
        self._findings: list[Finding] = []
        self._ran = False  # the contactor has been on
        self._drawn: Drawing | None = None
        self._lifts = self._needing = np.zeros(0, dtype=np.bool_)
        self._most_rpm = 0.0  # that the file asks for in a cut
        self._stocks: tuple[Stock, ...] = ()
        self._high_mm = self._radius_mm = 0.0
        if any(one.stock for one in twin.machine.fixtures):
            from isel_twin.plant.stock import stocks

            self._stocks, self._high_mm, self._radius_mm = stocks(twin.machine)
        self._sense = self._origin_mm = np.zeros(len(CARRIAGES))
        probe = twin.machine.probe
        self._probing = probe is not None and probe.enabled
        self._set_origin()

    def draw(self, drawn: Drawing | None) -> None:
        """As `Inspection.draw`."""
        self._drawn = drawn
        if drawn is not None:
            self._lifts = drawn.lifts
            self._needing = drawn.cuts & ~self._lifts & (drawn.speed_rpm != 0.0)
            self._most_rpm = self._asked_rpm(np.arange(len(drawn.cuts)))

    def look(self, twin: Twin) -> None:
        """Note the spindle if it has changed."""
        outputs, spindle = twin.outputs, twin.machine.spindle
        runs = bool(outputs.get("spindle_runs", outputs.get("spindle", 0)))
        now = State(twin.time_ns, runs)
        if spindle is not None:
            wanted = spindle.wanted_rev_min(outputs.get("analog", 0), outputs.get("spindle_speed"))
            now = State(twin.time_ns, runs, abs(twin.spindle_rev_min), abs(wanted))
        if not self._states or _coarse(now) != _coarse(self._states[-1]):
            self._states.append(now)
        self._ran |= runs

    def mark(self) -> MachiningMark:
        return MachiningMark(self._twin.time_ns, self._queued, len(self._findings), self._ran, self._origin_mm)

    def back(self, mark: MachiningMark, lines: Mapping[int, int]) -> None:
        """As `Inspection.back`."""
        self._states = [state for state in self._states if state.t_ns <= mark.t_ns]
        kept = self._findings[: mark.findings]
        self._findings = [replace(one, line=one.line and lines.get(one.line, one.line)) for one in kept]
        self._queued = tuple(lines.get(line, line) for line in mark.queued)
        self._ran, self._origin_mm = mark.ran, mark.origin_mm

    def _set_origin(self) -> None:
        """Take where the zero of the counters is on the machine."""
        twin = self._twin
        self._sense = twin.direction[: len(CARRIAGES)].astype(np.float64)
        self._origin_mm = twin.machine_position_mm - self._sense * twin.position_mm

    def take(self, result: Result, steps: Steps, counter_set: bool) -> None:
        """Look at a line that is over. counter_set: a counter was set in it, so nothing was cut."""
        if counter_set:
            self._set_origin()
            return
        if not self._bounds.spindle or self._probing:
            return
        spans = list(times([result]))
        if result.parts and spans[0][1] > result.time_ns:  # of a long program only the last steps are told
            spans.insert(0, (spans[0][0], result.time_ns, spans[0][1]))
            self._queued = (1,)
        for line, begin_ns, end_ns in spans:
            self._queued = (*self._queued, line)
            self._findings += self._standing(result, begin_ns, end_ns, steps)
            moved = any(motion.end_ns > begin_ns for motion in steps.motions[-1:])
            if moved and (self._twin.idle or result.parts):
                self._queued = ()

    def _standing(self, result: Result, begin_ns: int, end_ns: int, steps: Steps) -> Iterator[Finding]:
        """Cuts between two times in which the spindle was not as it should be, one a line."""
        drawn, pieces, last = self._drawn, np.zeros(0, dtype=np.int64), self._states[-1]
        as_it_should_be = last.t_ns <= begin_ns and not _stands(last, self._most_rpm)
        if as_it_should_be or len(self._findings) > MOST_FINDINGS or (drawn is None and not self._stocks):
            return
        if drawn is not None:
            low = int(drawn.line.searchsorted(min(self._queued), side="left"))
            high = int(drawn.line.searchsorted(max(self._queued) + AHEAD_LINES, side="right"))
            pieces = np.arange(low, high)
            if not self._needing[low:high].any() or not (drawn.relay or self._ran):
                return
        asked_rpm, told = self._asked_rpm(pieces), set[int]()
        for state, a_ns, b_ns in reversed(list(self._spans(begin_ns, end_ns))):
            if b_ns <= a_ns or not _stands(state, asked_rpm):
                continue
            t_ns = np.arange(a_ns, b_ns, max(LOOK_NS, (b_ns - a_ns) // MOST_LOOKS))
            ways_mm = np.stack([self._counted(t, steps) for t in (t_ns, np.minimum(t_ns + LOOK_NS, b_ns))], axis=1)
            for k in np.flatnonzero((ways_mm[:, 0] != ways_mm[:, 1]).any(axis=1)).tolist():
                line = self._cut_there(ways_mm[k], pieces, state, result.number)
                if line is not None and line not in told:
                    told.add(line)
                    at = (line, 1) if result.parts else None
                    words = self._words(state, asked_rpm)
                    yield Finding("spindle", words, result.number if at else line, int(t_ns[k]), at)

    def _asked_rpm(self, pieces: NDArray[np.int64]) -> float:
        """The highest speed that the file asks for in cuts of these pieces, as far as the machine can be told and have
        it; 0: none."""
        drawn, spindle = self._drawn, self._twin.machine.spindle
        if spindle is None or drawn is None or spindle.speed_from == "fixed":
            return 0.0
        asked = np.nan_to_num(drawn.speed_rpm[pieces[self._needing[pieces]]])
        return min(float(asked.max(initial=0.0)), spindle.max_rev_min)

    def _spans(self, begin_ns: int, end_ns: int) -> Iterator[tuple[State, int, int]]:
        """The states between two times, each with its part of them."""
        after_ns = end_ns
        for state in reversed(self._states):
            if state.t_ns < after_ns:
                yield state, max(state.t_ns, begin_ns), after_ns
                after_ns = max(state.t_ns, begin_ns)
            if state.t_ns <= begin_ns:
                return

    def _counted(self, t_ns: NDArray[np.int64], steps: Steps) -> Floats:
        """float64 [n, 3], where the counters were at these times of the line that is over, in mm."""
        after = np.zeros((len(t_ns), len(CARRIAGES)))
        for motion in reversed(steps.motions):
            if motion.end_ns <= t_ns[0]:
                break
            whole = np.array(motion.displacement(motion.end_ns)[: len(CARRIAGES)])
            made = np.array(
                [motion.displacement(t)[: len(CARRIAGES)] for t in np.minimum(t_ns, motion.end_ns).tolist()]
            )
            after += whole - np.where((t_ns < motion.start_ns)[:, None], 0, made)
        step_mm = np.array([axis.step_mm for axis in self._twin.machine.axes])
        end_mm: Floats = (np.array(self._twin.counts[: len(CARRIAGES)]) - after) * step_mm
        return end_mm

    def _cut_there(self, way_mm: Floats, pieces: NDArray[np.int64], state: State, number: int) -> int | None:
        """The line of the cut that the carriages make from one place to the next; None: they make none."""
        drawn = self._drawn
        if self._stocks and self._below(self._on_machine(way_mm)) is None:
            return None
        if drawn is None:
            up = way_mm[1] - way_mm[0]
            lifted = not up[:2].any() and self._sense[2] * up[2] < 0.0
            return None if lifted else number
        begin, along = drawn.points_mm[pieces], np.diff(drawn.points_mm, axis=0)[pieces]
        square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
        share = np.clip(np.einsum("ij,ij->i", way_mm[0] - begin, along) / square, 0.0, 1.0)
        apart_mm = np.linalg.norm(begin + share[:, None] * along - way_mm[0], axis=1)
        ahead = way_mm[1] - way_mm[0]
        apart_mm[along @ ahead < 0.7 * np.sqrt(square) * np.linalg.norm(ahead)] = np.inf
        nearest = int((apart_mm <= apart_mm.min() + ALIKE_MM).argmax())
        step_mm = max(axis.step_mm for axis in self._twin.machine.axes)
        piece = int(pieces[nearest])
        if apart_mm[nearest] > NEAR_MM + drawn.tolerance_mm + 3.0 * step_mm or not self._needing[piece]:
            return None
        return int(drawn.line[piece]) if _stands(state, self._asked_rpm(pieces[nearest : nearest + 1])) else None

    def _words(self, state: State, asked_rpm: float) -> str:
        """A spindle that is not as it should be."""
        if not state.runs:
            return "the spindle is off in this cut" + (", though the file has switched it on" if self._drawn else "")
        if not state.wanted_rpm:
            return "the spindle stands in this cut: its converter is told 0 1/min"
        if state.wanted_rpm < SPEED_SHARE * asked_rpm:
            return f"the spindle is told {state.wanted_rpm:.0f} 1/min in this cut; the file says {asked_rpm:.0f}"
        wanted_rpm = asked_rpm or state.wanted_rpm
        return f"the spindle does not have its speed in this cut: {state.speed_rpm:.0f} of {wanted_rpm:.0f} 1/min"

    def _on_machine(self, counted_mm: Floats) -> Floats:
        """Places by the counters as fixtures have them: X and Y of the machine, and the height above the table."""
        on_machine = self._origin_mm + self._sense * counted_mm
        on_machine[:, 2] = self._high_mm - on_machine[:, 2]
        return on_machine

    def _below(self, places_mm: Floats) -> Stock | None:
        """The stock in which one of these places is, before anything was cut."""
        found = (one for one in self._stocks if (one.depth_mm(places_mm, whole=True) > SURFACE_MM).any())
        return next(found, None)

    @property
    def blind(self) -> dict[str, str]:
        """Rules that cannot be judged, and why."""
        if self._probing:
            return dict.fromkeys(("spindle", "rapid"), "a probe is in place of the cutter")
        cutting = self._drawn is not None and bool(self._drawn.cuts.any())
        blind = {} if cutting or self._stocks else {"spindle": NO_CUTS}
        if not cutting or not self._stocks:
            blind["rapid"] = "no file of a CAM program that cuts" if self._stocks else NO_STOCK
        return blind

    def findings(self) -> Iterator[Finding]:
        """All that was found, at the end of the job."""
        drawn = self._drawn
        if self._probing:
            return
        if self._bounds.spindle:
            if self._ran if drawn is None else drawn.switches:
                yield from self._joined()
                yield from self._by_words()
            elif (first := self._first_cut()) is not None:
                yield replace(first, rule="caution", message=UNSWITCHED)
        if self._bounds.rapid and self._stocks and drawn is not None:
            yield from self._through_stock(drawn)

    def _first_cut(self) -> Finding | None:
        """The first cut of a job that never switches the spindle on."""
        if self._drawn is None:
            return next(iter(self._findings), None)
        lines = self._drawn.line[self._drawn.cuts & ~self._lifts]
        return Finding("spindle", "", int(lines[0])) if len(lines) else None

    def _joined(self) -> Iterator[Finding]:
        """Findings of the twin, with the lines of one cause as one."""
        by_cause: dict[str, list[Finding]] = {}
        for one in self._findings:
            by_cause.setdefault(one.message.partition(":")[0], []).append(one)
        for found in by_cause.values():
            more = len({one.at or one.line for one in found}) - 1
            yield replace(found[0], message=f"{found[0].message}{_more(more)}")

    def _by_words(self) -> Iterator[Finding]:
        """The first cut of each stretch in which the spindle stands as the file has it."""
        drawn = self._drawn
        if drawn is None:
            return
        cuts = drawn.cuts & ~self._lifts & (drawn.speed_rpm == 0.0)
        ends = (*sorted(drawn.off)[1:], len(cuts))
        for first, end in zip(sorted(drawn.off), ends, strict=True):
            standing = [k for k in (first + np.flatnonzero(cuts[first:end])).tolist() if self._in_work(drawn, k)]
            if standing:
                lines = list(dict.fromkeys(drawn.line[standing].tolist()))
                off = drawn.off[first]
                why = f"line {off} has switched it off" if off else "no line before has switched it on"
                yield Finding("spindle", f"the spindle stands in this cut: {why}{_more(len(lines) - 1)}", lines[0])

    def _in_work(self, drawn: Drawing, piece: int) -> bool:
        """True if a piece leads below the surface of stock, or if there is none that says where that is."""
        if not self._stocks:
            return True
        begin, end = self._on_machine(drawn.points_mm[piece : piece + 2])
        ways = [one.samples(begin, end) for one in self._stocks]
        return any(len(way) and self._below(way) is not None for way in ways)

    def _through_stock(self, drawn: Drawing) -> Iterator[Finding]:
        """Rapids through what is left of the stock, and changes of tools in it."""
        places = self._on_machine(drawn.points_mm)
        for stock in self._stocks:
            stock.restore()
            for point, line in drawn.changes:
                if (deep := float(stock.depth_mm(places[point : point + 1], whole=True)[0])) > SURFACE_MM:
                    yield Finding("rapid", f"a tool is changed in {stock.name}, {deep:.2f} mm below its surface", line)
            for k in range(len(drawn.cuts)):
                if self._lifts[k]:
                    continue
                radius = self._radius_mm if drawn.cuts[k] else 0.0
                if not len(way := stock.samples(places[k], places[k + 1], radius)):
                    continue
                if drawn.cuts[k]:
                    stock.cut(way, radius)
                elif (depths_mm := stock.depth_mm(way)).max() > SURFACE_MM:
                    how = "ends in" if depths_mm[-1] > SURFACE_MM else "leads through"
                    deepest = f"{depths_mm.max():.2f} mm deep"
                    yield Finding("rapid", f"a rapid {how} {stock.name}, {deepest}", int(drawn.line[k]))


def _more(lines: int) -> str:
    return f"; and in {lines} more line{'s' if lines > 1 else ''}" if lines else ""


def _coarse(state: State) -> tuple[bool, float, float]:
    """Rounded state, by which a change is noticed."""
    return state.runs, state.wanted_rpm, round(state.speed_rpm, -2)


def _stands(state: State, asked_rpm: float) -> bool:
    """True if a cut at this speed, 0 for that of the converter's command, must not be made now."""
    if not state.runs or state.wanted_rpm < 0.0:
        return not state.runs
    return not state.wanted_rpm or state.speed_rpm < SPEED_SHARE * (asked_rpm or state.wanted_rpm)
