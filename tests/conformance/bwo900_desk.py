"""The BWO 900 on the test desk: files as the manual prints them (3.10), a referenced machine, and programs analysed to
their end. Programs are written here with `|` between their blocks."""

from __future__ import annotations

from collections.abc import Mapping

from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.readings import Readings
from isel_twin.testing import Desk, IdealDrives

CARRIAGE = (20_000, 20_000, 20_000)
T1 = {"p21000": 1.0, "p21020": 2.0, "p21030": 3.0, "p21011": 0.0, "p21031": 0.0}
"""Tools (P21000 on, 20 parameters each): T1 without radius, T2 with radius 3."""


def file(*lines: str) -> bytes:
    """A file as it goes over the line: a blank line, the lines, #, EOT, a blank line."""
    return ("\r\n" + "".join(f"{line}\r\n" for line in (*lines, "#"))).encode("latin-1") + b"\x04\r\n"


def parameters(**values: float) -> bytes:
    """A file of parameters: p100=5, q171=2."""
    return file("D", *(f"{'K1:P' if n[0] == 'p' else 'q'} {n[1:]}: {value}" for n, value in values.items()))


REFERENCE = parameters(p8683=1, p12530=1, p12330=1, p12130=1)


def fresh(
    *programs: str, referenced: bool = True, settings: Mapping[str, object] | None = None, **before: float
) -> Desk:
    """A control with these programs and parameters, its axes at 0. settings: of the machine file."""
    desk = Desk.of("bwo900", carriage=CARRIAGE, settings=settings or {})
    for text in programs:
        desk.send(file(*text.split("|")))
    if before:
        desk.send(parameters(**before))
    if referenced:
        desk.send(REFERENCE)
        desk.finish()
    desk.run(0.01)
    return desk


def start(desk: Desk, number: int = 1, mode: int = 2) -> None:
    """Mode and Start."""
    desk.send(parameters(p8800=number, p8683=mode, p8684=1))


def run(*programs: str, mode: int = 2, **before: float) -> Desk:
    """P1 from its beginning to its end."""
    desk = fresh(*programs, **before)
    start(desk, mode=mode)
    desk.finish()
    return desk


def seconds(*programs: str, **before: float) -> float:
    """How long P1 takes, of virtual time."""
    desk = fresh(*programs, **before)
    begin = desk.time_ns
    start(desk)
    desk.finish()
    return (desk.time_ns - begin) / 1e9


def said(desk: Desk) -> list[int]:
    """Numbers of the messages, in order."""
    return [int(text[1:5]) for _, text in desk.remarks if text[:1] == "M" and text[1:5].isdigit()]


def mm(desk: Desk) -> tuple[float, ...]:
    return tuple(count / 1000.0 for count in desk.counts)


def value(desk: Desk, number: int) -> float:
    """A parameter P as the control puts it out (P11181)."""
    bases = (
        (0, 5_000, 10_000),
        (7_000, 10_000, 15_000),
        (11_000, 12_000, 1_000),
        (12_000, 18_400, 2_000),
        (20_000, 22_000, 20_000),
    )
    q = next(base + number - first for first, end, base in bases if first <= number < end)
    return put_out(desk)[q]


def put_out(desk: Desk) -> dict[int, float]:
    """All parameters, as the control puts them out, by q."""
    before = len(desk.replies)
    desk.send(parameters(p11181=0))
    lines = b"".join(data for _, data in desk.replies[before:]).decode("latin-1").split("\r\n")
    return {int(line[1:].split(":")[0]): float(line.split(":")[1].split()[0]) for line in lines if line[:1] == "q"}


def analysed(text: str, readings: Readings = Readings(), **values: float) -> Analysed:  # noqa: B008 -- frozen
    """A program analysed to its end."""
    return Analysed(text.replace("|", "\n"), readings=readings, **values)


class Lagging:
    """Drives that lag as they are told: `lag`, increments by axis; see isel_twin.controller.Drives."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self.lag: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.in_position = (True, True, True)
        self.speed = (0.0, 0.0, 0.0)
        self.on = (True, True, True)
        self.past_zero_pulse = (0, 0, 0)
        self.spindle_rev_min: float | None = None
        self.fault = self.overloaded = (False, False, False)
        desk.controller.use_drives(self)

    @property
    def encoder(self) -> tuple[int, ...]:
        return tuple(round(c - lag) for c, lag in zip(self._desk.counts, self.lag, strict=True))


class Pulsing(IdealDrives):
    """Ideal axes with a zero pulse every 5000 increments, the next one after power-on 1766 away."""

    @property
    def past_zero_pulse(self) -> tuple[int, ...]:
        return tuple(int(3_234 + made) % 5_000 for made in self._desk.steps.delta.sum(axis=0))


class Turning(IdealDrives):
    """Ideal axes, and a spindle that runs up in `ramp` 1/min a second to what its drive is told while A 0.0 is on."""

    def __init__(self, desk: Desk, ramp: float = 10_000.0) -> None:
        super().__init__(desk)
        self._desk, self.ramp = desk, ramp
        self.turns = self._speed = self._slip = 0.0
        self._told = {"spindle": 0, "spindle_speed": 0}
        self._seen, self._since_ns = 0, desk.time_ns

    @property
    def spindle_rev_min(self) -> float | None:
        log = self._desk.output_log
        for t_ns, name, level in log[self._seen :]:
            if name in self._told:
                self._turn_on(t_ns)
                self._told[name] = level
        self._seen = len(log)
        self._turn_on(self._desk.time_ns)
        return self._speed

    @property
    def slip(self) -> float:
        """Part of the speed by which it gives way."""
        return self._slip

    @slip.setter
    def slip(self, part: float) -> None:
        _ = self.spindle_rev_min
        self._slip = part

    def _turn_on(self, t_ns: int) -> None:
        goal = self._told["spindle_speed"] * (1.0 - self._slip) if self._told["spindle"] else 0.0
        seconds = (t_ns - self._since_ns) / 1e9
        before, most = self._speed, self.ramp * seconds
        self._speed = before + min(max(goal - before, -most), most)
        ramp_s = min(abs(self._speed - before) / self.ramp, seconds)
        self.turns += ((before + self._speed) / 2.0 * ramp_s + self._speed * (seconds - ramp_s)) / 60.0
        self._since_ns = t_ns


def with_spindle(*programs: str, ramp: float = 10_000.0, **before: float) -> tuple[Desk, Turning]:
    """A referenced control on a machine with a spindle."""
    made: list[Turning] = []

    def fitted(desk: Desk) -> Turning:
        made.append(Turning(desk, ramp))
        return made[-1]

    desk = Desk.of("bwo900", carriage=CARRIAGE, drives=fitted)
    for text in programs:
        desk.send(file(*text.split("|")))
    if before:
        desk.send(parameters(**before))
    desk.send(REFERENCE)
    desk.finish()
    desk.run(0.01)
    return desk, made[0]
