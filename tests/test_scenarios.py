"""What the commissioning engineer does to the machine, at given times, and what the host then sees."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.base.units import SECOND_NS
from isel_twin.plant import Cut
from isel_twin.wiring import ScenarioError, ScenarioEvent

MOVE = "@0A32000,5000,0,30,0,30,0,30"  # 100 mm, 6.4 s
START_MM = (30.0, 30.0, 30.0)


def twin_with(folder: Path, events: str, plant: str = "kinematic", **options: object) -> Twin:
    file = folder / "scenario.toml"
    file.write_text(events, encoding="utf-8")
    return Twin(plant=plant, scenario=file, start_mm=START_MM, **options)  # type: ignore[arg-type]


def home(twin: Twin) -> Twin:
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    assert twin.time_ns < 20e9, "the events below come after the reference run"
    return twin


@pytest.mark.parametrize(
    ("event", "reply"),
    [
        ('set = { hood = "open" }', "9"),
        ('set = { estop = "pressed" }', "9"),
        ('set = { overtemperature = "hot" }', "9"),
        ('set = { power = "off" }', "9"),
        ('set = { estop_2 = "broken" }', "9"),
        ('set = { limit_x2 = "broken" }', "2"),
        ('set = { stop = "down" }', "F"),
        ('set = { stop = "broken" }', "F"),
        ('set = { hood = "closed" }', "0"),
        ('set = { limit_x2 = "stuck_closed" }', "0"),
    ],
)
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_event_in_a_motion(tmp_path: Path, plant: str, event: str, reply: str) -> None:
    twin = home(twin_with(tmp_path, f"[[event]]\nat = 22.0\n{event}", plant))
    twin.run(20.0 - twin.time_ns / 1e9)
    assert twin.query(MOVE) == reply
    stopped = twin.steps.t_ns[-1]
    if reply == "0":
        assert twin.counts[0] == 32000
    elif reply == "F":
        assert 22.0e9 < stopped < 22.1e9, "a stop ramp"
    else:
        assert 21.99e9 < stopped <= 22.0e9, "no pulse after the event"


@pytest.mark.parametrize("order", ['{ hood = "open", key = "setup" }', '{ key = "setup", hood = "open" }'])
def test_what_changes_in_one_event_changes_together(tmp_path: Path, order: str) -> None:
    """The hood is never seen open in automatic, nor is it on the way back, however the table is written."""
    back = order.replace("open", "closed").replace("setup", "automatic")
    events = f"[[event]]\nat = 21.0\nset = {order}\n[[event]]\nat = 23.0\nset = {back}"
    twin = home(twin_with(tmp_path, events))
    twin.run(20.0 - twin.time_ns / 1e9)
    assert twin.query(MOVE) == "0"
    assert twin.inputs["key"] == "automatic"


def test_two_events_at_one_instant_happen_one_after_the_other(tmp_path: Path) -> None:
    events = '[[event]]\nat = 21.0\nset = { hood = "open" }\n[[event]]\nat = 21.0\nset = { key = "setup" }'
    twin = home(twin_with(tmp_path, events))
    twin.run(20.0 - twin.time_ns / 1e9)
    assert twin.query(MOVE) == "9"


def test_a_locked_hood_stays_closed_and_the_motion_goes_on(tmp_path: Path) -> None:
    twin = home(twin_with(tmp_path, '[[event]]\nat = 22.0\nset = { hood = "open" }'))
    assert twin.query("@0B1,0") == "0"
    twin.run(20.0 - twin.time_ns / 1e9)
    assert twin.query(MOVE) == "0"
    assert twin.inputs["hood"] == "closed"


def test_a_hand_on_the_carriage_bends_the_axis_but_loses_no_step(tmp_path: Path) -> None:
    events = "[[event]]\nat = 20.0\nforce_n = { x = 300.0 }\n[[event]]\nat = 22.0\nforce_n = { x = 0.0 }"
    twin = home(twin_with(tmp_path, events, "mujoco"))
    twin.run(19.9 - twin.time_ns / 1e9)
    before = twin.position_mm[0]
    twin.run(1.0)
    assert 0.005 < twin.position_mm[0] - before < 0.2
    twin.run(3.0)
    assert abs(twin.lost_steps[0]) < 4.0


def test_a_push_on_the_tool_bends_the_portal_and_leaves_the_table(tmp_path: Path) -> None:
    """100 N on 5 N/um: 20 um. On the table, which Y moves, the portal stays where it is."""
    for place, expected_mm in (("tool", 0.020), ("table", 0.0)):
        events = f"[[event]]\nat = 1.0\nforce_n = {{ y = 100.0 }}\nplace = '{place}'"
        twin = twin_with(tmp_path, events, "mujoco")
        twin.run(0.9)
        portal = twin._plant.data.joint("nod_y").qpos[0]  # type: ignore[attr-defined]
        twin.run(2.0)
        give_mm = 1e3 * (twin._plant.data.joint("nod_y").qpos[0] - portal)  # type: ignore[attr-defined]
        assert give_mm == pytest.approx(expected_mm, rel=0.02, abs=1e-6)


def test_a_lost_motor_phase_loses_steps_silently(tmp_path: Path) -> None:
    twin = home(twin_with(tmp_path, '[[event]]\nat = 22.0\nphase_lost = { x = "a" }', "mujoco"))
    twin.run(20.0 - twin.time_ns / 1e9)
    assert twin.query(MOVE) == "0"
    twin.run(1.0)
    assert twin.counts[0] == 32000
    assert abs(twin.lost_steps[0]) > 32
    assert np.abs(twin.lost_steps[1:3]).max() < 4.0


def test_noise_on_the_line_is_answered_with_the_manuals_codes_and_is_seeded(tmp_path: Path) -> None:
    def session(seed: int) -> list[bytes]:
        twin = twin_with(tmp_path, "[[event]]\nat = 0.0\nnoise = 0.02", seed=seed)
        replies = []
        for _ in range(200):
            twin.write(b"@0b1\r")
            twin.run(0.01)
            replies.append(twin.read())
        return replies

    first = session(1)
    assert first == session(1)
    assert first != session(2)
    assert len(set(first)) > 1, "some bytes were hit"


def test_a_start_button_in_a_scenario_resumes_a_stopped_motion(tmp_path: Path) -> None:
    events = "".join(
        f"[[event]]\nat = {at}\nset = {{ {key} = '{state}' }}\n"
        for at, key, state in (
            (22.0, "stop", "down"),
            (22.5, "stop", "up"),
            (23.0, "start", "down"),
            (23.2, "start", "up"),
        )
    )
    twin = home(twin_with(tmp_path, events))
    twin.run(20.0 - twin.time_ns / 1e9)
    assert twin.query(MOVE) == "F"
    assert 0 < twin.counts[0] < 32000
    twin.run(10.0)
    assert twin.counts[0] == 32000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"machine": "5050"}, "unknown machine '5050'"),
        (
            {"controller": "imc-s9"},
            "unknown controller 'imc-s9'; installed: bwo900, c142, external, gmi99, imc-m, imc-mp, imc-s8, ismif",
        ),
        ({"plant": "bullet"}, "unknown plant 'bullet'; there are: mujoco, kinematic"),
        ({"overrides": {"axes.x.backlas": 0.0}}, "axes.x.backlas"),
    ],
)
def test_wrong_arguments_are_named_in_one_line(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match="unknown") as error:
        Twin(**arguments)  # type: ignore[arg-type]
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda twin: twin.run(-1.0), "virtual time cannot pass by -1.0 s"),
        (lambda twin: twin.run(float("nan")), "virtual time cannot pass by nan s"),
        (lambda twin: twin.run(1e11), "virtual time cannot pass by 100000000000.0 s"),
        (lambda twin: twin.apply_force(3, 1.0), "axis 3 has no carriage"),
        (lambda twin: twin.apply_force(-1, 1.0), "axis -1 has no carriage"),
        (lambda twin: twin.apply_force(0, float("inf")), "a force of inf N"),
        (lambda twin: twin.apply_force(0, 1.0, "hood"), "a force cannot act at 'hood'; there are: tool, table"),
        (lambda twin: Twin(plant="kinematic", start_mm=(1.0, 2.0)), "start_mm has 2 values"),
        (lambda twin: Twin(plant="kinematic", start_mm=(1.0, 2.0, 1e6)), "start_mm: z = 1000000.0; it must lie from"),
        (lambda twin: Twin(plant="kinematic", start_mm=np.array([np.nan, 1, 1])), "start_mm: x = nan"),
    ],
)
def test_wrong_numbers_are_named_in_one_line(act: Callable[[Twin], None], message: str) -> None:
    twin = Twin(plant="kinematic")
    with pytest.raises(ValueError, match=re.escape(message)):
        act(twin)


def test_wrong_inputs_are_named_in_one_line() -> None:
    twin = Twin(plant="kinematic")
    with pytest.raises(ScenarioError, match=r"unknown input 'hod'; did you mean 'hood'\?"):
        twin.set_input("hod", "open")
    with pytest.raises(ScenarioError, match=r"input 'hood' cannot be 'ajar'; it can be: closed, open, forced"):
        twin.set_input("hood", "ajar")


def test_more_events_at_one_instant_than_a_broken_controller_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many there are, they come to an end; what does not is a controller that goes on for ever."""
    monkeypatch.setattr("isel_twin.core.twin._ENDLESS", 50)
    events = "[[event]]\nat = 1.0\nset = { user_0 = 'high' }\n[[event]]\nat = 1.0\nset = { user_0 = 'low' }\n"
    twin = twin_with(tmp_path, 60 * events + "[[event]]\nat = 1.0\nset = { user_1 = 'high' }\n")
    twin.run(2.0)
    assert (twin.inputs["user_0"], twin.inputs["user_1"]) == ("low", "high")
    assert twin.query("@0b0") == "002"


def test_a_controller_that_does_not_come_to_an_end_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("isel_twin.core.twin._ENDLESS", 50)
    twin = twin_with(tmp_path, 60 * "[[event]]\nat = 1.0\nset = { user_0 = 'high' }\n")
    monkeypatch.setattr(type(twin._controller), "next_ns", property(lambda controller: SECOND_NS))
    with pytest.raises(RuntimeError, match="does not come to an end at 1000000000 ns"):
        twin.run(2.0)


@pytest.mark.parametrize(("plant", "idle"), [("kinematic", 2), ("mujoco", 0)])
def test_what_needs_physics_is_said_and_counted_without(
    tmp_path: Path, plant: str, idle: int, caplog: pytest.LogCaptureFixture
) -> None:
    """A force of zero and a phase that comes back end what was, or was not, before."""
    twin = twin_with(
        tmp_path,
        """
        [[event]]
        at = 1.0
        force_n = { x = 50.0 }
        [[event]]
        at = 2.0
        force_n = { x = 0.0 }
        phase_lost = { y = "" }
        set = { hood = "open" }
        cut = "off"
        [[event]]
        at = 3.0
        phase_lost = { y = "a" }
        """,
        plant,
    )
    said = f"{tmp_path}/scenario.toml: 2 of 3 events have no effect without physics"
    assert [record.getMessage().startswith(said) for record in caplog.records] == [True] * bool(idle)
    assert (twin.events_left, twin.events_without_effect) == (3, 0)
    twin.run(2.5)
    assert (twin.events_left, twin.events_without_effect) == (1, min(idle, 1))
    twin.run(2.5)
    assert (twin.events_left, twin.events_without_effect) == (0, idle)


@pytest.mark.parametrize(("plant", "idle"), [("kinematic", 3), ("mujoco", 0)])
def test_what_needs_physics_is_counted_whoever_does_it(plant: str, idle: int) -> None:
    """By a call of its own or as an event; what only ends something is not counted."""
    twin = Twin(plant=plant)
    twin.apply_force(0, 50.0)
    twin.apply_force(0, 0.0)
    twin.set_cut(Cut(diameter_mm=6.0, flutes=2, depth_mm=0.5, width_mm=6.0, spindle_rpm=3600.0, kc_n_mm2=800.0))
    twin.set_cut(None)
    twin.carry_out(ScenarioEvent(0, {"force_n": {"y": 20.0}, "phase_lost": {"y": "a"}}))
    twin.carry_out(ScenarioEvent(0, {"set": {"hood": "open"}}))
    assert twin.events_without_effect == idle


CUT = """
[[event]]
at = 22.0
[event.cut]
diameter = 6.0
flutes = 2
depth = 0.5
width = 6.0
spindle = 3600
kc = { value = 800, unit = "N/mm2", grade = "estimate", source = "aluminium" }
[[event]]
at = 24.0
cut = "off"
"""


def test_a_cut_shows_while_it_lasts(tmp_path: Path) -> None:
    """2 x 0.5 mm x 800 N/mm2 x 0.13 mm / 4 = 26 N across a feed along X push portal and table apart in Y."""
    twin = home(twin_with(tmp_path, CUT, "mujoco"))
    twin.run(20.0 - twin.time_ns / 1e9)
    seen: list[float] = []
    twin.observe(lambda now: seen.append(now.position_mm[1]), 1_000_000)
    assert twin.query(MOVE) == "0"
    before, during, after = (np.array(seen[start:end]) for start, end in ((500, 1900), (2500, 3900), (4500, 5900)))
    assert np.ptp(before) < 1e-3
    assert np.ptp(during) > 5e-3, "teeth pass 120 times a second"
    assert np.ptp(after) < 1e-3
    assert during.mean() - before.mean() > 26.0 / 5e3
    assert np.abs(twin.lost_steps).max() < 4.0


def test_a_cut_between_two_lines_of_a_job() -> None:
    """And on the plant without physics it does nothing."""
    cut = Cut(diameter_mm=6.0, flutes=2, depth_mm=0.5, width_mm=6.0, spindle_rpm=3600.0, kc_n_mm2=800.0)
    for plant, shaken in (("mujoco", True), ("kinematic", False)):
        twin = home(Twin(plant=plant, start_mm=START_MM))
        spans = []
        for begins in (None, cut, None):
            twin.set_cut(begins)
            twin.write(b"@0A320,5000,0,30,0,30,0,30\r")
            seen: list[float] = []
            for _ in range(100):
                twin.run(0.002)
                seen.append(twin.position_mm[1])
            twin.run(1.0)
            spans.append(np.ptp(seen))
        assert (spans[1] > 3.0 * max(spans[0], spans[2], 1e-6)) == shaken
