"""A twin with servo axes, from the controller's border to the verdict: a card that leads them along set points."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from plugin.card6 import Card6, Card6Language

from isel_twin import Twin
from isel_twin.controller import Drives, Output, UsesDrives, offers
from isel_twin.jobs.checks.asserts import MotionError, assert_no_step_lost
from isel_twin.jobs.checks.watched import Watched
from isel_twin.jobs.expect import parse_condition
from isel_twin.jobs.result import Result
from isel_twin.jobs.verdict import judge
from isel_twin.machine import MachineError
from isel_twin.wiring import ScenarioEvent

WORDS = Card6Language()
START_MM = (100.0, 50.0, 30.0)


class ServoCard(Card6):
    """The card, told of a limit of a machine with servo axes, with an output that forgets faults of drives."""

    drives: Drives

    def drive_inputs(self) -> Sequence[Any]:
        return []

    def use_drives(self, drives: Drives) -> None:
        super().use_drives(drives)
        self.drives = drives

    def terminals(self) -> dict[str, tuple[str, ...]]:
        return {**super().terminals(), "slot0.hot": ("overtemperature",)}

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        if terminal != "slot0.hot":
            super().set_input(t_ns, terminal, level)

    def machine_overrides(self) -> dict[str, Any]:
        return {"axes.all.drive": "servo"}

    def reset(self, twin: Twin) -> None:
        """As a command would."""
        for level in (1, 0):
            self._events.append(Output("drive_reset", level))
            twin.run(0.001)
            twin.write(WORDS.frame("where"))
            twin.run(0.02)


def build(plant: str = "mujoco", machine: str = "4030-servo", **others: Any) -> tuple[Twin, ServoCard]:
    card = ServoCard()
    assert offers(card, UsesDrives)
    twin = Twin(machine, card, plant, **{"start_mm": START_MM, **others})
    twin.run(0.2)
    return twin, card


def go(twin: Twin, text: str, seconds: float) -> None:
    twin.write(WORDS.frame(text))
    twin.run(seconds)


def result(twin: Twin) -> Result:
    now, counts = twin.time_ns, tuple(twin.counts.tolist())
    return Result(1, "move", "K", True, now, now, counts, tuple(twin.position_mm.tolist()))


def test_in_motion_it_lags_and_loses_nothing():
    """20000 increments/s over 40 1/s, and the encoder that the card sees is behind by as much."""
    twin, card = build()
    go(twin, "move 40000 0 0 0 0 0 20000", 1.5)
    assert twin.following_error[0] == pytest.approx(500.0, rel=0.02)
    assert card.drives.lag[0] == pytest.approx(500.0, rel=0.02)
    assert card.drives.speed[0] == pytest.approx(20_000.0, rel=0.01)
    assert twin.counts[0] - card.drives.encoder[0] == pytest.approx(500.0, abs=90.0), "a set point is 80 increments"
    assert not card.drives.in_position[0]
    assert twin.lost_steps.tolist() == [0.0] * 6
    assert twin.margin[0] == pytest.approx(1 - 500 / 4000, abs=0.01)
    twin.run(2.5)
    assert card.drives.in_position == (True,) * 6
    assert twin.position_mm[0] == pytest.approx(40.0, abs=0.03)
    verdict = judge(twin, [result(twin)])
    assert verdict.ok
    assert verdict.summary()["switched_off"] == [""] * 6
    assert verdict.summary()["following_error"][3:] == [None] * 3
    json.dumps(verdict.summary())


def test_pushed_too_hard_it_is_off_and_the_verdict_says_why_also_after_a_reset():
    twin, card = build()
    watched = Watched(twin)
    go(twin, "move 40000 0 0 0 0 0 20000", 1.0)
    twin.apply_force(0, -2500.0)
    twin.run(0.035)
    twin.apply_force(0, 0.0)
    assert card.drives.fault == (True, False, False, False, False, False)
    assert card.drives.on[:3] == (False, True, True)
    assert twin.drive_faults[0] == (1, "following error exceeded")
    twin.run(5.0)
    assert twin.counts[0] == 40_000
    assert card.drives.encoder[0] < 30_000
    assert twin.lost_steps.tolist() == [0.0] * 6
    assert twin.forgotten_steps.tolist() == [0.0] * 6
    assert parse_condition("drive_faults.x == 1").look(twin, None).met
    assert parse_condition("drive_faults == 1").look(twin, None).met
    assert parse_condition("lag.x > 1000").look(twin, None).met
    assert parse_condition("lag.y < 5").look(twin, None).met
    verdict = judge(twin, [replace(result(twin), drive_faults_known=(1, None, None))])
    assert verdict.ok, "the job has said so"
    verdict = judge(twin, [result(twin)])
    assert not verdict.ok
    assert verdict.switched_off == ("following error exceeded", "", "", "", "", "")
    at = card.drives.encoder[0]
    card.reset(twin)
    assert not any(card.drives.fault)
    assert card.drives.on == (True,) * 6
    go(twin, "zero", 1.0)
    assert card.drives.encoder[0] == pytest.approx(0, abs=1)
    assert abs(card.drives.lag[0]) <= 1.0
    assert twin.position_mm[0] == pytest.approx(0.0, abs=0.03)
    assert twin.forgotten_steps.tolist() == [0.0] * 6
    go(twin, "move -1000 0 0 0 0 0 5000", 2.0)
    assert card.drives.encoder[0] == pytest.approx(-1000, abs=2)
    assert at != 0
    assert not judge(twin, [result(twin)]).ok, "it has been so"
    with pytest.raises(MotionError, match="x: following error exceeded"):
        assert_no_step_lost(watched)


def test_a_hot_amplifier_opens_the_contact_of_the_stages():
    """25 C and 5 W x 2 K/W are far below 85 C; 80 K more are not."""
    twin, card = build()
    assert twin.levels["slot0.hot"]
    twin.carry_out(ScenarioEvent(twin.time_ns, {"hot_stage_k": {"x": 80.0}}))
    twin.run(0.1)
    assert not twin.levels["slot0.hot"]
    assert not any(card.drives.on[:3])


def test_a_load_takes_current_to_move_and_nothing_to_stand():
    twin, card = build()
    twin.carry_out(ScenarioEvent(twin.time_ns, {"payload_kg": {"table": 30.0}}))
    go(twin, "move 0 -20000 0 0 0 0 20000", 3.0)
    assert not any(card.drives.fault)
    assert card.drives.encoder[1] == pytest.approx(-20_000, abs=2)


def test_restored_it_goes_on_to_the_bit():
    """In motion, and with a fault that stands."""
    twin, _ = build()
    go(twin, "move 40000 0 0 0 0 0 20000", 1.0)
    ends = []
    state = twin.save()
    for _ in range(2):
        twin.apply_force(0, -2500.0)
        twin.run(0.02)
        faulty = twin.save()
        twin.run(0.02)
        ends.append((twin.position_mm.tolist(), twin.drive_faults, twin.following_error.tolist()))
        twin.restore(state)
    twin.restore(faulty)
    twin.run(0.02)
    assert ends[0] == ends[1] == (twin.position_mm.tolist(), twin.drive_faults, twin.following_error.tolist())
    assert ends[0][1][0][0] == 1


def test_an_emergency_stop_is_no_fault_of_a_drive():
    twin, card = build()
    go(twin, "move 60000 0 0 0 0 0 20000", 1.0)
    twin.set_input("estop", "pressed")
    twin.run(1.0)
    assert card.drives.on[:3] == (False,) * 3
    assert not any(card.drives.fault)
    assert twin.drive_faults[0] == (0, "")


@pytest.mark.parametrize("plant", ["mujoco", "kinematic"])
def test_the_zero_pulse_stands_where_it_stands(plant):
    """Every 5 mm of the machine: power-on at 101.3 mm is 1300 increments past one, wherever the counter is 0."""
    twin, card = build(plant, start_mm=(101.3, 50.0, 30.0))
    assert card.drives.past_zero_pulse[0] == pytest.approx(1300, abs=12)
    go(twin, "move 5200 0 0 0 0 0 20000", 2.0)
    before = card.drives.past_zero_pulse[0]
    assert before == pytest.approx(1500, abs=12)
    go(twin, "zero", 0.1)
    assert card.drives.past_zero_pulse[0] == before
    go(twin, "move -1600 0 0 0 0 0 20000", 2.0)
    assert card.drives.past_zero_pulse[0] == pytest.approx(before - 1600 + 5000, abs=2)


def test_without_physics_drives_are_ideal():
    twin, card = build("kinematic")
    go(twin, "move 40000 0 0 0 0 0 20000", 1.5)
    assert twin.following_error.tolist() == [0.0] * 6
    assert twin.closed_loop.tolist() == [True] * 3 + [False] * 3
    assert card.drives.speed[0] == pytest.approx(20_000.0, rel=0.001)


@pytest.mark.parametrize("controller", ["imc-s8", "ismif-interpreter"])
def test_a_stepper_controller_refuses_the_machine_in_one_line(controller):
    from isel_twin.controller import controller_names

    name = next(name for name in controller_names() if name.split("-")[0] == controller.split("-")[0])
    with pytest.raises(
        MachineError, match="the machine has servo drives; take a machine with stepper drives"
    ) as caught:
        Twin("4030-servo", name)
    assert "\n" not in str(caught.value)


def test_a_servo_card_refuses_a_machine_with_stepper_motors_in_one_line():
    with pytest.raises(MachineError, match="take a machine with servo drives, such as 4030-servo") as caught:
        build(machine="4030")
    assert "\n" not in str(caught.value)
