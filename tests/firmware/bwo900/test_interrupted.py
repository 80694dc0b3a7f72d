"""A BWO 900 that measures, taps, follows a spline or swings, interrupted in the middle by everything that may happen.

What must hold: the axes stand soon, and nothing goes on by itself; once everything has been put right, the same program
ends where an undisturbed one does; and a twin that is saved in the middle and loaded by another one ends with the same
bits.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from conformance.bwo900_desk import REFERENCE, file, parameters

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.core.state import TwinState
from isel_twin.machine import Fixture
from isel_twin.wiring import ScenarioError, event_now

pytestmark = pytest.mark.long(seconds=6)

START_MM = (30.0, 30.0, 30.0)
MEASURE = (
    "P1",
    "N10 P8892:4 M01",
    "N20 T1 M16",
    "N30 G17 G53 G0 X200 Y150 Z-50",
    "N40 G1 Z-70 F3000",
    "N50 P140:2 P141:3 P143:100 P144:2 P147:500 P504:5 P149:510",
    "N60 P150:520 P522:-83",
    "N70 G69",
    "N80 G0 Z-50",
    "N90 M30",
)
TAP = ("P1", "N10 G0 X0 Y0 Z30 M3 S3000", "N20 G84 X1 P32:0.5 P33:15 P34:28 P35:30", "N30 M30")
SPLINE = (
    "P1", "N10 G1 F1200 X20 Y20", "N20 G51 X30 Y35", "N30 X40 Y20", "N40 X60 Y30", "N50 G1 X80", "N60 M30",
)  # fmt: skip
WORKS = {"measuring": (MEASURE, 4.4), "tapping": (TAP, 1.7), "spline": (SPLINE, 2.9)}
"""Programs, and seconds after their start: the probe is on its way, the tap in the thread, the axes on the spline."""


def machine(work: str) -> Twin:
    """The same machine each time."""
    if work == "tapping":
        return Twin("4030-servo-hf", "bwo900", plant="kinematic", start_mm=START_MM)
    block = Fixture("block", "box", (40.0, 40.0, 17.0), (205.0, 155.0, 0.0))
    overrides = {"probe.enabled": True}
    return Twin("4030-servo", "bwo900", plant="kinematic", start_mm=START_MM, fixtures=(block,), overrides=overrides)


def refer(twin: Twin) -> None:
    twin.write(REFERENCE)
    twin.run_until_idle(60.0)


def begin(twin: Twin, work: str, *, mode: int = 2) -> None:
    twin.write(file(*WORKS[work][0]))
    twin.write(parameters(p21000=1, p21010=3, p8683=1, p8508=1))
    twin.write(parameters(p8800=1, p8683=mode, p8684=1))


@cache
def middle(work: str) -> TwinState:
    twin = machine(work)
    refer(twin)
    begin(twin, work)
    twin.run(WORKS[work][1])
    return twin.save()


def in_the_middle(work: str) -> Twin:
    twin = machine(work)
    twin.restore(middle(work))
    return twin


def end(twin: Twin) -> tuple[list[int], bool]:
    return [int(count) for count in twin.counts], twin.fault


@cache
def undisturbed(work: str) -> tuple[list[int], bool]:
    twin = in_the_middle(work)
    twin.run_until_idle(120.0)
    return end(twin)


def of_element(name: str, bad: str, good: str) -> tuple[Callable[[Twin], None], Callable[[Twin], None]]:
    return lambda twin: twin.set_input(name, bad), lambda twin: twin.set_input(name, good)


def nothing(twin: Twin) -> None:
    """Nothing has to be put right."""


def mains(twin: Twin, *, on: bool) -> None:
    twin.carry_out(event_now({"brownout": not on}, Place("test", ScenarioError), twin.settable))


INTERRUPTIONS = {
    "emergency stop": of_element("estop", "pressed", "released"),
    "hood": of_element("hood", "forced", "closed"),
    "abort": (lambda twin: twin.write(parameters(p8705=1)), nothing),
    "HAND": (lambda twin: twin.write(parameters(p8683=1)), nothing),
    "mains": (lambda twin: mains(twin, on=False), lambda twin: mains(twin, on=True)),
    "emergency position": (lambda twin: twin.write(parameters(p12032=100, p12132=1)), nothing),
}


@pytest.mark.parametrize("interruption", INTERRUPTIONS)
@pytest.mark.parametrize("work", WORKS)
def test_interrupted_in_the_middle(work: str, interruption: str) -> None:
    happens, put_right = INTERRUPTIONS[interruption]
    twin = in_the_middle(work)
    happens(twin)
    twin.run(6.0)
    stands = twin.counts.tolist()
    twin.run(5.0)
    assert twin.counts.tolist() == stands, "it stands"
    assert stands != undisturbed(work)[0]
    put_right(twin)
    twin.run(1.0)
    assert twin.counts.tolist() == (stands if interruption != "mains" else twin.counts.tolist())
    twin.write(parameters(p8683=1))
    refer(twin)
    begin(twin, work)
    twin.run(1.0)
    twin.run_until_idle(120.0)
    assert end(twin) == undisturbed(work)


@pytest.mark.parametrize("work", WORKS)
def test_saved_in_the_middle_and_loaded_by_another_twin(work: str) -> None:
    twin, other = in_the_middle(work), machine(work)
    twin.run(0.013)
    other.restore(twin.save())
    lives = []
    for one in (twin, other):
        one.run_until_idle(120.0)
        lives.append((one.time_ns, one.counts.tolist(), one.machine_position_mm.tolist(), one.spindle_turns))
    assert lives[0] == lives[1]
    assert lives[0][1] == undisturbed(work)[0]


def test_saved_while_an_axis_goes_to_and_fro() -> None:
    """Of what the PLC asks for: a swinging axis and one on its way to a place, restored between two turns."""
    twin, other = machine("spline"), machine("spline")
    refer(twin)
    twin.write(parameters(p12037=6, p12038=0.3, p12321=300))
    twin.write(parameters(p12133=256, p12312=20))
    twin.run(2.13)
    other.restore(twin.save())
    lives = []
    for one in (twin, other):
        one.run(4.0)
        one.write(parameters(p12133=0))
        one.run_until_idle(30.0)
        lives.append((one.time_ns, one.counts.tolist(), one.machine_position_mm.tolist()))
    assert lives[0] == lives[1]
    assert lives[0][1][1] == 20_000
