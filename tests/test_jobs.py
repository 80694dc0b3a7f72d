"""The sample jobs of tests/jobs: those that have to do what they did, and one for each way in which a job fails."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from isel_twin.cli import main

JOBS = Path(__file__).parent / "jobs"
GOLDEN = sorted(JOBS.rglob("*.golden"))
SUFFIXES = (".txt", ".nc")

FAILING = {
    "not_referenced": ("'R'", ()),
    "limit_switch": ("'2'", ()),
    "wrong_numbers": ("'7'", ()),
    "too_fast": ("'0'", ("--plant", "mujoco")),
    "never_over": ("no complete reply within 60 s", ("--timeout", 60)),
    "not_as_expected": ("'unmet': [2, 3, 5]", ()),
    "hood": ("'9'", ("--scenario", JOBS / "failing" / "hood.toml")),
}
"""What each of them shows, and with which options."""


def call(*arguments: object) -> int:
    with pytest.raises(SystemExit) as caught:
        main([*map(str, arguments)])
    return int(caught.value.code or 0)


def job_of(golden: Path) -> Path:
    """A file of commands, or a program of the control's own."""
    return next(job for suffix in SUFFIXES if (job := golden.with_suffix(suffix)).is_file())


@pytest.mark.parametrize("golden", GOLDEN, ids=[str(path.relative_to(JOBS)) for path in GOLDEN])
def test_a_job_does_what_it_did(golden: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A deliberate change: isel-twin golden compare --replace tests/jobs/*/*.txt tests/jobs/*/*.nc."""
    assert call("golden", "compare", job_of(golden)) == 0, capsys.readouterr().out


def test_each_sample_that_can_be_compared_is(capsys: pytest.CaptureFixture[str]) -> None:
    jobs = sorted(path for suffix in SUFFIXES for path in JOBS.rglob(f"*{suffix}") if path.parent.name != "failing")
    assert sorted(job_of(golden) for golden in GOLDEN) == sorted(jobs)


@pytest.mark.parametrize("name", FAILING)
def test_a_job_fails_in_its_way(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    shown, options = FAILING[name]
    job = JOBS / "failing" / f"{name}.txt"
    plant = () if "--plant" in options else ("--plant", "kinematic")
    assert call("run", job, "--json", *plant, *options) == 1
    out, err = capsys.readouterr()
    assert shown.replace("'", '"') in out + err
    assert "lost" in out
    assert "Traceback" not in err


def test_every_failing_sample_is_tried() -> None:
    assert sorted(path.stem for path in (JOBS / "failing").glob("*.txt")) == sorted(FAILING)


def test_a_golden_run_of_a_job_that_fails_is_one_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("hood.txt", "hood.toml"):
        shutil.copy(JOBS / "failing" / name, tmp_path)
    job = tmp_path / "hood.txt"
    assert call("golden", "record", job, "--plant", "kinematic", "--scenario", tmp_path / "hood.toml") == 0
    assert call("golden", "compare", job) == 0
    (tmp_path / "hood.toml").write_text("# nobody opens it today\n")
    assert call("golden", "compare", job) == 1
    out = capsys.readouterr().out
    assert "reply '9' -> '0'" in out
    assert "verdict: not ok -> ok" in out
