"""The table of a sweep: whole at any time, resumed after anything, the same bytes whoever made it."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

from isel_twin.base.errors import CallError
from isel_twin.cli import main
from isel_twin.many.studies.plan import load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import OUTCOMES
from isel_twin.many.studies.table import Table, journal_of, read_rows
from tests import forked
from tests.forked import PATIENCE_S
from tests.full_disk import full_disk

OUTCOME = {**dict.fromkeys(OUTCOMES), "ok": True, "cycle_s": 1.5}


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["sweep", *map(str, words)])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def made(capsys: pytest.CaptureFixture[str], *words: object) -> list[dict[str, Any]]:
    """Rows that a call has computed."""
    code, out, _ = run(capsys, *words, "--json", "--workers", 1)
    *rows, summary = map(json.loads, out.splitlines())
    assert (code, summary["summary"], summary["missing"]) == (0, True, 0)
    return rows


def change(plan: Path, old: str, new: str) -> None:
    text = plan.read_text(encoding="utf-8")
    assert old in text
    plan.write_text(text.replace(old, new), encoding="utf-8")


def test_a_finished_sweep_makes_nothing_anew(plans: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, file = plans / "small.toml", plans / "small.parquet"
    assert [row["row"] for row in made(capsys, plan)] == [1, 2, 3, 4, 5, 6, 7, 8]
    before = file.read_bytes()
    assert made(capsys, plan) == []
    assert file.read_bytes() == before
    assert sorted(path.name for path in plans.glob("*small*")) == ["small.parquet", "small.toml"]


def test_more_seeds_add_rows_and_give_the_table_of_a_new_sweep(plans: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = plans / "small.toml"
    made(capsys, plan)
    change(plan, "seeds = 2", "seeds = 3")
    assert [row["seed"] for row in made(capsys, plan)] == [2, 2, 2, 2]
    assert len(made(capsys, plan, "--out", plans / "new.parquet")) == 12
    assert (plans / "small.parquet").read_bytes() == (plans / "new.parquet").read_bytes()


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("small.toml", "speed = [2000, 5000]", "speed = [2000, 6000]"),
        ("small.toml", "start_mm = [2, 2, 2]", "start_mm = [2, 2, 3]"),
        ("job.txt", "8000", "8001"),
        ("stuck.toml", "at = 0.0", "at = 0.1"),
    ],
)
def test_a_plan_changed_meanwhile_is_refused_and_the_table_left(
    plans: Path, file: str, old: str, new: str, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, table = plans / "small.toml", plans / "small.parquet"
    read = load_plan(plan)
    with Table(table, read, points(read)) as begun:
        for point in points(read):
            begun.add(point, OUTCOME)
    before = table.read_bytes()
    change(plans / file, old, new)
    code, out, err = run(capsys, plan)
    strange = 4 if "6000" in new else 8
    told = (
        f"isel-twin: {table}: {strange} of 8 rows are not of this plan: job, machine, scenario, values or the version"
    )
    assert (code, out) == (2, "")
    assert err.startswith(told)
    assert err.count("\n") == 1
    assert table.read_bytes() == before


@pytest.mark.parametrize("content", [b"", b"no table", b"PAR1"])
def test_what_is_no_table_is_left_alone(plans: Path, content: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    (plans / "small.parquet").write_bytes(content)
    code, _, err = run(capsys, plans / "small.toml")
    assert (code, err) == (
        2,
        f"isel-twin: {plans / 'small.parquet'}: is no Parquet file; name another one with --out\n",
    )
    assert (plans / "small.parquet").read_bytes() == content


def test_a_torn_journal_costs_the_torn_row_only(plans: Path) -> None:
    read = load_plan(plans / "small.toml")
    wanted, file = points(read), plans / "t.parquet"
    with Table(file, read, wanted) as table:
        rows = [table.add(point, OUTCOME) for point in wanted[:2]]
    lost = dict(rows[0], row=3, point=wanted[2].id)
    journal_of(file).write_text("".join(json.dumps(row) + "\n" for row in (rows[1], lost)) + '{"row": 4, "po')
    with Table(file, read, wanted) as table:
        assert [point.number for point in table.missing()] == [4, 5, 6, 7, 8]
        table.add(wanted[3], OUTCOME)
    assert [row["row"] for row in read_rows(file)] == [1, 2, 3, 4]


def test_damaged_lines_of_a_journal_cost_their_rows_only_and_are_told_once(
    plans: Path, caplog: pytest.LogCaptureFixture
) -> None:
    read = load_plan(plans / "small.toml")
    wanted, file = points(read), plans / "t.parquet"
    with Table(file, read, wanted) as table:
        rows = [table.add(point, OUTCOME) for point in wanted[:2]]
    whole = dict(rows[0], row=3, point=wanted[2].id)
    damaged = [
        {}, [], 7, None, {"point": []}, {"point": wanted[3].id}, {**whole, "point": 4}, {**whole, "commands": "many"},
        {**whole, "cycle_s": []}, {"point": "of another program"}, {**whole, "commands": 10**30},
        {**whole, "cycle_s": 10**400}, {**whole, "commands": True}, {**whole, "reply": "\ud800"},
    ]  # fmt: skip
    lines = [json.dumps(row).encode() for row in (*damaged, whole)] + [b"\xff\xfe", b"[" * 9999, b""]
    journal_of(file).write_bytes(b"\n".join(lines))
    with Table(file, read, wanted) as table:
        assert [point.number for point in table.missing()] == [4, 5, 6, 7, 8]
    assert [record.getMessage() for record in caplog.records] == [
        f"{journal_of(file)}: 16 damaged lines are left out; their rows are computed again"
    ]
    assert {name: read_rows(file)[2][name] for name in OUTCOMES} == OUTCOME


def test_a_full_disk_names_the_table(plans: Path) -> None:
    read = load_plan(plans / "small.toml")
    wanted, file = points(read), plans / "t.parquet"
    with Table(file, read, wanted) as table:
        table.add(wanted[0], OUTCOME)
        with full_disk(), pytest.raises(CallError, match=f"^{file}: File too large$"):
            table.add(wanted[1], OUTCOME)
    assert [row["row"] for row in read_rows(file)] == [1, 2], "the disk had room again"


def test_files_as_they_are_after_each_row_hold_all_rows(plans: Path) -> None:
    """What a kill would leave: the journal has been emptied several times by then."""
    change(plans / "small.toml", "seeds = 2", "seeds = 20")
    read = load_plan(plans / "small.toml")
    wanted, file, copy = points(read), plans / "t.parquet", plans / "copy.parquet"
    waited = 0
    with Table(file, read, wanted) as table:
        for number, point in enumerate(wanted, 1):
            table.add(point, OUTCOME)
            shutil.copy(file, copy)
            shutil.copy(journal_of(file), journal_of(copy))
            waited = max(waited, number - len(read_rows(copy)))
            with Table(copy, read, wanted) as left:
                assert len(left.rows) == number
    assert 3 <= waited <= 5, "a sixteenth of eighty"


def test_names_of_files_are_no_content(plans: Path) -> None:
    """Neither that of the job nor where a machine stands."""
    (plans / "mine").mkdir()
    (plans / "mine" / "machine.toml").write_text('based_on = "4030"\nname = "mine"\n', encoding="utf-8")
    change(plans / "small.toml", 'job = "job.txt"', 'job = "job.txt"\nmachine = "mine"')
    before = [point.id for point in points(load_plan(plans / "small.toml"))]
    moved = plans.rename(plans.with_name("elsewhere"))
    (moved / "job.txt").rename(moved / "other.txt")
    change(moved / "small.toml", '"job.txt"', '"other.txt"')
    assert [point.id for point in points(load_plan(moved / "small.toml"))] == before
    assert Path(load_plan(moved / "small.toml").work.spec.machine_name).is_absolute(), (
        "whoever computes stands elsewhere"
    )


def test_a_terminal_shows_how_far_it_is_and_how_long_it_takes(
    plans: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    code, out, err = run(capsys, plans / "small.toml", "--workers", 1)
    assert code == 0
    assert "8 of 8 rows, 4 of 8 (50 %, 22 to 78 %) failed" in out
    assert re.search(r"rows, 4 failed .*8/8.*0:00:00", err), "all of them, and no time left"


def test_one_owner_at_a_time(plans: Path) -> None:
    read = load_plan(plans / "small.toml")
    with Table(plans / "t.parquet", read, points(read)), pytest.raises(CallError, match=r"t\.parquet: is in use"):
        Table(plans / "t.parquet", read, points(read))


def test_columns_say_what_they_are(plans: Path) -> None:
    import pyarrow.parquet as pq

    read = load_plan(plans / "small.toml")
    with Table(plans / "t.parquet", read, points(read)):
        schema = pq.read_schema(plans / "t.parquet")
    assert schema.metadata[b"plan"].decode() == read.text
    assert schema.field("speed").metadata[b"key"] == b"job.speed"
    assert schema.field("cycle_s").metadata[b"unit"] == b"s"
    assert all(schema.field(name).metadata[b"description"] for name in schema.names)


PLAN = """
[sweep]
job = "job.txt"
plant = "kinematic"
start_mm = [2, 2, 2]
seeds = 400

[job]
speed = [8000]
ramp = [100]
"""


def begun(plan: Path, *options: str) -> Any:
    return forked.start("sweep", plan, "--json", *options)


def test_a_kill_loses_no_row_and_readers_find_a_whole_file_at_any_time(plans: Path) -> None:
    import duckdb
    import polars

    plan, file = plans / "long.toml", plans / "long.parquet"
    plan.write_text(PLAN, encoding="utf-8")
    told = []
    with begun(plan, "--workers", "1") as process:
        assert process.stdout is not None
        for _ in range(20):
            told.append(json.loads(process.stdout.readline())["point"])
            polars.read_parquet(file.read_bytes())  # opened once: Polars opens a name twice, maybe two versions of it
        ((seen,),) = duckdb.sql(f"select count(*) from '{file}'").fetchall()
        process.kill()
    assert seen >= 19, "at most a sixteenth behind"
    read = load_plan(plan)
    with Table(file, read, points(read)) as table:
        assert set(told) <= table.rows.keys()
        assert len(table.missing()) == 400 - len(table.rows)
    ids = [row["point"] for row in read_rows(file)]
    assert len(ids) == len(set(ids)) >= 20


@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_ends_it_and_says_how_to_go_on(plans: Path, workers: str) -> None:
    plan, file = plans / "long.toml", plans / "long.parquet"
    plan.write_text(PLAN, encoding="utf-8")
    with begun(plan, "--workers", workers) as process:
        assert process.stdout is not None
        process.stdout.readline()
        os.kill(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    rows = read_rows(file)
    assert len(rows) < 400
    assert json.loads(out.splitlines()[-1])["rows"] == len(rows)
    assert err == (
        f"isel-twin: {file}: interrupted; {len(rows)} rows are in the table, {400 - len(rows)} are missing; "
        f"the same call goes on from there\n"
    )
    assert not journal_of(file).exists()
