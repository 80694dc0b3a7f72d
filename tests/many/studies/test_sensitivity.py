"""Sensitivity from rows: the known answers of a function of which one has the closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from isel_twin.cli import main
from isel_twin.many.studies.plan import Plan, load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import OUTCOMES
from isel_twin.many.studies.sensitivity import Index, indices
from isel_twin.many.studies.table import Table
from tests.many.studies.test_plan import plan

HEAD = '[sweep]\nmoves = [[1, 1, 1]]\nsamples = 1024\nsampling = "SAMPLING"\n[machine]\n'
RANGES = "".join(
    f'axes.{axis}.guide_friction = {{ low = 10, high = 50, unit = "N", name = "x{i}" }}\n'
    for i, axis in enumerate("xyz", 1)
)


def ishigami(x1: float, x2: float, x3: float) -> float:
    """sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1, x in -pi .. pi (T. Ishigami, T. Homma 1990)."""
    return math.sin(x1) + 7.0 * math.sin(x2) ** 2 + 0.1 * x3**4 * math.sin(x1)


FIRST = (0.3139, 0.4424, 0.0)
TOTAL = (0.5576, 0.4424, 0.2437)
"""Its indices, in closed form."""


def rows(read: Plan) -> list[dict[str, Any]]:
    """Rows whose duration is Ishigami's function of three parameters from 10 to 50."""
    found = []
    for point in points(read):
        x = [math.pi * (value - 30.0) / 20.0 for value in point.values[:3]]
        given = {p.name: value for p, value in zip(read.parameters, point.values, strict=True)}
        outcome = {**dict.fromkeys(OUTCOMES), "ok": True, "cycle_s": ishigami(*x)}
        found.append({"row": point.number, "point": point.id, "seed": point.seed, **given, **outcome})
    return found


def of(found: list[Index], outcome: str = "cycle_s") -> dict[str, Index]:
    return {index.parameter: index for index in found if index.outcome == outcome}


def test_first_order_of_whatever_rows(tmp_path: Path) -> None:
    read = load_plan(plan(tmp_path, HEAD.replace("SAMPLING", "sobol") + RANGES))
    found = indices(read, rows(read))
    assert {index.outcome for index in found} == {"cycle_s"}, "nothing else varies"
    for i, first in enumerate(FIRST, 1):
        assert of(found)[f"x{i}"].first == pytest.approx(first, abs=0.05)


def test_first_order_and_total_of_saltelli_samples(tmp_path: Path) -> None:
    read = load_plan(plan(tmp_path, HEAD.replace("SAMPLING", "saltelli") + RANGES))
    made = rows(read)
    made[7]["cycle_s"] = None  # a row without an outcome costs its sample and no more
    found = of(indices(read, made))
    for i, (first, total) in enumerate(zip(FIRST, TOTAL, strict=True), 1):
        assert found[f"x{i}"].first == pytest.approx(first, abs=0.06)
        assert found[f"x{i}"].total == pytest.approx(total, abs=0.06)


def test_values_of_a_grid_by_groups(tmp_path: Path) -> None:
    """y = a + 3 b, b in (0, 1): of four values 0 .. 3 a has a variance of 5/4, 3 b one of 9/4; c tells nothing."""
    text = HEAD.replace('samples = 1024\nsampling = "SAMPLING"\n', "seeds = 8\n").replace("[machine]", "[settings]")
    text += "speed_hz = [1000, 1001, 1002, 1003]\nstart_stop_hz = [100, 101]\nacceleration_hz_per_ms = [100, 101]\n"
    read = load_plan(plan(tmp_path, text))
    made = []
    for point in points(read):
        a, b, c = point.values[0] - 1000, point.values[1] - 100, point.values[2]
        given = {"speed_hz": point.values[0], "start_stop_hz": point.values[1], "acceleration_hz_per_ms": c}
        made.append({"point": point.id, **given, **dict.fromkeys(OUTCOMES), "ok": b == 0, "cycle_s": a + 3.0 * b})
    found = indices(read, made)
    assert of(found)["speed_hz"].first == pytest.approx(5.0 / 14.0, abs=0.02)
    assert of(found)["start_stop_hz"].first == pytest.approx(9.0 / 14.0, abs=0.02)
    assert of(found)["acceleration_hz_per_ms"].first == pytest.approx(0.0, abs=0.02)
    assert of(found, "ok")["start_stop_hz"].first == pytest.approx(1.0)


def test_the_command_draws_it(plans: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a table that is there already, by way / speed."""
    (plans / "job.txt").write_text("@07\n@0R7\n@0J{ramp}\n@0A{way},{speed},0,30,0,30,0,30\n", encoding="utf-8")
    text = '[sweep]\njob = "job.txt"\nplant = "kinematic"\nstart_mm = [2, 2, 2]\nsamples = 64\n[job]\n'
    text += "speed = { low = 300, high = 600 }\nway = { low = 1000, high = 1040, whole = true }\nramp = [100]\n"
    path, picture = plan(plans, text), plans / "what.png"
    read = load_plan(path)
    with Table(plans / "plan.parquet", read, points(read)) as table:
        for point in points(read):
            speed, way = point.values[:2]
            table.add(point, {**dict.fromkeys(OUTCOMES), "ok": True, "cycle_s": way / speed})
    with pytest.raises(SystemExit) as caught:
        main(["sweep", str(path), "--workers", "1", "--json", "--sensitivity", str(picture)])
    *_, summary, told = map(json.loads, capsys.readouterr().out.splitlines())
    assert (caught.value.code, summary["rows"]) == (0, 64)
    assert picture.read_bytes().startswith(b"\x89PNG")
    first = {index["parameter"]: index["first"] for index in told["sensitivity"]}
    assert first["speed"] > 0.9 > 0.1 > first["way"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("small.toml --sensitivity a.gif", "--sensitivity a.gif: the name must end in .png, .svg or .pdf"),
        ("small.toml --sensitivity a.png", "--sensitivity: 8 points tell too little; take 64 or more"),
        ("small.toml --workers 0", "--workers 0: must be a number of processes from 1"),
        ("small.toml --workers 1 --cluster tcp://a", "--workers and cluster: a cluster has its own workers; name one"),
        ("-", "-: a job stands beside its plan; name a file"),
        ("none.toml", "none.toml: there is no such file"),
        ("small.toml --out small.toml", "--out small.toml: the name must end in .parquet"),
    ],
)
def test_a_call_that_cannot_be_carried_out(
    plans: Path, words: str, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(plans)
    with pytest.raises(SystemExit) as caught:
        main(["sweep", *words.split()])
    assert caught.value.code == 2
    assert f"isel-twin: {line}" in capsys.readouterr().err
    assert not list(plans.glob("*.parquet"))
