"""`check` of folders, of what isel-twin.toml names, and of files that cannot be read among others that can."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import junitparser
import pytest
import yaml

from isel_twin.cli.chosen import job_suffixes
from tests import forked
from tests.in_process import isel_twin

pytestmark = pytest.mark.long(seconds=4)

WELL = "@07\n@0R7\n@0M800,3000,0,30,0,30,0,30\n"
PART = "G21 G90\nG0 X10 Y5\nG1 X20 F600\nM2\n"
WRONG = "G21 G90\nG0 X10\nG77 X3\nM2\n"
PLANT = ("--plant", "kinematic")


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two jobs of one name, one in a folder below, a file that is wrong, one that is not there, and what is no job."""
    monkeypatch.chdir(tmp_path)
    jobs = tmp_path / "jobs"
    for name, text in {
        "a.txt": WELL, "b.nc": WRONG, "sub/a.txt": WELL, "sub/c.NC": PART, ".hidden/d.nc": WRONG, ".e.nc": WRONG,
        "a.golden": "", "hood.toml": "", "picture.png": "", "notes": "",
    }.items():  # fmt: skip
        (jobs / name).parent.mkdir(parents=True, exist_ok=True)
        (jobs / name).write_text(text)
    (jobs / "gone.nc").symlink_to("nowhere.nc")
    (jobs / "round").symlink_to(jobs)
    (jobs / "a.golden").unlink()
    (jobs / "x.golden").touch()
    return tmp_path


FOUND = ["jobs/a.txt", "jobs/b.nc", "jobs/gone.nc", "jobs/sub/a.txt", "jobs/sub/c.NC"]


def judged(out: str) -> dict[str, bool]:
    return {told["job"]: told["ok"] for told in map(json.loads, out.splitlines())}


@pytest.mark.parametrize("workers", ["1", "2"])
def test_each_file_of_a_folder_is_judged_and_what_is_no_job_is_said(shop: Path, workers: str) -> None:
    done = isel_twin("check", "jobs", *PLANT, "--json", "--workers", workers)
    assert done.returncode == 1
    assert list(judged(done.stdout).items()) == list(zip(FOUND, [True, False, False, True, True], strict=True))
    assert done.stderr == (
        "isel-twin: passed over, as no job has such a name, or as links to folders: "
        "jobs/hood.toml, jobs/notes, jobs/picture.png, jobs/round, jobs/x.golden\n"
    )


def test_one_that_cannot_be_read_is_an_error_in_every_form(shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = ("--junit", "out.xml", "--sarif", "out.sarif", "--report", "pages")
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    done = isel_twin("check", "jobs", *PLANT, *files)
    assert done.returncode == 1
    assert "jobs/b.nc: not read: line 3, column 1: G77 is unknown" in done.stdout
    assert "jobs/gone.nc: not read: is a link to nowhere.nc, which is not there\n" in done.stdout
    assert done.stdout.splitlines()[-1] != ""
    assert "5 jobs: 2 not read\n" in done.stdout
    assert "::error file=jobs/b.nc,line=3,title=isel-twin unread::G77 is unknown" in done.stdout
    suite = next(iter(junitparser.JUnitXml.fromfile("out.xml")))
    assert [(case.classname, case.name, case.is_error, case.is_failure) for case in suite] == [
        ("jobs", "a.txt", False, False),
        ("jobs", "b.nc", True, False),
        ("jobs", "gone.nc", True, False),
        ("jobs/sub", "a.txt", False, False),
        ("jobs/sub", "c.NC", False, False),
    ]
    assert (suite.tests, suite.failures, suite.errors) == (5, 0, 2)
    (run,) = json.loads(Path("out.sarif").read_text())["runs"]
    unread = [result for result in run["results"] if result["ruleId"] == "unread"]
    places = [result["locations"][0]["physicalLocation"] for result in unread]
    assert [result["level"] for result in unread] == ["error", "error"]
    assert [place["artifactLocation"]["uri"] for place in places] == ["jobs/b.nc", "jobs/gone.nc"]
    assert places[0]["region"] == {"startLine": 3, "startColumn": 1}
    assert sorted(page.name for page in Path("pages").iterdir()) == ["a-2.html", "a.html", "c.html"]
    told = isel_twin("check", "jobs/b.nc", "jobs/a.txt", *PLANT, "--json").stdout.splitlines()[0]
    (finding,) = json.loads(told)["findings"]
    assert (finding["rule"], finding["level"], finding["line"]) == ("unread", "error", 3)


def test_nothing_that_can_be_judged_is_code_2(shop: Path) -> None:
    done = isel_twin("check", "jobs/b.nc", "jobs/gone.nc", "--junit", "out.xml")
    assert (done.returncode, done.stdout) == (2, "")
    assert [line.split(": ")[1] for line in done.stderr.splitlines()] == ["jobs/b.nc", "jobs/gone.nc"]
    assert next(iter(junitparser.JUnitXml.fromfile("out.xml"))).errors == 2
    (shop / "empty").mkdir()
    done = isel_twin("check", "empty")
    assert (done.returncode, done.stdout) == (2, "")
    assert "empty: there is no job file in this folder (.cnc, .din," in done.stderr
    done = isel_twin("check", "empty", "jobs/a.txt", *PLANT)
    assert done.returncode == 1
    assert done.stdout.endswith("2 jobs: 1 not read\n")
    assert isel_twin("check", "jobs/a.txt", "--machine", "4O30").returncode == 2


def test_a_golden_run_that_is_asked_for_is_missed_by_its_job_alone(shop: Path) -> None:
    assert isel_twin("golden", "record", "jobs/a.txt", *PLANT).returncode == 0
    done = isel_twin("check", "jobs/a.txt", "jobs/sub", *PLANT, "--golden")
    assert done.returncode == 1
    assert "jobs/a.txt: ok" in done.stdout
    assert "jobs/sub/a.txt: not read: jobs/sub/a.golden: there is no golden run of jobs/sub/a.txt" in done.stdout


def test_alone_it_takes_what_the_project_names(shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files, folders and patterns as seen from the file, from any folder below it."""
    (shop / "isel-twin.toml").write_text('[check]\nplant = "kinematic"\njobs = ["jobs/*", "jobs/sub"]\n')
    assert list(judged(isel_twin("check", "--json").stdout)) == FOUND
    monkeypatch.chdir(shop / "jobs" / "sub")
    (shop / "isel-twin.toml").write_text('[check]\nplant = "kinematic"\njobs = ["jobs/s*/*.txt", "nothing*.nc"]\n')
    done = isel_twin("check", "--json")
    assert (done.returncode, judged(done.stdout)) == (1, {"../../jobs/sub/a.txt": True, "../../nothing*.nc": False})
    assert isel_twin("check", "c.NC").returncode == 0, "the key is no bound"
    monkeypatch.chdir(shop.parent)
    done = isel_twin("check", "--json", "--settings", shop / "isel-twin.toml")
    assert judged(done.stdout)[f"{shop.name}/jobs/sub/a.txt"]


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        (None, 'name the jobs: isel-twin check JOB..., or a folder; or in isel-twin.toml: [check] jobs = ["jobs"]'),
        ("[check]\n", "name the jobs: isel-twin check JOB..."),
        ("[check]\njobs = 'jobs'\n", "isel-twin.toml:2: check.jobs: 'jobs'; allowed: a list of files"),
        ("[[check.job]]\nmatch = 'a'\njobs = ['b']\n", "check.job 1.jobs: unknown"),
    ],
)
def test_without_any_it_says_how_to_name_them(settings: str | None, why: str, shop: Path) -> None:
    if settings is not None:
        (shop / "isel-twin.toml").write_text(settings)
    done = isel_twin("check", *(["jobs/a.txt"] if settings is not None and "[[" in settings else []))
    assert (done.returncode, done.stdout) == (2, "")
    assert why in done.stderr


def test_a_real_machine_is_moved_by_all_or_none(shop: Path) -> None:
    done = isel_twin("check", "jobs/a.txt", "jobs/b.nc", "--isel-port", "tcp://127.0.0.1:1", "--controller", "imc-s8")
    assert (done.returncode, done.stdout) == (2, "")
    assert "jobs/b.nc: line 3" in done.stderr
    (shop / "isel-twin.toml").write_text('[check]\njobs = ["jobs/a.txt"]\n')
    done = isel_twin("check", "--isel-port", "tcp://127.0.0.1:1", "--controller", "imc-s8")
    assert (done.returncode, done.stdout) == (2, "")
    assert "name the jobs that are to move the machine" in done.stderr


def test_a_folder_that_may_not_be_read_is_an_error_of_it(shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed, scanned = os.listdir, os.scandir

    def denied(made: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def list_(path: Any) -> Any:
            if Path(path).name == "sub":
                raise PermissionError(13, "Permission denied", str(path))
            return made(path)

        return list_

    monkeypatch.setattr(os, "listdir", denied(listed))
    monkeypatch.setattr(os, "scandir", denied(scanned))
    done = isel_twin("check", "jobs", *PLANT)
    assert done.returncode == 1
    assert "jobs/sub: not read: Permission denied\n" in done.stdout
    assert "jobs/a.txt: ok" in done.stdout


def test_a_folder_is_not_watched_unless_it_has_one_job(shop: Path) -> None:
    done = isel_twin("check", "--watch", "jobs")
    assert done.returncode == 2
    assert "--watch: names one job" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to a group of processes")
def test_what_an_interruption_leaves_is_named_beside_what_cannot_be_read(shop: Path) -> None:
    (shop / "jobs" / "c.txt").write_text(
        "@07\n@0R7\n" + "@0A80,5000,0,30,0,30,0,30\n@0A-80,5000,0,30,0,30,0,30\n" * 5000
    )
    with forked.start("check", "jobs", *PLANT, "--junit", "out.xml", cwd=shop, start_new_session=True) as command:
        assert command.stdout is not None
        while not command.stdout.readline().startswith("jobs/b.nc: not read"):
            pass
        command.send_signal(signal.SIGINT)
        out, _ = command.communicate(timeout=forked.PATIENCE_S)
    assert command.returncode == 130
    assert out.splitlines()[-1] == "6 jobs: 1 not read, 4 not judged"
    suite = next(iter(junitparser.JUnitXml.fromfile("out.xml")))
    assert [case.name for case in suite if case.is_error] == ["b.nc", "c.txt", "gone.nc", "a.txt", "c.NC"]


def test_the_hooks_know_each_suffix_that_a_folder_has() -> None:
    hooks = yaml.safe_load((Path(__file__).parents[2] / ".pre-commit-hooks.yaml").read_text())
    for hook in hooks:
        (known,) = re.findall(r"\(([a-z|]+)\)\$$", hook["files"])
        assert {f".{word}" for word in known.split("|")} == job_suffixes()
        assert re.search(hook["files"], "shop/jobs/sub/a.nc")
