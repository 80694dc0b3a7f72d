"""Events that wait for something, in a whole twin: when exactly, and the same however time is cut."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin import Twin
from isel_twin.controller import Output, create_controller
from isel_twin.wiring import ScenarioError
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=4)

START_MM = (30.0, 30.0, 30.0)
OUT = "@0A8000,8000,0,30,0,30,0,30"  # 25 mm at 25 mm/s
BACK = "@0A-8000,8000,0,30,0,30,0,30"
PLANTS = ("kinematic", "mujoco")


def twin_with(folder: Path | str, events: str, plant: str = "kinematic", **options: Any) -> Twin:
    file = Path(folder) / "scenario.toml"
    file.write_text(events, encoding="utf-8")
    return Twin(plant=plant, scenario=file, **{"start_mm": START_MM} | options)


def home(twin: Twin) -> Twin:
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    return twin


class Pressed:
    """Notes when the E-stop goes down, and where X is."""

    def __init__(self, twin: Twin) -> None:
        self.seen: list[tuple[int, float]] = []
        self._before = "released"
        twin.observe(self, 10**12)

    def __call__(self, twin: Twin) -> None:
        now = twin.inputs["estop"]
        if now == "pressed" != self._before:
            self.seen.append((twin.time_ns, float(twin.machine_position_mm[0])))
        self._before = now


PRESS = 'set = { estop = "pressed" }\n'


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(("sense", "limit"), [(">", 12.3), ("<", 12.3)])
def test_a_position_is_met_to_the_substep(tmp_path: Path, plant: str, sense: str, limit: float) -> None:
    """Within the way of a sub-step, 20 us at 25 mm/s: 0.5 um; or of a step of the kinematic plant, 3.125 um."""
    start_mm = (5.0, 30.0, 30.0) if sense == ">" else (30.0, 30.0, 30.0)
    twin = twin_with(tmp_path, f'[[event]]\nwhen = "x {sense} {limit} mm"\n{PRESS}', plant, start_mm=start_mm)
    pressed = Pressed(twin)
    assert twin.query("@07") == "0"
    if sense == ">":
        assert twin.query("@0R1") == "0"
        assert twin.query(OUT) == "9"
    else:
        assert twin.query("@0R1") == "9"
    assert len(pressed.seen) == 1
    beyond = pressed.seen[0][1] - limit
    assert -1e-3 < (beyond if sense == ">" else -beyond) < 4e-3, "the frame between carriage and gauge gives by 0.2 um"


@pytest.mark.parametrize("plant", PLANTS)
def test_a_position_left_and_passed_again_is_met_again(tmp_path: Path, plant: str) -> None:
    """At power-on X stands beyond it, which does not count; of three times out two are asked for."""
    events = '[[event]]\nwhen = "x > 12 mm"\ntimes = 2\nset = { user_1 = "high" }\nfor = 0.01\n'
    twin = home(twin_with(tmp_path, events, plant))
    high: list[int] = []
    twin.observe(lambda twin: high.append(twin.time_ns) if twin.inputs["user_1"] == "high" else None, 10**6)
    for command in (OUT, BACK, OUT, BACK, OUT):
        assert twin.query(command) == "0"
    assert 1 + int((np.diff(high) > 10**8).sum()) == 2


@pytest.mark.parametrize("timed", [False, True])
def test_a_message_of_the_host(tmp_path: Path, timed: bool) -> None:
    twin = home(twin_with(tmp_path, f'[[event]]\nwhen = "sent @0A"\n{PRESS}', line_speed=timed))
    pressed = Pressed(twin)
    assert twin.query("@0P")[0] == "0"
    assert pressed.seen == []
    began = twin.time_ns
    assert twin.query(OUT) == "9"
    arrives = began + len(OUT + "\r") * twin.serial_format.byte_ns * timed
    assert [t for t, _ in pressed.seen] == [arrives]


def test_a_message_of_the_controller(tmp_path: Path) -> None:
    """The reply 0 to @07 is the first."""
    twin = twin_with(tmp_path, f'[[event]]\nwhen = "replied 0"\ndelay = 0.25\n{PRESS}')
    pressed = Pressed(twin)
    twin.run(1.0)
    assert twin.query("@07") == "0"
    answered = twin.time_ns
    twin.run(1.0)
    assert [t for t, _ in pressed.seen] == [answered + 250_000_000]


def test_the_line_is_cut_as_the_reply_goes_out(tmp_path: Path) -> None:
    twin = twin_with(tmp_path, '[[event]]\nwhen = "replied 0"\nline_cut = true\nfor = 0.1\n', line_speed=True)
    twin.write(b"@07\r")
    twin.run(1.0)
    assert twin.read() == b""
    assert twin.query("@07") == "0"


def test_without_a_language_bytes_are_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("isel_twin.core.assembly.language_factory", lambda name: lambda: None)
    twin = twin_with(tmp_path, f'[[event]]\nwhen = "sent 07<13>"\n{PRESS}')
    twin.write(b"@07")
    assert twin.inputs["estop"] == "released"
    twin.write(b"\r")
    assert twin.inputs["estop"] == "pressed"


def test_an_output(tmp_path: Path) -> None:
    """The first time that it moves is the reference run, the second the move."""
    events = (
        '[[event]]\nwhen = "output moving == 1"\nalways = true\ndelay = 0.2\nset = { user_1 = "high" }\nfor = 0.001\n'
    )
    twin = twin_with(tmp_path, events)
    high: list[int] = []
    twin.observe(lambda twin: high.append(twin.time_ns) if twin.inputs["user_1"] == "high" else None, 10**6)
    home(twin)
    high.clear()
    began = twin.time_ns
    assert twin.query(OUT) == "0"
    assert high[0] == began + 200_000_000


def test_an_output_that_a_controller_adds(tmp_path: Path) -> None:
    text = f'[[event]]\nwhen = "output vacuum == 1"\n{PRESS}'
    with pytest.raises(ScenarioError, match="unknown output 'vacuum'; there are: stages,"):
        twin_with(tmp_path, text)
    controller: Any = create_controller("imc-s8")
    controller.output_names = ("vacuum",)
    twin = twin_with(tmp_path, text, controller=controller)
    controller._events.append(Output("vacuum", 1))
    twin.write(b"@")
    assert twin.inputs["estop"] == "pressed"


def test_an_input_and_what_comes_after(tmp_path: Path) -> None:
    events = f"""
        [[event]]
        name = "trip"
        when = "input hood == open"
        set = {{ user_1 = "high" }}
        [[event]]
        when = "0.5 s after trip"
        delay = 0.25
        {PRESS}
    """
    twin = home(twin_with(tmp_path, events))
    assert twin.events_left == 2
    pressed = Pressed(twin)
    twin.run(0.1)
    twin.set_input("key", "setup")
    twin.set_input("hood", "open")
    opened = twin.time_ns
    assert (twin.inputs["user_1"], twin.events_left) == ("high", 1)
    twin.run(2.0)
    assert [t for t, _ in pressed.seen] == [opened + 750_000_000]
    assert twin.events_left == 0


def test_a_switch_and_a_fault_are_inputs(tmp_path: Path) -> None:
    events = f"""
        [[event]]
        when = "input limit_x1 == struck"
        set = {{ limit_y2 = "broken" }}
        [[event]]
        when = "input limit_y2 == broken"
        {PRESS}
    """
    twin = twin_with(tmp_path, events)
    assert twin.query("@07") == "0"
    assert twin.query("@0R1") != "0"
    assert (twin.inputs["limit_y2"], twin.inputs["estop"]) == ("broken", "pressed")


def test_two_conditions_at_one_instant_happen_in_the_order_of_the_file(tmp_path: Path) -> None:
    """A command comes and the motion begins at one instant, the command first; the file has the last word."""
    moving = '[[event]]\nwhen = "output moving == 1"\nalways = true\nset = { user_1 = "high" }\n'
    told = '[[event]]\nwhen = "sent @0A"\nset = { user_1 = "low" }\n'
    for text, state in ((moving + told, "low"), (told + moving, "high")):
        twin = home(twin_with(tmp_path, text))
        twin.write(OUT.encode() + b"\r")
        assert twin.outputs["moving"] == 1
        assert twin.inputs["user_1"] == state


def test_repeats_with_clearing(tmp_path: Path) -> None:
    """Four times noise for 0.1 s, every 0.5 s."""
    twin = twin_with(tmp_path, "[[event]]\nat = 1\nrepeat = 4\nevery = 0.5\nnoise = 0.5\nfor = 0.1\n")
    assert twin.events_left == 4
    on = []
    for tick in range(400):
        twin.run_until(tick * 10_000_000)
        if twin.faults:
            on.append(tick)
    assert on == [start + k for start in (100, 150, 200, 250) for k in range(10)]
    assert twin.events_left == 0


def test_without_a_gap_a_repeat_goes_on_without_a_break(tmp_path: Path) -> None:
    twin = twin_with(tmp_path, "[[event]]\nat = 1\nrepeat = 2\nevery = 0.5\nnoise = 0.5\nfor = 0.5\n")
    twin.run(1.5)
    assert twin.faults == {"noise": 0.5}
    twin.run(0.5)
    assert twin.faults == {}


def test_what_never_comes_is_left(tmp_path: Path) -> None:
    twin = home(twin_with(tmp_path, f'[[event]]\nwhen = "x > 390 mm"\n{PRESS}'))
    assert twin.query(OUT) == "0"
    assert twin.events_left == 1


STORY = """
[[event]]
name = "far"
when = "x > 9 mm"
always = true
friction_n = { x = 60 }
for = 0.05
[[event]]
when = "0.03 s after far"
times = 2
payload_kg = { table = 5 }
for = 0.2
[[event]]
when = "x < 20.123 mm"
times = 3
set = { limit_y2 = "bounce" }
[[event]]
when = "output moving == 0"
times = 3
delay = 0.0123
swapped = { limit_x2 = "limit_y2" }
for = 0.3
[[event]]
when = "sent @0A"
times = 4
undervoltage = 0.2
for = 0.1
[[event]]
when = "replied 0"
always = true
obstacle_mm = { y = 200 }
[[event]]
when = "replied 0"
times = 5
delay = 0.0006
line_cut = true
for = 0.0011
[[event]]
at = 12
every = 0.25
repeat = 30
dropped = 0.02
doubled = 0.02
noise = 0.01
for = 0.1
[[event]]
at = 21.7000001
brownout = true
for = 0.2
[[event]]
when = "input estop == pressed"
hot_stage_k = { z = 70 }
"""
IMC = (
    (0.1, b"@07\r"), (0.5, b"@0R7\r"), (14.0, OUT.encode() + b"\r"), (16.3, BACK.encode() + b"\r"),
    (18.1, OUT.encode() + b"\r"), (21.0, BACK.encode() + b"\r"), (23.0, b"@07\r"),
)  # fmt: skip
ISMIF = (
    (0.1, b"$HZXY\x01"), (14.0, b"#S300\r#E0,4000\r#R37\r"), (14.2, b"L0,X4000,Y0,Z0\x01"),
    (16.3, b"L0,X0,Y0,Z0\x01"), (18.1, b"L0,X4000,Y0,Z0\x01"), (21.0, b"L0,X0,Y0,Z0\x01"), (23.0, b"$HZXY\x01"),
)  # fmt: skip
TOLD = {
    "imc-s8": (IMC, STORY),
    "ismif": (ISMIF, STORY.replace("sent @0A", "sent L0").replace("replied 0", "replied <2>")),
}
END_S = 24.0


def played(controller: str, plant: str, timed: bool, cuts: Sequence[float]) -> tuple[Any, ...]:
    """What is to be seen at the end and on the way, with time cut there too."""
    with tempfile.TemporaryDirectory() as folder:
        sent, story = TOLD[controller]
        twin = twin_with(folder, story, plant, line_speed=timed, seed=3, controller=controller)
        heard = []
        written = dict(sent)
        for at_s in sorted({*written, *cuts, 11.0, END_S}):
            twin.run_until(round(at_s * 1e9))
            heard += [twin.read()] if at_s in written or at_s == END_S else []
            if at_s == 11.0:
                twin.set_input("user_2", "high")
            if at_s in written:
                twin.write(written[at_s])
        steps = twin.steps
        return (
            b"|".join(heard), twin.machine_position_mm.tobytes(), twin.lost_steps.tobytes(), tuple(twin.counts),
            dict(twin.inputs), dict(twin.outputs), dict(twin.faults), twin.events_left, steps.t_ns.tobytes(),
        )  # fmt: skip


@pytest.mark.parametrize(
    ("controller", "plant", "timed", "examples"),
    [
        ("imc-s8", "kinematic", True, 25),
        ("imc-s8", "mujoco", True, 5),
        ("imc-s8", "mujoco", False, 3),
        ("ismif", "kinematic", True, 10),
        ("ismif", "mujoco", True, 3),
    ],
)
def test_the_same_bits_however_time_is_cut(controller: str, plant: str, timed: bool, examples: int) -> None:
    whole = played(controller, plant, timed, ())
    assert whole[7] <= 2, "nearly all of it happens"

    @settings(max_examples=drawn(examples), deadline=None, derandomize=True)
    @given(st.lists(st.floats(0.0, END_S), max_size=60))
    def cut(cuts: list[float]) -> None:
        assert played(controller, plant, timed, cuts) == whole

    cut()
