"""A session with a second machine that is other in one thing: it is found, and nothing else is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import Twin
from isel_twin.many.learning.causes import Cause, best, sure
from isel_twin.many.learning.explain import explained
from isel_twin.many.learning.learn import told_alone
from isel_twin.many.learning.session import Session
from isel_twin.recordings.compare import traffic
from isel_twin.recordings.mcap import RecordingWriter
from isel_twin.recordings.reading import read
from isel_twin.recordings.recording import FileRecording
from tests.in_process import isel_twin as cli

HERE = TwinSpec(plant="kinematic", line_speed=True, start_mm=(5.0, 5.0, 5.0))
COMMANDS = (
    "@07",
    "@0d5000,5000,5000",
    "@0R7",
    "@0P",
    "@0A8000,5000,400,2000,0,30,0,30",
    "@0B1,0",
    "@0b1",
    "@0M0,9000,0,9000,0,900,0,30",
    "@0P",
    "@07",  # a limit switch wants it before a reference run
    "@0R7",
    "@0M3200,9000,3200,9000,0,900,0,30",
    "@0V",
    "@0P",
    "@0Id1,2,3,4",
)


def flash(*lines: str) -> bytes:
    twin = Twin(plant="kinematic")
    assert [twin.query(line) for line in (*lines, "@0IW")] == ["0"] * (len(lines) + 1)
    assert twin.flash is not None
    return twin.flash


def recorded(path: Path, spec: TwinSpec, commands: tuple[str, ...] = COMMANDS) -> Path:
    """What a tap would have recorded of this machine: bytes and their times."""
    twin = spec.build(keep_motions=1)
    recording = FileRecording(path.with_suffix(".twin.mcap"), twin, 100_000_000)
    for command in commands:
        twin.query(command)
        twin.run(0.05)
    recording.close()
    with RecordingWriter(path, {"kind": "tap", "controller": "imc-s8"}) as writer:
        for time_ns, data, by_host, _ in traffic(read(path.with_suffix(".twin.mcap"))):
            (writer.sent if by_host else writer.received)(time_ns, data)
    return path


def session(path: Path) -> Session:
    return Session(tuple(traffic(read(path))), "imc-s8")


@pytest.mark.parametrize(
    ("other", "name", "value"),
    [
        ({"flash": "@0IJ50"}, "acceleration", 50),
        ({"flash": "@0Ij900"}, "start-stop frequency", 900),
        ({"controller": "c142"}, "firmware", None),
        ({"events": [{"at": 0.0, "set": {"limit_y2": "stuck_open"}}]}, "switch", None),
        ({}, "", None),
    ],
)
def test_what_is_other_at_the_second_machine_is_found(
    other: dict[str, Any], name: str, value: int | None, tmp_path: Path
) -> None:
    there = HERE.with_(start_mm=(6.5, 4.0, 5.5))
    if "events" in other:
        there = there.with_events(other["events"])
    elif "flash" in other:
        there = there.with_(flash=flash(other["flash"]))
    else:
        there = there.with_(**other)
    found = explained(session(recorded(tmp_path / "real.mcap", there)), HERE.with_(start_mm=None))
    assert found.same, found.unexplained
    assert [(cause.name, cause.value) for cause in found.causes] == ([(name, value)] if name else [])
    assert found.alternatives == ((),) * len(found.causes)


def test_the_usual_value_is_named_only_if_the_twin_has_it(tmp_path: Path) -> None:
    """With a flash of its own the twin's value is another one than that of a controller as it was delivered, 100."""
    path = recorded(tmp_path / "real.mcap", HERE.with_(flash=flash("@0IJ50")))
    told = []
    for here in (HERE, HERE.with_(flash=flash("@0IJ200"))):
        (cause,) = explained(session(path), here.with_(start_mm=None)).causes
        assert cause.value == 50
        told.append(cause.told.rpartition("not ")[2])
    assert told == ["100", "what the twin has in its own"]


def test_play_is_found_in_later_reference_runs_by_physics(tmp_path: Path) -> None:
    there = HERE.with_(plant="mujoco", overrides={"axes.x.backlash": 0.3})
    path = recorded(tmp_path / "real.mcap", there, ("@01", "@0d5000", "@0R1", "@0A1600,5000", "@0R1", "@0P"))
    found = explained(session(path), HERE.with_(plant="mujoco", start_mm=None))
    (cause,) = found.causes
    assert cause.name in ("backlash", "reference speed")
    assert found.same


@pytest.mark.parametrize(("there_mm", "here_mm"), [(1.0, 0.02), (0.97, 1.0), (0.0, 1.0)])
def test_play_is_looked_for_within_what_a_machine_file_allows(there_mm: float, here_mm: float, tmp_path: Path) -> None:
    """0 to 1 mm: neither the first step nor any other of the search leaves that, wherever the truth is."""
    there = HERE.with_(plant="mujoco", overrides={"axes.x.backlash": there_mm})
    path = recorded(tmp_path / "real.mcap", there, ("@01", "@0d5000", "@0R1", "@0A1600,5000", "@0R1", "@0P"))
    here = HERE.with_(plant="mujoco", start_mm=None, overrides={"axes.x.backlash": here_mm})
    found = explained(session(path), here)
    plays = [cause.value for cause in found.causes if cause.name == "backlash"]
    assert all(0.0 <= value <= 1.0 for value in plays if value is not None)


@pytest.mark.parametrize("what", ["too far", "cannot be built"])
def test_a_trial_that_cannot_be_made_loses_that_trial(what: str, tmp_path: Path) -> None:
    path = recorded(tmp_path / "real.mcap", HERE)
    beyond = HERE.with_(overrides={"axes.x.backlash": 2.0} if what == "too far" else {"axes.x.travel": 9000.0})
    assert session(path).tried(beyond) is None
    good = Cause("good", "", "", HERE)
    assert [cause for _, cause, _ in best(session(path), [Cause("bad", "", "", beyond), good], "kinematic")] == [good]


def test_a_session_with_a_hood_opened_is_compared_to_its_end(tmp_path: Path) -> None:
    """Reference runs that are broken off lead the search for play astray."""
    commands = ("@07", "@0d5000,5000,5000", "@0R7", "@0A1600,5000,0,30,0,30,0,30", "@0R7", "@0P") * 4
    opened = [{"at": 12.0, "set": {"hood": "forced"}}, {"at": 14.0, "set": {"hood": "closed"}}]
    path = recorded(tmp_path / "real.mcap", HERE.with_(plant="mujoco").with_events(opened), commands)
    explained(session(path), HERE.with_(plant="mujoco", start_mm=None))


def test_a_place_at_power_on_that_is_said_is_a_difference_that_is_named(tmp_path: Path) -> None:
    path = recorded(tmp_path / "real.mcap", HERE.with_(start_mm=(20.0, 20.0, 20.0)))
    found = explained(session(path), HERE, unknown_start=False)
    assert [cause.name for cause in found.causes] == ["power-on position"]
    assert found.same
    assert found.causes[0].spec.start_mm == pytest.approx((29.5, 22.4, 10.5), abs=10.0)  # any place with that duration


@pytest.mark.parametrize(("sigma", "vague"), [(410.0, True), (64.0, False)])
def test_a_number_that_the_delays_hide_is_said_to_be_so(sigma: float, vague: bool) -> None:
    """A start-stop frequency moves the end of a move by 2 / a for each Hz, 20 us at 100 Hz/ms: a scatter of
    8 ms hides 400 Hz."""
    told = sure(482.0, sigma, 300.0)
    assert told.startswith(f"+- {sigma:.2g}")
    assert ("delays of this session" in told) is vague


def test_what_the_bytes_alone_tell(tmp_path: Path) -> None:
    """19200 baud, 8N1: 520.8 us a byte."""
    told = {one.what: one.value for one in told_alone(session(recorded(tmp_path / "real.mcap", HERE)))}
    assert told == {"axes": "X Y Z", "speeds": "30 to 9000 Hz", "line speed": "19200 baud"}


def test_learn_writes_a_flash_with_which_the_twin_does_the_same(tmp_path: Path) -> None:
    path = recorded(tmp_path / "real.mcap", HERE.with_(flash=flash("@0IJ50")))
    image = tmp_path / "flash.bin"
    done = cli("learn", path, "--plant", "kinematic", "-o", image)
    assert done.returncode == 0, done.stderr
    assert "acceleration 50 Hz/ms in its flash" in done.stdout
    assert cli("compare", path, "--plant", "kinematic", "--flash", image).returncode == 0
    assert cli("replay", path, "--plant", "kinematic", "--flash", image).returncode == 0
    done = cli("compare", path, "--plant", "kinematic", "--report", tmp_path / "page.html", "--json")
    assert done.returncode == 1
    summary = json.loads(done.stdout.splitlines()[-1])
    assert summary["verdict"].startswith("the same but for acceleration 50 Hz/ms in its flash (+- ")
    assert summary["unexplained"] == []
    assert "<svg" in (tmp_path / "page.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("compare", "--start", "1,2"), "--start '1,2': must be X,Y,Z in mm"),
        (("replay", "--step-tolerance", "-1"), "--step-tolerance -1: must be a number of steps from 0"),
        (("compare", "real.mcap", "--seed", "3"), "says itself what it was made with"),
        (("learn", "--flash", "none.bin"), "none.bin: there is no such file"),
    ],
)
def test_what_cannot_be_carried_out_is_one_line(arguments: tuple[str, ...], told: str, tmp_path: Path) -> None:
    path = recorded(tmp_path / "real.mcap", HERE, ("@07",))
    done = cli(arguments[0], path, *(str(path) if word == "real.mcap" else word for word in arguments[1:]))
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert told in done.stderr
