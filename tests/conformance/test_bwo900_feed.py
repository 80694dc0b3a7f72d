"""Dripfeed (manual 2.5.1, P8811): a program that is carried out while it comes; the host waits by its handshake."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.bwo900_desk import file, fresh, mm, parameters, said, value
from conformance.rows import shows

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.programs import feed as feed_module
from isel_twin.firmware.bwo900.programs.feed import HIGH, ROOM, Feed
from isel_twin.wiring import ScenarioError, event_now

pytestmark = pytest.mark.long(seconds=7)

FEED = parameters(p8811=1, p8800=12, p8683=2, p8684=1)
REFERENCE = parameters(p8683=1, p12530=1, p12330=1, p12130=1)


def spiral(count: int, end: str = "M30") -> list[str]:
    """Blocks of pieces of 0.2 mm: some 24 bytes each."""
    blocks = ["N1 G90 G1 F3000 X0 Y0 Z0"]
    for n in range(2, count):
        x, y = 10 + 8 * np.cos(n / 40), 10 + 8 * np.sin(n / 40)
        blocks.append(f"N{n} X{x:.3f} Y{y:.3f}")
    return [*blocks, f"N{count} {end}"]


def machine(line_speed: bool = False) -> Twin:
    twin = Twin(
        controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(5.0, 5.0, 5.0), line_speed=line_speed
    )
    twin.write(REFERENCE)
    assert twin.run_until_idle(100.0)
    return twin


def path(twin: Twin) -> np.ndarray:
    """float64 [n, 2]: the set points after the reference run, in increments."""
    begun = next(motion for motion in twin.steps.motions if motion.start_ns >= twin.steps_made[0].t_ns - 1)
    made = twin.steps.t_ns > begun.start_ns
    return np.cumsum(np.vstack(([[0, 0]], twin.steps.delta[made][:, :2])), axis=0).astype(float)


def apart(places: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each place to a line through points."""
    begin, way = line[:-1], np.diff(line, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-9)
    share = np.clip(((places[:, None] - begin) * way).sum(axis=2) / square, 0.0, 1.0)
    return np.linalg.norm(places[:, None] - begin - share[..., None] * way, axis=2).min(axis=1)


@shows("bwo900-2.5.1d-1")
def test_a_program_is_carried_out_as_if_it_were_in_the_memory() -> None:
    blocks = spiral(6000)
    kept, twin = machine(), machine()
    kept.write(file("P12", *blocks))
    kept.write(parameters(p8800=12, p8683=2, p8684=1))
    twin.write(FEED)
    twin.write(file("P1", *blocks))
    assert twin.commands_due > ROOM  # most of it waits at the host
    assert kept.run_until_idle()
    assert twin.run_until_idle()
    assert not twin.fault
    assert twin.commands_due == 0
    assert np.array_equal(twin.steps.delta, kept.steps.delta)
    assert [text for _, text in twin.remarks] == []


@shows("bwo900-2.5.1d-2")
def test_the_number_in_the_file_is_ignored_and_the_memory_stays_as_it_is() -> None:
    desk = fresh("P12|N10 G0 X9|N20 M30", "P1|N10 G0 Y9|N20 M30")
    desk.send(FEED)
    desk.send(file("P1", "N10 G0 X1", "N20 M30"))
    desk.finish()
    assert mm(desk) == (1.0, 0.0, 0.0)
    desk.send(parameters(p8811=0, p8800=12, p8684=1))
    desk.finish()
    assert mm(desk) == (9.0, 0.0, 0.0)
    desk.send(parameters(p8800=1, p8684=1))
    desk.finish()
    assert mm(desk) == (9.0, 9.0, 0.0)
    assert said(desk) == []


@shows("bwo900-2.5.1d-3")
def test_the_buffer_is_loaded_from_the_change_to_auto_on_and_started_later() -> None:
    desk = fresh(p8811=1, p8800=12)
    desk.send(parameters(p8683=2))
    desk.send(file("P1", "N10 G0 X1", "N20 M30"))
    desk.run(1.0)
    assert mm(desk) == (0.0, 0.0, 0.0)
    assert value(desk, 8_561) == len("N10 G0 X1") + len("N20 M30")
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk) == (1.0, 0.0, 0.0)
    assert value(desk, 8_561) == 0


@shows("bwo900-2.5.1d-4")
def test_by_a_flag_it_is_loaded_from_the_start_on() -> None:
    """P8807, byte 1, bit 4: what comes before Start is a program as any other."""
    desk = fresh(p8811=1, p8807=16, p8800=12)
    desk.send(parameters(p8683=2))
    desk.send(file("P12", "N10 G0 X7", "N20 M30"))
    desk.send(parameters(p8684=1))
    desk.run(1.0)
    assert mm(desk) == (0.0, 0.0, 0.0)
    desk.send(file("P1", "N10 G0 X1", "N20 M30"))
    desk.finish()
    assert mm(desk) == (1.0, 0.0, 0.0)
    desk.send(parameters(p8811=0, p8684=1))
    desk.finish()
    assert mm(desk) == (7.0, 0.0, 0.0)


@shows("bwo900-2.5.1d-5")
@pytest.mark.parametrize(
    "block",
    ["M23.10", "M23.5.10", "P500:0 P500<1.10", "M24.3", "M29", "M28..10", "M28.12", "M23.12.10"],
)
def test_nothing_leads_back(block: str) -> None:
    desk = fresh("P5|N10 G0 Z5|N20 M30")
    desk.send(FEED)
    desk.send(file("P1", "N10 G0 X1", f"N20 {block}", "N30 G0 X2", "N40 M30"))
    desk.finish()
    assert said(desk) == [1269]
    assert any(text.startswith("M1269 P12 N20") for _, text in desk.remarks)
    assert mm(desk) == (1.0, 0.0, 0.0)


@shows("bwo900-2.5.1d-6")
def test_subprograms_and_cycles_in_the_memory_are_called() -> None:
    desk = fresh("P5|N10 G0 Y5|N20 M24.2|N30 G91 Y1|N40 M25|N50 G90 M02", "Z500|N10 G0 Z1|N20 M02")
    desk.send(FEED)
    desk.send(file("P1", "N10 G0 X1", "N20 M28.5", "N30 G500", "N40 M30"))
    desk.finish()
    assert said(desk) == []
    assert mm(desk) == (1.0, 7.0, 1.0)


@shows("bwo900-2.5.1d-8")
def test_a_cycle_in_the_file_goes_to_the_memory() -> None:
    desk = fresh(p8811=1, p8800=12)
    desk.send(parameters(p8683=2))
    desk.send(file("Z500", "N10 G0 Z1", "N20 M02"))
    desk.send(file("P1", "N10 G500", "N20 M30"))
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk) == (0.0, 0.0, 1.0)


@shows("bwo900-2.5.1d-7")
@pytest.mark.parametrize("key", ["p8801=20", "p8804=1"])
def test_no_block_is_looked_for(key: str) -> None:
    """A start at a block, and a restart."""
    name, number = key.split("=")
    desk = fresh(p8802=12, p8803=20)
    desk.send(parameters(**{name: float(number)}))
    desk.send(FEED)
    desk.send(file("P1", "N10 G0 X1", "N20 G0 X2", "N30 M30"))
    desk.finish()
    assert said(desk) == [1269]
    assert mm(desk) == (0.0, 0.0, 0.0)


def test_a_slow_line_starves_it_and_no_harm_is_done() -> None:
    """9600 baud bring a block of 24 bytes in 27 ms; it takes 4 ms. The axes stand, and go on; the end is exact, and
    radius correction is that of the program in the memory, wherever the line made it wait."""
    blocks = [
        "N10 G90 G0 X5 Y5 T2 M16",
        "N20 G42 G1 F6000 X10",
        *(f"N{30 + n} X{10 + n * 0.1:.1f} Y{5 + 2 * np.sin(n / 10):.3f}" for n in range(1, 60)),
        "N100 G40 X0 Y0",
        "N110 M30",
    ]
    tools = parameters(p21020=2, p21030=0.1, p21031=0)
    kept, slow = machine(), machine(line_speed=True)
    kept.write(tools)
    kept.write(file("P12", *blocks))
    kept.write(parameters(p8800=12, p8683=2, p8684=1))
    assert kept.run_until_idle()
    slow.write(tools)
    assert slow.run_until_idle()
    slow.write(FEED)
    slow.write(file("P1", *blocks))
    assert slow.run_until_idle()
    assert not slow.fault
    assert slow.counts.tolist() == kept.counts.tolist() == [0, 0, 0]
    assert apart(path(slow), path(kept)).max() <= 25.0  # increments: chords of 2 ms; the radius is 100
    assert len(slow.steps.delta) > len(kept.steps.delta) + 25


@shows("bwo900-2.5.1d-9")
@pytest.mark.parametrize("how", ["abort", "hand", "estop", "end of the program", "message"])
def test_what_comes_after_the_end_is_thrown_away(how: str) -> None:
    twin = machine()
    twin.write(FEED)
    blocks = spiral(6000)
    if how == "end of the program":
        blocks[900] = "N901 M30"
    if how == "message":
        blocks[900] = "N901 G999"
    twin.write(file("P1", *blocks))
    twin.run(1.0)
    assert twin.commands_due > 0
    match how:
        case "abort":
            twin.press("abort")
        case "hand":
            twin.press("mode", "hand")
        case "estop":
            twin.set_input("estop", "pressed")
    assert twin.run_until_idle(100.0)
    assert twin.commands_due == 0
    if how == "estop":
        twin.set_input("estop", "released")
    said_before = len(twin.remarks)
    twin.press("mode", "hand")
    twin.write(REFERENCE)
    twin.write(file("P7", "N10 G0 X3 Y0 Z0", "N20 M30"))
    assert twin.run_until_idle(100.0)
    twin.write(parameters(p8811=0, p8800=7, p8683=2, p8684=1))
    assert twin.run_until_idle(100.0)
    assert twin.counts.tolist() == [3000, 0, 0]
    assert len(twin.remarks) == said_before


def test_a_stop_lets_the_host_wait_and_start_goes_on() -> None:
    twin = machine()
    twin.write(FEED)
    twin.write(file("P1", *spiral(6000)))
    twin.run(2.0)
    twin.press("stop")
    twin.run(2.0)
    waiting, where = twin.commands_due, twin.counts.tolist()
    twin.run(60.0)
    assert (twin.commands_due, twin.counts.tolist()) == (waiting, where)
    twin.press("start")
    assert twin.run_until_idle()
    assert twin.commands_due == 0
    assert not twin.fault


def test_it_is_saved_and_restored_between_two_blocks() -> None:
    twin, other = machine(), machine()
    twin.write(FEED)
    twin.write(file("P1", *spiral(4000)))
    twin.run(2.0)
    state = twin.save()
    assert twin.run_until_idle()
    other.restore(state)
    assert other.commands_due > 0
    assert other.run_until_idle()
    assert other.counts.tolist() == twin.counts.tolist()
    assert other.time_ns == twin.time_ns


@shows("bwo900-2.5.1d-10", "bwo900-2.5.1d-11")
def test_xon_and_xoff() -> None:
    """P11176 = 1: the host is told by characters, and one who does not listen loses blocks: M1268."""
    twin = machine()
    twin.write(parameters(p11176=1))
    twin.write(FEED)
    data = file("P1", *spiral(6000))
    sent, seen, clear = 0, b"", True
    while sent < len(data):
        if clear:
            twin.write(data[sent : sent + 512])
            sent += 512
        twin.run(0.01)
        reply = twin.read()
        seen += reply
        clear = {b"\x13": False, b"\x11": True}.get(reply[-1:], clear)
    assert twin.run_until_idle()
    assert not twin.fault
    assert seen.startswith(b"\x13\x11\x13")
    assert set(seen) == {0x11, 0x13}
    deaf = machine()
    deaf.write(parameters(p11176=1))
    deaf.write(FEED)
    deaf.write(data)
    assert deaf.run_until_idle()
    assert deaf.fault
    assert any(text.startswith("M1268 P12") for _, text in deaf.remarks)


@pytest.mark.parametrize("how", ["reset", "brownout"])
def test_a_reset_in_the_middle(how: str) -> None:
    """What comes still belongs to no file; the next one is taken."""
    twin = machine()
    twin.write(FEED)
    twin.write(file("P1", *spiral(3000)))
    twin.run(2.0)
    twin.carry_out(event_now({how: True}, Place("test", ScenarioError), twin.settable))
    twin.run(1.0)
    if how == "brownout":
        twin.carry_out(event_now({how: False}, Place("test", ScenarioError), twin.settable))
    assert twin.run_until_idle()
    assert twin.commands_due == 0
    twin.write(REFERENCE)
    twin.write(file("P7", "N10 G0 X3 Y0 Z0", "N20 M30"))
    assert twin.run_until_idle()
    twin.write(parameters(p8811=0, p8800=7, p8683=2, p8684=1))
    assert twin.run_until_idle()
    assert twin.counts.tolist() == [3000, 0, 0]


# ---- the buffer by itself --------------------------------------------------------------------------------------------


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feed_module, "KEPT", 100)
    one = Feed("P1")
    for n in range(1, 50_000):
        one.add(n, f"N{n} X{n % 100}")
        block = one.block(n - 1)
        assert block.number == n
        assert one.level == 0
    assert len(one._known) == len(one._texts) == 100
    assert one.after(49_999) == f"X{49_999 % 100}"
    assert one.after(49_000) == ""
    assert (one.number(49_998), one.number(10)) == (49_999, -1)


def test_the_host_waits_and_goes_on() -> None:
    one, n = Feed("P1"), 0
    while not one.waits:
        n += 1
        one.add(n, f"N{n} X1")
    assert HIGH <= one.level < HIGH + 20
    place = 0
    while one.waits:
        one.block(place)
        place += 1
    assert one.level <= feed_module.LOW
    more = n
    while one.level + 20 < ROOM:
        more += 1
        one.add(more, f"N{more} X1")
    with pytest.raises(ProgramError, match="1268"):
        one.add(more + 1, f"N{more + 1} X1 Y{'1' * 20}")
    assert one.level <= ROOM
