"""The recipe of a twin is a value; a machine is read and built once, and a changed file is noticed."""

from __future__ import annotations

import pickle
import shutil
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.core.spec import TwinSpec
from isel_twin.machine import Machine, load_machine, models_folder, with_overrides
from isel_twin.recordings.reading import read
from isel_twin.recordings.recording import FileRecording
from isel_twin.recordings.replay import rebuilt, replay
from isel_twin.wiring import ScenarioError

EVENTS = [
    {"name": "door", "at": 0.5, "set": {"hood": "open"}},
    {"when": "0.25 s after door", "set": {"hood": "closed"}},
]


def spec() -> TwinSpec:
    return TwinSpec(plant="kinematic", seed=5, overrides={"axes.all.lead": 4.0}).with_events(EVENTS)


def test_a_spec_goes_through_a_pickle_and_builds_the_same_twin() -> None:
    twins = [spec().build(), pickle.loads(pickle.dumps(spec())).build()]
    for twin in twins:
        twin.run(0.6)
        assert twin.inputs["hood"] == "open"
        assert twin.events_left == 1
        twin.run(0.2)
        assert twin.inputs["hood"] == "closed"
        assert twin.events_left == 0
    assert twins[0].position_mm.tolist() == twins[1].position_mm.tolist()


def test_a_loaded_machine_goes_through_a_pickle(tmp_path: Path) -> None:
    asked = TwinSpec(load_machine("4030"), plant="kinematic")
    assert pickle.loads(pickle.dumps(asked)) == asked
    assert Twin.of(asked).machine == Twin(plant="kinematic").machine


def test_events_are_refused_by_event_and_key() -> None:
    with pytest.raises(ScenarioError, match=r"^scenario: event 1\.at: 'noon'; allowed: "):
        TwinSpec(plant="kinematic").with_events([{"at": "noon", "set": {"hood": "open"}}])
    with pytest.raises(ValueError, match=r"there are events, too"):
        spec().with_(scenario=Path("hood.toml"))


def test_a_recording_of_events_replays(tmp_path: Path) -> None:
    twin = spec().build()
    recording = FileRecording(tmp_path / "a.mcap", twin, 10_000_000)
    twin.query("@07")
    twin.run(1.0)
    assert recording.close()
    recorded = read(tmp_path / "a.mcap")
    assert replay(recorded, rebuilt(recorded, tmp_path)) is None


def test_a_machine_is_built_once_for_the_same_overrides() -> None:
    machine, overrides = load_machine("4030"), {"payload.mass": 3.0}
    made = with_overrides(machine, overrides)
    assert load_machine("4030") is machine
    assert with_overrides(machine, dict(overrides)) is made
    assert made.axes is machine.axes
    assert (made.payload_kg, machine.payload_kg) == (
        3.0,
        machine.tree["payload"]["mass"]["value"],
    )
    assert with_overrides(machine, {"payload.mass": 3}) is not made, "a value of another type is checked anew"
    assert with_overrides(machine, {}) is machine


@pytest.mark.parametrize("changed", ["machine.toml", "4030.xml"])
def test_a_changed_file_is_noticed(changed: str, tmp_path: Path) -> None:
    folder = tmp_path / "mill"
    shutil.copytree(models_folder() / "4030", folder)
    assert changed in {path.name for path in folder.iterdir()}
    before: Machine = load_machine(folder)
    assert load_machine(folder) is before
    file = folder / changed
    file.write_bytes(file.read_bytes() + b"\n")
    after = load_machine(folder)
    assert after is not before
    assert after == before


def test_a_changed_parent_is_noticed(tmp_path: Path) -> None:
    shutil.copytree(models_folder() / "4030", tmp_path / "mill")
    heir = tmp_path / "heir"
    heir.mkdir()
    (heir / "machine.toml").write_text('based_on = "../mill"\nname = "heir"\n')
    assert load_machine(heir).description != "new"
    file = tmp_path / "mill" / "machine.toml"
    file.write_text(file.read_text().replace(load_machine(heir).description, "new"))
    assert load_machine(heir).description == "new"
