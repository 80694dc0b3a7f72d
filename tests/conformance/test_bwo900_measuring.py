"""Measuring cycles G69 with a touch probe on the machine (manual 5.1), and their messages.

The printed examples run as they stand, but for A and B, which the machine has not. Zero point 0 (G53) puts them onto
it, and P8892 lets Z rise upwards:

    control = (X - 424.96, Y - 174.3, 352.23 - Z) mm        machine = control + 5 mm: the reference points are there

Expected values: gauge, bore and surface stand where the test puts them; the probe answers as its law says (plant/24),
which is 5, 11, 8 and 8 um in +X, -X, +Y and -Y, 8 um in Z.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest
from conformance.bwo900_desk import REFERENCE, file, fresh, parameters, put_out, said, start
from conformance.rows import case, shows

from isel_twin import Twin
from isel_twin.machine import Fixture

pytestmark = pytest.mark.long(seconds=11)

GAUGE_AT, BORE_AT = (624.96, 324.3), (600.35, 299.8)
"""The printed centre; one near X600 Y300, where the printed example begins."""
TABLE_Z = 250.23
"""Of the ball's lowest point on the table: 147 mm of travel less its reach of 40 mm are 102 mm of the control."""
STEP_MM = 0.001
"""An increment of the encoders."""
OVERWRITTEN = 1106
BEGIN = "N10 P8892:4 M01|N20 T1 M16|N30 G17 G53 G0 X{} Y{} Z280|N40 G1 Z270 F3000"
COMMON = "N120 P141:3|N130 P143:100|N140 P144:2|N150 P147:500|N160 P504:5|N170 P149:510"
END = "N240 G0 Z280 M30"
IN_BORE = f"N110 P140:1|{COMMON}|N180 P150:520|N182 P520:624.96 P521:324.3P523:54|N230 G69|{END}"
ON_SURFACE = f"N110 P140:2|{COMMON}|N180 P150:520|N182 P522:260.23|N230 G69|{END}"
CENTRE = f"N110 P140:60|{COMMON}|N180 P152:22|N190 P154:530|N230 G69|{END}"
PLACE = f"N110 P140:40|{COMMON.replace('|N170', '|N165 P148:3|N170')}|N180 P154:550|N230 G69|{END}"
"""The printed examples from N110 on."""
TOOL = {"p21000": 1.0, "p21010": 3.0, "p21011": 0.0}
ZERO = {"p20000": -424.96, "p20001": -174.3, "p20002": -352.23}


def at(place: tuple[float, float]) -> tuple[float, float, float]:
    """Machine coordinates of a place on the table."""
    return place[0] - 419.96, place[1] - 169.3, 0.0


def ring(place: tuple[float, float], bore: float) -> Fixture:
    """25 mm high: the ball is in it at Z270."""
    return Fixture("ring", "ring", (bore + 20.0, bore, 25.0), at(place))


def block(top: float) -> Fixture:
    return Fixture("block", "box", (40.0, 40.0, top - TABLE_Z), at((600.0, 300.0)))


STATED_MM = 0.003
"""Of a place: repeatability 0.5 um and increments of 1 um, of each edge, in calibration and bore."""


class Bench:
    """A twin with a probe, referenced, that carries out programs."""

    def __init__(self, *fixtures: Fixture, plant: str = "kinematic", **overrides: Any) -> None:
        values: dict[str, Any] = {"probe.enabled": True, **overrides}
        self.twin = Twin(
            controller="bwo900", machine="4030-servo", plant=plant, start_mm=(30, 30, 30), seed=1,
            fixtures=fixtures, overrides=values,
        )  # fmt: skip
        self.remarks: list[str] = []
        self.twin.listen(lambda _, kind, what: self.remarks.append(str(what)) if kind == "remark" else None)
        self.twin.write(parameters(**TOOL, **ZERO) + REFERENCE)
        self.twin.run_until_idle(60.0)

    def run(self, program: str, place: tuple[float, float] = (600.0, 300.0), **before: float) -> list[int]:
        """Messages of P1, which begins there."""
        self.remarks.clear()
        self.twin.write(file(*f"P1|{BEGIN.format(*place)}|{program}".split("|")))
        self.twin.write(parameters(**before, p8683=1, p8508=1))
        self.twin.write(parameters(p8800=1, p8683=2, p8684=1))
        self.twin.run(0.5)
        self.twin.run_until_idle(120.0)
        numbers = [int(text[1:5]) for text in self.remarks if text[:1] == "M" and text[1:5].isdigit()]
        return [number for number in numbers if number != OVERWRITTEN]

    def values(self, first: int, count: int) -> list[float]:
        """Parameters from that number on."""
        twin = self.twin
        twin.read()
        twin.write(parameters(p11181=0))
        twin.run(15.0)
        lines = twin.read().decode("latin-1").split("\r\n")
        put = {line[1:].split(":")[0].strip(): line.split(":")[1].split()[0] for line in lines if line[:1] == "q"}
        return [float(put.get(str(10_000 + n), "nan")) for n in range(first, first + count)]


def test_places() -> None:
    """What the tests reckon with: the machine stands where the module says."""
    bench = Bench()
    assert bench.run("N50 M30", GAUGE_AT) == []
    assert bench.twin.machine_position_mm == pytest.approx([*at(GAUGE_AT)[:2], 352.23 - 270.0 + 5.0], abs=STEP_MM)


@cache
def triggers() -> tuple[float, ...]:
    """XN, XP, YN, YP, ZN (never measured), ZP, as the two calibrations of the manual find them."""
    bench = Bench(ring(GAUGE_AT, 54.0))
    assert bench.run(IN_BORE, GAUGE_AT) == []
    there = bench.values(510, 4)
    bench = Bench(block(260.23))
    assert bench.run(ON_SURFACE) == []
    return *there, 0.0, bench.values(515, 1)[0]


def calibrated() -> dict[str, float]:
    return {f"p{510 + n}": value for n, value in enumerate(triggers())}


@shows("bwo900-5.1-1", "bwo900-5.1-2", "bwo900-5.1-3")
def test_the_probe_is_calibrated() -> None:
    """The middle of the ball stands its radius before the edge, less what it is deflected: negative after a motion
    in +. Along Z its lowest point counts: 8 um below the surface."""
    xn, xp, yn, yp, _, zp = triggers()
    found, law = (xn, xp, yn, yp, zp), (-3.0 + 0.005, 3.0 - 0.011, -3.0 + 0.008, 3.0 - 0.008, -0.008)
    assert found == pytest.approx(law, abs=1.5 * STEP_MM)


@shows("bwo900-5.1-4", "bwo900-5.1-7")
@pytest.mark.parametrize("touches", [1, 3])
def test_it_touches_each_edge_that_often_and_ends_in_the_middle(touches: int) -> None:
    bench, changes, before = Bench(ring(GAUGE_AT, 54.0)), 0, "free"
    program = IN_BORE.replace("P144:2", f"P144:{touches}").replace("|N240 G0 Z280 M30", "")
    bench.twin.write(file(*f"P1|{BEGIN.format(620, 322)}|{program}|N240 M00|N250 M30".split("|")))
    bench.twin.write(parameters(p8800=1, p8683=2, p8684=1))
    bench.twin.run(0.5)
    while not bench.twin.idle:
        bench.twin.run(0.02)
        now = bench.twin.inputs["probe"]
        changes, before = changes + (now != before), now
    assert changes == 2 * 4 * touches
    assert bench.twin.machine_position_mm[:2] == pytest.approx(at(GAUGE_AT)[:2], abs=STEP_MM)


@shows("bwo900-5.1-5", "bwo900-5.1-7")
def test_the_centre_of_a_bore() -> None:
    """22 mm wide, 0.35 and -0.2 mm beside the place where the cycle begins."""
    bench = Bench(ring(BORE_AT, 22.0))
    assert bench.run(CENTRE.replace("|N240 G0 Z280 M30", "|N240 M00|N250 M30"), **calibrated()) == []
    assert bench.values(530, 2) == pytest.approx(BORE_AT, abs=STATED_MM)
    assert bench.twin.machine_position_mm[:2] == pytest.approx(at(BORE_AT)[:2], abs=STATED_MM + STEP_MM)


@shows("bwo900-5.1-6")
@pytest.mark.parametrize(
    ("axis", "begin", "expected"),
    [(3, "", 267.4), (1, "N50 X630 Y300|N60 Z264.4 F3000|", 620.0), (2, "N50 X600 Y330|N60 Z264.4 F3000|", 320.0)],
)
def test_a_place_on_a_surface(axis: int, begin: str, expected: float) -> None:
    """From above, and from both sides, 10 mm before the block: the range of confidence is more then."""
    bench = Bench(block(267.4))
    wide = "P504:5" if axis == 3 else "P504:12"
    assert bench.run(begin + PLACE.replace("P148:3", f"P148:{axis}").replace("P504:5", wide), **calibrated()) == []
    assert bench.values(549 + axis, 1) == pytest.approx([expected], abs=STATED_MM)


@shows("bwo900-5.1-8")
def test_with_physics_a_bore_is_measured_as_exactly() -> None:
    """Backlash, structure, lag, the force of the stylus, repeatability: calibrated in one ring, then in another one.
    Both stand on the table, so that what is off between encoder and table is in both."""
    near = (GAUGE_AT[0] - 60.0, GAUGE_AT[1] - 30.0)
    bench = Bench(ring(GAUGE_AT, 54.0), Fixture("bore", "ring", (32.0, 22.0, 25.0), at(near)), plant="mujoco")
    assert bench.run(IN_BORE.replace("P144:2", "P144:1"), GAUGE_AT) == []
    assert bench.run(CENTRE.replace("P144:2", "P144:1"), (near[0] + 0.4, near[1] - 0.3)) == []
    assert bench.values(530, 2) == pytest.approx(near, abs=STATED_MM)
    assert bench.twin.collisions == []


# Messages


@shows("bwo900-5.1-9")
def test_nothing_is_touched() -> None:
    """The axis stops at edge and range of confidence: 27 - 3 + 5 mm in +X."""
    bench = Bench()
    assert bench.run(IN_BORE, GAUGE_AT) == [8136]
    assert bench.twin.machine_position_mm[0] == pytest.approx(at(GAUGE_AT)[0] + 29.0, abs=STEP_MM)


@shows("bwo900-5.1-10")
def test_it_is_touched_too_early() -> None:
    """A bore 10 mm narrower than it is said to be."""
    bench = Bench(ring(GAUGE_AT, 44.0))
    assert bench.run(IN_BORE, GAUGE_AT) == [8167]
    assert bench.twin.machine_position_mm[0] < at(GAUGE_AT)[0] + 24.0, "it has not come to the safety distance"
    assert bench.twin.collisions == []


@shows("bwo900-5.1-9", "bwo900-5.1-10")
@pytest.mark.parametrize(("fault", "number"), [("broken", 8136), ("stuck_open", 8136), ("stuck_closed", 8167)])
def test_a_contact_that_does_not_work(fault: str, number: int) -> None:
    bench = Bench(block(267.4))
    bench.twin.set_input("probe", fault)
    assert bench.run(PLACE, **calibrated()) == [number]


def test_it_breaks_where_it_cannot_stop() -> None:
    """With a broken wire it goes on into the block, 6 mm, and breaks: a collision, and no result."""
    bench = Bench(block(267.4))
    bench.twin.set_input("probe", "broken")
    assert bench.run(PLACE.replace("P504:5", "P504:12"), **calibrated()) == [8136]
    assert [f"{one.first} {one.second}" for one in bench.twin.collisions] == ["probe block"]


def test_emergency_stop_ends_a_measurement() -> None:
    bench = Bench(block(260.23))
    bench.twin.write(file(*f"P1|{BEGIN.format(600, 300)}|{ON_SURFACE}".split("|")))
    bench.twin.write(parameters(p8800=1, p8683=2, p8684=1))
    while bench.twin.inputs["probe"] == "free":
        bench.twin.run(0.05)
    bench.twin.set_input("estop", "pressed")
    bench.twin.run_until_idle(10.0)
    assert "M3001" in " ".join(bench.remarks)
    bench.twin.set_input("estop", "released")
    assert bench.values(515, 1) != bench.values(515, 1), "nan: nothing was measured"


WRONG = [
    case("bwo900-5.1-11", IN_BORE, "P140:1", "P140:3", 8137),
    case("bwo900-5.1-12", IN_BORE, "P141:3", "P141:0", 8138),
    case("bwo900-5.1-13", IN_BORE, "P143:100", "P143:--", 8140),
    case("bwo900-5.1-14", IN_BORE, "P144:2", "P144:0", 8141),
    case("bwo900-5.1-15", IN_BORE, "P147:500", "P147:--", 8142),
    case("bwo900-5.1-15", IN_BORE, "P149:510", "P149:--", 8142),
    case("bwo900-5.1-15", IN_BORE, "P150:520", "P150:0.5", 8142),
    case("bwo900-5.1-16", IN_BORE, "P504:5", "P504:0", 8149),
    case("bwo900-5.1-17", PLACE, "P148:3", "P148:4", 8150),
    case("bwo900-5.1-18", CENTRE, "P149:510", "P149:510 P510:--", 8151),
    case("bwo900-5.1-18", CENTRE, "P149:510", "P149:510 P511:--", 8152),
    case("bwo900-5.1-18", CENTRE, "P149:510", "P149:510 P512:--", 8153),
    case("bwo900-5.1-18", CENTRE, "P149:510", "P149:510 P513:--", 8154),
    case("bwo900-5.1-18", CENTRE, "N230", "N200 P514:--|N230 G18", 8155),
    case("bwo900-5.1-18", PLACE, "P149:510", "P149:510 P515:--", 8156),
    case("bwo900-5.1-19", IN_BORE, "P520:624.96", "P520:--", 8157),
    case("bwo900-5.1-19", IN_BORE, "P521:324.3", " P521:--", 8158),
    case("bwo900-5.1-19", ON_SURFACE, "P522:260.23", "P522:--", 8159),
    case("bwo900-5.1-19", IN_BORE, "P523:54", " P523:--", 8160),
    case("bwo900-5.1-20", CENTRE, "P152:22", "P152:0", 8162),
    case("bwo900-5.1-21", CENTRE, "P154:530", "P154:--", 8168),
    case("bwo900-5.1-22", IN_BORE, "P523:54", " P523:6", 8134),
    case("bwo900-5.1-23", IN_BORE, "N110", "N105 T0 M16|N110", 8164),
]


@pytest.mark.parametrize(("program", "right", "wrong", "number"), WRONG)
def test_what_is_programmed_wrongly(program: str, right: str, wrong: str, number: int) -> None:
    """It is refused before anything moves."""
    assert right in program
    text = f"N20 T1 M16|N40 G1 F3000 X10 Y10|{program.replace(right, wrong)}"
    desk = fresh(f"P1|{text}", **TOOL, **calibrated())
    start(desk)
    desk.finish()
    assert said(desk) == [number]
    assert desk.counts == (10_000, 10_000, 0)


@shows("bwo900-5.1-24")
def test_radius_correction_is_off_from_then_on() -> None:
    """What waits for the probe would be M1229 with it; G41 is not in force behind the cycle."""
    bench = Bench(block(267.4))
    assert bench.run(PLACE.replace("N230 G69", "N220 G41 X600|N230 G69"), **calibrated()) == []
    assert bench.values(552, 1) == pytest.approx([267.4], abs=STATED_MM)


@shows("bwo900-5.1-25")
def test_a_cycle_z69_that_has_been_loaded_comes_in_place_of_the_own_one() -> None:
    desk = fresh("Z69|N10 P700:P140+1", "P1|N10 P140:5|N20 G69|N30 M30")
    start(desk)
    desk.finish()
    assert said(desk) == []
    assert put_out(desk)[10_700] == 6.0


def test_supervision_does_not_wait_for_a_probe() -> None:
    desk = fresh("P1|N20 T1 M16|N30 sc:1|N40 P140:40|N50 G69|N60 sc:0|N70 M30", **TOOL)
    start(desk)
    desk.finish()
    assert said(desk) == [1229]


def test_without_moving_nothing_is_measured() -> None:
    """P8812: the cycle is passed over, its results stay."""
    desk = fresh(f"P1|N20 T1 M16|N40 G1 F3000 X10 Y10|{PLACE}", **TOOL, **calibrated(), p8812=1, p552=7)
    start(desk)
    desk.finish()
    assert said(desk) == []
    assert put_out(desk)[10_552] == 7.0


def test_stop_and_start_in_the_middle_change_nothing() -> None:
    """Stop while the probe is on its way to the surface; the result is the same."""
    bench = Bench(block(267.4))
    bench.twin.write(parameters(**calibrated()))
    bench.twin.write(file(*f"P1|{BEGIN.format(600, 300)}|{PLACE}".split("|")))
    bench.twin.write(parameters(p8800=1, p8683=2, p8684=1))
    for _ in range(8):
        bench.twin.run(1.5)
        bench.twin.press("stop")
        bench.twin.run(0.2)
        bench.twin.press("start")
    bench.twin.run_until_idle(60.0)
    assert bench.values(552, 1) == pytest.approx([267.4], abs=STATED_MM)


def test_a_saved_twin_goes_on_measuring() -> None:
    """Saved between two touches, with the probe at the surface: a restored twin ends with the same numbers."""
    bench = Bench(block(267.4))
    bench.twin.write(parameters(**calibrated()))
    bench.twin.write(file(*f"P1|{BEGIN.format(600, 300)}|{PLACE}".split("|")))
    bench.twin.write(parameters(p8800=1, p8683=2, p8684=1))
    while bench.twin.inputs["probe"] == "free":
        bench.twin.run(0.05)
    state = bench.twin.save()
    other = Bench(block(267.4))
    other.twin.restore(state)
    for one in (bench, other):
        one.twin.run_until_idle(60.0)
    assert other.values(552, 1) == bench.values(552, 1) == pytest.approx([267.4], abs=STATED_MM)
