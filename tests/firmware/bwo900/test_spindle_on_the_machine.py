"""A BWO 900 and the spindle of the machine 4030-servo-hf, together on the twin."""

from __future__ import annotations

import pytest
from conformance.bwo900_desk import REFERENCE, file, parameters

from isel_twin import Twin

THREAD = ("P1", "N1 G0 X0 Y0 Z30 M3 S3000", "N2 G84 X1 P32:0.5 P33:15 P34:28 P35:30", "N3 M30")


def started(*program: str) -> Twin:
    """A referenced machine whose program has just begun."""
    twin = Twin("4030-servo-hf", "bwo900", plant="kinematic", start_mm=(2.0, 2.0, 2.0))
    twin.write(file(*program))
    twin.write(REFERENCE)
    twin.run_until_idle()
    twin.run(0.1)
    twin.write(parameters(p8800=1, p8683=2, p8684=1))
    return twin


def test_a_thread_on_the_whole_machine():
    """0.5 mm a turn while the tap cuts, after the run-up of the converter: 3000 of 24000 in 3/8 s."""
    twin = started(*THREAD)
    twin.run_until(60_000_000_000, lambda: twin.counts[2] == 30_000)
    twin.run_until(60_000_000_000, lambda: twin.counts[2] < 26_000)
    begin_mm, begin = twin.counts[2] / 1e3, twin.spindle_turns
    twin.run(0.3)
    assert twin.spindle_rev_min == 3_000.0
    assert begin_mm - twin.counts[2] / 1e3 == pytest.approx(0.5 * (twin.spindle_turns - begin), abs=0.003)
    twin.run_until_idle()
    assert twin.counts[2] == 30_000
    assert not twin.fault
    twin.run(1.0)
    assert twin.spindle_rev_min == 0.0


def test_saved_while_it_waits_for_its_spindle():
    twin = started("P1", "N1 G0 X1", "N2 M3 S20000", "N3 G95 G1 F0.01 X3", "N4 M30")
    twin.run(1.0)
    assert (twin.counts[0], twin.idle) == (1_000, False)
    state = twin.save()
    twin.run_until_idle()
    then = twin.time_ns, twin.spindle_turns, tuple(twin.counts)
    twin.restore(state)
    twin.run_until_idle()
    assert (twin.time_ns, twin.spindle_turns, tuple(twin.counts)) == then


@pytest.mark.parametrize(("element", "state"), [("estop", "pressed"), ("hood", "forced")])
def test_estop_and_hood_in_a_thread(element, state):
    twin = started(*THREAD)
    twin.run_until(60_000_000_000, lambda: twin.counts[2] == 30_000)
    twin.run_until(60_000_000_000, lambda: twin.counts[2] < 26_000)
    twin.set_input(element, state)
    twin.run(0.2)
    assert twin.outputs["spindle_runs"] == 0
    assert 0.0 < twin.spindle_rev_min < 3_000.0, "it coasts"
    twin.run(3.0)
    assert twin.spindle_rev_min == 0.0
    assert twin.unfinished
