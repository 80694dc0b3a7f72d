"""Motions of a recording that somebody has altered: refused when they are read, before C takes their numbers."""

from __future__ import annotations

import base64
import zlib
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.motion import SetPointRun, StepRun, line
from isel_twin.motion.circle import circle
from isel_twin.motion.joined import Joined, joined
from isel_twin.motion.pieces import piece
from isel_twin.motion.time_law import trapezoid
from isel_twin.recordings.runs import described, motion_from

ARC = circle(1000, 0, 141, 141, 1, -1, False, third_axis=2, third_steps=70)
LINE = line((800, -2000, 3, 0))
PERIOD_NS = 4_000_000


def shrunk(values: NDArray[Any]) -> str:
    return base64.b64encode(zlib.compress(values.tobytes())).decode()


def table_of(path: Any) -> dict[str, Any]:
    return described(StepRun(path, trapezoid(path.ticks, 10_000, 400, 100_000), 0))


@pytest.mark.parametrize("path", [ARC, LINE])
def test_a_path_is_read_as_it_was(path: Any) -> None:
    motion = motion_from(table_of(path))
    assert isinstance(motion, StepRun)
    assert motion.path == path


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        ("circle", "plane", [0, 4]),
        ("circle", "plane", [0, 1 << 40]),
        ("circle", "plane", [-1, 1]),
        ("circle", "plane", [1, 1]),
        ("circle", "third_axis", 7),
        ("circle", "axes", 1),
        ("circle", "ticks", -1),
        ("circle", "xs", 1 << 40),
        ("circle", "squared_radius", 1 << 62),
        ("circle", "third_steps", "many"),
        ("line", "ticks", 1999),
        ("line", "ticks", 0),
        ("line", "ticks", 1 << 40),
    ],
)
def test_a_path_that_no_controller_makes(kind: str, name: str, value: object) -> None:
    table = table_of(ARC if kind == "circle" else LINE)
    steps = table["steps"]
    (steps["circle"] if kind == "circle" else steps)[name] = value
    with pytest.raises(ValueError, match=r"circle|line|literal"):
        motion_from(table)


@pytest.mark.parametrize("first", [3, 40, 1 << 30])
def test_pieces_that_follow_none(first: int) -> None:
    """A plan of one piece goes on with the second at most."""
    before = SetPointRun(joined(piece((25_000.0,), 25_000, 300, 50_000), PERIOD_NS), PERIOD_NS, 0)
    plan, late_ns = before.plan, 40 * PERIOD_NS
    assert isinstance(plan, Joined)
    more = plan.replanned(before.count(late_ns), append=piece((1000.0,), 1000, 300, 50_000))
    table = described(SetPointRun(more, PERIOD_NS, 0), before, late_ns)
    assert motion_from(deepcopy(table), before).last == more.ticks
    table["joined"]["first"] = first
    with pytest.raises(ValueError, match="stretch of another plan"):
        motion_from(table, before)


def test_what_was_made_stays_on_pieces_that_there_are() -> None:
    """A stretch of one piece, the first one, behind phases on the second."""
    plan = joined(piece((2500.0,), 2500, 300, 50_000), PERIOD_NS)
    longer = plan.replanned(10, append=piece((1000.0,), 1000, 300, 50_000))
    table = {**described(SetPointRun(plan, PERIOD_NS, 0)), "later": True}
    phases = plan.blocks[0].phases.copy()
    phases[:, 0] += 1000.0
    table["joined"]["phases"] = shrunk(phases)
    with pytest.raises(ValueError, match="stretch of another plan"):
        motion_from(table, SetPointRun(longer, PERIOD_NS, 0))


def test_a_phase_on_a_piece_beyond_the_last() -> None:
    table = described(SetPointRun(joined(piece((2500.0,), 2500, 300, 50_000), PERIOD_NS), PERIOD_NS, 0))
    table["joined"]["piece"] = shrunk(np.array([0, 0, 1], np.int32))
    with pytest.raises(ValueError, match="stretch"):
        motion_from(table)
