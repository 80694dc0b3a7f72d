"""BWO 900: what the PLC asks for beside a program (7.1, 8.4, 8.5, 8.7), once more from the manual's text, and together
with what else can happen meanwhile."""

from __future__ import annotations

import math

import pytest
from conformance.bwo900_desk import REFERENCE, T1, file, fresh, mm, parameters, run, said, start, value
from conformance.rows import shows

from isel_twin import Twin
from isel_twin.testing import Desk

Z6 = "Z6|N10 P500:0|N20 G53 G0 X15 M01|N30 P8047:1|N40 P8045:1|N50 P500:1|N60 M30"


def spindle_tool(desk: Desk) -> tuple[float, float]:
    """Group of the tool in the spindle, and of the one that reckons."""
    return value(desk, 8100), value(desk, 8150)


# P8041, P8043: tools in HAND


def in_hand() -> Desk:
    desk = fresh(Z6, p500=-1, p8100=0, p8150=0, **T1)
    desk.send(parameters(p8683=1))
    return desk


@shows("bwo900-7.1-34")
def test_a_change_moves_and_comes_back_to_hand_again_and_again() -> None:
    desk = in_hand()
    for tool in (2.0, 1.0):
        desk.send(parameters(p8043=tool))
        desk.finish()
        assert spindle_tool(desk) == (tool, tool)
        assert (value(desk, 500), value(desk, 8683), said(desk)) == (1.0, 1.0, [])
    assert mm(desk)[0] == 15.0


@pytest.mark.parametrize("key", [{"p8705": 1.0}, {"p8682": 1.0}])
def test_a_change_that_is_held_or_broken_off(key: dict[str, float]) -> None:
    """Abort: the old tool stays, and a change in HAND is possible again. Stop: Start ends the change."""
    desk = in_hand()
    desk.send(parameters(p8043=2))
    desk.run(0.1)
    desk.send(parameters(**key))
    desk.finish()
    assert (spindle_tool(desk)[0], value(desk, 500)) == (0.0, 0.0)
    if "p8705" in key:
        assert 0.0 < mm(desk)[0] < 15.0
        desk.send(parameters(p8683=1, p8508=1))
        desk.send(parameters(p8043=2))
    else:
        desk.send(parameters(p8682=0))
        desk.send(parameters(p8684=1))
    desk.finish()
    assert (spindle_tool(desk), mm(desk)[0], value(desk, 500)) == ((2.0, 2.0), 15.0, 1.0)


def machine() -> Twin:
    twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(6, 6, 6), seed=2)
    twin.write(file(*Z6.replace("X15", "X60").split("|")) + parameters(p8043=0, **T1) + REFERENCE)
    twin.run_until_idle(60.0)
    return twin


def test_a_change_in_hand_goes_on_after_save_and_ends_with_an_emergency_stop() -> None:
    """Saved in the middle of Z6: the copy makes the same move. E-stop: it is over, nothing
    moves after the release, and the next change is whole."""
    twin = machine()
    twin.write(parameters(p8683=1))
    twin.write(parameters(p8043=2))
    twin.run(0.4)
    middle = twin.machine_position_mm[0]
    saved = twin.save()
    twin.run_until_idle(30.0)
    end = tuple(twin.machine_position_mm)
    assert 6.0 < middle < end[0] == pytest.approx(65.0, abs=0.01)
    twin.restore(saved)
    assert twin.machine_position_mm[0] == middle
    twin.run_until_idle(30.0)
    assert tuple(twin.machine_position_mm) == end
    twin.restore(saved)
    twin.set_input("estop", "pressed")
    twin.run(1.0)
    held = tuple(twin.machine_position_mm)
    twin.set_input("estop", "released")
    twin.write(parameters(p8683=1, p8508=1))
    twin.run(2.0)
    assert tuple(twin.machine_position_mm) == held
    assert held[0] < end[0] - 10.0
    twin.write(parameters(p8043=2))
    twin.run_until_idle(30.0)
    assert twin.machine_position_mm[0] == pytest.approx(65.0, abs=0.01)


# P8870, P8871


@shows("bwo900-8.5-75")
def test_length_of_a_helix_and_of_its_shadows() -> None:
    """A full circle of radius 8 while Z goes 6 deep: 2 pi 8 in XY, 4 x 8 in X, with Z the helix."""
    for mask, length in ((3, 16 * math.pi), (1, 32.0), (4, 6.0), (7, math.hypot(16 * math.pi, 6.0)), (0, 0.0)):
        desk = fresh("P1|N10 G0 X20 Y20 Z10 M1|N20 P8870:" + str(mask) + " M1|N30 G2 F3000 X20 Y20 Z16 I28 J20|N40 M30")
        start(desk)
        desk.finish()
        assert value(desk, 8871) == pytest.approx(length, rel=1e-5, abs=1e-9)


# P8812


@shows("bwo900-8.5-30")
@pytest.mark.parametrize("off", ["0", "--"])
def test_without_moving_an_end_is_where_the_axes_stand(off: str) -> None:
    """The next program with motion starts from where the axes are, and comes to its places."""
    desk = run("P1|N10 G0 X25 Y12|N20 G91 X5|N30 M30", p8812=1.0)
    assert mm(desk) == (0.0, 0.0, 0.0)
    desk.send(file("D", f"K1:P 8812: {off}"))
    start(desk)
    desk.finish()
    assert (mm(desk), said(desk)) == ((30.0, 12.0, 0.0), [])


# P12137


@shows("bwo900-8.7-23")
def test_abort_of_a_program_whose_axis_is_locked() -> None:
    """It waits for good without a message; abort ends it, and the other direction is free."""
    desk = fresh("P1|N10 G1 F3000 X-2|N20 M30", "P2|N10 G1 F3000 X5|N20 M30", p12137=256.0)
    start(desk)
    desk.run(2.0)
    assert (mm(desk)[0], value(desk, 8687), said(desk)) == (0.0, 1.0, [])
    desk.send(parameters(p8705=1))
    desk.finish()
    desk.send(parameters(p8508=1))
    start(desk, 2)
    desk.finish()
    assert mm(desk)[0] == 5.0
