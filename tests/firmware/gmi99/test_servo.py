"""The card on the machine with servo drives: reference run, lag, a push that is too much, and what follows from it."""

from __future__ import annotations

import pytest
from conformance.gmi99_desk import command, long

from isel_twin import Twin

STATUS = bytes.fromhex("10 E0 01 E1 16")


def ask(twin: Twin, frame: str) -> str:
    """The answer to a frame, which is on an untimed line."""
    twin.read()
    twin.write(bytes.fromhex(frame))
    twin.run(0.0)
    return twin.read().hex(" ").upper()


def referenced(speed_hz: int, acceleration: int) -> Twin:
    twin = Twin(controller="gmi99", machine="4030-servo", start_mm=(40.0, 40.0, 30.0))
    assert twin.query("Q7;1") == "E5"
    assert twin.counts.tolist() == [0] * 6
    assert twin.query("#1") == "#00"
    for line in ("M50000", f"f{speed_hz}", f"B{acceleration}"):
        assert twin.query(line) == "E5"
    return twin


def lag(twin: Twin) -> float:
    """Set point minus encoder of axis 0, as a host reads both: the drive's address is 0."""
    return _three(ask(twin, command("T", 0, 0))) - _three(ask(twin, command("T", 0, address=0)))


def _three(answer: str) -> int:
    return int.from_bytes(bytes.fromhex(answer)[6:9], "little", signed=True)


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_the_zero_point_is_a_zero_pulse(plant: str) -> None:
    """Wherever the run begins, it ends at the same turn of the encoder, 5 mm from the next one: within the scatter of
    what follows the set point."""
    places = []
    for start_mm in (20.0, 20.0037, 23.0, 31.9):
        twin = Twin(controller="gmi99", machine="4030-servo", plant=plant, start_mm=(start_mm, 20.0, 30.0))
        twin.query("Q1;1")
        twin.run(0.1)
        assert twin.counts[0] == 0
        places.append(float(twin.machine_position_mm[0]))
    assert max(places) - min(places) <= (0.0021 if plant == "kinematic" else 0.02)


def test_the_steady_lag_is_speed_over_gain() -> None:
    """f / Kv = 10000 / 40 = 250 increments, and the set point that is being led to: up to 4 ms of 10000 Hz more."""
    twin = referenced(10_000, 50)
    twin.write(twin.language.frame("81h 100000"))
    twin.run(5.0)
    assert 245 <= lag(twin) <= 255 + 40
    twin.run(5.5)
    assert ask(twin, STATUS.hex()) == "10 E0 00 E0 16"
    assert abs(lag(twin)) <= 10


@pytest.mark.parametrize(("newton", "faults"), [(500.0, False), (2500.0, True)])
def test_a_push(newton: float, faults: bool) -> None:
    """The peak current of 12 A holds 1.2 N m, 1500 N at 5 mm lead: 500 N is held within 800 increments, 2500 N runs
    away and passes the limit of 4000 increments about 30 ms later."""
    twin = referenced(20_000, 500)
    twin.write(twin.language.frame("81h 100000"))
    twin.run(1.0)
    assert 495 <= lag(twin) <= 505 + 80
    twin.apply_force(0, -newton)
    twin.run(0.020)
    assert ask(twin, STATUS.hex()) == "10 E0 90 70 16"
    twin.run(0.044)
    if not faults:
        assert lag(twin) < 800
        assert ask(twin, STATUS.hex()) == "10 E0 90 70 16"
        return
    assert int(ask(twin, STATUS.hex()).split()[2], 16) & 0x40
    assert ask(twin, command("T", 1, 3, 0)).split()[6] in ("90", "98"), "M0.4 no E-stop, M0.7 an error of a drive"
    assert ask(twin, command("T", 3, 8)) == long(b"\x00")
    assert ask(twin, "10 00 01 01 16") == "10 00 40 40 16", "of the drive: reference missing"
    twin.apply_force(0, 0.0)
    twin.run(0.5)
    assert ask(twin, STATUS.hex()) == "10 E0 40 20 16"
    assert twin.query("Q7;0") == "E5"
    assert twin.query("#1") == "#00"
    assert twin.query("81h -1000") == "E5"
    assert twin.counts[0] == -1000


def test_an_emergency_stop_takes_the_current() -> None:
    twin = referenced(10_000, 50)
    twin.write(twin.language.frame("81h 50000"))
    twin.run(1.0)
    twin.set_input("estop", "pressed")
    twin.run(0.01)
    assert ask(twin, STATUS.hex()) == "10 E0 48 28 16"
    assert twin.outputs["stages"] == 0
    twin.set_input("estop", "released")
    assert twin.query("Q7;1") == "E5"
    assert twin.query("#1") == "#00"
    assert twin.outputs["stages"] == 1
