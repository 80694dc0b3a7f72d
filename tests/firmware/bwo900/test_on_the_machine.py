"""The sample programs on the gantry with servo drives (MuJoCo): the carriage follows as the law of the servo has it.

    lag / set point = 1 - w_v Kv (T_i s + 1) / D,   D = T_i s^3 + w_v T_i s^2 + w_v (1 + Kv T_i) s + w_v Kv

the cascade without feed-forward (docs/fidelity.md; machine file: Kv 40 1/s, w_v 2 pi 50 Hz, T_i = 4 / w_v): v / Kv at
constant speed, and on circles a smaller radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin import Twin

pytestmark = pytest.mark.long(seconds=9)

JOBS: Final = Path(__file__).parents[2] / "jobs" / "bwo900"
START_MM: Final = (30.0, 30.0, 30.0)
KV: Final = 40.0
W_V: Final = 2.0 * math.pi * 50.0
T_I: Final = 4.0 / W_V
D: Final = (T_I, W_V * T_I, W_V * (1.0 + KV * T_I), W_V * KV)
SAMPLE_S: Final = 2e-3
FASTEST_MM_S: Final = 100.0
LED_MM: Final = 0.5 * FASTEST_MM_S * SAMPLE_S
"""The counter tells the set point that the drive is being led to in the next 2 ms: on the average half of that."""
LOST_MM: Final = 0.1
"""Carriage against law: backlash 0.02 mm, what friction winds up, 30 N turning round at the drive, 0.06 mm."""
WINDOW_MM: Final = math.sqrt(1.0 / 1000.0) + 0.01
"""At an exact stop: the control's window (P12016 not set: root of an increment in mm), half of the backlash."""
Places = NDArray[np.float64]


@dataclass(frozen=True)
class Ride:
    """A program's way, (n, 3), mm: set points, lag of the drives, carriage; what the law makes of the set points."""

    set_point: Places
    lag: Places
    carriage: Places
    law: Places


@cache
def ride(name: str) -> Ride:
    """A sample program from its start to its end, after the reference run."""
    from scipy import signal  # half a second, for this file alone

    twin = Twin(controller="bwo900", machine="4030-servo", start_mm=START_MM)
    remarks: list[str] = []
    steps = list(begin(twin, name))
    twin.listen(lambda _time, kind, what: remarks.append(str(what)) if kind == "remark" else None)
    twin.write(steps[-1])
    twin.run(0.01)
    began_ns, counts = twin.time_ns, twin.counts[:3]
    rows: list[NDArray[Any]] = []
    while not twin.idle:  # counters are not read in between: the control would be advanced every time
        twin.run(SAMPLE_S)
        rows.append(np.concatenate([twin.following_error[:3], twin.position_mm[:3]]))
    assert not [r for r in remarks if "M" in r], remarks
    assert not twin.fault
    table = np.array(rows)
    time = np.arange(len(table)) * SAMPLE_S
    ticks = twin.steps
    made = ticks.t_ns > began_ns
    way = np.concatenate([np.zeros((1, 3), np.int64), np.cumsum(ticks.delta[made, :3], axis=0, dtype=np.int64)])
    read_ns = began_ns + (np.arange(len(table)) + 1) * round(1e9 * SAMPLE_S)
    set_point = (counts + way[np.searchsorted(ticks.t_ns[made], read_ns, side="right")]) / 1000.0
    law = np.stack(
        [
            first + signal.lsim(((W_V * KV * T_I, W_V * KV), D), axis - first, time)[1]
            for axis, first in ((set_point[:, a], set_point[0, a]) for a in range(3))
        ],
        axis=1,
    )
    return Ride(set_point, table[:, :3] / 1000.0, table[:, 3:], law)


def begin(twin: Twin, name: str) -> list[bytes]:
    """Send a sample program and make the reference run; its parts, the last one starts it."""
    job = twin.language.job((JOBS / name).read_text())
    steps = [b"".join(data) for _, data in job]
    for data in steps[:-1]:
        twin.write(data)
        twin.run_until_idle()
    return steps


def beside(places: Places, path: Places, window: int = 15) -> Places:
    """Distance of each place (n, 3) to the path (n, 3), as far as `window` samples away on it, (n - 2 window,)."""
    best = np.full(len(places), np.inf)
    for shift in range(-window, window):
        a, b = np.roll(path, shift, axis=0), np.roll(path, shift + 1, axis=0)
        way = b - a
        share = np.clip(((places - a) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-18), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(places - a - share[:, None] * way, axis=1))
    return best[window:-window]


def begun(one: Ride) -> int:
    """The sample at which the tool is above the workpiece, 10 mm."""
    return int(np.argmax(one.set_point[:, 2] == 40.0))


@pytest.mark.parametrize("name", ["pocket.nc", "holes.nc", "contour.nc"])
def test_the_carriage_follows_within_the_lag_of_the_law(name: str) -> None:
    one = ride(name)
    expected = one.set_point - one.law
    assert np.abs(one.lag - expected).max() <= LED_MM
    assert np.abs(one.lag).max() == pytest.approx(FASTEST_MM_S / KV, rel=0.005), "v / Kv in rapid"
    assert beside(one.carriage, one.law).max() <= LOST_MM
    assert np.abs(one.carriage[-1] - one.set_point[-1]).max() <= WINDOW_MM, "the end is an exact stop"


def test_the_lag_while_milling() -> None:
    """F1800 is 30 mm/s, 0.75 mm behind, along straight lines, 0.2 s (8 / Kv) after their beginning."""
    one = ride("contour.nc")
    velocity = np.diff(one.set_point, axis=0) / SAMPLE_S
    speed = np.linalg.norm(velocity, axis=1)
    steady = [k for k in range(100, len(speed)) if np.ptp(velocity[k - 100 : k + 1], axis=0).max() < 1.0]
    milling = [k for k in steady if abs(speed[k] - 30.0) < 0.5 and one.set_point[k, 2] == 29.0]
    assert len(milling) > 500
    assert np.linalg.norm(one.lag[milling], axis=1) == pytest.approx(30.0 / KV, rel=0.03)


def test_the_pockets_walls() -> None:
    """36 x 24 mm about (60, 60), a circle of radius 12 about (100, 60), tool of radius 3; floors at 27 and 28.5.

    On the wall of the circle the carriage runs inside by R (1 - 1 / sqrt(1 + (w / Kv)^2)), 7 um at 15 mm/s.
    """
    one = ride("pocket.nc")
    way = one.carriage[begun(one) :]
    low = way[way[:, 2] < 30.0 - 0.02] - (60.0, 60.0, 30.0)
    left, right = low[low[:, 0] < 20.0], low[low[:, 0] >= 20.0]
    assert np.abs(left[:, 0]).max() + 3.0 == pytest.approx(18.0, abs=LOST_MM)
    assert np.abs(left[:, 1]).max() + 3.0 == pytest.approx(12.0, abs=LOST_MM)
    assert np.hypot(right[:, 0] - 40.0, right[:, 1]).max() + 3.0 == pytest.approx(12.0, abs=LOST_MM)
    assert low[:, 2].min() == pytest.approx(-3.0, abs=WINDOW_MM)


def test_the_holes() -> None:
    """Two workpieces, each with fields of 3 x 2 and of 2 x 2 places along (10, 10) and (-10, 10)."""
    one = ride("holes.nc")
    fields = [(10 * i, 10 * j) for j in range(2) for i in range(3)] + [
        (10 + 10 * (i - j), 20 + 10 * (i + j)) for j in range(2) for i in range(2)
    ]
    wanted = [(x0 + x, y0 + y) for x0, y0 in ((40, 40), (90, 60)) for x, y in fields]
    carriage = one.carriage[begun(one) :]
    z = carriage[:, 2]
    deep = np.flatnonzero(z < 26.0 + 0.1)
    groups = np.split(deep, np.flatnonzero(np.diff(deep) > 100) + 1)
    places = [carriage[g[np.argmin(z[g])]] for g in groups]
    assert sorted((round(float(p[0])), round(float(p[1]))) for p in places) == sorted(wanted)
    assert [p[2] for p in places] == pytest.approx([26.0] * 20, abs=WINDOW_MM), "an exact stop at each depth"
    exact = [min(math.dist(p[:2], w) for w in wanted) for p in places]
    assert max(exact) <= WINDOW_MM


def distance(places: Places, corners: list[tuple[float, float]], circle: tuple[float, float, float, int]) -> Places:
    """Of places (n, 2) to a closed polygon; the line behind corner number `circle[3]` is an arc about a centre."""
    u, v, radius, arc = circle
    best = np.full(len(places), np.inf)
    for k, start in enumerate(corners):
        end = corners[(k + 1) % len(corners)]
        if k == arc:
            inside = ((places - (u, v)) > -1e-9).all(axis=1)
            best = np.where(inside, np.minimum(best, np.abs(np.hypot(*(places - (u, v)).T) - radius)), best)
            continue
        a, way = np.array(start), np.array(end) - np.array(start)
        share = np.clip((places - a) @ way / (way @ way), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(places - a - share[:, None] * way, axis=1))
    return best


@pytest.mark.parametrize(
    ("corners", "circle", "middle"),
    [
        ([(0, 0), (0, 30), (30, 30), (40, 20), (40, 0)], (30.0, 20.0, 10.0, 2), False),
        ([(35, 5), (35, 18), (28, 25), (5, 25), (5, 5)], (28.0, 18.0, 7.0, 1), True),
    ],
)
def test_the_tool_keeps_its_radius_from_the_contour(
    corners: list[tuple[float, float]], circle: tuple[float, float, float, int], middle: bool
) -> None:
    """Outside and inside: the set points to half an increment an axis, the carriage as the law has it."""
    one = ride("contour.nc")
    zero = np.array((60.0, 60.0, 30.0))
    for path, tolerance in ((one.set_point, 1.5e-3), (one.carriage, 0.2)):
        low = (path - zero)[np.abs(path[:, 2] - 29.0) < 0.03][:, :2]
        inner = ((low > (5, 5)) & (low < (35, 25))).all(axis=1)
        apart = distance(low[inner == middle], corners, circle)
        assert apart.min() == pytest.approx(3.0, abs=tolerance)
        assert len(apart) > 1000
    # The first corner outside is passed in an arc: what stands 3 mm from the contour is most of the way.
    low = (one.set_point - zero)[np.abs(one.set_point[:, 2] - 29.0) < 1e-9][:, :2]
    inner = ((low > (5, 5)) & (low < (35, 25))).all(axis=1)
    apart = distance(low[inner == middle], corners, circle)
    assert np.mean(np.abs(apart - 3.0) < 1.5e-3) > 0.6


def test_a_stop_ends_when_the_axes_are_there_however_time_is_cut() -> None:
    """Exact stops are over when the axes are within their window, not when somebody happens to look."""
    program = b"\r\nP1\r\nN10 G00 G28 X10 F3000\r\nN20 G01 Y10\r\nN30 X0\r\nN40 Y0\r\nN50 M30\r\n#\r\n\x04\r\n"
    ends = []
    for pieces_s in (None, 0.0213):
        twin = Twin(controller="bwo900", machine="4030-servo", start_mm=START_MM)
        begin(twin, "pocket.nc")
        twin.write(program)
        twin.run_until_idle()
        began = twin.time_ns
        twin.write(b"".join(twin.language.job("P1\nN10 M30")[-1][1]))
        if pieces_s is None:
            twin.run_until_idle()
        ended: list[int] = []
        while not ended:
            if twin.idle:
                ended.append(twin.time_ns)
            else:
                twin.run_until(twin.time_ns + round(1e9 * pieces_s), lambda one=twin: one.idle)  # type: ignore[operator]
        ends.append((ended[0] - began, twin.counts.tolist(), twin.position_mm.tolist()))
    assert ends[0] == ends[1]
    # Four ways of 10 mm with 400 mm/s^2: 2 sqrt(10 / 400) s each, then what the lag takes.
    assert 4 * 0.316 < ends[0][0] / 1e9 < 4 * (0.316 + 0.3) + 0.1


def test_it_is_saved_and_restored_within_a_cycle() -> None:
    def life(saved_at: int | None) -> tuple[int, list[int], list[float]]:
        twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=START_MM)
        twin.write(begin(twin, "pocket.nc")[-1])
        for number in range(6):
            twin.run(3.1)
            if number == saved_at:
                state = twin.save()
                assert state.life.pickled, "else it is told its whole life again"
                twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=START_MM)
                twin.restore(state)
        twin.run_until_idle()
        return twin.time_ns, twin.counts.tolist(), twin.position_mm.tolist()

    undisturbed = life(None)
    assert undisturbed[1][:3] == [100_000, 60_000, 40_000]
    assert [life(number) for number in (1, 4)] == [undisturbed] * 2
