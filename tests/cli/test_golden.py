"""`isel-twin golden`: a run written down, what is said of one that does something else, and calls that cannot be."""

from __future__ import annotations

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.jobs.golden import Golden, Move, differences, dumps, load

JOB = """# out and back
@07
@0R7
@0M3000,3000,700,2000,0,30,0,30
@0P
@0M0,3000,0,3000,0,30,0,30
"""


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["golden", *map(str, arguments)])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


@pytest.fixture
def job(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A job with its golden run beside it."""
    path = tmp_path / "job.txt"
    path.write_text(JOB)
    assert call(capsys, "record", path, "--plant", "kinematic")[0] == 0
    return path


def change(job: Path, old: str, new: str) -> None:
    assert old in job.read_text()
    job.write_text(job.read_text().replace(old, new))


def told(capsys: pytest.CaptureFixture[str], job: Path, *options: object) -> list[tuple[int | None, str]]:
    """Line and text of every difference."""
    code, out, err = call(capsys, "compare", job, "--json", *options)
    answer = json.loads(out)
    assert err == ""
    assert answer["same"] == (not answer["differences"]) == (code == 0)
    return [(difference["line"], difference["what"]) for difference in answer["differences"]]


def test_the_file_says_what_each_command_did(job: Path) -> None:
    content = tomllib.loads(job.with_suffix(".golden").read_text())
    assert {key: content[key] for key in ("job", "machine", "controller", "plant", "seed")} == {
        "job": "job.txt", "machine": "4030", "controller": "imc-s8", "plant": "kinematic", "seed": 0,
    }  # fmt: skip
    lines = content["lines"]
    assert [line["line"] for line in lines] == [2, 3, 4, 5, 6]
    assert [line["reply"] for line in lines] == ["0", "0", "0", "0000BB80002BC000000", "0"]
    assert lines[2]["counts"] == [3000, 700, 0, 0]
    assert lines[2]["ticks"] == [3000, 700, 0, 0]
    assert "windows" not in lines[0]
    assert "windows" not in lines[3]
    assert content["end"]["counts"] == [0, 0, 0, 0]
    assert content["end"]["ok"] is True


def test_digests_are_those_of_the_stream(job: Path) -> None:
    twin = Twin(plant="kinematic")
    for command in ("@07", "@0R7"):
        twin.query(command)
    before, sent_ns = len(twin.steps), twin.time_ns
    twin.query("@0M3000,3000,700,2000,0,30,0,30")
    t_ns, delta = twin.steps.t_ns[before:] - sent_ns, twin.steps.delta[before:].astype("<i4")
    line = tomllib.loads(job.with_suffix(".golden").read_text())["lines"][2]
    windows = [
        hashlib.sha256(t_ns[k : k + 500].astype("<i8").tobytes() + delta[k : k + 500].tobytes()).hexdigest()[:6]
        for k in range(0, 3000, 500)
    ]
    assert line["windows"].split() == windows
    y = np.flatnonzero(delta[:, 1])
    assert line["axes"].split()[1] == hashlib.sha256(t_ns[y].tobytes() + delta[y, 1].tobytes()).hexdigest()[:6]
    assert line["axes"].split()[2:] == ["-", "-"]


def test_the_same_again_is_the_same(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = call(capsys, "compare", job)
    assert (code, err) == (0, "")
    assert "unchanged (5 commands" in out


def test_with_physics_as_well(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "short.txt"
    job.write_text("@07\n@0M40,500,0,30,0,30,0,30\n")  # refused before a reference run: still a run
    assert call(capsys, "record", job)[0] == 0
    assert call(capsys, "compare", job)[0] == 0
    assert tomllib.loads(job.with_suffix(".golden").read_text())["end"]["ok"] is False


def test_a_slower_command_is_found_where_it_begins_to_differ(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change(job, "@0M3000,3000,700,2000", "@0M3000,2900,700,2000")
    found = told(capsys, job)
    assert [line for line, _ in found] == [4, 4, 4, None]  # nothing of line 6, which is as it was
    (sent, time, stream, cycle) = [what for _, what in found]
    assert sent == "sent @0M3000,3000,700,2000,0,30,0,30 -> @0M3000,2900,700,2000,0,30,0,30"
    assert "s (+" in time
    assert cycle.startswith("cycle time ")
    assert "%" in cycle
    assert "x at other times, y at other times" in stream
    begin_s, end_s = (float(word) for word in stream.split("from ")[1].split(" s ")[0].split(" to "))
    twin = Twin(plant="kinematic")
    for command in ("@07", "@0R7"):
        twin.query(command)
    sent_ns, streams = twin.time_ns, []
    for speed in (3000, 2900):
        before = len(twin.steps)
        sent_ns = twin.time_ns
        twin.query(f"@0M3000,{speed},700,2000,0,30,0,30")
        streams.append(twin.steps.t_ns[before:] - sent_ns)
        twin.query("@0M0,3000,0,3000,0,30,0,30")
    first_ns = streams[1][np.flatnonzero(streams[0] != streams[1])[0]]
    assert begin_s <= first_ns / 1e9 + 1e-6
    assert first_ns / 1e9 <= end_s + 1e-6


def test_an_axis_that_goes_elsewhere_is_named(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change(job, "3000,3000,700,2000", "3000,3000,690,2000")
    texts = [what for _, what in told(capsys, job)]
    assert any("y 700 -> 690 ticks" in text and "x " not in text.split(": ")[-1] for text in texts)
    assert any("counters 3000 700 0 0 -> 3000 690 0 0" in text for text in texts)
    assert any("reply '0000BB80002BC000000' -> '0000BB80002B2000000'" in text for text in texts)


def test_lines_that_come_and_go(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = job.read_text()
    job.write_text(text + "@0P\n")
    assert (7, "@0P: is new") in told(capsys, job)
    job.write_text("".join(text.splitlines(keepends=True)[:-1]))
    assert (6, "@0M0,3000,0,3000,0,30,0,30: no longer sent") in told(capsys, job)


def test_comments_and_empty_lines_change_nothing(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job.write_text("# another comment\n\n" + job.read_text())
    assert told(capsys, job) == []


def test_another_machine_is_a_difference_that_is_named(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (None, "machine: 4030 -> traverse") in told(capsys, job, "--machine", "traverse")


def test_another_name_of_the_job_is_no_difference(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = job.rename(job.with_name("other.txt"))
    job.with_suffix(".golden").rename(other.with_suffix(".golden"))
    assert told(capsys, other) == []


def test_update_writes_down_what_is_different_and_leaves_the_rest(
    job: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    golden = job.with_suffix(".golden")
    before = golden.read_text().splitlines()
    change(job, "@0M0,3000,0,3000", "@0M0,2000,0,3000")
    assert call(capsys, "compare", job, "--replace")[0] == 0
    after = golden.read_text().splitlines()
    changed = [new for old, new in zip(before, after, strict=True) if old != new]
    assert [line.strip().partition(",")[0].partition(" = 1")[0] for line in changed[:1]] == ["{ line = 6"]
    assert [line.partition(" ")[0] for line in changed[1:]] == ["cycle_s"]
    stat = golden.stat().st_mtime_ns
    assert call(capsys, "compare", job, "--replace")[0] == 0
    assert golden.stat().st_mtime_ns == stat


def test_several_jobs_and_the_exit_code_is_of_all(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = job.with_name("other.txt")
    other.write_text("@07\n")
    assert call(capsys, "record", other, "--plant", "kinematic")[0] == 0
    change(job, "@0P\n", "")
    code, out, _ = call(capsys, "compare", job, other)
    assert code == 1
    assert "other.txt: unchanged (1 command, 0.000 s, ok)" in out


def test_a_machine_and_a_scenario_of_ones_own_are_found_from_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    job, scenario = tmp_path / "job.txt", tmp_path / "later.toml"
    job.write_text(JOB)
    scenario.write_text('[[event]]\nat = 0.5\nset = { estop = "pressed" }\n')
    monkeypatch.chdir(tmp_path)
    assert call(capsys, "record", "job.txt", "--plant", "kinematic", "--scenario", "later.toml")[0] == 0
    assert 'scenario = "later.toml"' in job.with_suffix(".golden").read_text()
    monkeypatch.chdir("/")
    assert call(capsys, "compare", job)[0] == 0
    scenario.unlink()
    code, _, err = call(capsys, "compare", job)
    assert code == 2
    assert "later.toml: there is no such file" in err


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("compare",), "name the jobs"),
        (("compare", "none.txt"), "none.txt: there is no such file"),
        (("compare", "new.txt"), "new.golden: there is no golden run of new.txt; isel-twin golden record new.txt"),
        (("compare", "-"), "a golden run stands beside its job"),
        (("compare", "job.golden"), "job.golden: is a golden run, not a job"),
        (("record", "job.txt"), "job.golden: is there already; --replace replaces it"),
        (("record", "new.txt", "--machine", "4o3o"), "unknown machine '4o3o'"),
        (("record", "empty.txt"), "empty.txt: there is no command in it"),
        (("compare", "job.txt", "--timeout", "-1"), "--timeout -1: must be a time"),
    ],
)
def test_a_call_that_cannot_be_is_one_line_and_changes_nothing(
    job: Path,
    arguments: tuple[str, ...],
    error: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(job.parent)
    job.with_name("new.txt").write_text(JOB)
    job.with_name("empty.txt").write_text("# nothing\n")
    before = {path: path.read_bytes() for path in job.parent.iterdir()}
    code, out, err = call(capsys, *arguments)
    assert (code, out) == (2, "")
    assert error in err
    assert err.count("\n") == 1
    assert {path: path.read_bytes() for path in job.parent.iterdir()} == before


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("format = 1", "format = 2", "format: 2; allowed: 1"),
        ("format = 1\n", "", "format: missing; this is no golden file"),
        ("seed = 0", 'seed = "a"', "seed: 'a'; must be int"),
        ('plant = "kinematic"', 'pland = "kinematic"', "pland: unknown key; did you mean 'plant'?"),
        ("{ line = 2,", "{ line = true,", "lines 1.line: True; must be int"),
        ('took_s = "0.000000000"', 'took_s = "soon"', "lines 1.took_s: 'soon'; must be a time in s"),
        ("counts = [0, 0, 0, 0] }", 'counts = ["x"] }', "must be list"),
        ("format = 1", "format = 1\n\x01", "not a TOML file"),
    ],
)
def test_a_golden_file_that_is_wrong_is_one_line(
    job: Path, old: str, new: str, error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    golden = job.with_suffix(".golden")
    assert old in golden.read_text()
    golden.write_text(golden.read_text().replace(old, new, 1))
    before = golden.read_bytes()
    code, out, err = call(capsys, "compare", job, "--replace")
    assert (code, out) == (2, "")
    assert error in err
    assert str(golden) in err
    assert err.count("\n") == 1
    assert golden.read_bytes() == before


TEXT = st.text(st.characters(codec="utf-8"), max_size=20)
MOVES = st.builds(
    Move,
    line=st.integers(1, 10**6),
    sent=TEXT,
    reply=TEXT,
    took_ns=st.integers(0, 10**14),
    counts=st.tuples(st.integers(), st.integers()),
)
END: dict[str, Any] = {"ok": True, "cycle_s": 1.5, "counts": [1], "position_mm": [0.1], "lost_steps": [0]}


@settings(deadline=None)
@given(st.lists(MOVES, max_size=4))
def test_what_is_written_is_what_is_read(tmp_path_factory: pytest.TempPathFactory, moves: list[Move]) -> None:
    head = {"job": "j", "machine": "4030", "controller": "imc-s8", "plant": "kinematic", "seed": 3}
    run = Golden(head, tuple(moves), END)
    path = tmp_path_factory.mktemp("golden") / "x.golden"
    path.write_text(dumps(run), encoding="utf-8", newline="")
    assert load(path) == run
    assert list(differences(load(path), run)) == []
