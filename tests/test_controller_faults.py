"""The fault of each controller: it stands until what it wants has been done, and names its cause.

For the iMC by its manual, section 5 (`2`: initialisation and a reference run, imc/47; `9`: plant fault) and
docs/safety.md; of a host that takes no notice of replies the verdict is the same as of one that does.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.bridge.operate.conditions import conditions, program
from isel_twin.bridge.operate.control import Operator
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from tests.in_process import isel_twin

START_MM = (30.0, 30.0, 30.0)
MOVE = "@0A8000,4000,0,30,0,30,0,30"  # 25 mm in two seconds
FAR = "@0A16000,4000,0,30,0,30,0,30"
STEPPER = ("imc-s8", "c142", "it116")


def imc(controller: str = "imc-s8", **options: Any) -> Twin:
    """Initialised, with its reference where it stands."""
    twin = Twin(controller=controller, plant="kinematic", start_mm=START_MM, **options)
    assert twin.query("@07") == "0"
    assert twin.query("@0N7") == "0"
    assert (twin.fault, twin.fault_cause) == (False, "")
    return twin


def moving(twin: Twin) -> Twin:
    twin.write(MOVE.encode() + b"\r")
    twin.run(0.5)
    return twin


# ---- the iMC ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("controller", STEPPER)
@pytest.mark.parametrize(
    ("element", "state", "cause"),
    [
        ("estop", "pressed", "emergency stop"),
        ("estop_2", "broken", "emergency stop"),
        ("overtemperature", "hot", "a power stage is too hot"),
        ("hood", "forced", "the stages have lost their power"),
        ("hood_automatic", "broken", "hood open in automatic"),
        ("power", "off", "the stages have lost their power"),
        ("limit_x2", "broken", "limit_x2 struck"),
        ("limit_y1", "stuck_open", "limit_y1 struck"),
    ],
)
def test_what_ends_a_motion_is_a_fault(controller: str, element: str, state: str, cause: str) -> None:
    twin = moving(imc(controller))
    twin.set_input(element, state)
    twin.run_until_idle()
    assert (twin.fault, twin.fault_cause) == (True, cause)


def test_an_emergency_stop_at_rest_is_a_fault_until_the_axes_are_initialised() -> None:
    twin = imc()
    twin.set_input("estop", "pressed")
    assert twin.fault_cause == "emergency stop"
    assert twin.query("@07") == "9"
    twin.set_input("estop", "released")
    assert twin.fault_cause == "emergency stop", "the stages are off, and positions are lost"
    assert twin.query("@07") == "0"
    assert not twin.fault
    assert twin.query(MOVE) == "R", "a move still needs a reference"
    assert twin.fault_cause == f"{MOVE} not made: R: not referenced"
    assert twin.query("@0N7") == "0"
    assert not twin.fault


def test_an_emergency_stop_at_power_on_is_a_fault_a_relay_that_is_still_open_is_none() -> None:
    twin = Twin(plant="kinematic")
    assert not twin.fault
    twin.set_input("power", "off")
    twin.write(b"\xfe")
    assert not twin.fault, "as a machine whose key nobody has turned"
    twin.set_input("estop", "pressed")
    assert twin.fault_cause == "emergency stop"


def test_a_limit_switch_is_a_fault_until_the_axes_are_initialised() -> None:
    twin = moving(imc())
    twin.set_input("limit_x2", "broken")
    twin.run_until_idle()
    assert twin.read() == b"2"
    twin.set_input("limit_x2", "ok")
    assert twin.fault_cause == "limit_x2 struck"
    assert twin.query(MOVE) == "2"
    assert twin.query("@0N7") == "2", "a reference run alone is not enough (imc/47)"
    assert twin.fault
    assert twin.query("@07") == "0"
    assert not twin.fault


def test_a_reference_run_that_fails_is_a_fault() -> None:
    twin = imc()
    twin.set_input("limit_x1", "broken")
    assert twin.query("@0R1") == "2"
    assert twin.fault_cause.startswith("reference run of X: limit_x1 is still struck")


def test_a_hood_that_refuses_a_move_is_a_fault_until_the_move_is_made() -> None:
    twin = imc()
    twin.set_input("hood", "open")
    assert not twin.fault, "at rest it may be open"
    assert twin.query(MOVE) == "H"
    assert twin.fault_cause == f"{MOVE} not made: H: hood open in automatic"
    twin.set_input("hood", "closed")
    assert twin.query(FAR) == "0"
    assert twin.fault, "another one does not make it good"
    assert twin.query(MOVE) == "0"
    assert not twin.fault


def test_the_stop_key_leaves_a_move_unmade_until_it_goes_on() -> None:
    twin = moving(imc())
    twin.set_input("stop", "down")
    twin.run_until_idle()
    twin.set_input("stop", "up")
    assert twin.read() == b"F"
    assert twin.fault_cause == f"{MOVE} not made: F: stopped or broken off"
    assert twin.query("@0S") == "0"
    assert not twin.fault


@pytest.mark.parametrize("byte", [253, 255])
def test_a_stop_by_the_host_is_its_own_will(byte: int) -> None:
    twin = moving(imc())
    twin.write(bytes([byte]))
    twin.run_until_idle()
    assert twin.read() == b"F"
    assert not twin.fault


def test_what_the_host_has_done_wrong_is_no_fault_of_the_machine() -> None:
    twin = imc()
    assert twin.query("@0A1,2") == "7"
    assert twin.query("@0A8000,300000,0,30,0,30,0,30") == "D"
    assert not twin.fault


# ---- the others ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("controller", "cause"), [("gmi99", "E-stop"), ("bwo900", "M3001: emergency stop")], ids=["gmi99", "bwo900"]
)
def test_an_emergency_stop_stands_whatever_has_cleared_its_message(controller: str, cause: str) -> None:
    twin = Twin("4030-servo", controller, "kinematic", start_mm=(3.0, 3.0, 3.0))
    job = {"gmi99": "Q7;1\nf2000\n", "bwo900": "N10 G1 F300 G91 X1\nN20 M30\n"}[controller]
    assert played(twin, parse_job(job, twin.language, controller)).ok
    twin.set_input("estop", "pressed")
    assert twin.fault_cause == cause
    if controller == "gmi99":
        twin.query("#0")
    else:
        twin.carry_out(_key(twin, mode="hand"))
    twin.run(0.1)
    assert twin.fault


def _key(twin: Twin, **keys: str) -> Any:
    from isel_twin.base.parameters import Place
    from isel_twin.wiring import ScenarioError, event_now

    return event_now({"key": keys}, Place("test", ScenarioError), twin.settable, twin.keys)


def test_an_error_of_the_ismif_names_what_it_could_not_read() -> None:
    twin = Twin(controller="ismif", plant="kinematic")
    twin.query("xyz")
    assert twin.fault
    assert twin.fault_cause
    twin.query("@R")
    assert (twin.fault, twin.fault_cause) == (False, "")


def test_without_mains_nothing_is_well() -> None:
    twin = imc(scenario=None)
    twin.carry_out(_off(twin))
    assert twin.fault_cause == "the mains is off"


def _off(twin: Twin) -> Any:
    from isel_twin.base.parameters import Place
    from isel_twin.wiring import ScenarioError, event_now

    return event_now({"brownout": True}, Place("test", ScenarioError), twin.settable)


# ---- who reads it ----------------------------------------------------------------------------------------------------


def test_a_job_that_expects_the_refusal_expects_its_fault_and_no_later_one() -> None:
    def verdict(job: str) -> tuple[bool, str]:
        twin = imc()
        twin.set_input("estop", "pressed")
        made = played(twin, parse_job(job, twin.language, "imc-s8"))
        return made.ok, made.verdict.fault_left

    assert verdict(f"{MOVE} => 9\n") == (True, "")
    assert verdict("@0P\n! fault == 1\n") == (True, "")
    assert verdict("@0P\n") == (False, "emergency stop")


def test_a_fault_that_was_expected_and_mended_does_not_answer_for_the_next(tmp_path: Path) -> None:
    scenario = tmp_path / "twice.toml"
    scenario.write_text(
        '[[event]]\nwhen = "replied F"\nset.estop = "pressed"\nfor = 1\n'
        '[[event]]\nwhen = "sent @0P"\nset.estop = "pressed"\n'
    )
    job = f"@07\n@0N7\n{MOVE}<13> <0.3s> <253> => F\n<0.2s>\n{MOVE} => 9\n<2s>\n@07\n@0P => *\n<0.5s>\n"
    twin = Twin(plant="kinematic", start_mm=START_MM, scenario=scenario)
    verdict = played(twin, parse_job(job, twin.language, "imc-s8")).verdict
    assert (verdict.ok, verdict.fault_left) == (False, "emergency stop")


HOST = """
import time, serial
port = serial.Serial("COM1", 19200, timeout=5)
for line in ("@07", "@0N7", "{move}"):
    port.write(line.encode() + b"\\r")
    port.read(1)
time.sleep(5)
"""


@pytest.mark.parametrize(
    ("event", "said"),
    [
        ('when = "x > 100 mm"\nset.estop = "pressed"', "all well"),
        ('at = 1\nset.estop = "pressed"', "fault left in the controller: emergency stop"),
        ('at = 1\nset.limit_x2 = "broken"', "fault left in the controller: limit_x2 struck"),
        ('at = 1\nset.stop = "down"', f"fault left in the controller: {MOVE} not made: F"),
        ('at = 0\nset.hood = "open"', f"fault left in the controller: {MOVE} not made: H"),
    ],
)
def test_a_host_that_ignores_replies_is_told_by_the_verdict(event: str, said: str, tmp_path: Path) -> None:
    host, scenario = tmp_path / "host.py", tmp_path / "events.toml"
    host.write_text(HOST.format(move=MOVE))
    scenario.write_text(f"[[event]]\n{event}\n")
    at = [word for axis in "xyz" for end in ("low", "high") for word in ("--set", f"axes.{axis}.power_on_{end}=30")]
    done = isel_twin(
        "exec", "--check", *at, "--plant", "kinematic", "--scenario", scenario, "--", "python", host
    )  # fmt: skip
    assert said in done.stderr
    assert done.returncode == (0 if said == "all well" else 1)


def test_a_host_that_leaves_while_the_machine_moves_is_told_so(tmp_path: Path) -> None:
    host = tmp_path / "host.py"
    host.write_text(HOST.format(move=MOVE).replace("time.sleep(5)", "").replace("timeout=5", "timeout=0.5"))
    done = isel_twin("exec", "--check", "--plant", "kinematic", "--", "python", host)
    assert "the controller is still busy" in done.stderr
    assert done.returncode == 1


def test_those_who_operate_see_it() -> None:
    twin = imc()
    operator = Operator(Server(twin, Pacer(None), ()), twin)
    assert (operator.state()["fault"], conditions(operator.state())["controller"]) == (False, "")
    twin.set_input("estop", "pressed")
    state = operator.state()
    assert (state["fault"], state["fault_cause"]) == (True, "emergency stop")
    assert (conditions(state)["controller"], program(state)) == ("emergency stop", "Aborted")
