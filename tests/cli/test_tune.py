"""`isel-twin tune`: from a job to its faster self, by the command line."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from isel_twin.cli import main
from isel_twin.cli.tune_output import Table
from tests.near import COARSE, near_switches

pytestmark = pytest.mark.long(seconds=10)

JOB = """@07
@0d5000,5000,5000
@0R7
@0M9600,9000,0,30,0,30,0,30    # a rapid way
@0A320,1000,0,30,0,30,0,30
@0M0,9000,0,30,0,30,0,30
"""
SMALL = ("--trials", "12", "--robust", "1", "--confirm", "3", "--acceleration", "100:400", "--start-stop", "300")


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its stages are known: one repetition says nothing of others."""
    return near_switches(tmp_path_factory.mktemp("near"), 2.0, more=f'{COARSE}[axes.all.stage]\nkind = "fast"\n')


@pytest.fixture
def tune(near: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Any:
    """tune(words...) -> exit code, standard output, standard error; in a folder with `job.txt`."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.txt").write_text(JOB)

    def call(*words: str) -> tuple[int, str, str]:
        machine = () if "--machine" in words else ("--machine", str(near))
        with pytest.raises(SystemExit) as caught:
            main([*words, *machine])
        assert isinstance(caught.value.code, int)
        said = capsys.readouterr()
        return caught.value.code, said.out, said.err

    return call


def test_a_setting_is_judged_on_what_this_machine_may_be(tune: Any, tmp_path: Path) -> None:
    few = ("--trials", "1", "--robust", "0", "--confirm", "1", "--margin", "0", "--acceleration", "100")
    (tmp_path / "job.txt").write_text("@07\n@0R7\n@0M1600,5000,0,30,0,30,0,30\n")
    code, out, _ = tune("tune", "job.txt", *few, "--uncertain", "2", "--json")
    *_, trial, summary = map(json.loads, out.splitlines())
    assert code == 0
    assert trial["repetitions"] == 3  # as it is, and twice as it may be
    assert 0.0 < trial["torque"][1] < trial["torque"][0] < 1.0, "and with motors as weak as their bands say"
    time, margin = summary["uncertain"]
    assert (time["what"], margin["what"]) == ("time", "margin")
    assert margin["low"] < margin["high"]
    code, _, err = tune("tune", "job.txt", *few, "--uncertain", "3")
    assert (code, "of another number of machines that it may be" in err) == (2, True)


@pytest.mark.slow
def test_the_tuned_job_is_faster_and_holds(tune: Any, tmp_path: Path) -> None:
    code, out, err = tune("tune", "job.txt", *SMALL, "--picture", "front.svg")
    assert (code, err) == (0, "")
    assert "3 new machines" in out
    assert " % where motors are as weak as their bands say" in out
    assert "to keep its ramps in the controller, send: @0IL  @0Ij300  @0IJ" in out
    assert (tmp_path / "front.svg").read_text().startswith("<?xml")
    assert {path.name for path in tmp_path.iterdir()} == {
        "job.txt", "job.tuned.txt", "job.permanent.txt", "job.tune.db", "front.svg"
    }  # fmt: skip
    text = (tmp_path / "job.tuned.txt").read_text()
    assert "@0A320,1000,0,30,0,30,0,30\n" in text, "a feed"
    assert "# a rapid way" in text
    assert tune("run", "job.tuned.txt", "--robust", "3", "--seed", "9")[0] == 0
    assert tune("run", "job.permanent.txt", "--plant", "kinematic", "--flash", "f.bin")[0] == 0

    # once more: nothing is tried again, and it is the same
    code, told, _ = tune("tune", "job.txt", *SMALL, "--json", "--workers", "2")
    *trials, summary = map(json.loads, told.splitlines())
    assert code == 0
    assert [trial["trial"] for trial in trials] == list(range(len(trials)))
    assert 2 <= len(trials) <= 12
    assert summary["saved"] > 0.25
    assert summary["confirmed"]["lost"] == 0
    assert summary["confirmed"]["at_most"] == pytest.approx(1.0 - 0.05 ** (1 / 3), abs=1e-4)
    assert f"tuned: {summary['tuned']['time_s']:.3f} s, {100 * summary['saved']:.1f} % less" in out
    assert (tmp_path / "job.tuned.txt").read_text() == text

    # its database is of this job
    (tmp_path / "job.txt").write_text(JOB.replace("9000", "9500"))
    code, out, err = tune("tune", "job.txt", *SMALL)
    assert (code, out) == (2, "")
    assert err.startswith("isel-twin: job.tune.db: study 'tune' is of another job; choose another name or ")


def test_an_edge_that_is_asked_for_is_kept(tune: Any, tmp_path: Path) -> None:
    """A swing grows from some 22 800 Hz on, from less on machines with less supply: twice as far from it is at most
    11 500 Hz."""
    few = ("--trials", "6", "--robust", "0", "--confirm", "1", "--acceleration", "100", "--start-stop", "300")
    code, out, err = tune("tune", "job.txt", *few, "--margin", "0", "--edge", "2", "--json")
    assert (code, err) == (0, "")
    *_, summary = map(json.loads, out.splitlines())
    assert 9000 < summary["tuned"]["values"]["speed_hz"] <= 11_500
    code, out, _ = tune("run", "job.tuned.txt", "--json", "--plant", "mujoco")
    assert code == 0
    edges = [edge for line in map(json.loads, out.splitlines()[3:-1]) for edge in line["edge"] if edge]
    assert 2.0 <= min(edges) < 2.4


def test_ctrl_c_keeps_what_has_been_tried(tune: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried = Table.tried

    def interrupted(self: Table, one: Any) -> None:
        tried(self, one)
        if one.number == 1:
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(Table, "tried", interrupted)
        code, out, err = tune("tune", "job.txt", *SMALL)
    assert code == 130
    assert err == "isel-twin: job.txt: interrupted after 2 of 12 trials; the same command continues\n"
    assert " trial   time / s    saved   margin  settings" in out
    assert {path.name for path in tmp_path.iterdir()} == {"job.txt", "job.tune.db"}
    code, out, _ = tune("tune", "job.txt", "--trials", "3", *SMALL[2:])
    assert "continues after 2 trials" in out
    assert code == 0


def test_each_move_gets_its_own(tune: Any, tmp_path: Path) -> None:
    words = ("--each-move", "--trials", "5", "--robust", "0", "--confirm", "2", "--json")
    code, out, _ = tune("tune", "job.txt", *words)
    summary = json.loads(out.splitlines()[-1])
    assert code == 0
    assert len(summary["tuned"]["values"]) == 8
    assert summary["confirmed"]["lost"] == 0
    assert "@0A320,1000," in (tmp_path / "job.tuned.txt").read_text()


def test_where_nothing_holds_nothing_is_written(tune: Any, tmp_path: Path) -> None:
    code, _, err = tune("tune", "job.txt", *SMALL[2:], "--trials", "1", "--margin", "0.99")
    assert code == 1
    assert err == (
        "isel-twin: job.txt: no setting keeps the margin on all machines; a smaller --margin, or more --trials, may\n"
    )
    assert not (tmp_path / "job.tuned.txt").exists()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("-", "-: the tuned job stands beside the job; name a file"),
        ("missing.txt", "missing.txt: there is no such file"),
        ("job.txt --trials 0", "--trials 0: must be a whole number from 1"),
        ("job.txt --settle-mm 0", "--settle-mm 0: must be a distance up to 10, such as 0.01"),
        ("job.txt --confirm 0", "--confirm 0: must be a whole number from 1"),
        ("job.txt --margin 20", "--margin 20: must be from 0 to 1"),
        ("job.txt --cluster here", "--cluster 'here': must be the address of a dask scheduler, tcp://HOST:PORT"),
        (
            "job.txt --workers 1 --cluster tcp://a:1",
            "--workers and cluster: a cluster has its own workers; name one of the two",
        ),
        ("job.txt --speed fast", "--speed fast: must be LOW:HIGH, for example 5000:20000"),
        ("job.txt --speed 5:50000", "speed_hz 5:50000: imc-s8 takes 30 to 40000"),
        ("job.txt --storage nonsense://x", "nonsense://x: cannot be used as a storage: Can't load plugin: *"),
        ("job.txt --picture o.xyz", "--picture o.xyz: the name must end in .png, .svg or .pdf"),
        ("job.txt --out job.txt", "job.txt: is named twice in this call; choose another name for what is written"),
        ("job.txt --machine none", "unknown machine 'none'*"),
        ("none.txt", "there is no move in the job that settings could be brought to"),
        ("wrong.txt --storage w.db", "wrong.txt: line 2: *; a job has to run before it can be tuned: isel-twin run *"),
    ],
)
def test_what_cannot_be_done_is_told_in_a_line(tune: Any, tmp_path: Path, words: str, line: str) -> None:
    (tmp_path / "none.txt").write_text("@07\n@0R7\n")
    (tmp_path / "wrong.txt").write_text("@07\n@0M1,9000\n")
    code, out, err = tune("tune", *words.split())
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    said = err.removeprefix("isel-twin: ").rstrip("\n")
    begin, star, end = line.partition("*")
    if line.startswith("*"):
        assert end.rstrip("*") in said
    else:
        assert said.startswith(begin), said
        assert end.rstrip("*") in said if star else said == line
    assert not list(tmp_path.glob("*.tuned.txt"))


def test_one_of_a_thing_is_told_as_one(tune: Any, tmp_path: Path) -> None:
    (tmp_path / "one.txt").write_text("@07\n@0R7\n@0M1600,9000,0,30,0,30,0,30\n")
    ranges = ("--speed", "9000", "--start-stop", "300", "--acceleration", "100:110")
    _, out, _ = tune("tune", "one.txt", "--trials", "1", "--robust", "0", "--confirm", "1", *ranges)
    assert out.startswith("1 parameter for 1 move; ")
    assert " % on 1 new machine, " in out
