"""A measuring day: the numbers of the standards, predictions that nobody can change, a score that says what differs."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from isel_twin.language import MoveSettings, create_language, needed
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.many.identification import protocol as protocol_module
from isel_twin.many.identification.experiment import Experiment, assemble, job_text
from isel_twin.many.identification.measured import Measured, MeasuredError, Reading, read_measured, written
from isel_twin.many.identification.protocol import characteristics, day
from isel_twin.many.identification.ring_down import read_signal, ring_down
from isel_twin.many.identification.sealed import Day, Predicted, Score, predict_day, score, sealed
from isel_twin.many.identification.stand_in import carry_out
from tests.near import COARSE, near_switches

pytestmark = pytest.mark.long(seconds=5)

CONTROLLER = "imc-s8"
LANGUAGE = needed(create_language(CONTROLLER), CONTROLLER)


def numbers(readings: list[Reading]) -> dict[str, float]:
    return {one.what.partition(": ")[2]: one.value for one in characteristics(Measured(tuple(readings)))}


def test_positioning_is_that_of_iso_230_2() -> None:
    """Two runs at 0 and 100: up 0, 2 and 10, 10 um; down 20, 22 and 40, 44; s: half the difference times sqrt 2."""
    up, down = {0.0: (0.0, 2.0), 100.0: (10.0, 10.0)}, {0.0: (20.0, 22.0), 100.0: (40.0, 44.0)}
    readings = []
    for run in range(2):
        for mm, of in ((0.0, up), (100.0, up), (100.0, down), (0.0, down)):
            readings.append(Reading("", 1, "x", mm + 1e-3 * of[mm][run] + 7.0, gauge="1 positioning x", counter_mm=mm))
    told = numbers(readings)
    s = math.sqrt(2.0)
    assert told["reversal B"] == pytest.approx(0.032)  # 42 - 10 at 100
    assert told["repeatability R"] == pytest.approx(1e-3 * (2 * 0.0 + 2 * 2 * s + 32.0))
    assert told["accuracy A"] == pytest.approx(1e-3 * (42.0 + 2 * 2 * s - (1.0 - 2 * s)))
    assert told["lead error"] == pytest.approx(100.0 * 1e-3 * (26.0 - 11.0) / 100.0)


def test_a_circle_shows_squareness_centre_and_reversal() -> None:
    """Y leans by 0.5 mm/m, the bar's centre is 0.1 mm off, and one way reads 10 um more."""
    radius, middle, lean = 50.0, (60.0, 60.0, 0.0), 0.5e-3
    readings = []
    for way in (1, -1):
        for number in range(16):
            angle = way * 2.0 * math.pi * number / 16
            x, y = radius * math.cos(angle), radius * math.sin(angle)
            mm = math.hypot(x + lean * y + 0.1, y) + (0.01 if way < 0 else 0.0)
            readings.append(Reading("", 1, "x", mm, gauge="5 circle", about_mm=middle))
    told = numbers(readings)
    assert told["squareness"] == pytest.approx(0.5, abs=0.005)
    assert told["reversal H"] == pytest.approx(0.01, abs=1e-6)
    assert told["circular deviation G"] == pytest.approx(lean * radius, rel=0.02)


@pytest.mark.parametrize(("hz", "damping"), [(38.4, 0.031), (12.0, 0.06), (110.0, 0.01)])
def test_a_ring_down_has_frequency_and_damping(hz: float, damping: float, tmp_path: Path) -> None:
    """From a sound of which a fiftieth is noise, with a hum of the mains that is as strong."""
    time_s, draw = np.arange(0.0, 0.6, 1e-3), np.random.default_rng(3)
    turns = 2.0 * math.pi * hz * time_s
    sound = np.exp(-damping * turns) * np.cos(math.sqrt(1.0 - damping**2) * turns) + 0.02 * draw.normal(size=600) + 4.0
    file = tmp_path / "ring.csv"
    file.write_text("s,m/s2\n" + "\n".join(f"{t:.4f},{a:.5f}" for t, a in zip(time_s, sound, strict=True)))
    told = ring_down(*read_signal(file))
    assert told == (pytest.approx(hz, rel=0.01), pytest.approx(damping, rel=0.12))


def test_what_does_not_ring_is_refused(tmp_path: Path) -> None:
    time_s = np.arange(0.0, 0.4, 1e-3)
    with pytest.raises(ValueError, match="nothing rings"):
        ring_down(time_s, np.exp(-time_s / 0.002))
    with pytest.raises(ValueError, match="8 samples are too few"):
        ring_down(time_s[:8], time_s[:8])
    with pytest.raises(ValueError, match="rise evenly"):
        ring_down(np.concatenate([time_s, time_s]), np.zeros(800))
    form = tmp_path / "day.toml"
    form.write_text('[[ring]]\nrecording = "day"\ncommand = 3\naxis = "x"\npush_n = 100.0\nfile = "gone.csv"\n')
    with pytest.raises(MeasuredError, match=r"ring 1\.file: .*gone\.csv: No such file"):
        read_measured(form)


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    """Small: 120 mm of travel, and found at its switches."""
    folder = near_switches(tmp_path_factory.mktemp("near"), 2.0, more=COARSE)
    return with_overrides(load_machine(folder), {"axes.all.travel": 120.0})


@pytest.fixture(scope="module")
def planned(near: Machine) -> Experiment:
    """A day for X and Y, of two runs, without the series of stalls."""
    blocks = [block for block in day(near, CONTROLLER, ["x", "y"], seed=0, runs=2) if block.stall is None]
    kept = [
        block
        for block in blocks
        if not block.name.startswith(("positioning y", "ring y", "reversal", "straightness", "heights"))
    ]
    kept = [block for block in kept if " y" not in block.name]
    return assemble("day", kept, LANGUAGE)


@pytest.fixture(scope="module")
def predicted(near: Machine, planned: Experiment) -> list[Predicted]:
    return predict_day(planned, near, CONTROLLER, number=3, seed=1)


def test_the_job_says_that_growth_by_heat_takes_a_second_day(planned: Experiment) -> None:
    assert (
        "[1] x: ISO 230-2, 5 places, 2 times from either side, scale; on the cold machine: growth by heat takes a "
        "second day, measured warm" in job_text(planned, LANGUAGE)
    )


def test_each_error_of_geometry_is_a_number_of_the_day(near: Machine) -> None:
    """Lead 0.05 %, 11.5 um/m by each of 20 K, square by 0.4 mm/m, bow 40 um, turn 0.5 mm/m: each where it shows, though
    all are there. The straightedge is 100 of 120 mm: (5/6)^2 of the bow."""
    wanted = ("positioning x", "straightness x_y", "heights x", "circle")
    blocks = [block for block in day(near, CONTROLLER, ["x", "y"], seed=0, runs=2) if block.name in wanted]
    flags = {f"imperfections.{name}": True for name in ("lead_error", "growth", "squareness", "straightness", "abbe")}
    guides = {"guides.x_y": 40.0, "guides.turn_x": 0.5, "guides.turn_y": 0.0, "guides.arm_x": 0.0, "guides.y_x": 0.0}
    errors = {"axes.all.lead_error": 0.05, "axes.x.screw_warming": 20.0, "squareness.xy": 0.4, "axes.all.backlash": 0.0}
    real = with_overrides(near, {**flags, **guides, **errors})
    _, measured = carry_out(assemble("day", blocks, LANGUAGE), real, CONTROLLER, seed=2, noise_mm=0.0, time_noise_s=0.0)
    told = {one.what: one.value for one in characteristics(measured)}
    assert told["positioning x: lead error"] == pytest.approx(0.05 + 0.0230, abs=0.004)
    assert told["straightness x_y: bow"] == pytest.approx(0.040 * (5 / 6) ** 2, abs=0.003)
    assert told["circle: squareness"] == pytest.approx(0.4, abs=0.08)
    turn = next(value for what, value in told.items() if what.startswith("heights x"))
    assert turn == pytest.approx(0.5 * 100 / 120, abs=0.05)


FIVE = {
    "axes.x.lead_error": 0.05,
    "squareness.xy": 1.0,
    "axes.x.backlash": 0.15,
    "axes.x.guide_friction": 150.0,
    "structure.flex_x.stiffness": 0.8,
}
"""What the stand-in has and nobody knows: a lead 0.05 % long, axes 1 mm/m off square, seven times the backlash, five
times the friction of the guide, and a frame six times as soft."""


@pytest.fixture(scope="module")
def form(
    near: Machine, planned: Experiment, predicted: list[Predicted], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Filled in by a stand-in that differs in five ways."""
    real = with_overrides(near, {**FIVE, "imperfections.lead_error": True, "imperfections.squareness": True})
    _, measured = carry_out(planned, real, CONTROLLER, seed=9, noise_mm=0.005, time_noise_s=0.0)
    folder = tmp_path_factory.mktemp("day")
    text, job, _ = sealed(written(measured), job_text(planned, LANGUAGE), {"machine": "near"}, predicted)
    (folder / "day.txt").write_text(job)
    (folder / "day.toml").write_text(text)
    return folder / "day.toml"


def test_each_of_five_differences_is_found_where_it_shows(form: Path) -> None:
    told = {one.predicted.what: one for one in score(form).scores}
    beyond = {name for name, one in told.items() if one.verdict in ("differs", "questionable")}
    assert {"positioning x: lead error", "circle: squareness", "positioning x: reversal B"} <= beyond
    for where in ("push x", "coast x"):
        assert any(name.startswith(where) for name in beyond), where
    assert told["positioning x: lead error"].measured == pytest.approx(0.05, abs=0.01)
    assert told["circle: squareness"].measured == pytest.approx(1.0, abs=0.1)
    assert not score(form).holds


def test_the_machine_that_was_believed_holds(near: Machine, planned: Experiment, predicted: list[Predicted]) -> None:
    _, measured = carry_out(planned, near, CONTROLLER, seed=5, noise_mm=0.005, time_noise_s=0.0)
    found = {one.what: one.value for one in characteristics(measured)}
    told = Day(tuple(Score(one, found[one.what]) for one in predicted), "")
    assert told.measured == len(predicted) >= 10
    assert told.holds, [one for one in told.scores if one.verdict != "holds"]


@pytest.mark.parametrize(
    ("old", "new"),
    [("high = ", "high = 9"), ('axis = "x"\n', 'axis = "y"\n'), ('machine = "near"', 'machine = "far"')],
)
def test_a_changed_prediction_or_plan_is_noticed(form: Path, tmp_path: Path, old: str, new: str) -> None:
    text = form.read_text()
    assert old in text
    changed = tmp_path / "changed.toml"
    changed.write_text(text.replace(old, new, 1))
    with pytest.raises(MeasuredError, match=r"changed\.toml: protocol\.seal: plan or predictions are not those"):
        score(changed)


def test_another_job_beside_the_form_is_noticed(form: Path, tmp_path: Path) -> None:
    (tmp_path / "day.toml").write_text(form.read_text())
    assert score(tmp_path / "day.toml").seal == score(form).seal
    (tmp_path / "day.txt").write_text(form.with_suffix(".txt").read_text() + "@0M1,1\n")
    with pytest.raises(MeasuredError, match="is not the job that was sealed"):
        score(tmp_path / "day.toml")


def test_filling_in_keeps_the_seal(planned: Experiment, predicted: list[Predicted], tmp_path: Path) -> None:
    """The form with nan and with values have one seal; without predictions there is none."""
    empty, _, seal = sealed(written(planned.template()), "", {}, predicted)
    template = planned.template()
    full = dataclasses.replace(template, readings=tuple(dataclasses.replace(one, mm=1.0) for one in template.readings))
    assert sealed(written(full), "", {}, predicted)[2] == seal
    (tmp_path / "day.toml").write_text(empty)
    told = score(tmp_path / "day.toml")
    assert told.measured == 0
    assert not told.holds
    assert "nothing of what was predicted" in told.in_words()
    (tmp_path / "plain.toml").write_text(written(template))
    with pytest.raises(MeasuredError, match="has no predictions"):
        score(tmp_path / "plain.toml")


@pytest.mark.parametrize("controller", ["ismif", "gmi99", "c142"])
def test_a_day_is_planned_in_the_language_and_speeds_of_its_controller(
    controller: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Five places, five times from either side, of each axis; the blocks of every experiment are left out here."""
    monkeypatch.setattr(protocol_module, "blocks", lambda *_: [])
    language = needed(create_language(controller), controller)
    asked: list[int] = []

    class Watched:
        ranges = language.ranges

        @staticmethod
        def move(target: list[int], how: MoveSettings) -> list[bytes]:
            asked.append(how.speed_hz)
            return list(language.move(target, how))

    monkeypatch.setattr(protocol_module, "create_language", lambda name: Watched)
    blocks = day(load_machine("4030"), controller, ["x", "y"], seed=0)
    low, high = language.ranges["speed_hz"]
    assert all(low <= speed <= high for speed in asked)
    assert max(asked) == min(10_000, high)
    read = {block.name: sum(len(step.readings) for step in block.steps) for block in blocks}
    assert (read["positioning x"], read["circle"], read["straightness y_z"], read["heights x"]) == (50, 32, 9, 8)
