"""Every fault by its one name: what it does to replies or motion, in a scenario and at the control port.

Where a machine file has the number that a fault changes, the faulty machine must move as one built with that number.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.bridge.operate.control import ControlError, Operator
from isel_twin.controller import create_controller
from isel_twin.wiring import ACTS, ScenarioError, event_now

START_MM = (30.0, 30.0, 30.0)
OUT = "@0A8000,8000,0,30,0,30,0,30"  # 25 mm
BACK = "@0A-8000,8000,0,30,0,30,0,30"


def build(plant: str = "mujoco", **options: Any) -> Twin:
    return Twin(plant=plant, **{"start_mm": START_MM} | options)


def home(twin: Twin) -> Twin:
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    return twin


def happen(twin: Twin, **content: Any) -> None:
    """What the control port, the panel and a replay do."""
    twin.carry_out(event_now(content, Place("test", ScenarioError), twin.settable))


class ByScenario:
    """The same by a file: the event stands at an instant that is known only when the twin has been brought to it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __call__(self, events: str, plant: str = "mujoco", **options: Any) -> Twin:
        file = self.folder / "scenario.toml"
        file.write_text(events, encoding="utf-8")
        return build(plant, scenario=file, **options)


@pytest.fixture
def scenario(tmp_path: Path) -> ByScenario:
    return ByScenario(tmp_path)


# ---- the machine as another machine file would have it ---------------------------------------------------------------


def path(twin: Twin) -> np.ndarray:
    """Positions on the way of a few moves, float64 [n, 3]."""
    seen = []
    home(twin)
    for command in (OUT, BACK):
        twin.write(command.encode() + b"\r")
        for _ in range(40):
            twin.run(0.05)
            seen.append(twin.machine_position_mm.copy())
    return np.array(seen)


@pytest.mark.parametrize(
    ("fault", "number"),
    [
        ("friction_n = { x = 40 }", {"axes.x.guide_friction": 70.0}),
        ("payload_kg = { table = 8 }", {"payload.mass": 8.0}),
        ("undervoltage = 0.5", {"axes.all.stage.supply": 24.0}),
    ],
)
def test_a_fault_from_the_beginning_is_another_machine(
    scenario: ByScenario, fault: str, number: Mapping[str, float]
) -> None:
    faulty = path(scenario(f"[[event]]\nat = 0\n{fault}\n"))
    built = path(build(overrides=number))
    healthy = path(build())
    assert np.abs(faulty - built).max() < 1e-6, "mm"
    assert np.abs(healthy - built).max() > 1e-4, "or it shows nothing"


def test_a_fault_that_is_over_leaves_nothing(scenario: ByScenario) -> None:
    """All of them for 2 ms, before anything moves: then the machine is as it was."""
    all_of_them = """
        [[event]]
        at = 0.001
        for = 0.002
        friction_n = { x = 40, y = 5 }
        payload_kg = { table = 8, tool = 2 }
        obstacle_mm = { x = 200, z = 20 }
        undervoltage = 0.5
        hot_stage_k = { x = 10 }
    """
    twin = scenario(all_of_them)
    twin.run(0.002)
    assert set(twin.faults) == {
        "friction_n.x", "friction_n.y", "payload_kg.table", "payload_kg.tool", "obstacle_mm.x", "obstacle_mm.z",
        "undervoltage", "hot_stage_k.x",
    }  # fmt: skip
    assert np.abs(path(twin) - path(build())).max() < 1e-9, "mm"
    assert dict(twin.faults) == {}


# ---- motion ----------------------------------------------------------------------------------------------------------


def test_friction_beyond_what_the_motor_can_do_holds_the_carriage() -> None:
    twin = home(build())
    happen(twin, friction_n={"x": 5000.0})
    assert twin.query(OUT) == "0", "nobody tells the controller"
    assert abs(twin.position_mm[0]) < 0.1
    assert twin.lost_steps[0] > 7900
    happen(twin, friction_n={"x": 0.0})
    assert dict(twin.faults) == {}
    before = twin.position_mm[0]
    twin.query(OUT)
    twin.run(0.5)
    assert twin.position_mm[0] - before == pytest.approx(25.0, abs=0.1)


def test_a_carriage_does_not_pass_an_obstacle_from_either_side() -> None:
    twin = home(build())
    here = twin.machine_position_mm[0]
    happen(twin, obstacle_mm={"x": here + 10.0})
    twin.query(OUT)
    twin.run(0.5)
    assert here + 9.0 < twin.machine_position_mm[0] < here + 10.05
    slips = twin.lost_steps[0] / twin.slip_steps[0]
    assert slips > 100
    assert twin.inputs["limit_x2"] == "free"
    happen(twin, obstacle_mm={"x": "off"})
    twin.query(OUT)
    beyond = twin.machine_position_mm[0]
    happen(twin, obstacle_mm={"x": beyond - 5.0})
    twin.query(BACK)
    twin.run(0.5)
    assert beyond - 5.05 < twin.machine_position_mm[0] < beyond - 4.0


def test_an_obstacle_behind_the_stop_changes_nothing() -> None:
    plain, faulty = home(build()), home(build())
    happen(faulty, obstacle_mm={"x": 1000.0})
    for twin in (plain, faulty):
        twin.query(OUT)
    assert (plain.position_mm == faulty.position_mm).all()


def test_a_load_on_the_tool_hangs_on_the_motor() -> None:
    """Torque m g r / efficiency at standstill: the load angle of Z grows the way the weight pulls."""
    twin = home(build())
    twin.query("@0A0,30,0,30,8000,8000,0,30")
    twin.run(1.0)
    before = twin.lost_steps[2]
    happen(twin, payload_kg={"tool": 15.0})
    twin.run(1.0)
    assert before - twin.lost_steps[2] > 0.3, "microsteps, forward"
    happen(twin, payload_kg={"tool": 0.0})
    assert dict(twin.faults) == {}


def test_under_voltage_takes_the_torque_of_fast_moves() -> None:
    twin = home(build())
    happen(twin, undervoltage=0.85)
    twin.query(OUT)
    twin.run(0.5)
    assert twin.lost_steps[0] > twin.slip_steps[0]
    assert twin.margin[0] == 0.0
    happen(twin, undervoltage=0.0)
    twin.watch_margin()
    twin.query(BACK)
    assert twin.margin[0] > 0.3


def test_under_voltage_of_a_common_supply_drops_the_stages() -> None:
    """48 V less 65 % is below the lockout of 20 V once the capacitor has given what it had; above 24 V they hold."""
    twin = home(build(overrides={"supply.enabled": True}))
    assert twin.supply_v == pytest.approx(48.0, rel=0.02)
    happen(twin, undervoltage=0.65)
    twin.query(OUT)
    twin.run(30.0)
    assert twin.supply_v < 24.0, "what the coils gave back does not bring them on again"
    assert twin.lost_steps[0] > twin.slip_steps[0]
    happen(twin, undervoltage=0.0)
    twin.run(1.0)
    assert twin.supply_v > 24.0


def test_a_hot_stage_opens_the_safety_chain_until_it_has_cooled() -> None:
    """25 C and 70 K are beyond the limit of 85 C, with 40 K it is cool, below the hysteresis of 10 K."""
    twin = home(build())
    happen(twin, hot_stage_k={"x": 70.0})
    assert (twin.inputs["overtemperature"], twin.outputs["power"]) == ("hot", 0)
    assert twin.query(OUT) == "9"
    happen(twin, hot_stage_k={"x": 40.0})
    assert twin.inputs["overtemperature"] == "normal"


def test_a_lost_phase_halves_the_torque(scenario: ByScenario) -> None:
    twin = home(build())
    happen(twin, phase_lost={"x": "ab"})
    twin.query(OUT)
    assert abs(twin.position_mm[0]) < 0.1


# ---- contacts --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_swapped_switches_stop_the_wrong_axis(plant: str) -> None:
    """The reference run of Z works its switch, which leads to the terminal of X: the carriage never meets its own."""
    twin = build(plant)
    happen(twin, swapped={"limit_z1": "limit_x1"})
    assert dict(twin.faults) == {"swapped.limit_x1": "limit_z1"}
    assert twin.query("@07") == "0"
    twin.write(b"@0R4\r")
    twin.run(60.0)
    assert twin.machine_position_mm[2] < 0.05, "it is at its own switch, which trips within 50 um of its place"
    assert twin.inputs["limit_z1"] == "struck"


def test_swapping_back_by_either_name() -> None:
    for name in ("limit_x1", "limit_z1"):
        twin = build("kinematic")
        happen(twin, swapped={"limit_z1": "limit_x1"})
        happen(twin, swapped={name: ""})
        assert dict(twin.faults) == {}
        home(twin)


def test_a_contact_swapped_anew_leaves_its_old_partner() -> None:
    twin = build("kinematic")
    happen(twin, swapped={"limit_z1": "limit_x1"})
    happen(twin, swapped={"limit_x1": "limit_y1"})
    assert dict(twin.faults) == {"swapped.limit_x1": "limit_y1"}


def test_a_worn_switch_chatters_for_twenty_milliseconds() -> None:
    """At least six further changes; the level ends as it began the last time."""
    twin = build("kinematic")
    happen(twin, set={"start": "bounce"})
    terminal = next(name for name, contacts in twin._controller.terminals().items() if contacts == ("start",))
    edges: list[int] = []
    before = twin.levels[terminal]

    def watch(at: Twin) -> None:
        nonlocal before
        if at.levels[terminal] != before:
            before = at.levels[terminal]
            edges.append(at.time_ns)

    twin.observe(watch, 10**9)
    twin.run(0.1)
    twin.set_input("start", "down")
    twin.run(0.1)
    assert 7 <= len(edges) <= 25
    assert len(edges) % 2 == 1
    assert edges[0] == 100_000_000
    assert 100_000_000 < edges[-1] <= 120_000_000
    assert twin.levels[terminal]


@pytest.mark.parametrize("fault", ["broken", "stuck_open"])
def test_an_open_limit_switch_stops_the_motion(fault: str) -> None:
    twin = home(build("kinematic"))
    twin.write(OUT.encode() + b"\r")
    twin.run(0.5)
    happen(twin, set={"limit_x2": fault})
    twin.run_until_idle()
    assert twin.read().strip() == b"2"


def test_a_stuck_switch_is_run_through() -> None:
    twin = build()
    happen(twin, set={"limit_z1": "stuck_closed"})
    twin.query("@07")
    twin.write(b"@0R4\r")
    twin.run(60.0)
    assert twin.machine_position_mm[2] < -1.0, "up to the stop"


# ---- the line --------------------------------------------------------------------------------------------------------


def test_all_bytes_lost_is_silence() -> None:
    twin = build("kinematic")
    happen(twin, dropped=1.0)
    assert twin.query("@07") == ""
    happen(twin, dropped=0.0)
    assert twin.query("@07") == "0"


def test_doubled_bytes_are_not_understood() -> None:
    """@@00..., and a reply 5 for it, doubled too."""
    twin = build("kinematic")
    happen(twin, doubled=1.0)
    assert twin.query("@07") == "55"
    happen(twin, doubled=0.0)
    twin.run(1.0)
    twin.read()
    assert twin.query("@07") == "0"


@pytest.mark.parametrize("key", ["dropped", "doubled", "noise"])
def test_bytes_are_hit_with_the_chance_given(key: str) -> None:
    """Of 20 000 bytes a tenth; 5 standard deviations of a binomial are 212."""
    twin = build("kinematic")
    happen(twin, **{key: 0.1})
    seen: list[int] = []
    twin._controller.receive = lambda t_ns, data: seen.extend(data)  # type: ignore[method-assign]
    twin.write(b"A" * 20_000)
    hit = {"dropped": 20_000 - len(seen), "doubled": len(seen) - 20_000, "noise": sum(b != 65 for b in seen)}[key]
    assert abs(hit - 2000) < 212


def test_a_line_cut_while_a_reply_is_on_its_way_loses_the_rest_of_it() -> None:
    """520.8 us a byte: after 5.2 ms of the reply nine bytes have come, and after another 5.2 ms the rest comes."""
    whole, cut = (home(build("kinematic", line_speed=True)) for _ in range(2))
    reply = whole.query("@0P")
    cut.read()
    cut.write(b"@0P\r")
    while not cut.replies_due:
        cut.run(10e-6)
    began = cut.time_ns
    byte_ns = cut.serial_format.byte_ns
    cut.run_until(began + 9 * byte_ns + byte_ns // 2)
    happen(cut, line_cut=True)
    assert dict(cut.faults) == {"line_cut": True}
    cut.run_until(began + 14 * byte_ns + byte_ns // 2)
    happen(cut, line_cut=False)
    cut.run_until_idle()
    said = cut.read().decode()
    assert said in (reply[:9] + reply[14:], reply[:8] + reply[13:], reply[:10] + reply[15:])
    assert cut.idle
    assert cut.replies_due == 0


def test_what_has_come_before_the_cut_can_still_be_read() -> None:
    twin = build("kinematic", line_speed=True)
    twin.write(b"@07\r")
    twin.run_until_idle()
    happen(twin, line_cut=True)
    assert twin.reply_waiting
    twin.run(1.0)
    assert twin.read() == b"0"
    assert not twin.reply_waiting
    twin.write(b"@07\r")
    twin.run(1.0)
    assert twin.read() == b""
    happen(twin, line_cut=False)
    assert twin.query("@07") == "0"


# ---- the controller --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_reset_in_motion_forgets_the_place(plant: str) -> None:
    """The motion ends at once, the axes are unknown (reply 4), and a reference run finds the same place again."""
    twin = home(build(plant))
    twin.write(OUT.encode() + b"\r")
    twin.run(0.8)
    assert twin.outputs["moving"] == 1
    happen(twin, reset=True)
    stopped = twin.steps.t_ns[-1]
    assert (twin.outputs["moving"], twin.counts.tolist()) == (0, [0, 0, 0, 0])
    twin.run(1.0)
    assert twin.steps.t_ns[-1] == stopped <= 10**9 * 60
    assert twin.read() == b"", "who was asked has forgotten it"
    assert twin.query(OUT) == "4"
    home(twin)
    twin.query(OUT)
    twin.run(0.5)
    assert twin.position_mm[0] == pytest.approx(25.0, abs=0.05)
    assert abs(twin.lost_steps[0]) < twin.slip_steps[0] / 2
    assert dict(twin.faults) == {}, "a reset is over at once"


def test_faults_of_the_world_stay_over_a_reset() -> None:
    twin = home(build())
    happen(twin, set={"limit_x2": "broken"}, noise=0.25, friction_n={"x": 50.0}, swapped={"limit_y1": "limit_y2"})
    before = dict(twin.faults)
    happen(twin, reset=True)
    assert dict(twin.faults) == before


def test_a_brown_out_during_a_move() -> None:
    """Stages off, the carriage coasts and stops; nobody answers; then the controller starts anew, without a place."""
    twin = home(build())
    twin.write(OUT.encode() + b"\r")
    twin.run(0.8)
    happen(twin, brownout=True, **{"for": 0.3})
    assert twin.faults == {"brownout": True}
    assert (twin.outputs["power"], twin.outputs["stages"]) == (0, 0)
    twin.write(b"@0P\r")
    twin.run(0.2)
    assert twin.read() == b""
    assert not twin.steps.t_ns[-1] > twin.time_ns - 150_000_000
    twin.run(0.2)
    assert dict(twin.faults) == {}
    assert twin.outputs["power"] == 1
    assert twin.query(OUT) == "4"
    home(twin)
    assert twin.query(OUT) == "0"


def test_a_brown_out_leaves_what_people_have_set() -> None:
    twin = home(build("kinematic"))
    twin.set_input("estop", "pressed")
    happen(twin, brownout=True)
    happen(twin, brownout=True)
    twin.run(0.1)
    happen(twin, brownout=False)
    happen(twin, brownout=False)
    assert twin.inputs["estop"] == "pressed"
    assert twin.outputs["power"] == 0


def test_flash_outlives_reset_and_brown_out() -> None:
    """The baud rate kept in the flash is that of the next start (4.2.15)."""
    twin = build("kinematic")
    twin.query("@07")
    image = twin.flash
    happen(twin, reset=True)
    happen(twin, brownout=True)
    happen(twin, brownout=False)
    assert twin.flash == image
    assert twin.query("@07") == "0"


@pytest.mark.parametrize("controller", ["ismif"])
def test_other_controllers_start_anew_as_well(controller: str) -> None:
    twin = build("kinematic", controller=controller)
    for data in twin.language.reference():  # type: ignore[union-attr]
        twin.write(data)
        assert twin.run_until_idle()
    twin.run(0.1)
    happen(twin, brownout=True, **{"for": 0.1})
    twin.run(0.2)
    assert twin.counts.tolist() == [0] * len(twin.counts)
    for data in twin.language.reference():  # type: ignore[union-attr]
        twin.write(data)
        assert twin.run_until_idle()


def test_a_controller_that_was_handed_in_cannot_start_anew() -> None:
    twin = build("kinematic", controller=create_controller("imc-s8"))
    happen(twin, reset=True)
    assert "there is no other" in twin.remarks[-1][1]
    happen(twin, brownout=True)
    assert twin.outputs["power"] == 0, "the cabinet has no mains all the same"
    twin.write(b"@07\r")
    twin.run_until_idle()
    assert twin.read() == b"9"


# ---- one name everywhere ---------------------------------------------------------------------------------------------

ONE_OF_EACH: Mapping[str, Any] = {
    "set": {"limit_x2": "broken"},
    "swapped": {"limit_x1": "limit_y1"},
    "force_n": {"x": 20.0},
    "phase_lost": {"x": "a"},
    "cut": {
        "diameter": 6.0, "flutes": 2, "depth": 0.5, "width": 3.0, "spindle": 18000,
        "kc": {"value": 800, "unit": "N/mm2", "grade": "estimate", "source": "aluminium"},
    },
    "friction_n": {"y": 10.0},
    "obstacle_mm": {"x": 200.0},
    "payload_kg": {"tool": 1.0},
    "undervoltage": 0.2,
    "hot_stage_k": {"z": 5.0},
    "noise": 0.1,
    "dropped": 0.1,
    "doubled": 0.1,
    "line_cut": True,
    "reset": True,
    "brownout": True,
}  # fmt: skip


class Server:
    """What an operator needs of a server."""

    def __init__(self, twin: Twin) -> None:
        self.pacer: Any = None

    def present(self) -> None:
        """The twin is where it is."""

    def act(self, text: str) -> None:
        """Nobody writes it down."""


def test_there_is_one_of_each() -> None:
    """Keys are those of the controller, see test_keys.py."""
    assert set(ONE_OF_EACH) == set(ACTS) - {"key"}


@pytest.mark.parametrize("key", ONE_OF_EACH)
def test_set_and_cleared_by_one_key_at_the_control_port(key: str) -> None:
    twin = build()
    operator = Operator(Server(twin), twin)  # type: ignore[arg-type]
    act, value = ACTS[key], ONE_OF_EACH[key]
    operator.ask({key: value})
    names = [f"{key}.{name}" for name in value] if act.by and key != "set" else [key]
    if key == "set":
        names = list(value)
    assert list(twin.faults) == (names if act.fault else [])
    if key == "reset":
        return
    off = {"limit_x2": "ok"} if key == "set" else dict.fromkeys(value, act.off) if act.by else act.off
    operator.ask({key: off})
    assert dict(twin.faults) == {}
    operator.ask({key: value, "for": 0.01})
    twin.run(0.02)
    assert dict(twin.faults) == {}


@pytest.mark.parametrize("key", [key for key, act in ACTS.items() if act.physical])
def test_what_needs_physics_is_refused_at_the_control_port_without(key: str) -> None:
    twin = build("kinematic")
    operator = Operator(Server(twin), twin)  # type: ignore[arg-type]
    with pytest.raises(ControlError, match=rf"^request: {key}: does nothing without physics"):
        operator.ask({key: ONE_OF_EACH[key]})
    assert dict(twin.faults) == {}


@pytest.mark.parametrize("key", ONE_OF_EACH)
def test_the_content_of_an_event_makes_it_again(key: str) -> None:
    settable = build("kinematic").settable
    content = {key: ONE_OF_EACH[key]} | ({} if key == "reset" else {"for": 0.5})
    event = event_now(content, Place("test", ScenarioError), settable)
    assert event.content == content
    assert event_now(dict(event.content), Place("test", ScenarioError), settable) == event


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"friction_n": {"x": -1}}, "friction_n.x: -1; allowed: 0 .. 100000 N"),
        ({"friction_n": {"a": 1}}, "friction_n.a: unknown key; allowed: x, y, z"),
        ({"obstacle_mm": {"x": "of"}}, "obstacle_mm.x: 'of'; allowed: off"),
        ({"payload_kg": {"hood": 1}}, "payload_kg.hood: unknown key; did you mean 'tool'?"),
        ({"undervoltage": 1}, "undervoltage: 1; allowed: 0 .. 0.95"),
        ({"line_cut": 1}, "line_cut: 1; allowed: true, false"),
        ({"reset": False}, "reset: False; allowed: true"),
        ({"swapped": {"limit_x1": "limit_x1"}}, "swapped.limit_x1: 'limit_x1'; did you mean 'limit_"),
        ({"swapped": {"hood": "limit_x1"}}, "swapped.hood: unknown contact"),
        ({"reset": True, "for": 1}, "for: nothing of it lasts"),
        ({"noise": 0.1, "for": -1}, "for: -1; allowed: 0 .. 1e+09 s"),
        ({"dropt": 0.1}, "dropt: unknown key; did you mean 'dropped'?"),
    ],
)
def test_a_refused_event_changes_nothing(content: Mapping[str, Any], said: str) -> None:
    twin = build("kinematic")
    with pytest.raises(ScenarioError) as error:
        happen(twin, **content if "reset" in content else {"set": {"estop": "pressed"}, **content})
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert dict(twin.faults) == {}
    assert twin.inputs["estop"] == "released"
