"""Toolpaths as commands of the iMC family.

    @0M x,f, y,f, z,f, 0,30        straight, absolute: z2 is not looked at
    @0f-1  @0y B,f,D,...  @0M      an arc of X and Y, and the rest of the way to its programmed end; with Z @0w

The same f stands for every axis: with @0z1 that of X is the speed of the leading axis, even if X stands (imc/48).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from isel_twin.cam.course import Move, Turn
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Place
from isel_twin.cam.writing import COOLANT, Speed, pause, remark
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.firmware.imc.profile import Profile
from isel_twin.motion.circle import squared_radius

SPINDLE_PORT = 2
ANALOG_PORT, ANALOG_MOST = 4, 255  # 0 to 10 V
USER_PORT = 0
USER_BITS = 8
LEAST_ARC_MM = 0.2  # radius below which chords are as good
ROUND_MM = 0.005  # by which the radius of an arc may change
# Z goes evenly with the steps of X and Y, not with the angle: by what part of its way in a quarter turn it can be off
UNEVEN = 0.05
MOST = 1 << 23  # parameters have 24 bits (imc/15)


class ImcCommands:
    """Implements `isel_twin.cam.writing.Commands`."""

    both_senses = False
    speed_by: Final = "scale"

    def __init__(self, profile: Profile, axes: MachineAxes, settings: CamSettings, reference: Sequence[str]) -> None:
        self.along_path = axes.speed_along_path
        self.low_hz, self.high_hz = profile.min_speed_hz, profile.max_speed_hz
        self._lacks = profile.unknown_commands
        self._arc: tuple[int, ...] | None = None  # B, D, ... of the arc that has been asked for
        self._plane_free = "e" not in self._lacks  # the plane of arcs may be another one from before
        self._axes = axes.count
        self._z_mm = axes.steps_mm[2]
        self._tolerance_mm = settings.tolerance_mm
        self._outputs = settings.outputs
        self._reference = reference
        self._spindle_port = profile.spindle_port if profile.spindle_port >= 0 else SPINDLE_PORT
        self._user = 0  # what has been written to the user port
        self._spins, self._analog = False, -1  # -1: nothing has been written to its port

    def begin(self) -> Iterable[str]:
        return [line for line in self._reference if line[2] not in self._lacks]

    def move(self, move: Move) -> Iterable[Written]:
        if "z" in self._lacks and move.steps[2] and (move.steps[0] or move.steps[1]):
            return self._by_parts(move)
        return (self._line(move.place, move.to, self._speed(move)),)

    def _speed(self, move: Move) -> int:
        """Speed of the leading axis, or along the path (motion/1), where axes of other counts may ask for too much."""
        if not self.along_path:
            return round(move.hz)
        return min(round(move.hz * math.hypot(*move.steps) / max(map(abs, move.steps))), self.high_hz)

    def _line(self, place: Place, to: tuple[int, int, int], hz: int) -> Written:
        x, y, z = to
        if self._axes == 3:
            return Written(f"@0M{x},{hz},{y},{hz},{z},{hz},0,30", place)
        return Written(f"@0M{x},{hz},{y},{hz}" if self._axes == 2 else f"@0M{x},{hz}", place)

    def _by_parts(self, move: Move) -> Iterable[Written]:
        """Without 3D Z goes by itself: away from the reference end last, towards it, which is up, first."""
        if not move.rapid:
            raise CamError("X or Y with Z in one line: this controller moves Z by itself", move.place)
        (x, y, z), (dx, dy, dz) = move.to, move.steps
        first = (x - dx, y - dy, z) if abs(z) < abs(z - dz) else (x, y, z - dz)
        hz = round(move.hz)
        return self._line(move.place, first, hz), self._line(move.place, move.to, hz)

    def turn_counts(self, turn: Turn) -> float | None:
        """A helix is one command, too, if Z leaves it by no more than chords would."""
        height = turn.to[2] - turn.start[2]
        if height and abs(height / self._z_mm * math.pi / 2.0 / turn.sweep) * UNEVEN > self._tolerance_mm:
            return None
        round_ = turn.radius_mm > LEAST_ARC_MM and abs(turn.spread_mm) <= ROUND_MM
        known = {"f", "w" if height else "y"}.isdisjoint(self._lacks)
        if not (round_ and known and (turn.a, turn.b) == (0, 1)):
            return None
        self._arc = _parameters(turn)
        return None if self._arc is None or abs(height) > self._arc[0] else float(self._arc[0])

    def turn(self, turn: Turn) -> Iterable[Written]:
        assert self._arc is not None, turn
        b, *others = self._arc
        hz = round(b * turn.speed_mm_s / turn.length_mm)
        if height := turn.to[2] - turn.start[2]:
            others.append(height)
        if self._plane_free:
            self._plane_free = False
            yield Written("@0e0", turn.place)
        yield Written("@0f-1" if turn.sweep > 0 else "@0f0", turn.place)
        yield Written(f"@0{'w' if height else 'y'}{b},{hz},{','.join(map(str, others))}", turn.place)
        yield self._line(turn.place, turn.to, hz)

    def held(self) -> Iterable[Written]:
        return ()

    def settled(self, place: Place) -> Iterable[Written]:
        return ()

    def reference(self, axes: tuple[int, ...]) -> Iterable[str]:
        """With all axes together from then on, which a reference run ends."""
        run = [f"@0R{sum(1 << axis for axis in axes)}"] if axes else []
        return [*run, "@0z1"] if self._axes == 3 and "z" not in self._lacks else run

    def dwell(self, seconds: float) -> str:
        return pause(seconds)

    def spindle(self, turns: int, speed: Speed | None) -> Iterator[str]:
        """Its speed first; that alone if it turns."""
        if turns and speed is not None and (analog := round(ANALOG_MOST * speed.share)) != self._analog:
            self._analog = analog
            yield f"@0B{ANALOG_PORT},{analog}"
            if self._spins:
                return
        self._spins = bool(turns)
        if "spindle" in self._outputs:
            yield from self.output("spindle", self._spins) or ()
        else:
            yield f"@0B{self._spindle_port},{abs(turns)}"

    def coolant(self, number: int, on: bool) -> Iterable[str] | None:
        return self.output(COOLANT[number], on)

    def output(self, name: str, on: bool) -> Iterable[str] | None:
        """A bit of the user port; the others stay."""
        bit = self._outputs.get(name)
        if bit is None:
            return None
        if not 0 <= bit < USER_BITS:
            raise CamError(f"[cam] outputs: {name} = {bit}; the user port has bits 0 to {USER_BITS - 1}")
        self._user = self._user | 1 << bit if on else self._user & ~(1 << bit)
        return [f"@0B{USER_PORT},{self._user}"]

    def remark(self, text: str) -> str:
        return remark(text)

    def end(self) -> Iterable[str]:
        return ()


def _parameters(turn: Turn) -> tuple[int, ...] | None:
    """B, D, Xs, Ys, Rx, Ry; None if the controller would not read a radius out of them that is meant (motion/3).

    The centre is moved to a whole number of steps, and R is a whole number for which the circle passes through the
    start: of all that are near, the two that move the arc least.
    """
    mean = (turn.radius_mm + turn.spread_mm / 2.0) * turn.per_mm
    near, x, y = round(mean), turn.start[0] - turn.centre[0], turn.start[1] - turn.centre[1]
    xs, ys = round(x), round(y)
    if (found := _read_as(turn, xs, ys, near)) is not None:
        return found
    others = [
        (math.hypot(u - x, v - y) + abs(r - mean), u, v, r)
        for u in (math.floor(x), math.ceil(x))
        for v in (math.floor(y), math.ceil(y))
        for r in {near, math.floor(mean), math.ceil(mean), round(math.hypot(u, v))}
    ]
    return next((found for _, u, v, r in sorted(others) if (found := _read_as(turn, u, v, r)) is not None), None)


def _read_as(turn: Turn, xs: int, ys: int, r: int) -> tuple[int, ...] | None:
    """The parameters for a start there, as seen from the centre; None if the controller reads another radius."""
    xe, ye = xs + turn.to[0] - turn.start[0], ys + turn.to[1] - turn.start[1]
    sign = 1 if turn.sweep > 0 else -1
    rx, ry = _senses(xs, ys * sign)
    ry *= sign
    d = (rx * ry * (r * r - xs * (xs + rx) - ys * (ys + ry))) // 2
    read = squared_radius(d, xs, ys, rx, ry) if sign > 0 else squared_radius(d, ys, xs, ry, rx)
    if read != r * r:
        return None
    b = _counted(xs, ys * sign, xe, ye * sign, r, abs(turn.sweep))
    return (b, d, xs, ys, rx, ry) if 0 < b < MOST and max(abs(d), abs(xs), abs(ys)) < MOST else None


def _senses(x: int, y: int) -> tuple[int, int]:
    """In which X and Y go counter-clockwise; a half axis belongs to the quadrant that is entered there."""
    return -1 if y > 0 or (y == 0 and x > 0) else 1, 1 if x > 0 or (x == 0 and y < 0) else -1


def _counted(xs: int, ys: int, xe: int, ye: int, r: int, sweep: float) -> int:
    """Single-axis steps of a counter-clockwise arc: |dx| + |dy| from one half axis to the next is 2 R."""
    whole = 8 * r
    turns, rest = divmod(sweep, 2.0 * math.pi)
    way = (_along(xe, ye, r) - _along(xs, ys, r)) % whole
    expected = rest / (2.0 * math.pi) * whole
    if way - expected > whole / 2:  # an end a step before the start
        way -= whole
    elif expected - way > whole / 2:
        way += whole
    return max(way, 0) + whole * int(turns)


def _along(x: int, y: int, r: int) -> int:
    """Steps from (R, 0), counter-clockwise."""
    if x > 0 and y >= 0:
        return r - x + y
    if x <= 0 and y > 0:
        return 3 * r - x - y
    if x < 0:
        return 5 * r + x - y
    return 7 * r + x + y
