"""A recorded session, played again to a twin built from the recording, is the same to the bit."""

from __future__ import annotations

import dataclasses
import itertools
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin.base.parameters import Place
from isel_twin.base.toml import toml_line
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import controller_names
from isel_twin.core.twin import Twin
from isel_twin.language import MoveSettings, create_language, needed
from isel_twin.recordings.compare import Counters, paired, traffic
from isel_twin.recordings.host import play_host
from isel_twin.recordings.reading import Entry, Played, RecordingError, read
from isel_twin.recordings.recording import FileRecording
from isel_twin.recordings.replay import rebuilt, replay, versions
from isel_twin.wiring import ACTS, ScenarioError, event_now
from isel_twin.wiring.acts import BESIDE

pytestmark = pytest.mark.long(seconds=10)

INTERVAL_NS = 10_000_000
CUT = {
    "diameter": 6.0,
    "flutes": 2,
    "depth": 0.5,
    "width": 6.0,
    "spindle": 18000,
    "kc": {"value": 800, "unit": "N/mm2", "grade": "estimate", "source": "aluminium"},
}
SCENARIO = """
[[event]]
at = 25.3
set = { limit_x2 = "stuck_open" }

[[event]]
at = 26.0
force_n = { z = 30.0 }

[[event]]
at = 26.5
noise = 0.02
"""


def happen(twin: Twin, content: dict[str, Any]) -> None:
    twin.carry_out(event_now(content, Place("test", ScenarioError), twin.settable))


def session(twin: Twin, wait: Callable[[float], object]) -> None:
    """Reference, moves, one broken off, one through an E-stop; faults, pushes, cuts, another line speed."""
    language = needed(twin.language, twin.controller_name)
    settings = MoveSettings(speed_hz=4000)

    def say(data: bytes, seconds: float = 0.3) -> None:
        twin.write(data)
        wait(seconds)

    for data in language.reference():
        say(data, 4.0)
    for number, target in enumerate(((3000, 1000, 500), (1000, 4000, 0), (9000, 0, 800))):
        for data in language.move(target, settings):
            say(data)
        if number == 0:
            twin.apply_force(0, 12.0, "tool")
            happen(twin, {"phase_lost": {"y": "a"}})
        wait(0.4)
        if number == 1:
            say(language.break_off())
            happen(twin, {"phase_lost": {"y": ""}, "cut": CUT})
            twin.watch_margin()
        wait(1.2)
    twin.line_speed = not twin.line_speed
    twin.set_cut(None)
    for data in language.move((0, 8000, 0), settings):
        say(data)
    twin.set_input("estop", "pressed")
    wait(0.2)
    twin.set_input("estop", "released")
    for data in language.reference():
        say(data, 2.0)
    wait(max(0.0, 27.0 - twin.time_ns / SECOND_NS))
    twin.write(b"\x00garbage\xff\r\xe5" * 5)
    wait(0.5)


def waits(twin: Twin, cut: str) -> Callable[[float], object]:
    """How time passes: at one go, as in queries, or in slices as a clock on a wall has them."""
    if cut == "whole":
        return twin.run
    random_s = random.Random(7)

    def slices(seconds: float) -> None:
        end_ns = twin.time_ns + round(seconds * SECOND_NS)
        while twin.time_ns < end_ns:
            twin.run_until(min(end_ns, twin.time_ns + random_s.randrange(1, 60_000_000)))
            twin.read()
            _ = twin.counts, twin.position_mm

    return slices


def record(path: Path, cut: str = "whole", **how: Any) -> Twin:
    """A session in a file."""
    scenario = path.with_suffix(".toml")
    scenario.write_text(SCENARIO)
    twin = Twin(seed=11, scenario=scenario, **{"start_mm": (6.0, 7.0, 8.0), **how})
    recording = FileRecording(path, twin, INTERVAL_NS)
    session(twin, waits(twin, cut))
    assert recording.close()
    scenario.unlink()
    return twin


@pytest.mark.parametrize("cut", ["whole", "slices"])
@pytest.mark.parametrize("controller", controller_names())
def test_a_session_of_each_controller_replays_to_the_bit(controller: str, cut: str, tmp_path: Path) -> None:
    machine = "4030-servo" if controller in ("gmi99", "bwo900") else "4030"
    twin = record(tmp_path / "session.mcap", cut, controller=controller, machine=machine, line_speed=cut == "slices")
    recorded = read(tmp_path / "session.mcap")
    assert versions(recorded) == []
    assert np.array_equal(recorded.steps().delta, twin.steps.delta)
    assert len(recorded.steps()) > 1000
    again = rebuilt(recorded, tmp_path)
    assert replay(recorded, again) is None
    assert again.time_ns == twin.time_ns
    assert again.position_mm.tobytes() == twin.position_mm.tobytes()


def test_a_kinematic_session_replays_at_a_pace(tmp_path: Path) -> None:
    record(tmp_path / "session.mcap", plant="kinematic", overrides={"axes.x.backlash": 0.02})
    recorded = read(tmp_path / "session.mcap")
    seen: list[int] = []
    assert replay(recorded, rebuilt(recorded, tmp_path), seen.append) is None
    assert seen == sorted(seen)
    assert max(b - a for a, b in itertools.pairwise(seen)) <= 10_000_000


def test_flash_of_an_earlier_life_and_its_writes(tmp_path: Path) -> None:
    first = Twin(plant="kinematic")
    first.query("@0IUhello")
    first.query("@0IW")
    twin = Twin(plant="kinematic", flash=first.flash, keep_motions=1)
    recording = FileRecording(tmp_path / "flash.mcap", twin, INTERVAL_NS)
    assert "hello" in twin.query("@0U")
    twin.query("@0IUworld")
    twin.query("@0IW")
    twin.query("\xfe")  # reset of the controller
    recording.close()
    recorded = read(tmp_path / "flash.mcap")
    assert len(list(recorded.of("/flash"))) == 1
    assert replay(recorded, rebuilt(recorded, tmp_path)) is None


EVERY_ACT: list[dict[str, Any]] = [
    {"set": {"hood": "open"}},
    {"force_n": {"x": -20.0}, "place": "tool"},
    {"phase_lost": {"y": "a"}},
    {"noise": 0.05},
    {"cut": CUT},
    {"swapped": {"limit_x1": "limit_x2"}},
    {"friction_n": {"x": 30.0}},
    {"obstacle_mm": {"x": 8.0}},
    {"payload_kg": {"table": 3.0}},
    {"undervoltage": 0.4},
    {"hot_stage_k": {"x": 10.0}},
    {"dropped": 0.05},
    {"doubled": 0.05},
    {"line_cut": True, "for": 0.011},
    {"reset": True},
    {"brownout": True, "for": 0.1},
]
"""An event for each thing that can be done."""


def test_every_act_is_listed() -> None:
    """Keys of a controller are replayed in tests/test_keys.py."""
    assert {key for event in EVERY_ACT for key in event if key not in BESIDE} == set(ACTS) - {"key"}


@pytest.mark.parametrize("event", EVERY_ACT, ids=lambda event: next(iter(event)))
def test_a_session_with_each_act_replays_to_the_bit(event: dict[str, Any], tmp_path: Path) -> None:
    """In mid-motion, and again as an event of a scenario; counters are what the controller counts all the time."""
    scenario = tmp_path / "act.toml"
    table = {**event, "cut": {**CUT}} if "cut" in event else event
    scenario.write_text("\n".join(["[[event]]", "at = 6.2", *map(toml_line, table, table.values()), ""]))
    twin = Twin(start_mm=(1.0, 1.0, 1.0), scenario=scenario, line_speed=True)
    path = tmp_path / "session.mcap"
    recording = FileRecording(path, twin, INTERVAL_NS)
    for command in ("@07", "@0R7", "@0A2000,2000,500,2000,0,30,0,30"):
        twin.query(command)
    twin.write(b"@0A2000,2000,1500,2000,0,30,0,30\r")
    twin.run(0.05)
    happen(twin, event)
    for command in (b"@0P\r", b"@0A-900,2000,0,30,0,30,0,30\r", b"@0P\r"):
        twin.run(0.02)
        twin.write(command)
    twin.run_until(6_500_000_000)
    recording.close()
    scenario.unlink()
    recorded = read(path)
    counters, played = Counters(recorded), Played(recorded)
    for piece in played.samples():
        assert [counters.at(int(t)) for t in piece["time_ns"]] == [tuple(c) for c in piece["counts"].tolist()]
    assert event in [entry.content for entry in recorded.of("/scenario")]
    assert replay(recorded, rebuilt(recorded, tmp_path)) is None


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short recording."""
    path = tmp_path_factory.mktemp("short") / "short.mcap"
    twin = Twin(plant="kinematic", start_mm=(1.0, 1.0, 1.0))
    recording = FileRecording(path, twin, INTERVAL_NS)
    twin.query("@07")
    twin.query("@0R7")
    twin.set_input("hood", "open")
    twin.set_input("hood", "closed")
    twin.query("@0A100,1000,0,30,0,30,0,30")
    recording.close()
    return path


def changed(path: Path, channel: str, number: int, **content: Any) -> tuple[Any, int]:
    """A recording in which one message is another, and its time."""
    recorded = read(path)
    entries = list(recorded.entries)
    index = [i for i, entry in enumerate(entries) if entry.channel == channel][number]
    entries[index] = Entry(channel, entries[index].time_ns, {**entries[index].content, **content})
    return dataclasses.replace(recorded, entries=tuple(entries)), entries[index].time_ns


@pytest.mark.parametrize(
    ("channel", "number", "content", "told"),
    [
        ("/host/received", 1, {"hex": "31"}, "recorded 1, now 0"),
        ("/runs", -2, {"continues": True}, '"continues": true'),
        ("/outputs", -1, {"stages": 7}, '"stages": 7'),
        ("/counters", 0, {"value": 5}, '"value": 5'),
    ],
)
def test_the_first_difference_is_told(
    short: Path, tmp_path: Path, channel: str, number: int, content: dict[str, Any], told: str
) -> None:
    recorded, time_ns = changed(short, channel, number, **content)
    difference = replay(recorded, rebuilt(recorded, tmp_path))
    assert difference is not None
    assert (difference.channel, difference.time_ns) == (channel, time_ns)
    assert told in str(difference)


def test_another_position_is_told_with_its_field(short: Path, tmp_path: Path) -> None:
    recorded = read(short)
    samples = recorded.samples.copy()
    samples["position_mm"][40, 1] += 1e-12
    recorded = dataclasses.replace(recorded, sample_bytes=samples.tobytes())
    difference = replay(recorded, rebuilt(recorded, tmp_path))
    assert difference is not None
    assert difference.time_ns == recorded.sample_times_ns[40]
    assert difference.recorded.startswith("position_mm[1] ")


def test_what_no_longer_happens_is_told(short: Path, tmp_path: Path) -> None:
    recorded = read(short)
    more = Entry("/remarks", recorded.end_ns, {"text": "a remark"})
    recorded = dataclasses.replace(recorded, entries=(*recorded.entries, more))
    difference = replay(recorded, rebuilt(recorded, tmp_path))
    assert difference is not None
    assert (difference.channel, difference.replayed) == ("/remarks", "nothing")


def test_another_seed_is_a_difference(short: Path, tmp_path: Path) -> None:
    recorded = read(short)
    recorded = dataclasses.replace(recorded, metadata={**recorded.metadata, "seed": "1"})
    difference = replay(recorded, rebuilt(recorded, tmp_path))
    assert difference is not None


def test_a_recording_that_was_cut_off_replays_as_far_as_it_goes(tmp_path: Path) -> None:
    twin = Twin(plant="kinematic", start_mm=(1.0, 1.0, 1.0), line_speed=True)
    path = tmp_path / "cut.mcap"
    recording = FileRecording(path, twin, INTERVAL_NS)
    sizes = []
    for command, seconds in ((b"@07\r", 0.02), (b"@0R7\r", 0.3), (b"\xff", 0.02), (b"@0P\r", 0.04)):
        twin.write(command)
        for _ in range(round(seconds / 0.003)):  # a reply is on its way for longer
            twin.run(0.003)
            recording.flush()
            sizes.append(path.stat().st_size)
    recording.close()
    whole, cut = path.read_bytes(), tmp_path / "part.mcap"
    on_the_way = 0
    for size in sorted({*sizes}):
        cut.write_bytes(whole[:size])
        recorded = read(cut)
        assert not recorded.whole
        assert replay(recorded, rebuilt(recorded, tmp_path)) is None
        on_the_way += any(entry.time_ns > recorded.end_ns for entry in recorded.of("/host/received"))
    assert on_the_way >= 2


def test_a_recording_cut_off_between_a_command_and_the_arrival_of_its_reply_replays(tmp_path: Path) -> None:
    """A byte takes 0.5 ms at 19 200 baud: the recording is copied every 0.2 ms."""
    twin = Twin(plant="kinematic", line_speed=True)
    path, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    recording = FileRecording(path, twin, INTERVAL_NS)
    twin.write(b"@07\r")
    ahead = 0
    for _ in range(20):
        twin.run(2e-4)
        recording.flush()
        cut.write_bytes(path.read_bytes())
        recorded = read(cut)
        ahead += any(entry.time_ns > recorded.end_ns for entry in recorded.of("/host/received"))
        if recorded.entries:
            assert replay(recorded, rebuilt(recorded, tmp_path)) is None
    recording.close()
    assert ahead, "the reply is written down before it arrives"


def test_versions_that_differ_are_told(short: Path) -> None:
    recorded = read(short)
    recorded = dataclasses.replace(recorded, metadata={**recorded.metadata, "mujoco": "1.2.3"})
    (line,) = versions(recorded)
    assert line.startswith("recorded with mujoco 1.2.3, here is ")


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ({"kind": "tap"}, "is of a real controller"),
        ({"begins_ns": "17"}, "does not begin at power-on"),
        ({"overrides": "{"}, "does not say what was recorded"),
        ({"seed": "x"}, "does not say what was recorded"),
        ({"controller": "abc"}, "unknown controller 'abc'"),
    ],
)
def test_recordings_that_cannot_be_played_are_refused_in_one_line(
    short: Path, tmp_path: Path, said: dict[str, str], told: str
) -> None:
    recorded = read(short)
    recorded = dataclasses.replace(recorded, metadata={**recorded.metadata, **said})
    with pytest.raises(ValueError, match=told) as caught:
        rebuilt(recorded, tmp_path)
    assert "\n" not in str(caught.value)


def test_nothing_outside_the_folder_is_written(short: Path, tmp_path: Path) -> None:
    recorded = read(short)
    evil = {**recorded.attachments, "model/../../../evil.xml": b"x", "model//etc/evil.xml": b"x"}
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    rebuilt(dataclasses.replace(recorded, attachments=evil), folder)
    assert [path for path in tmp_path.rglob("evil.xml") if not path.is_relative_to(folder)] == []


def test_the_host_of_a_real_controller_is_played_on_past_a_difference(short: Path) -> None:
    """A recording of a twin stands for that of a real controller: bytes with times are all that is used."""
    recorded = read(short)
    there = paired(traffic(recorded), create_language("imc-s8"))
    twin = Twin(plant="kinematic", start_mm=(50.0, 50.0, 50.0), line_speed=True, seed=5)
    assert [one.reply for one in play_host(traffic(recorded), twin)] == [one.reply for one in there]
    other, _ = changed(short, "/host/received", 1, hex="31")
    again = play_host(traffic(other), Twin(plant="kinematic"))
    assert [one.reply for one in again] == [one.reply for one in there]


def test_a_recording_that_begins_late_cannot_be_played(tmp_path: Path) -> None:
    twin = Twin(plant="kinematic")
    twin.run(1.0)
    FileRecording(tmp_path / "late.mcap", twin, INTERVAL_NS).close()
    with pytest.raises(RecordingError, match="does not begin at power-on"):
        rebuilt(read(tmp_path / "late.mcap"), tmp_path)
