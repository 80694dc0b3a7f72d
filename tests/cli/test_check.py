"""`isel-twin check`: each rule broken once and kept once, bounds of projects, and what other programs read of it."""

from __future__ import annotations

import json
import re
import signal
import sys
from pathlib import Path
from typing import Any

import junitparser
import pytest

from isel_twin.cli import main
from isel_twin.jobs.checks import RULES
from tests import forked

pytestmark = pytest.mark.long(seconds=4)

HOME = "@07\n@0R7\n"
WELL = HOME + "@0M3200,3000,1600,3000,0,30,0,30\n"
SLIP = 32  # steps: four full steps of the motor, of eight each


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["check", *map(str, arguments)])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def write(folder: Path, text: str, name: str = "job.txt") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def found(capsys: pytest.CaptureFixture[str], job: Path, *options: object) -> list[tuple[str, int | None, str]]:
    """Rule, line and message of each finding; the exit code is theirs."""
    plant = () if "--plant" in options else ("--plant", "kinematic")
    code, out, err = call(capsys, job, "--json", *plant, *options)
    answer = json.loads(out)
    findings = answer["findings"]
    assert err == ""
    assert answer["ok"] == (code == 0) == all(each["level"] == "warning" for each in findings)
    return [(each["rule"], each["line"], each["message"]) for each in findings]


def rules(capsys: pytest.CaptureFixture[str], job: Path, *options: object) -> list[tuple[str, int | None]]:
    return [(rule, line) for rule, line, _ in found(capsys, job, *options)]


def test_nothing_is_wrong_with_a_job_that_is_well(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = call(capsys, write(tmp_path, WELL), "--plant", "kinematic")
    assert (code, err) == (0, "")
    assert out.startswith(f"{tmp_path / 'job.txt'}: ok (3 commands, ")
    assert "\n  not looked at: lost, halfway, margin, edge, deviation\n" in out
    assert out.endswith("1 job: all well as far as looked at\n")
    code, out, err = call(capsys, write(tmp_path, WELL), "--plant", "mujoco")
    assert (code, err) == (0, "")
    assert out.endswith("1 job: all well\n")
    assert "not looked at" not in out


@pytest.mark.parametrize(
    ("job", "options", "expected"),
    [
        (HOME + "@0Jfast\n", (), [("refused", 3)]),
        ("@0M1,500,1,500,0,30,0,30\n@07\n", (), [("refused", 1)]),
        (HOME + "@0P => 1\n", (), [("refused", 3)]),
        (HOME + "@0P => *\n", (), []),
        (WELL + "! x == 5 +- 0.1 mm\n", (), [("unmet", 4)]),
        (WELL + "! x == 10 +- 0.01 mm\n", (), []),
        (HOME + "@0A-3200,3000,0,30,0,30,0,30 => 2\n", (), [("switch", 3)]),
        (HOME + "@0A-3200,3000,0,30,0,30,0,30 => 2\n", ("--may-strike", "limit_x1"), []),
        (HOME + "@0A-3200,3000,0,30,0,30,0,30 => 2\n", ("--may-strike", "limit_y1"), [("switch", 3)]),
        (HOME + "@0A-3200,3000,0,30,0,30,0,30 => 2\n", ("--may-strike", "all"), []),
        (HOME + "@0A-3200,3000,0,30,0,30,0,30 => 2\n! limit_x1 == struck\n", (), []),
        (HOME + "@0A-3200,3000,0,30,0,30,0,30 => 2\n! limit_x2 == free\n", (), [("switch", 3)]),
        (WELL, ("--cycle-s", "30"), [("cycle", 3)]),
        (WELL, ("--cycle-s", "40"), []),
        (WELL, ("--deviation-mm", "0.001"), [("effect", None)]),  # without physics the carriage follows the counter
        (WELL, ("--margin", "0.5"), [("effect", None)]),  # and nothing is known of margins
    ],
)
def test_rules_that_need_no_physics(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    job: str,
    options: tuple[str, ...],
    expected: list[tuple[str, int | None]],
) -> None:
    assert rules(capsys, write(tmp_path, job), *options) == expected


def test_a_command_that_is_not_over_in_time_ends_the_job(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = write(tmp_path, WELL + "@0P\n")
    findings = found(capsys, job, "--timeout", "5")
    assert [(rule, line) for rule, line, _ in findings] == [("unfinished", 2), ("unfinished", 2)]
    assert "no complete reply within 5 s" in findings[0][2]
    assert "2 lines are not sent" in findings[1][2]


def test_events_that_come_too_late_are_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = write(tmp_path, '[[event]]\nat = 500\nset = { hood = "open" }\n', "late.toml")
    assert rules(capsys, write(tmp_path, WELL), "--scenario", scenario) == [("effect", None)]
    assert call(capsys, tmp_path / "job.txt", "--plant", "kinematic", "--scenario", scenario)[0] == 0


def test_physics_loses_steps_keeps_margins_and_tolerances(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ramps that no motor follows: all of it is wrong in the line that does it. A slow move keeps all of them."""
    fast = write(tmp_path, HOME + "@0j4000\n@0J4000\n@0M9600,30000,0,30,0,30,0,30\n@0P\n", "fast.txt")
    bounds = ("--plant", "mujoco", "--margin", "0.2", "--deviation-mm", "0.5")
    findings = found(capsys, fast, *bounds)
    assert {(rule, line) for rule, line, _ in findings if line == 5} == {("lost", 5), ("margin", 5), ("deviation", 5)}
    (lost,) = (message for rule, _, message in findings if rule == "lost")
    found_lost = re.fullmatch(r"x has lost (\d+) steps", lost)
    assert found_lost is not None
    assert int(found_lost[1]) % SLIP == 0  # no load angle, as in the verdict
    assert rules(capsys, write(tmp_path, WELL, "slow.txt"), *bounds) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to a group of processes")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("workers", [1, 2])
def test_what_was_judged_before_an_interruption_is_in_the_files(
    tmp_path: Path, number: int, code: int, workers: int
) -> None:
    """As when CI ends a job that takes too long. The job that was not judged is an error: nothing is green unearned."""
    write(tmp_path, HOME + "@0Q\n", "bad.txt")
    write(tmp_path, HOME + "@0A80,5000,0,30,0,30,0,30\n@0A-80,5000,0,30,0,30,0,30\n" * 5_000, "endless.txt")
    words = ("bad.txt", "endless.txt", "--plant", "kinematic", "--workers", str(workers))
    files = ("--junit", "out.xml", "--sarif", "out.sarif")
    with forked.start("check", *words, *files, cwd=tmp_path, start_new_session=True) as command:
        assert command.stdout is not None
        assert command.stdout.readline().startswith("bad.txt: failed")
        command.send_signal(number)
        out, err = command.communicate(timeout=forked.PATIENCE_S)
    assert (command.returncode, err) == (code, "isel-twin: interrupted: 1 of 2 jobs judged\n")
    assert out.splitlines()[-1] == "2 jobs: 1 failed, 1 not judged"
    suite = next(iter(junitparser.JUnitXml.fromfile(str(tmp_path / "out.xml"))))
    assert [(case.name, case.is_failure, case.is_error) for case in suite] == [
        ("bad.txt", True, False),
        ("endless.txt", False, True),
    ]
    assert (suite.tests, suite.failures, suite.errors) == (2, 1, 1)
    (run,) = json.loads((tmp_path / "out.sarif").read_text())["runs"]
    (told,) = run["invocations"]
    assert [result["ruleId"] for result in run["results"]] == ["refused"]
    assert told["executionSuccessful"] is False
    assert [note["level"] for note in told["toolExecutionNotifications"]] == ["note", "error"]


def test_a_job_that_works_by_luck(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """60 mm back from where the machine happens to stand: from some places that ends at a switch."""
    job = write(tmp_path, "@07\n@0N7\n@0A-19200,9000,0,30,0,30,0,30 => *\n! x < -59 mm\n")
    told = found(capsys, job, "--robust", "12", "--may-strike", "all")
    (luck,) = (message for rule, _, message in told if rule == "luck")
    assert "of 12 repetitions end differently: number " in luck
    assert rules(capsys, write(tmp_path, WELL, "well.txt"), "--robust", "3") == []


def test_golden_runs_are_compared_where_there_are_any(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = write(tmp_path, WELL)
    with pytest.raises(SystemExit):
        main(["golden", "record", str(job), "--plant", "kinematic"])
    assert capsys.readouterr().err == ""
    assert rules(capsys, job) == []
    job.write_text(WELL.replace("3200,3000", "3200,2900"))
    assert {rule for rule, _ in rules(capsys, job)} == {"golden"}
    assert rules(capsys, job, "--no-golden") == []
    job.with_suffix(".golden").unlink()
    code, _, err = call(capsys, job, "--golden", "--plant", "kinematic")
    assert code == 2
    assert "there is no golden run of" in err


def test_bounds_of_a_project_are_found_above_a_job(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(
        tmp_path,
        '[check]\nplant = "kinematic"\ncycle_s = 1.0\n[[check.job]]\nmatch = "slow/*"\ncycle_s = "off"\n'
        '[[check.job]]\nmatch = "slow/b*.txt"\nmay_strike = ["all"]\nscenario = "hood.toml"\n',
        "isel-twin.toml",
    )
    write(tmp_path, '[[event]]\nat = 900\nset = { hood = "open" }\n', "hood.toml")
    for name in ("a.txt", "slow/a.txt", "slow/b.txt"):
        write(tmp_path, WELL, name)
    jobs = [tmp_path / name for name in ("a.txt", "slow/a.txt", "slow/b.txt")]
    code, out, _ = call(capsys, *jobs, "--json")
    answers = [json.loads(line) for line in out.splitlines()]
    assert code == 1
    assert [[each["rule"] for each in answer["findings"]] for answer in answers] == [["cycle"], [], ["effect"]]
    assert [answer["job"] for answer in answers] == [str(job) for job in jobs]
    assert call(capsys, jobs[0], "--cycle-s", "100")[0] == 0  # an option has the last word
    nearer = write(tmp_path / "slow", '[check]\nplant = "kinematic"\ncycle_s = 2.0\n', "isel-twin.toml")
    assert call(capsys, jobs[1])[0] == 1
    nearer.unlink()
    assert call(capsys, jobs[1])[0] == 0


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("[check]\nmargn = 0.2\n", "isel-twin.toml:2: check.margn: unknown key; did you mean 'margin'?"),
        ("[check]\nmargin = 2\n", "check.margin: 2; allowed: 0 .. 1"),
        ("[check]\nmargin = 'much'\n", "check.margin: 'much'; allowed: 0 .. 1"),
        ("[check]\nseed = 1.5\n", "check.seed: 1.5; allowed: a whole number"),
        ("[check]\nmay_strike = 'all'\n", "check.may_strike: 'all'; allowed: a list"),
        ("[check]\ngolden = 1\n", "check.golden: 1; allowed: true, false"),
        (
            "[check]\n\nmachine = '4031'\n",
            "isel-twin.toml:3: check.machine: '4031'; allowed: a folder with",
        ),
        ("[check]\ncontroller = 'imc-s9'\n", "isel-twin.toml:2: check.controller: 'imc-s9'; allowed: bwo900, c142,"),
        ("[[check.job]]\nmatch = '*'\nplant = 'sand'\n", "check.job 1.plant: 'sand'; allowed: mujoco, kinematic"),
        ("[[check.job]]\ncycle_s = 1\n", "check.job 1.match: missing"),
        ("[chek]\n", "chek: unknown key"),
        ("check = 1\n", "check: 1; allowed: a table"),
        ("[check\n", "not a TOML file"),
    ],
)
def test_wrong_bounds_are_one_line(tmp_path: Path, text: str, error: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, text, "isel-twin.toml")
    code, out, err = call(capsys, write(tmp_path, WELL))
    assert (code, out) == (2, "")
    assert error in err
    assert "isel-twin.toml" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("name", ["ours", "ours/machine.toml", "./ours"])
def test_a_machine_stands_where_the_settings_file_sees_it(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From whatever folder the jobs are checked."""
    write(tmp_path, 'based_on = "4030"\nname = "ours"\n', "shop/ours/machine.toml")
    write(tmp_path, f"[check]\nplant = 'kinematic'\nmachine = '{name}'\n", "shop/isel-twin.toml")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    code, out, _ = call(capsys, write(tmp_path, WELL, "shop/job.txt"), "--json")
    assert (code, json.loads(out)["ok"]) == (0, True)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ((), "name the jobs"),
        (("none.txt",), "none.txt: there is no such file"),
        (("empty.txt",), "empty.txt: there is no command in it"),
        (("binary.txt",), "binary.txt: line 1, column 1: the file is no text, or UTF-16"),
        (("long.txt",), "long.txt: is longer than 16 MiB; cut it into several"),
        (("-",), "bounds stand beside a job"),
        (("job.txt", "--margin", "2"), "--margin 2: must be from 0 to 1"),
        (("job.txt", "--deviation-mm", "nan"), "--deviation-mm nan: must be"),
        (("job.txt", "--cycle-s", "-1"), "--cycle-s -1: must be a time"),
        (("job.txt", "--robust", "-1"), "--robust -1: must be"),
        (("job.txt", "--robust", "1000000000"), "--robust 1000000000: must be a number of repetitions up to 10000"),
        (("job.txt", "--workers", "0"), "--workers 0: must be"),
        (("job.txt", "--may-strike", "limit_q"), "may-strike limit_q: is no end switch; there are:"),
        (("job.txt", "--settings", "none.toml"), "none.toml: there is no such file"),
        (("job.txt", "--machine", "4O30"), "unknown machine '4O30'"),
        (("job.txt", "--junit", "job.txt"), "--junit job.txt: the name must end in .xml"),
        (("job.txt", "--sarif", "none/x.sarif"), "cannot write in folder"),
        (("names.txt", "--plant", "kinematic"), "names.txt: line 3"),
    ],
)
def test_a_call_that_cannot_be_is_one_line_and_nothing_is_begun(
    tmp_path: Path,
    arguments: tuple[str, ...],
    error: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, WELL)
    write(tmp_path, "# nothing\n", "empty.txt")
    write(tmp_path, HOME + "! spindel == 1\n", "names.txt")
    (tmp_path / "binary.txt").write_bytes(bytes(range(256)))
    with (tmp_path / "long.txt").open("wb") as file:
        file.truncate(100_000_000)
    before = {path: path.stat() for path in tmp_path.iterdir()}
    code, out, err = call(capsys, *arguments)
    assert (code, out) == (2, "")
    assert error in err.splitlines()[0]
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == {
        path.name: stat.st_mtime_ns for path, stat in before.items()
    }


ODD = "@07\n@0R7\n@0Q<1><2><13>\n@0A-3200,3000,0,30,0,30,0,30\n"
"""A refusal, bytes that XML does not have, a switch."""


def written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    """JUnit and SARIF of a job that is well and one that is not."""
    junit, sarif = tmp_path / "out.xml", tmp_path / "out.sarif"
    jobs = (write(tmp_path, WELL, "well.txt"), write(tmp_path, ODD, 'odd "&<.txt'))
    assert call(capsys, *jobs, "--plant", "kinematic", "--junit", junit, "--sarif", sarif)[0] == 1
    return junit.read_text(), sarif.read_text()


def test_an_independent_reader_reads_the_junit_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    suites = junitparser.JUnitXml.fromstring(written(tmp_path, capsys)[0].encode())
    (suite,) = suites
    assert (suite.tests, suite.failures, suite.errors, suite.skipped) == (2, 1, 0, 0)
    well, odd = suite
    assert (well.name, well.is_passed, odd.is_failure) == ("well.txt", True, True)
    assert odd.name == 'odd "&<.txt'
    assert well.time == pytest.approx(33.7, abs=3)
    (failure,) = odd.result
    assert failure.type == "refused"
    assert "limit_x1 is struck (line 4, at " in failure.text


def test_the_sarif_file_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from sarif_pydantic import Sarif

    text = written(tmp_path, capsys)[1]
    log = Sarif.model_validate_json(text)
    (run,) = log.runs
    assert [rule.id for rule in run.tool.driver.rules] == list(RULES)
    content: dict[str, Any] = json.loads(text)
    results = content["runs"][0]["results"]
    places = [result["locations"][0]["physicalLocation"] for result in results]
    assert [(each["ruleId"], place["region"]["startLine"]) for each, place in zip(results, places, strict=True)] == [
        ("refused", 3),
        ("refused", 4),
        ("switch", 4),
        ("fault", 4),
    ]
    assert all(place["artifactLocation"]["uri"].endswith("odd%20%22%26%3C.txt") for place in places)
    assert all(list(RULES)[each["ruleIndex"]] == each["ruleId"] for each in results)


def test_annotations_where_the_runner_reads_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    job = write(tmp_path, ODD, "a,b.txt")
    monkeypatch.chdir(tmp_path)
    assert "::error" not in call(capsys, "a,b.txt", "--plant", "kinematic")[1]
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    out = call(capsys, job.name, "--plant", "kinematic")[1]
    assert "::error file=a%2Cb.txt,line=4,title=isel-twin switch::limit_x1 is struck\n" in out


def test_processes_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jobs = [write(tmp_path, text, f"{n}.txt") for n, text in enumerate((WELL, ODD, HOME))]
    one = call(capsys, *jobs, "--plant", "kinematic", "--json")
    assert call(capsys, *jobs, "--plant", "kinematic", "--json", "--workers", "2") == one


def test_many_findings_of_a_rule_are_told_in_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    findings = found(capsys, write(tmp_path, "@07\n" + "@0J0\n" * 100))
    assert len(findings) == 21
    assert findings[-1] == ("refused", None, "and 80 more of the same")


def test_each_job_has_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jobs = write(tmp_path, WELL), write(tmp_path, HOME + "@0A99999999,3000,0,30,0,30,0,30\n", "other/job.txt")
    pages = tmp_path / "pages"
    plain = call(capsys, *jobs, "--plant", "kinematic", "--cycle-s", "1")
    told = call(capsys, *jobs, "--plant", "kinematic", "--cycle-s", "1", "--report", pages, "--workers", "2")
    assert plain == told
    assert sorted(path.name for path in pages.iterdir()) == ["job-2.html", "job.html"]
    first, second = ((pages / name).read_text() for name in ("job.html", "job-2.html"))
    assert "at most 1 s" in first
    assert "id='finding-1'" in first
    assert "id='finding-2'" not in first
    assert "id='finding-2'" in second
    (tmp_path / "file").write_text("")
    assert call(capsys, *jobs, "--report", tmp_path / "file")[0] == 2


def test_a_page_says_what_the_golden_run_did_otherwise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = write(tmp_path, WELL)
    with pytest.raises(SystemExit):
        main(["golden", "record", str(job), "--plant", "kinematic"])
    call(capsys, job, "--plant", "kinematic", "--report", tmp_path)
    assert "The job does what it did" in (tmp_path / "job.html").read_text()
    write(tmp_path, WELL.replace("@0M3200,3000", "@0M3200,2900"))
    for command, report in (("check", tmp_path), ("run", tmp_path / "job.html")):
        with pytest.raises(SystemExit):
            main([command, str(job), "--report", str(report), "--plant", "kinematic"])
        page = (tmp_path / "job.html").read_text()
        assert "Compared with the golden run" in page
        assert "line-3" in page
        assert "@0M3200,2900,1600,3000,0,30,0,30" in page


def test_one_file_that_cannot_be_written_costs_no_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job, sarif = write(tmp_path, WELL), tmp_path / "found.sarif"
    code, out, err = call(capsys, job, "--plant", "kinematic", "--junit", "/dev/full", "--sarif", sarif)
    assert (code, err) == (2, "isel-twin: /dev/full: No space left on device\n")
    assert "1 job: all well as far as looked at" in out
    assert json.loads(sarif.read_text())["version"] == "2.1.0"


def test_pages_need_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = write(tmp_path, WELL)
    code, _, err = call(capsys, job, "--plant", "kinematic", "--report", job)
    assert (code, err) == (2, f"isel-twin: {job}: is a file; name a folder for the pages\n")
