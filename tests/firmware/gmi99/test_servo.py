"""The card on the machine with servo drives: reference run, lag, a push that is too much, and what follows from it."""

from __future__ import annotations

from pathlib import Path

import pytest
from conformance.gmi99_desk import command, long

from isel_twin import Twin
from isel_twin.envs import Settings, Setup, run_job

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
    assert ask(twin, command("T", 3, 8)) == long(b"\x02"), "pulses blocked"
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


def test_it_is_saved_and_restored_in_mid_motion() -> None:
    def life(saved_at: int | None) -> tuple[int, list[int], list[float]]:
        twin = referenced(20_000, 100)
        for line in ("p3;100;0", "84h 2000", "p10;14;1", "84h 0", "p3;101"):
            twin.query(line)
        twin.write(twin.language.frame("81h 20000 | 83h 0 9000 | p3;1;0 | 81h 5"))
        for number in range(20):
            twin.run(0.1)
            if number == saved_at:
                state = twin.save()
                twin = Twin(controller="gmi99", machine="4030-servo", start_mm=(40.0, 40.0, 30.0))
                twin.restore(state)
        twin.run_until(twin.time_ns + 10**11, lambda: twin.idle)
        return twin.time_ns, twin.counts.tolist(), twin.position_mm.tolist()

    undisturbed = life(None)
    assert undisturbed[1] == [5, 9000, 0, 0, 0, 0]
    assert [life(number) for number in (2, 15)] == [undisturbed] * 2


def test_events_wait_for_its_outputs_and_telegrams(tmp_path: Path) -> None:
    file = tmp_path / "scenario.toml"
    output = '[[event]]\nwhen = "output a0.4 == 1"\nset.user_0 = "high"\n'
    telegram = '[[event]]\nwhen = "sent T5;12"\nset.user_1 = "high"\n'
    file.write_text(output + telegram)
    twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic", start_mm=(40.0, 40.0, 30.0), scenario=file)
    twin.query("Q7;0")
    twin.query("p10;16;4")
    assert (twin.inputs["user_0"], twin.inputs["user_1"]) == ("high", "low")
    twin.query("T5;12")
    assert twin.inputs["user_1"] == "high"
    twin.run(0.004)  # the safety program's pass: the image of the inputs is from its end
    assert twin.query("T1;1;1").startswith("I C3"), "E1.0 and E1.1, and both limit switches of X free"


def test_a_job_is_tuned_on_it() -> None:
    """5 mm at 20000 Hz and 500 Hz/ms, 1 um an increment, and as long again for Y: 0.25 s and 0.04 s each."""
    setup = Setup(job=[(5.0, 0.0, 0.0), (5.0, 5.0, 0.0)], machine="4030-servo", controller="gmi99", tolerance_mm=0.05)
    row = run_job(setup, Settings(20_000, 500, 300))
    assert row.good
    assert row.moves == 2
    assert row.time_s == pytest.approx(0.58, abs=0.02)


def test_the_safety_program_is_there() -> None:
    """An open hood in motion: the relay takes the power, the PLC sets the stop flag and tells the host, once."""
    twin = referenced(10_000, 50)
    assert ask(twin, command("T", 3, 4)) == long(b"\x00")
    twin.write(twin.language.frame("81h 50000"))
    twin.run(1.0)
    twin.set_input("hood", "forced")
    twin.run(0.008)
    assert int(ask(twin, command("T", 1, 3, 0)).split()[6], 16) & 1, "M0.0"
    assert [twin.query("#1"), twin.query("#1")] == ["#42 02", "#40"]
    twin.set_input("hood", "closed")
    assert twin.query("Q7;1") == "E5"
    twin.write(twin.language.frame("81h 5000"))
    twin.run(1.0)
    assert twin.counts[0] == 0, "the stop flag holds"
    twin.set_input("start", "down")
    twin.run(0.1)
    twin.set_input("start", "up")
    twin.run(2.0)
    assert twin.counts[0] == 5000


@pytest.mark.parametrize(
    ("rev_min", "analog"),
    [(0, 0), (93, 0), (96, 1), (6000, 64), (12_000, 128), (18_000, 192), (23_999, 255), (24_000, 255), (65_535, 255)],
)
def test_the_safety_program_scales_the_speed_of_the_spindle(rev_min: int, analog: int) -> None:
    """The whole part of 256 S / 24000 in quarters of 1/min, at most 255: 10 V."""
    twin = Twin(controller="gmi99", machine="4030-servo-hf", plant="kinematic")
    twin.query("Q7;0")
    assert twin.query("m100;1;24000") == "E5"
    assert twin.query(f"m100;1;{rev_min}") == "E5"
    assert twin.query("p10;16;15") == "E5"
    twin.run(0.1)
    assert (twin.outputs["analog"], twin.outputs["a1.7"]) == (analog, 1), "and then the next command"


def test_the_safety_program_acknowledges_a_speed_without_a_scale() -> None:
    twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic")
    twin.query("Q7;0")
    twin.query("m100;1;12000")
    twin.query("p10;16;15")
    twin.run(0.1)
    assert (twin.outputs.get("analog", 0), twin.outputs["a1.7"]) == (0, 1)


def test_the_safety_program_switches_the_spindle() -> None:
    twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic")
    twin.query("Q7;0")
    assert twin.query("m53") == "E5"
    assert twin.outputs["a0.0"] == twin.outputs["spindle_runs"] == 1
    assert twin.query("m55") == "E5"
    assert twin.outputs["a0.0"] == twin.outputs["spindle_runs"] == 0
