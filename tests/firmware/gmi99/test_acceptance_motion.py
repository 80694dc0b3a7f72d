"""Moves of the GMI99 as a host sees them: telegrams in, set positions, status and set points out; rows of acceptance.

Telegrams are given byte by byte and figures worked out from the formulas of the manual. The line takes no time, the
machine is the 4030-servo with the kinematic plant, and t0 is a time of the 4 ms grid at which the telegrams go out. Set
positions are within one increment on the way and exact at rest, ends fall in the tick of the closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion.joined_forms import Law, Part, displacement, law
from mpmath import mpf
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.testing import Desk
from tests.thorough import drawn

OK = "E5"
STATUS = "10 E0 01 E1 16"
ABORT = "10 E0 00 E0 16"
Q = "68 08 08 68 E0 51 07 00 00 00 00 00 38 16"
M_50000 = "68 05 05 68 E0 4D 50 C3 00 40 16"
F_10000 = "68 05 05 68 E0 66 10 27 00 7D 16"
F_5000 = "68 05 05 68 E0 66 88 13 00 E1 16"
TO_20000 = "68 05 05 68 E0 81 20 4E 00 CF 16"
TO_10000 = "68 05 05 68 E0 81 10 27 00 98 16"
TO_238 = "68 05 05 68 E0 81 EE 00 00 4F 16"
TO_0 = "68 05 05 68 E0 81 00 00 00 61 16"
G91 = "68 05 05 68 E0 47 5B 00 00 82 16"
CORNER_X, CORNER_Y = (
    "68 08 08 68 E0 83 10 27 00 00 00 00 9A 16",
    "68 08 08 68 E0 83 10 27 00 10 27 00 D1 16",
)
FS0_1000 = "68 08 08 68 E0 4E E8 03 00 0B 00 00 24 16"
SINE = "68 08 08 68 E0 4E 01 00 00 18 00 00 47 16"
FAST_CIRCLES = "68 08 08 68 E0 4E 01 00 00 0E 00 00 3D 16"
WHY_NOT = "68 08 08 68 E0 54 03 00 00 08 00 00 3F 16"
"""T3;8."""

TICK_NS = 4_000_000


class Host:
    """A host at the card's line, and its clock: milliseconds after t0."""

    def __init__(self, *frames: str, ready: bool = True) -> None:
        """Switched on; if it is to be ready, after the preparation: positions 0, M 50000 Hz, f 10000 Hz."""
        self.twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic", start_mm=(200.0, 150.0, 70.0))
        if ready:
            self.prepare(Q, M_50000, F_10000)
        assert self.tell(*frames) == [OK] * len(frames)
        self.settle()

    def prepare(self, *frames: str) -> None:
        assert self.tell(*frames) == [OK] * len(frames)
        self.settle()
        assert self.tell(STATUS) == ["10 E0 00 E0 16"]

    def settle(self) -> None:
        """Until nothing is done, and on to a time of the grid, which is then t0."""
        assert self.twin.run_until_idle()
        self.twin.run_until(-(-self.twin.time_ns // TICK_NS) * TICK_NS)
        self.t0_ns = self.twin.time_ns

    def tell(self, *frames: str) -> list[str]:
        """The answer to each, at this instant."""
        answers = []
        for frame in frames:
            self.twin.read()
            self.twin.write(bytes.fromhex(frame))
            self.twin.run(0.0)
            answers.append(self.twin.read().hex(" ").upper())
        return answers

    def at(self, ms: float) -> None:
        self.twin.run_until(self.t0_ns + round(ms * 1e6))

    def position(self, axis: int = 0) -> int:
        """T0."""
        body = bytes([0xE0, 0x54, 0, 0, 0, axis, 0, 0])
        (answer,) = self.tell((b"\x68\x08\x08\x68" + body + bytes([sum(body) % 256, 0x16])).hex())
        got = bytes.fromhex(answer)
        assert got[:6] == bytes.fromhex("68 05 05 68 E0 40")
        assert got[9] == sum(got[4:9]) % 256
        return int.from_bytes(got[6:9], "little", signed=True)

    def positions(self, *axes: int) -> tuple[int, ...]:
        return tuple(self.position(axis) for axis in axes)

    def status(self) -> int:
        (answer,) = self.tell(STATUS)
        return int(answer.split()[2], 16)

    @property
    def moving(self) -> bool:
        """I.4."""
        return bool(self.status() & 0x10)

    def flag(self, byte: int) -> int:
        """T1;3;byte."""
        body = bytes([0xE0, 0x54, 1, 0, 0, 3, 0, 0, byte, 0, 0])
        (answer,) = self.tell((b"\x68\x0b\x0b\x68" + body + bytes([sum(body) % 256, 0x16])).hex())
        return int(answer.split()[6], 16)

    def ends_at(self, seconds: float) -> None:
        """It moves until the tick in which this time after t0 falls, and no longer."""
        ticks = math.ceil(seconds * 1000 / 4 - 1e-4)
        self.at(4 * ticks - 0.001)
        assert self.moving
        self.at(4 * ticks)
        assert not self.moving

    def set_points(self) -> NDArray[np.int64]:
        """int64 [ticks + 1, 6]: increments since t0 at each tick of what has been made since."""
        steps = self.twin.steps
        deltas = steps.delta[steps.t_ns > self.t0_ns].astype(np.int64)
        return np.vstack((np.zeros((1, deltas.shape[1]), dtype=np.int64), np.cumsum(deltas, axis=0)))

    def accept(self, *frames: str) -> None:
        assert self.tell(*frames) == [OK] * len(frames)


def near(got: int | Sequence[int], wanted: int | Sequence[int]) -> bool:
    return bool(np.all(np.abs(np.subtract(got, wanted)) <= 1))


def test_g_20_the_printed_examples() -> None:
    host = Host(ready=False)
    host.accept("68 08 08 68 E0 4E 3F 00 00 0A 00 00 77 16")
    host.prepare("68 08 08 68 E0 51 3F 00 00 00 00 00 70 16")
    host.accept(TO_238)
    host.settle()
    assert host.position() == 238
    host.accept("68 08 08 68 E0 89 1E 00 00 F4 01 00 7C 16")
    host.settle()
    host.accept("68 0B 0B 68 E0 96 46 00 00 0F 00 00 64 00 00 2F 16")
    host.settle()
    assert host.positions(0, 1, 2, 3, 4) == (30, 70, 15, 500, 100)


def test_g_21_straight_move_with_linear_ramps() -> None:
    host = Host()
    host.accept(TO_20000)
    wanted = {8: 2, 20: 10, 100: 250, 200: 1000, 204: 1040, 1000: 9000, 2100: 19_750}
    for ms, increments in wanted.items():
        host.at(ms)
        assert near(host.position(), increments)
        assert host.moving
    host.ends_at(2.2)
    assert host.position() == 20_000


def test_g_22_straight_move_with_sine_ramps() -> None:
    """T = 2 s + pi/2 x 200 ms = 2.314159 s."""
    host = Host(SINE)
    host.accept(TO_20000)
    for ms, increments in {100: 79, 200: 545, 312: 1549, 1000: 8429}.items():
        host.at(ms)
        assert near(host.position(), increments)
    host.ends_at(2 + math.pi / 10)
    assert host.position() == 20_000


def test_g_23_a_short_move_never_gets_fast() -> None:
    """The peak sqrt(50 000 x 500) = 5000 Hz: 20 increments a tick at most."""
    host = Host()
    host.accept("68 05 05 68 E0 81 F4 01 00 56 16")
    host.at(100)
    assert near(host.position(), 250)
    host.ends_at(0.2)
    assert 19 <= np.diff(host.set_points()[:, 0]).max() <= 20


def test_g_24_tool_speed_control_on() -> None:
    host = Host(F_5000)
    host.accept("68 08 08 68 E0 83 B8 0B 00 A0 0F 00 D5 16")
    host.at(500)
    assert near(host.positions(0, 1), (1350, 1800))
    host.ends_at(1.1)
    assert host.positions(0, 1) == (3000, 4000)


@pytest.mark.parametrize(
    ("control", "seconds", "midway"),
    [("off", 0.9, (1125, 2250)), ("on", 0.994427, (1006, 2012))],
)
def test_g_25_tool_speed_control_off(control: str, seconds: float, midway: tuple[int, int]) -> None:
    host = Host(F_5000, *(["68 05 05 68 E0 57 00 00 00 37 16"] if control == "off" else []))
    host.accept("68 08 08 68 E0 83 D0 07 00 A0 0F 00 E9 16")
    host.at(500)
    assert near(host.positions(0, 1), midway)
    host.ends_at(seconds)


def test_g_26_an_axis_of_twice_the_resolution() -> None:
    host = Host("68 0B 0B 68 E0 57 01 00 00 00 80 00 02 00 00 BA 16", "68 05 05 68 E0 66 E8 03 00 31 16")
    host.accept("68 05 05 68 E0 82 D0 07 00 39 16")
    for ms, increments in ((100, 180), (500, 980)):
        host.at(ms)
        assert near(host.position(1), increments)
    host.ends_at(1.020015)
    assert host.position(1) == 2000


def test_g_27_collinear_moves_join() -> None:
    host = Host()
    host.accept(TO_10000, TO_20000)
    host.ends_at(2.2)
    assert host.position() == 20_000
    steps = np.diff(host.set_points()[:, 0])
    assert set(steps[51:499]) == {40}  # ramps of 50 ticks; 10 000 is passed in tick 275


def test_g_28_a_command_that_is_not_synchronous_parts_them() -> None:
    host = Host()
    host.accept(TO_10000, "68 05 05 68 E0 47 5E 00 00 85 16", TO_20000)
    host.at(1200)
    assert host.position() == 10_000
    host.ends_at(2.4)
    at = host.set_points()[:, 0]
    assert at[300] == 10_000  # t0 + 1.2 s
    assert at[301] - at[300] == 0 or at[301] - at[300] == round(50_000 * 0.004**2 / 2)
    assert at[299] >= 9999


def test_g_29_a_feed_between_two_moves_does_not_part_them() -> None:
    host = Host()
    host.accept(TO_10000, F_5000, TO_20000)
    host.at(1124)
    assert 10_000 - 40 < host.position() <= 10_000
    host.at(1128)
    assert 10_000 <= host.position() < 10_000 + 40
    host.ends_at(3.175)
    assert set(np.diff(host.set_points()[:, 0])[283:760]) == {20}


@pytest.mark.parametrize(
    ("fs90", "seconds"),
    [
        ("68 08 08 68 E0 4E 00 00 00 10 00 00 3E 16", 2.4),
        ("68 08 08 68 E0 4E E8 03 00 10 00 00 29 16", 2.362),
    ],
    ids=["g-30, full stop", "g-31, jump of 1000 Hz"],
)
def test_g_30_and_31_right_angle(fs90: str, seconds: float) -> None:
    host = Host(FS0_1000, fs90)
    host.accept(CORNER_X, CORNER_Y)
    half = seconds / 2 * 1000
    host.at(half // 4 * 4)
    assert near(host.positions(0, 1), (10_000, 0)) or host.position() >= 10_000 - 4
    host.at(math.ceil(half / 4) * 4)
    assert host.position() == 10_000
    host.ends_at(seconds)
    assert host.positions(0, 1) == (10_000, 10_000)


def test_g_32_a_piece_takes_12_ms() -> None:
    host = Host(G91)
    host.accept(*["68 05 05 68 E0 81 64 00 00 C5 16"] * 20)
    host.ends_at(0.406667)
    assert host.position() == 2000
    assert np.diff(host.set_points()[:, 0]).max() <= math.ceil(100 / 3)


def test_g_33_speed_above_m() -> None:
    host = Host(ready=False)
    host.prepare(Q, "68 05 05 68 E0 4D 88 13 00 C8 16", "68 05 05 68 E0 66 28 23 00 91 16")
    host.accept(TO_20000)
    host.ends_at(4.1)
    assert set(np.diff(host.set_points()[:, 0])[26:999]) == {20}


def test_g_34_v_factor() -> None:
    host = Host("68 05 05 68 E0 4D F0 49 02 68 16", "68 05 05 68 E0 66 13 27 00 80 16")
    host.accept(TO_20000)
    host.ends_at(2.2)
    assert set(np.diff(host.set_points()[:, 0])[51:499]) == {40}


@pytest.mark.parametrize(("override", "seconds"), [("10 E0 09 32 1B 16", 4.1), ("10 E0 09 78 61 16", 1.906667)])
def test_g_35_override_from_outside(override: str, seconds: float) -> None:
    host = Host()
    host.accept(override, TO_20000)
    host.ends_at(seconds)
    assert host.position() == 20_000


STOP = "68 0B 0B 68 E0 70 0B 00 00 00 00 00 01 00 00 5C 16"
NO_STOP = "68 0B 0B 68 E0 70 0B 00 00 00 00 00 00 00 00 5B 16"


def test_g_36_stop_flag_and_on() -> None:
    host = Host()
    host.accept(TO_20000)
    host.at(1000)
    host.accept(STOP)
    host.at(1100)
    assert near(host.position(), 9750)
    host.at(1200)
    assert host.position() == 10_000
    host.at(1600)
    assert host.position() == 10_000
    (why,) = host.tell(WHY_NOT)
    assert int(why.split()[5], 16) & 4
    host.at(2000)
    host.accept(NO_STOP)
    host.at(2200)
    assert near(host.position(), 11_000)
    host.ends_at(3.2)
    assert host.position() == 20_000


def test_g_37_abort_in_motion() -> None:
    host = Host()
    host.accept(TO_20000, TO_0)
    host.at(1000)
    host.accept(ABORT)
    host.ends_at(1.2)
    assert host.position() == 10_000
    host.at(1500)
    assert host.position() == 10_000
    assert host.tell(STATUS) == ["10 E0 00 E0 16"]


def test_g_38_buffer_full() -> None:
    """The 101st is not taken; after 10 s of 1000 increments at 100 Hz there is room for it."""
    host = Host(G91, "68 05 05 68 E0 66 64 00 00 AA 16")
    move = "68 05 05 68 E0 81 E8 03 00 4C 16"
    host.accept(*[move] * 100)
    assert host.tell(move) == ["10 E0 08 E8 16"]
    host.at(9900)
    assert host.tell(move) == ["10 E0 08 E8 16"]
    host.at(10_100)
    assert host.tell(move, move) == [OK, "10 E0 08 E8 16"]


def test_g_39_not_ready() -> None:
    host = Host(ready=False)
    host.accept(TO_238)
    assert host.tell(STATUS) == ["10 E0 40 20 16"]
    host.at(1000)
    assert host.position() == 0
    assert host.twin.fault


def test_g_40_enable_input() -> None:
    """On the desk, where a terminal can be held: in the cabinet e0.0 is fed by what feeds the drives."""
    desk = Desk.of("gmi99", carriage=(100_000, 100_000, 50_000))

    def answer(frame: str) -> bytes:
        seen = len(desk.replies)
        desk.send(bytes.fromhex(frame))
        return b"".join(data for _, data in desk.replies[seen:])

    answer(Q)
    desk.finish()
    for frame in (M_50000, F_10000, "68 08 08 68 E0 4E 01 00 00 33 00 00 62 16"):
        assert answer(frame) == b"\xe5"
    desk.set("e0.0", False)
    assert answer(TO_238) == b"\xe5"
    desk.run(1.0)
    assert desk.counts[0] == 0
    assert answer(WHY_NOT)[5] & 8
    desk.set("e0.0", True)
    desk.finish()
    assert desk.counts[0] == 238
    # and in motion: it brakes along the path, stands, and goes on
    desk.advance_to(-(-desk.time_ns // TICK_NS) * TICK_NS)
    t0_ns = desk.time_ns
    answer(TO_20000)
    desk.advance_to(t0_ns + 1_000_000_000)
    desk.set("e0.0", False)
    desk.run(1.0)
    assert abs(desk.counts[0] - (238 + 10_000)) <= 1
    desk.set("e0.0", True)
    desk.finish()
    assert desk.counts[0] == 20_000


def test_g_41_motion_without_axes() -> None:
    host = Host("68 08 08 68 E0 4E 01 00 00 11 00 00 40 16")
    before = host.twin.machine_position_mm.copy()
    host.accept(TO_20000)
    host.at(1000)
    assert near(host.position(), 9000)
    assert host.flag(3) & 0x10
    host.ends_at(2.2)
    assert host.position() == 20_000
    assert np.abs(host.set_points()).max() == 0
    assert np.abs(host.twin.machine_position_mm - before).max() < 1e-9


def test_g_42_quarter_circle() -> None:
    host = Host(FAST_CIRCLES, G91)
    host.accept(
        "68 05 05 68 E0 47 03 00 00 2A 16",
        "68 08 08 68 E0 83 F0 D8 FF 00 00 00 2A 16",
        "68 08 08 68 E0 83 F0 D8 FF 10 27 00 61 16",
    )
    host.ends_at(1.770809)
    assert host.positions(0, 1) == (-10_000, 10_000)
    from_centre = host.set_points()[:, :2] + [10_000, 0]
    assert np.abs(np.hypot(*from_centre.T) - 10_000).max() < 1
    assert np.all(np.diff(np.arctan2(from_centre[:, 1], from_centre[:, 0])) >= 0)


def test_g_43_speed_limit_of_circles() -> None:
    """At most sqrt(4000)/0.012 = 5270.46 Hz: 21.08 increments a tick."""
    host = Host(FAST_CIRCLES, G91)
    host.accept(
        "68 05 05 68 E0 47 02 00 00 29 16",
        "68 08 08 68 E0 83 E8 03 00 00 00 00 4E 16",
        "68 08 08 68 E0 83 00 00 00 00 00 00 63 16",
    )
    host.ends_at(1.297659)
    assert host.positions(0, 1) == (0, 0)
    at = host.set_points()[:, :2]
    turned = np.unwrap(np.arctan2(at[:, 1], at[:, 0] - 1000))
    assert turned[-1] - turned[0] == pytest.approx(-2 * math.pi)
    assert np.hypot(*np.diff(at, axis=0).T).max() <= math.sqrt(4000) / 3 + math.sqrt(2)


def test_g_44_and_45_zero_points() -> None:
    host = Host()
    host.accept("68 0B 0B 68 E0 47 36 00 00 E8 03 00 01 00 00 49 16", "68 05 05 68 E0 47 36 00 00 5D 16", TO_0)
    host.settle()
    assert host.positions(0, 1) == (1000, 0)
    assert host.tell("68 0B 0B 68 E0 54 08 00 00 36 00 00 00 00 00 72 16") == ["68 05 05 68 E0 5A E8 03 00 25 16"]
    host.accept("68 05 05 68 E0 47 35 00 00 5C 16", TO_0)
    host.settle()
    assert host.position() == 0


# ---- moves that arrive at any time ----------------------------------------------------------------------------------


def frame(code: int, value: int) -> str:
    """A long record with one parameter."""
    body = bytes([0xE0, code]) + (value & 0xFFFFFF).to_bytes(3, "little")
    return (b"\x68\x05\x05\x68" + body + bytes([sum(body) % 256, 0x16])).hex(" ")


def along(axis: int, way: int, feed: int, before: tuple[int, int] | None) -> Part:
    """A move of one axis, 12 ms at least; FS90 = 600 Hz at a right angle, 300 Hz back, where the change is twice the
    velocity; straight on without limit."""
    entry = math.inf
    if before is not None and before[0] != axis:
        entry = 600.0
    elif before is not None and before[1] * way < 0:
        entry = 300.0
    n = (float(way), 0.0) if axis == 0 else (0.0, float(way))
    return Part(n, abs(way), min(feed, abs(way) / 0.012), 50_000, entry)


arrivals = st.lists(
    st.tuples(
        st.integers(0, 600),
        st.sampled_from([0, 1]),
        st.integers(-6000, 6000).filter(bool),
        st.integers(2000, 20_000),
    ),
    min_size=1,
    max_size=7,
)


@settings(max_examples=drawn(25), deadline=None, derandomize=True)
@given(arrivals)
def test_moves_that_arrive_in_motion_equal_the_closed_form(moves: list[tuple[int, int, int, int]]) -> None:
    """Relative moves, each so many ms after the one before, in force at the next time of the grid: from the momentary
    speed, or from standstill if all before have been made."""
    host = Host(G91, FS0_1000, "68 08 08 68 E0 4E 58 02 00 10 00 00 98 16")
    parts: list[Part] = []
    form: Law | None = None
    ms, before = 0, None
    for delay, axis, way, feed in moves:
        ms += delay
        host.at(ms)
        host.accept(frame(0x66, feed), frame(0x81 if axis == 0 else 0x82, way))
        t = mpf(math.ceil(ms / 4)) * 4 / 1000
        standing = form is None or t >= form.end - mpf(10) ** -9
        parts.append(along(axis, way, feed, None if standing else before))
        before = axis, way
        if form is None or standing:
            new = law(parts[-1:], t=t, first=len(parts) - 1)
            form = new if form is None else form.until(t, new)
        else:
            number, place, speed = form.at(t)
            form = form.until(t, law(parts[number:], t=t, v=speed, s=place, first=number))
    t0_ns = host.t0_ns
    host.settle()
    assert form is not None
    steps = host.twin.steps
    at = np.cumsum(steps.delta[:, :2].astype(np.int64), axis=0)
    assert steps.t_ns[-1] - t0_ns == pytest.approx(float(form.end) * 1e9, abs=TICK_NS)
    for k in {*range(0, len(at), max(len(at) // 40, 1)), len(at) - 1}:
        exact = displacement(parts, form, mpf(int(steps.t_ns[k]) - t0_ns) / 10**9)
        assert np.abs(at[k] - np.array(exact, dtype=float)).max() <= 0.51
    assert tuple(at[-1]) == tuple(int(sum(n)) for n in zip(*(part.way for part in parts), strict=True))
