"""Keys of a control's own panel: pressed by Twin, scenario and control port alike, recorded, replayed, saved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from isel_twin.bridge.operate.control import ControlError
from isel_twin.cli.ctl import _request
from isel_twin.core.twin import Twin
from isel_twin.recordings.reading import read
from isel_twin.recordings.recording import FileRecording
from isel_twin.recordings.replay import rebuilt, replay
from isel_twin.wiring import ScenarioError
from tests.bridge.test_control import Bench

PROGRAM = b"\r\nP3\r\nN10 G1 F1200 X60 Y20\r\n/N20 G0 X0\r\nN30 M30\r\n#\r\n\x04\r\n"
REFERENCED_S = 35.0
"""By then all axes are referenced, wherever they stood."""
START_MM = (20.0, 30.0, 10.0)


def new_twin(**wanted: Any) -> Twin:
    return Twin("4030-servo", "bwo900", plant="kinematic", start_mm=START_MM, **wanted)


def operate(twin: Twin) -> None:
    """A program is loaded by the host, and started by hand at half its feed; stopped on its way, and on again."""
    twin.press("reference", "all")
    twin.run_until_idle()
    twin.write(PROGRAM)
    for name, value in (("program", 3), ("skip", True), ("override", 50.0), ("mode", "auto")):
        twin.press(name, value)
    twin.press("start")
    twin.run(2.0)
    twin.press("stop")
    twin.run_until_idle()
    assert 0 < twin.counts[0] < 60_000
    twin.press("start")
    twin.run_until_idle()


def test_a_program_is_chosen_started_stopped_and_ends_where_it_says() -> None:
    twin = new_twin()
    operate(twin)
    assert twin.counts.tolist() == [60_000, 20_000, 0]
    assert twin.key_values == {
        "mode": "auto", "override": 50.0, "skip": True, "program": 3, "block": 0,
        "axis": "x", "step": 0.0, "move": "off",
    }  # fmt: skip
    assert not twin.remarks


def test_the_override_is_a_part_of_the_feed() -> None:
    """N10 is sqrt(60^2 + 20^2) = 63.25 mm at 1200 mm/min: 3.16 s, and at half the override twice as long."""
    times = []
    for override in (100.0, 50.0):
        twin = new_twin()
        twin.press("reference", "all")
        twin.run_until_idle()
        twin.write(PROGRAM)
        for name, value in (("program", 3), ("skip", True), ("override", override), ("mode", "auto")):
            twin.press(name, value)
        began_ns = twin.time_ns
        twin.press("start")
        twin.run_until_idle()
        times.append((twin.time_ns - began_ns) / 1e9)
    assert times == pytest.approx([3.16, 6.32], abs=0.25)


def test_a_scenario_presses_the_same_keys(tmp_path: Path) -> None:
    file = tmp_path / "keys.toml"
    file.write_text(
        f"""
[[event]]
at = 1.0
key = {{ reference = "all" }}
[[event]]
at = {REFERENCED_S}
key = {{ program = 3, skip = true, mode = "auto", start = true }}
[[event]]
when = "x > 50 mm"
key = {{ stop = true }}
"""
    )
    twin = new_twin(scenario=file)
    twin.write(PROGRAM)
    twin.run(REFERENCED_S + 10.0)
    assert twin.outputs["active"] == 1
    assert 20_000 < twin.counts[0] < 60_000
    assert twin.events_left == 0


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({"overide": 50}, "overide: unknown key; did you mean 'override'?"),
        ({"mode": "automatic"}, "mode: 'automatic'; allowed: hand, auto, single, positioning"),
        ({"override": 121}, "override: 121; allowed: 0 .. 120 %"),
        ({"start": False}, "start: False; allowed: true"),
        ({"program": "P3"}, "program: 'P3'"),
    ],
)
def test_a_wrong_key_is_one_line_with_what_is_allowed(content: dict[str, Any], why: str) -> None:
    bench = Bench(machine="4030-servo", controller="bwo900")
    with pytest.raises(ControlError, match=r".*") as caught:
        bench.ask(key=content)
    assert why in str(caught.value)
    assert "\n" not in str(caught.value)
    assert bench.twin.key_values["mode"] == "hand"


def test_a_controller_without_keys_says_so() -> None:
    twin = Twin(plant="kinematic")
    assert twin.keys == {}
    assert twin.key_values == {}
    with pytest.raises(ScenarioError, match="the controller has no keys"):
        twin.press("start")


def test_the_control_port_presses_and_tells() -> None:
    bench = Bench(machine="4030-servo", controller="bwo900")
    answer = bench.ask(key={"mode": "single", "override": 80})
    assert (answer["keys"]["mode"], answer["keys"]["override"], answer["inputs"]) == ("single", 80.0, {})
    assert "keys" not in bench.ask(set={"hood": "open"})
    assert bench.ask(state=True)["keys"]["mode"] == "single"
    assert bench.ask(state=True)["keys"]["override"] == 80.0
    assert bench.ask(keys=True)["mode"] == "what the control does: hand, auto, single, positioning"


def test_the_state_tells_where_a_program_waits() -> None:
    bench = Bench(machine="4030-servo", controller="bwo900")
    assert bench.ask(state=True)["unfinished"] == ""
    bench.ask(key={"reference": "all"})
    bench.twin.run_until_idle()
    bench.twin.write(PROGRAM)
    bench.twin.run_until_idle()
    bench.ask(key={"program": 3, "mode": "single", "start": True})
    bench.twin.run_until_idle()
    assert bench.ask(state=True)["unfinished"] == "P3 N10 waits for Start"


def test_ctl_says_keys_as_it_says_inputs() -> None:
    assert _request("key", ["start", "mode=auto", "override=80"], None) == {
        "key": {"start": True, "mode": "auto", "override": 80}
    }
    assert _request("keys", [], None) == {"keys": True}


def test_a_recorded_session_is_the_same_to_the_bit(tmp_path: Path) -> None:
    file = tmp_path / "keys.mcap"
    twin = new_twin()
    recording = FileRecording(file, twin, 10_000_000)
    operate(twin)
    recording.close()
    recorded = read(file)
    assert [entry.content["key"] for entry in recorded.of("/operator") if "key" in entry.content][:2] == [
        {"reference": "all"},
        {"program": 3},
    ]
    assert replay(recorded, rebuilt(recorded, tmp_path)) is None


def test_a_twin_saved_between_two_keys_goes_on_alike() -> None:
    twin, other = new_twin(), new_twin()
    twin.press("reference", "all")
    twin.run_until_idle()
    twin.write(PROGRAM)
    for name, value in (("program", 3), ("mode", "auto"), ("override", 50.0)):
        twin.press(name, value)
    twin.press("start")
    twin.run(1.0)
    other.restore(twin.save())
    for one in (twin, other):
        one.press("override", 100.0)
        one.run(1.0)
    assert other.counts.tolist() == twin.counts.tolist()
    assert other.key_values == twin.key_values


def test_without_supply_no_key_is_heard() -> None:
    bench = Bench(machine="4030-servo", controller="bwo900")
    bench.ask(brownout=True)
    bench.ask(key={"mode": "auto"})
    bench.ask(brownout=False)
    assert bench.ask(state=True)["keys"]["mode"] == "hand"


def test_the_potentiometer_of_a_card_is_a_key_too() -> None:
    """20 mm at 20000 Hz take 1 s, and at half of it 2 s: once `o1` has switched the potentiometer on."""
    times = []
    for percent in (100, 50):
        twin = Twin("4030-servo", "gmi99", plant="kinematic", start_mm=START_MM)
        for text in ("Q7;1", "M40000", "B1000", "f20000", "o1"):
            assert twin.query(text) == "E5"
        twin.press("override", percent)
        assert twin.key_values == {"override": percent}
        began_ns = twin.time_ns
        twin.query("81h 20000")
        times.append((twin.time_ns - began_ns) / 1e9)
    assert times == pytest.approx([1.0, 2.0], abs=0.06)


def test_an_axis_moves_in_hand_as_long_as_its_key_is_held_or_by_a_step() -> None:
    """1000 mm/min where nobody has said otherwise: 16.7 mm in a second, less the ramps; then 2.5 mm back."""
    twin = new_twin()
    twin.press("reference", "all")
    twin.run_until_idle()
    twin.press("axis", "y")
    twin.press("move", "+")
    twin.run(1.0)
    twin.press("move", "off")
    twin.run_until_idle()
    y = int(twin.counts[1])
    assert 16_000 < y < 17_500
    assert twin.counts[0] == twin.counts[2] == 0
    twin.press("step", 2.5)
    twin.press("move", "-")
    twin.press("move", "off")
    twin.run_until_idle()
    assert twin.counts[1] == y - 2500
