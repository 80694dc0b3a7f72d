"""The real time's part of a block: what analysis has prepared is what is made, and nothing of an earlier program."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.bwo900_desk import fresh, mm, parameters, start
from numpy.typing import NDArray

from isel_twin.testing import Desk

CONTOUR = "P1|N10 G0 X10 Y10 tr3|N20 G1 G41 F3000 X20|N30 X80|N40 Y60|N50 X20|N60 G40 X0 Y0|N70 M30"
"""Inside a frame, with a tool of radius 3."""


def ways(desk: Desk, first: int) -> NDArray[np.float64]:
    """Where the axes have been since a tick, (n, 3), mm."""
    steps = desk.steps_since(first).delta
    return (np.array(desk.counts) - steps.sum(axis=0) + steps.cumsum(axis=0)) / 1000.0


def test_the_path_is_beside_the_contour() -> None:
    """G41: on the left of the contour by the radius (4.13)."""
    desk = fresh(CONTOUR)
    first = desk.ticks
    start(desk)
    desk.finish()
    way = ways(desk, first)
    x, y = way[:, 0], way[:, 1]
    assert y[(abs(x - 50.0) < 1.0) & (y < 35.0)] == pytest.approx(13.0, abs=2e-3)
    assert x[(abs(y - 40.0) < 1.0) & (x > 60.0)] == pytest.approx(77.0, abs=2e-3)
    assert y[(abs(x - 50.0) < 1.0) & (y > 35.0)] == pytest.approx(57.0, abs=2e-3)
    assert mm(desk) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("after_s", [0.6, 1.1, 1.7])
def test_nothing_is_left_of_a_program_that_was_broken_off(after_s: float) -> None:
    """P8705: forget the rest; blocks that waited for the next corner are part of it."""
    desk = fresh(CONTOUR, "P2|N10 G1 F3000 X5 Y90|N20 M30")
    start(desk)
    desk.run(after_s)
    desk.send(parameters(p8705=1))
    desk.finish()
    here = np.array(mm(desk)[:2])
    first = desk.ticks
    start(desk, number=2)
    desk.finish()
    assert mm(desk) == (5.0, 90.0, 0.0)
    way = ways(desk, first)[:, :2] - here
    along = (np.array([5.0, 90.0]) - here) / np.hypot(*(np.array([5.0, 90.0]) - here))
    assert np.abs(way @ np.array([-along[1], along[0]])).max() < 2e-3
