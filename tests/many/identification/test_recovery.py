"""Replays that are kept, recorded positions, and families that a fit must find back before they are promoted."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from isel_twin.cli import main
from isel_twin.machine import load_machine, with_overrides
from isel_twin.many.identification import fit as fit_module
from isel_twin.many.identification import replays as replays_module
from isel_twin.many.identification import trajectory as trajectory_module
from isel_twin.many.identification.fit import fit
from isel_twin.many.identification.measured import Measured, Reading
from isel_twin.many.identification.model import Model
from isel_twin.many.identification.patch import as_json, patch
from isel_twin.many.identification.recovery import family, unrecovered
from isel_twin.many.identification.replays import Replays
from isel_twin.many.identification.session import session_of, stand_alone
from isel_twin.many.identification.trajectory import CLOCK_S, GAUGE, TIMES, with_trajectories
from isel_twin.many.identification.unknowns import unknown
from isel_twin.recordings.reading import Recorded, read
from tests.many.identification.test_doubts import SPEEDS_MM_S, coasted_mm
from tests.near import near_switches

CONTROLLER = "imc-s8"
MACHINE = load_machine("4030")


# The journal ---


def coasts() -> Measured:
    return Measured(tuple(Reading("day", n, "x", mm, 0.005) for n, mm in enumerate(coasted_mm(MACHINE), 1)))


def test_a_fit_that_was_ended_goes_on_and_ends_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ended after ten replays, the last line torn off: the second call makes the rest, the third none."""
    made: list[int] = []

    def predicted(session: object, machine: Any) -> Any:
        made.append(1)
        if len(made) == limit[0]:
            raise KeyboardInterrupt
        return np.array(coasted_mm(machine))

    monkeypatch.setattr(replays_module, "predict", predicted)
    journal, day = tmp_path / "fit.journal", stand_alone("day", coasts(), CONTROLLER)
    unknowns = [unknown(MACHINE, "axes.x.guide_friction"), unknown(MACHINE, "axes.x.shaft_viscous")]
    limit = [0]
    whole = fit(MACHINE, unknowns, [day], [])
    every = len(made)
    made.clear()
    limit[0] = 11
    with pytest.raises(KeyboardInterrupt):
        fit(MACHINE, unknowns, [day], [], journal=journal)
    with journal.open("a") as file:
        file.write('{"key": "torn')
    made.clear()
    limit[0] = 0
    resumed = fit(MACHINE, unknowns, [day], [], journal=journal)
    assert len(made) <= every - 10
    assert resumed.u.tobytes() == whole.u.tobytes()
    assert resumed.covariance.tobytes() == whole.covariance.tobytes()
    made.clear()
    fit(MACHINE, unknowns, [day], [], journal=journal)
    assert made == []


def test_another_machine_has_other_replays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replays_module, "predict", lambda session, machine: np.array(coasted_mm(machine)))
    journal, day, item = (
        tmp_path / "j",
        stand_alone("day", coasts(), CONTROLLER),
        unknown(MACHINE, "axes.x.shaft_viscous"),
    )
    told: list[int] = []
    replays = Replays(progress=told.append, journal=journal)
    other = with_overrides(MACHINE, {"axes.x.guide_friction": 40.0})
    first, second, again = replays.make([(day, one, (item,), [2e-4]) for one in (MACHINE, other, MACHINE)])
    assert first.tobytes() == again.tobytes() != second.tobytes()
    assert told == [1, 2]
    assert len({json.loads(line)["key"] for line in journal.read_text().splitlines()}) == 2


@pytest.mark.parametrize(
    "content", [b"@07\n@0R7\n", b"one line without an end", b"\xff\xfe\x00\n", b"[" * 9999 + b"\n"]
)
def test_what_is_no_journal_is_left_alone(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "job.txt"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"job\.txt: is no journal of replays; name another file"):
        Replays(journal=file)
    assert file.read_bytes() == content


def test_damaged_lines_of_a_journal_are_left_out_and_told_once(tmp_path: Path, caplog) -> None:  # type: ignore[no-untyped-def]
    whole = b'{"key": "a", "values": [1.0, 2.5]}\n'
    damaged = b'{}\n[]\n{"key": 1, "values": [1.0]}\n{"key": "b", "values": [[1.0]]}\n{"key": "c", "val\n\xff\n'
    file = tmp_path / "fit.journal"
    file.write_bytes(damaged + whole + b'{"key": "d", "va')
    assert {key: list(values) for key, values in Replays(journal=file)._known.items()} == {"a": [1.0, 2.5]}
    assert [record.getMessage() for record in caplog.records] == [
        f"{file}: 6 damaged lines are left out; their replays are made again"
    ]
    assert file.read_bytes() == whole


# Recovery ---


def test_a_family_is_what_is_named_alike() -> None:
    names = ("friction.x", "friction.y", "supply", "axes.x.guide_friction", "switch.limit_x2")
    assert [family(name) for name in names] == ["friction", "friction", "supply", "guide_friction", "switch"]


def stub(predict: Callable[[np.ndarray], np.ndarray], names: Sequence[str], sigma: float) -> Model:
    """A model of data without zeros and bounds."""
    content = {
        "unknowns": tuple(SimpleNamespace(name=name) for name in names),
        "predictions": lambda points: [predict(point) for point in points],
        "between": lambda wanted, predicted: (wanted - predicted) / sigma,
    }
    return cast(Model, SimpleNamespace(**content))


def test_what_the_data_tell_is_found_back_and_what_they_do_not_is_named() -> None:
    """The second parameter has a step: its slope at the result is none a deviation away, as where steps are lost."""

    def predict(u: np.ndarray) -> np.ndarray:
        return np.array([u[0], math.tanh(20.0 * (u[1] - 0.5)) / 20.0 + 0.5])

    model = stub(predict, ("friction.x", "backlash.x"), 0.05)
    jacobian = -np.eye(2) / 0.05
    deviation = np.full(2, 0.05)
    assert unrecovered(model, np.array([0.5, 0.5]), jacobian, deviation) == ("backlash",)
    roughly = np.array([0.05, 0.6])
    assert unrecovered(model, np.array([0.5, 0.5]), jacobian, roughly) == ()


def test_what_is_not_recovered_is_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coast finds its friction back; had it not, the number would be a fitted one."""
    assert len(SPEEDS_MM_S) >= 8
    monkeypatch.setattr(fit_module, "PROVEN", {"guide_friction"})
    monkeypatch.setattr(replays_module, "predict", lambda session, one: np.array(coasted_mm(one)))
    day = stand_alone("day", coasts(), CONTROLLER)
    found = fit(MACHINE, [unknown(MACHINE, "axes.x.guide_friction")], [day], [], gate=True)
    assert found.unrecovered == ()
    lost = replace(found, unrecovered=("guide_friction",))
    for result, grade in ((found, "measured"), (lost, "fitted")):
        text = patch(result, MACHINE, "4030", "found", CONTROLLER, ["day"], ["other"])
        assert f'grade = "{grade}", interval' in text
    assert "guide_friction: put elsewhere by a standard deviation, the fit does not find it back" in lost.doubts[0]
    assert as_json(lost, ["day"], [])["not_recovered"] == ["guide_friction"]


# Trajectories ---


def recorded(times_s: np.ndarray, x_mm: np.ndarray) -> Recorded:
    position = np.zeros((len(times_s), 3))
    position[:, 0] = x_mm
    content = {"sample_times_ns": np.round(1e9 * times_s).astype(np.int64), "samples": {"position_mm": position}}
    return cast(Recorded, SimpleNamespace(**content))


def test_positions_of_a_recording_are_readings_in_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second at 40 mm/s, sampled every 10 ms, from 1 s on: eight places, each at its time after the command, and as
    sure as scale and clock are; the second command moves nothing, the third has gaps."""
    times_s = np.arange(0.0, 4.0, 0.01)
    commands = [SimpleNamespace(sent_ns=round(1e9 * s), duration_ns=10**9, text="move") for s in (1.0, 2.0, 3.0)]
    monkeypatch.setattr(trajectory_module, "exchanges_of", lambda session: commands)
    kept = (times_s < 3.0) | (np.arange(len(times_s)) % 5 == 0)
    x_mm = 40.0 * (np.clip(times_s, 1.0, 2.0) + np.clip(times_s, 3.0, 4.0))
    session = with_trajectories(stand_alone("day", Measured(), CONTROLLER), recorded(times_s[kept], x_mm[kept]))
    readings = session.measured.readings
    assert [one.at_s for one in readings] == pytest.approx([(n + 0.5) / TIMES for n in range(TIMES)])
    assert [one.mm - readings[0].mm for one in readings] == pytest.approx([40.0 * n / TIMES for n in range(TIMES)])
    assert {(one.command, one.axis, one.gauge) for one in readings} == {(1, "x", f"{GAUGE} 1 x")}
    assert readings[3].sigma_mm == pytest.approx(math.hypot(0.005, 40.0 * CLOCK_S))


def test_a_recorded_path_fits_its_machine_and_no_other(tmp_path: Path) -> None:
    """A lead 0.125 % too long is 25 um over 20 mm: no gauge was there, the positions refuse it."""
    (tmp_path / "near").mkdir()
    near = near_switches(tmp_path / "near", 2.0)
    job, file = tmp_path / "job.txt", tmp_path / "run.mcap"
    job.write_text("@07\n@0R7\n@0M6400,12000,0,100,0,100,0,30\n@0M640,12000,0,100,0,100,0,30\n")
    with pytest.raises(SystemExit) as ended:
        main(["run", str(job), "--machine", str(near), "--record", str(file)])
    assert ended.value.code == 0
    machine = load_machine(near)
    session = with_trajectories(session_of(read(file), Measured(), "", machine), read(file))
    assert len(session.measured.readings) >= 2 * TIMES
    model = Model(machine, [unknown(machine, "lead.x")], [session])
    right, wrong = (model.residuals_at(np.array([u])) for u in (0.0, 2.5))
    assert model.squares(right) < 0.1 * model.freedom(right, 1)
    assert model.squares(wrong) > 2.0 * model.freedom(wrong, 1)
