"""`isel-twin experiment` and `isel-twin identify`: from a plan to a machine, and what is refused in one line."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path

import pytest

from isel_twin.cli import main
from isel_twin.jobs.job import parse_job
from isel_twin.language import create_language, needed
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.many.identification import experiment as experiment_module
from isel_twin.many.identification import protocol as protocol_module
from isel_twin.many.identification.experiment import Block, Teller, assemble, job_text
from isel_twin.many.identification.experiment import _push as push
from isel_twin.many.identification.experiment import _reversal as reversal
from isel_twin.many.identification.measured import read_measured, written
from isel_twin.many.identification.stand_in import carry_out, write_recording
from tests.near import COARSE, near_switches

pytestmark = pytest.mark.long(seconds=9)


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return near_switches(tmp_path_factory.mktemp("near"), 2.0, more=COARSE)


@pytest.fixture(scope="module")
def archive(near: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of a machine with twice the backlash, and what its gauge has said; a reversal each."""
    folder = tmp_path_factory.mktemp("days")
    language = needed(create_language("imc-s8"), "imc-s8")
    machine = load_machine(near)
    hidden = with_overrides(machine, {"axes.x.backlash": 0.04})
    for seed, mm in ((1, 4.0), (2, 6.0)):
        with pytest.MonkeyPatch.context() as fewer:
            fewer.setattr(experiment_module, "REVERSALS", 2)
            block: Block = reversal(Teller(language, "x", machine.axes[0].steps_per_mm), mm)
        experiment = assemble(f"day{seed}", [block], language)
        recorded, measured = carry_out(experiment, hidden, "imc-s8", seed=seed, noise_mm=0.002, time_noise_s=0.0)
        path = folder / f"day{seed}.mcap"
        write_recording(path, recorded)
        path.with_suffix(".toml").write_text(written(measured))
    return folder


@pytest.fixture
def days(archive: Path, tmp_path: Path) -> list[Path]:
    """The recordings of the archive, where they may be written over."""
    for path in archive.iterdir():
        shutil.copy(path, tmp_path)
    return [tmp_path / "day1.mcap", tmp_path / "day2.mcap"]


def measured(days: list[Path]) -> list[object]:
    return [part for day in days for part in ("--measured", day.with_suffix(".toml"))]


def test_from_recordings_to_a_machine(
    near: Path, days: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shop, page = near.with_name("shop"), tmp_path / "page.html"
    options = ("--fit", "backlash.x", "--patch", shop, "--report", page)
    code, out, err = call(capsys, "identify", *days, *measured(days), "--machine", near, *options)
    assert code == 0
    (doubt,) = err.splitlines()  # reversals alone cannot tell a nut from a gauge
    assert "exclude lost motion that pulls do not show, as of a gauge that sticks (backlash.x)" in doubt
    assert doubt.endswith("what would tell: reversals read by another gauge")
    assert "before the fit:\n  rank 1 of 1" in out
    assert "held out: rms" in out
    backlash = load_machine(shop).tree["axes"]["x"]["backlash"]
    assert backlash["value"] == pytest.approx(0.04, rel=0.1)
    assert backlash["grade"] == "fitted"
    assert "day1" in backlash["source"]
    assert "day2" not in backlash["source"]
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_what_predicts_worse_writes_nothing(
    near: Path, days: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Day 1 was read on another scale: every second reading is 0.08 mm too low."""
    form = days[0].with_suffix(".toml")
    lines = form.read_text().splitlines()
    number = 0
    for index, line in enumerate(lines):
        if line.startswith("mm = "):
            number += 1
            lines[index] = f"mm = {float(line[5:]) - 0.08 * (number % 2 == 0)!r}"
    form.write_text("\n".join(lines))
    shop = near.with_name("worse")
    code, out, err = call(
        capsys, "identify", *days, *measured(days), "--machine", near, "--fit", "backlash.x", "--patch", shop
    )
    assert code == 1
    doubt, explained, refused = err.splitlines()
    assert doubt.startswith("isel-twin: the model does not explain these data: chi-square")
    assert "day1" in doubt
    assert explained == "isel-twin: no law known here would explain it; look at these readings first"
    assert refused.startswith("isel-twin: refused: the fit predicts day2 worse than before")
    assert "worse" in out
    assert not shop.exists()


def test_json_has_it_all(days: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And a machine that comes with the package is the base of one in any folder."""
    shop = tmp_path / "machines" / "shop"
    ends = [f"axes.{axis}.power_on_{end}" for axis in "xyz" for end in ("low=2.0", "high=3.0")]
    near = [part for value in (*ends, "timing.motor_substep=50.0") for part in ("--set", value)]
    options = ("--machine", "4030", *near, "--fit", "backlash.x", "--hold-out", "0", "--patch", shop, "--json")
    code, out, _ = call(capsys, "identify", *days, *measured(days), *options)
    content = json.loads(out)
    assert code == 0
    assert load_machine(shop).tree["axes"]["x"]["backlash"]["value"] == pytest.approx(0.04, rel=0.1)
    assert content["fitted"]["recordings"] == ["day1", "day2"]
    assert content["times_better"] is None
    (found,) = content["parameters"]
    assert found["interval"][0] < 0.04 < found["interval"][1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "--measured: name at least one file"),
        (("--measured", "no.toml"), "no.toml: there is no such file"),
        (("MEASURED", "--fit", "fricton.x"), "did you mean 'friction.x'"),
        (("MEASURED", "--hold-out", "day9"), "--hold-out 'day9': no such recording; allowed: day1, day2"),
        (("MEASURED", "--hold-out", "day1", "--hold-out", "day2"), "nothing is left to be fitted"),
        (("MEASURED", "--fit", "backlash.x", "--prior", "supply=20..60"), "--prior supply: is not fitted"),
        (("MEASURED", "--prior", "supply=60..20"), "must be NAME=LOW..HIGH"),
        (("MEASURED", "--workers", "0"), "--workers 0: must be"),
    ],
)
def test_a_wrong_call_is_one_line(
    days: list[Path], options: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    every = [part for option in options for part in (measured(days) if option == "MEASURED" else (option,))]
    code, _, err = call(capsys, "identify", *days, *every)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1


def test_without_scipy_the_extra_is_named(
    days: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    code, _, err = call(capsys, "identify", *days)
    assert code == 2
    assert "pip install 'isel-twin[tune]'" in err


@pytest.mark.slow
def test_a_plan_is_a_job_and_a_form(near: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What tells backlash is a reversal; the job runs, the form waits to be filled in."""
    code, out, err = call(
        capsys, "experiment", tmp_path / "day1", "--machine", near, "--fit", "backlash.x", "--blocks", "1"
    )
    assert (code, err) == (0, "")
    assert "backlash.x" in out
    job, form = (tmp_path / "day1").with_suffix(".txt"), (tmp_path / "day1").with_suffix(".toml")
    assert parse_job(job.read_text(), create_language("imc-s8"), "imc-s8")
    assert "read" in job.read_text()
    content = tomllib.loads(form.read_text())
    assert len(content["reading"]) >= 2
    assert read_measured(form).unread == len(content["reading"])
    code, _, _ = call(capsys, "run", job, "--machine", near, "--plant", "kinematic")
    assert code == 0


def test_a_job_says_above_its_line_what_to_measure() -> None:
    language = needed(create_language("imc-s8"), "imc-s8")
    machine = load_machine("4030")
    experiment = assemble("day1", [reversal(Teller(language, "x", machine.axes[0].steps_per_mm), 12.0)], language)
    lines = job_text(experiment, language).splitlines()
    wanted = experiment.template().readings[0].command
    index = next(n for n, line in enumerate(lines) if line.startswith(f"# command {wanted}:"))
    assert "read the gauge on x" in lines[index]
    commands = [line for line in lines[: index + 2] if line and not line.startswith("#")]
    assert len(commands) == wanted


def test_an_experiment_needs_a_plain_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = call(capsys, "experiment", tmp_path / "day1.txt")
    assert code == 2
    assert "has no ending" in err


def test_a_controller_that_answers_nothing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A session has its times from replies; a CNC on a one-way line gives none."""
    words = ("--machine", "4030-servo", "--controller", "bwo900")
    code, out, err = call(capsys, "experiment", tmp_path / "day1", *words)
    assert (code, out) == (2, "")
    assert err.startswith("isel-twin: controller 'bwo900' answers nothing to a move, so no recording tells when one")
    assert not (tmp_path / "day1.txt").exists()


@pytest.fixture
def scored(near: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A form of a day with one push, planned, sealed and carried out on the machine that was believed."""

    def day(machine: Machine, controller: str, axes: list[str], seed: int) -> list[Block]:
        language = needed(create_language(controller), controller)
        return [push(Teller(language, axes[0], machine.axes[0].steps_per_mm), 12.0, 150.0, "tool")]

    monkeypatch.setattr(protocol_module, "day", day)
    plan = ("--protocol", "--uncertain", "2", "--machine", near, "--carry-out", near)
    code, out, err = call(capsys, "experiment", tmp_path / "day", *plan)
    assert (code, err) == (0, "")
    assert "push x 150 at the tool: both ways" in out
    first = (tmp_path / "day.txt").read_text().splitlines()[0]
    assert out.splitlines()[-1] == f"sealed: {first.removeprefix('# sealed: ')}"
    return tmp_path / "day.toml"


def test_a_measuring_day_is_sealed_and_scored(scored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = call(capsys, "identify", "--score", scored)
    assert (code, err) == (0, "")
    assert "the day holds what was predicted: 0 of 1 beyond |E_n| = 1" in out
    code, out, _ = call(capsys, "identify", "--score", scored, "--json")
    (row,) = json.loads(out)["score"]["scores"]
    assert (code, row["verdict"]) == (0, "holds")
    text = scored.read_text()
    read = [line for line in text.splitlines() if line.startswith("mm = ")]
    scored.write_text(text.replace(read[0], "mm = 9.0").replace(read[4], "mm = 9.0"))  # pulled up, both times
    code, out, _ = call(capsys, "identify", "--score", scored)
    assert code == 1
    assert "it differs in push x 150 at the tool: both ways" in out
    scored.write_text(text.replace("push_n = 150.0", "push_n = 100.0", 1))
    code, _, err = call(capsys, "identify", "--score", scored)
    assert code == 2
    assert "day.toml: protocol.seal: plan or predictions are not those that were sealed" in err


def test_a_score_stands_behind_a_fit(
    scored: Path, near: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The form is measured data, too; a second call takes its replays from the journal."""
    page, recording = tmp_path / "page.html", scored.with_suffix(".mcap")
    fit = ("--score", scored, "--fit", "stiffness.x", "--hold-out", "0", "--machine", near, "--report", page)
    code, out, _ = call(capsys, "identify", recording, *fit, "--journal", tmp_path / "fit.journal")
    assert code == 0
    assert out.index("stiffness.x") < out.index("verdict") < out.index("the day holds")
    assert "The measuring day, predicted beforehand" in page.read_text()
    told = call(capsys, "identify", recording, *fit, "--journal", tmp_path / "fit.journal", "--json")
    assert json.loads(told[1])["score"]["holds"]


def test_without_recordings_a_score_is_all(scored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = call(capsys, "identify", "--score", scored, "--patch", tmp_path / "shop")
    assert code == 2
    assert "score: without recordings nothing is fitted" in err
    code, _, err = call(capsys, "experiment", tmp_path / "d", "--protocol", "--uncertain", "1")
    assert code == 2
    assert "--uncertain 1: must be from 2 to 1000" in err
    code, _, err = call(capsys, "experiment", tmp_path / "d", "--protocol", "--fit", "supply")
    assert code == 2
    assert "protocol: a measuring day is the same for all; leave --fit" in err
