"""iMC, sections 2.2.29 to 2.2.31: 3D, moves until a port event, control bytes."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.closed_forms import hex24, line, pulse_times_ns, stop_times_ns
from conformance.imc_desk import MIDDLE, XYZA, initialised, made, ready
from conformance.rows import case, shows

STOP, RESET, BREAK = b"\xfd", b"\xfe", b"\xff"

# --- 2.2.29: 3D ----------------------------------------------------------------------------------------------------


@shows("imc-2.2.29-1", "imc-2.2.29-3", "imc-2.2.29-5")
def test_3d_relative_moves() -> None:
    desk = ready()
    assert desk.query("@0z1") == "0"
    for _ in range(2):
        assert made(desk, "@0A100,1000,50,900,-30,900,25,900").delta.tolist() == line(100, 50, -30).tolist()


@shows("imc-2.2.29-4", "imc-2.2.29-5")
def test_3d_absolute_moves() -> None:
    desk = ready()
    assert desk.query("@0z1") == "0"
    assert made(desk, "@0M100,1000,50,900,-30,900,0,900").delta.tolist() == line(100, 50, -30).tolist()
    assert made(desk, "@0M0,1000,0,900,0,900,25,900").delta.tolist() == line(-100, -50, 30).tolist()


@shows("imc-1-38", "imc-2.2.29-2")
def test_back_to_2_5d() -> None:
    desk = ready()
    assert desk.query("@0z1") == "0"
    assert desk.query("@0z0") == "0"
    stream = made(desk, "@0A100,1000,50,900,-30,900,25,900")
    expected = np.concatenate([line(100, 50), line(0, 0, -30), line(0, 0, 25)])
    assert stream.delta.tolist() == expected.tolist()


@shows("imc-2.2.29-7")
def test_a_follows_along_in_3d() -> None:
    desk = ready(XYZA)
    assert desk.query("@0z1") == "0"
    begin = desk.time_ns
    stream = made(desk, "@0A10,1000,50,900,-30,900,200,900")
    assert stream.total == (10, 50, -30, 200)
    assert stream.delta.tolist() == line(10, 50, -30, 200).tolist()
    assert stream.t_ns.tolist() == [begin + t for t in pulse_times_ns(200, 1000)]


@shows("imc-2.2.29-8")
def test_3d_knows_two_states() -> None:
    assert ready().query("@0z2") == "1"


# --- 2.2.30: until a port event ------------------------------------------------------------------------------------


@shows("imc-2.2.30-1", "imc-2.2.30-10")
def test_bit_rising_in_the_move_ends_it() -> None:
    desk = ready(XYZA)
    desk.at(2.0005, lambda: desk.set("user_2", True))
    edge = desk.time_ns + 2_000_500_000
    stream = made(desk, "@0Z0,4,4,600,0,0,3000,0")
    # From 600 Hz down to 300 Hz at 100 Hz/ms takes 3 ms and 1.35 steps.
    after = stream.t_ns[stream.t_ns > edge]
    assert len(after) <= 2
    assert (after <= edge + 3_000_000).all()
    assert 1195 <= len(stream) <= 1202
    assert desk.query("@0P") == hex24(0, 0, len(stream), 0)


@shows("imc-2.2.30-1")
def test_without_a_ramp_the_move_ends_within_one_step() -> None:
    desk = ready(XYZA)
    assert desk.query("@0j600") == "0"
    edge = desk.time_ns + 2_000_500_000
    desk.at(2.0005, lambda: desk.set("user_2", True))
    stream = made(desk, "@0Z0,4,4,600,0,0,3000,0")
    assert (stream.t_ns > edge).sum() <= 1
    assert edge - stream.t_ns[-1] < 1e9 / 600


@shows("imc-2.2.30-2", "imc-2.2.30-3")
def test_without_the_event_the_move_is_a_move() -> None:
    desk = ready(XYZA)
    begin = desk.time_ns
    stream = made(desk, "@0Z0,4,4,600,0,0,3000,0")
    assert stream.delta.tolist() == line(0, 0, 3000).tolist()
    assert stream.t_ns.tolist() == [begin + t for t in pulse_times_ns(3000, 600)]


@shows("imc-2.2.30-4")
def test_moves_until_an_event_are_relative() -> None:
    desk = ready()
    for _ in range(2):
        assert desk.query("@0Z0,4,4,600,10,-20,30") == "0"
    assert desk.counts == (20, -40, 60, 0)


@shows("imc-2.2.30-5")
def test_event_that_has_already_come() -> None:
    desk = ready(XYZA)
    desk.set("user_2", True)
    assert len(made(desk, "@0Z0,4,4,600,0,0,3000,0")) <= 1


@shows("imc-2.2.30-6")
def test_mask_of_the_event() -> None:
    desk = ready()
    for bit in (0, 1, 3):
        desk.set(f"user_{bit}", True)
    assert len(made(desk, "@0Z0,6,4,900,500,0,0")) == 500  # bits 1 and 2 must be 0 and 1; they are 1 and 0
    desk.set("user_2", True)
    assert len(made(desk, "@0Z0,6,4,900,500,0,0")) == 500
    desk.set("user_1", False)
    assert len(made(desk, "@0Z0,6,4,900,500,0,0")) <= 1


@pytest.mark.parametrize(
    ("axes", "count"),
    [
        case("imc-2.2.30-7", 1, 1),
        case("imc-2.2.30-8", 3, 2),
        case("imc-2.2.30-9", 7, 3),
        pytest.param(XYZA, 4, marks=shows("imc-2.2.30-10")),
    ],
)
def test_one_number_of_steps_an_axis(axes: int, count: int) -> None:
    desk = ready(axes)
    for given in range(6):
        steps = "".join(",7" for _ in range(given))
        assert desk.query(f"@0Z0,4,4,600{steps}") == ("0" if given == count else "7"), given
    assert desk.counts == tuple(7 if axis < count else 0 for axis in range(4))


@shows("imc-2.2.30-11")
def test_moves_until_an_event_are_linear_in_all_axes() -> None:
    stream = made(ready(XYZA), "@0Z0,4,4,900,100,-30,250,10")
    assert stream.delta.tolist() == line(100, -30, 250, 10).tolist()


# --- 2.2.31: control bytes -----------------------------------------------------------------------------------------

LONG = {"A": "@0A20000,5000,-7000,900,300,900,-100,900", "M": "@0M20000,5000,-7000,900,300,900,0,900"}
RELATIVE, ABSOLUTE = LONG["A"], LONG["M"]


@pytest.mark.parametrize("command", [case("imc-2.2.31-2", RELATIVE), case("imc-2.2.31-3", ABSOLUTE)])
@pytest.mark.parametrize("at_ns", [1_000_000_000, 1_234_567_891, 3_500_000_017])
def test_stop_ramps_down_from_the_momentary_frequency(command: str, at_ns: int) -> None:
    desk = ready()
    begin = desk.time_ns
    desk.start(command)
    desk.advance_to(begin + at_ns)
    desk.send(STOP)
    assert desk.finish() == "F"
    stream = desk.steps
    t_ns = stream.t_ns - begin
    assert t_ns.tolist() == stop_times_ns(20_000, 5000, 300, 100_000, at_ns)
    assert np.count_nonzero(t_ns > at_ns) in (124, 125)  # (5000^2 - 300^2) / (2 * 100000) = 124.55
    assert stream.delta.tolist() == line(20_000, -7000)[: len(stream)].tolist()
    assert desk.replies[-1] == (int(stream.t_ns[-1]), b"F")


@shows("imc-2.2.31-4")
@pytest.mark.parametrize(
    ("command", "at_s"),
    [(c, at_s) for c in (RELATIVE, ABSOLUTE) for at_s in (0.0005, 0.02, 1.0, 3.99, 4.2)] + [(RELATIVE, 4.42)],
)
def test_start_makes_exactly_the_rest(command: str, at_s: float) -> None:
    """In the ramps, in the middle and in the Z moves behind X and Y."""
    desk = ready()
    desk.start(command)
    desk.run(at_s)
    desk.send(STOP)
    assert desk.finish() == "F"
    assert desk.query("@0S") == "0"
    whole = ready()
    assert whole.query(command) == "0"
    assert desk.steps.delta.tolist() == whole.steps.delta.tolist()
    assert desk.counts == whole.counts


@shows("imc-2.2.31-4")
def test_a_move_can_be_stopped_again_and_again() -> None:
    desk = ready()
    desk.start(RELATIVE)
    for _ in range(5):
        desk.run(0.3)
        desk.send(STOP)
        assert desk.finish() == "F"
        desk.start("@0S")
    assert desk.finish() == "0"
    assert desk.counts == (20_000, -7000, 200, 0)


@shows("imc-2.2.31-5")
def test_position_after_stop() -> None:
    desk = ready()
    desk.start(RELATIVE)
    desk.run(1.0)
    desk.send(STOP)
    assert desk.finish() == "F"
    x, y, z, _ = desk.steps.total
    assert x > 4000
    assert desk.query("@0P") == hex24(x, y, z)
    assert desk.query("@0S") == "0"


@shows("imc-2.2.31-6", "imc-2.2.31-7", "imc-5-27", "imc-5-29")
def test_stop_key() -> None:
    by_byte, by_key = ready(), ready()
    for desk in (by_byte, by_key):
        desk.start(RELATIVE)
        desk.run(1.0)
    by_byte.send(STOP)
    by_key.set("stop", "down")
    assert by_byte.finish() == "F"
    assert by_key.finish() == "F"
    assert by_byte.steps.t_ns.tolist() == by_key.steps.t_ns.tolist()
    by_key.set("stop", "up")
    assert by_key.query("@0s") == "0"
    assert by_key.counts == (20_000, -7000, 200, 0)


@shows("imc-5-28")
def test_start_key_goes_on() -> None:
    desk = ready()
    desk.start(RELATIVE)
    desk.run(1.0)
    desk.press("stop")
    assert desk.finish() == "F"
    desk.press("start")
    desk.run(10.0)
    assert desk.counts == (20_000, -7000, 200, 0)


@shows("imc-2.2.31-7")
def test_stop_at_rest_says_nothing() -> None:
    desk = ready()
    desk.send(STOP + b"\r\n")
    assert desk.finish() == ""
    assert desk.query("@0P") == hex24(0, 0, 0)


@shows("imc-2.2.31-1")
def test_control_bytes_overtake_what_waits() -> None:
    desk = ready()
    desk.send(RELATIVE.encode() + b"\r@0P\r")
    desk.run(1.0)
    desk.send(STOP)
    reply = desk.finish()
    assert reply == "F" + hex24(*desk.counts[:3])
    assert desk.counts[0] < 6000


@shows("imc-2.2.31-8")
def test_reset_ends_the_stream_at_once() -> None:
    desk = ready()
    desk.start(RELATIVE)
    desk.run(1.0)
    edge = desk.time_ns
    desk.send(RESET)
    assert desk.finish() == ""
    desk.run(5.0)
    assert desk.read() == ""
    assert desk.steps.t_ns[-1] <= edge


@shows("imc-2.2.31-9", "imc-2.2.31-10")
@pytest.mark.parametrize("in_motion", [True, False])
def test_after_reset_axes_and_reference_are_gone(in_motion: bool) -> None:
    desk = ready()
    if in_motion:
        desk.start(RELATIVE)
        desk.run(0.5)
    desk.send(RESET)
    assert desk.finish() == ""
    desk.run(1.0)
    assert desk.query("@0A10,900") == "4"
    assert desk.query("@07") == "0"
    assert desk.query("@0A10,900,0,900,0,900,0,900") == "R"
    assert desk.query("@0R7") == "0"
    assert desk.query("@0A10,900,0,900,0,900,0,900") == "0"


@pytest.mark.parametrize("command", [case("imc-2.2.31-11", RELATIVE), case("imc-2.2.31-12", ABSOLUTE)])
def test_break_forgets_the_rest(command: str) -> None:
    by_stop, by_break = ready(), ready()
    for desk, byte in ((by_stop, STOP), (by_break, BREAK)):
        desk.start(command)
        desk.run(1.0)
        desk.send(byte)
        assert desk.finish() == "F"
    assert by_stop.steps.t_ns.tolist() == by_break.steps.t_ns.tolist()
    desk = by_break
    assert desk.query("@0S") == "G"
    at = desk.counts
    assert desk.query("@0P") == hex24(*at[:3])
    assert made(desk, "@0A10,900,0,900,0,900,0,900").total == (10, 0, 0, 0)


@shows("imc-2.2.31-2")
@pytest.mark.parametrize("gap", range(1, 16))
def test_a_stop_in_the_first_steps_loses_nothing(gap: int) -> None:
    desk = ready()
    desk.start("@0A40,2000,0,900,0,900,0,900")
    desk.run(gap * 1.1e-3)
    desk.send(STOP)
    assert desk.finish() == "F"
    assert desk.query("@0S") == "0"
    assert desk.counts == (40, 0, 0, 0)
    assert tuple(desk.carriage) == (MIDDLE[0] + 40, *MIDDLE[1:])


@pytest.mark.parametrize("byte", [STOP, BREAK])
def test_a_reference_run_that_is_stopped_has_to_be_made_again(byte: bytes) -> None:
    """The manual speaks of relative and absolute moves only; a reference run has no rest to go on with."""
    desk = initialised()
    desk.start("@0R7")
    desk.run(0.3)
    desk.send(byte)
    assert desk.finish() == "F"
    assert desk.query("@0S") == "G"
    assert desk.query("@0A10,900,0,900,0,900,0,900") == "R"
    assert desk.query("@0R7") == "0"
    assert desk.query("@0A10,900,0,900,0,900,0,900") == "0"
