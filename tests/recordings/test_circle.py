"""The circle of the manual in every kind of trace: what a reader that knows nothing of the twin finds in them.

Source: the example of the circle command in the interface cards' manual, `@0y400,1500,119,-141,141,-1,-1`: B is the
number of interpolations, each of which makes a step of one or both axes, and steps of the two axes together are 400.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from isel_twin import Twin
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.write import write_trace

CIRCLE = "@0y400,1500,119,-141,141,-1,-1\r"
MS = 1_000_000


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Reference run, a move, the circle, spindle on, an opened hood and the power stages off."""
    folder = tmp_path_factory.mktemp("circle")
    twin = Twin(plant="kinematic")
    with Recorder(twin, 10 * MS) as recorder:
        for line in ("@07\r", "@0R7\r", "@0j300\r", "@0M8000,8000,8000,8000,0,30,0,30\r", CIRCLE, "@0B2,1\r"):
            if line == CIRCLE:
                (folder / "begin").write_text(str(twin.time_ns))
            twin.write(line.encode())
            twin.run_until(twin.time_ns + 60_000 * MS, lambda: twin.idle)
            assert twin.read() == b"0"
            if line == CIRCLE:
                (folder / "end").write_text(str(twin.time_ns))
        twin.run(0.2)
        twin.set_input("hood", "open")
        twin.run(0.2)
        for kind in (".npz", ".vcd", ".parquet"):
            write_trace(folder / f"t{kind}", twin.steps, recorder)
    return folder


def dump(path: Path) -> tuple[dict[str, str], dict[str, list[tuple[int, str]]]]:
    """Types and changes of each signal by "scope.name": a reader of IEEE 1364-2005, chapter 18, in a few lines."""
    kinds: dict[str, str] = {}
    names: dict[str, str] = {}
    changes: dict[str, list[tuple[int, str]]] = {}
    scopes: list[str] = []
    head, body = path.read_text("ascii").split("$enddefinitions $end")
    assert re.search(r"\$timescale\s+1 ns\s+\$end", head)
    for word, rest in re.findall(r"\$(scope|upscope|var)\s+(.*?)\s*\$end", head, re.DOTALL):
        if word == "scope":
            scopes.append(rest.split()[1])
        elif word == "upscope":
            scopes.pop()
        else:
            kind, size, code, name = rest.split()
            full = ".".join([*scopes, name])
            assert full not in kinds, "viewers tell signals by scope and name"
            assert re.fullmatch(r"[A-Za-z_][A-Za-z0-9_$]*", name), "a name that needs no escape"
            kinds[full], names[code], changes[full] = f"{kind} {size}", full, []
    time = -1
    for line in body.split("\n"):
        if line.startswith("#"):
            assert int(line[1:]) > time or time < 0
            time = int(line[1:])
        elif line[:1] in "bBrRsS" and " " in line:
            value, code = line[1:].rsplit(" ", 1)
            changes[names[code]].append((time, value))
        elif line and not line.startswith("$"):
            changes[names[line[1:]]].append((time, line[0]))
    return kinds, changes


def rises(changes: list[tuple[int, str]]) -> list[int]:
    return [time for (_, before), (time, now) in pairwise(changes) if (before, now) == ("0", "1")]


def test_it_has_400_rising_step_edges_at_the_times_of_the_stream(traces: Path) -> None:
    _, changes = dump(traces / "t.vcd")
    edges = {axis: rises(changes[f"step.step_{axis}"]) for axis in "xyza"}
    begin, end = (int((traces / name).read_text()) for name in ("begin", "end"))
    circle = {axis: [time for time in edges[axis] if begin < time <= end] for axis in "xyza"}
    assert len(circle["x"]) + len(circle["y"]) == 400
    assert circle["z"] == circle["a"] == []
    with np.load(traces / "t.npz") as stream:
        for i, axis in enumerate("xyza"):
            assert stream["t_ns"][stream["delta"][:, i] != 0].tolist() == edges[axis]


def test_directions_sum_up_to_the_end_of_the_stream(traces: Path) -> None:
    _, changes = dump(traces / "t.vcd")
    with np.load(traces / "t.npz") as stream:
        end = stream["delta"].sum(axis=0).tolist()
    for i, axis in enumerate("xyza"):
        minus = changes[f"step.dir_{axis}"]
        at = [[value for time, value in minus if time <= edge][-1] for edge in rises(changes[f"step.step_{axis}"])]
        assert at.count("0") - at.count("1") == end[i]


def test_it_carries_hood_brake_spindle_and_switches_for_viewers_with_and_without_text(traces: Path) -> None:
    kinds, changes = dump(traces / "t.vcd")
    assert kinds["step.step_x"] == kinds["step.dir_x"] == "wire 1"
    assert kinds["output.spindle"] == kinds["output.brake"] == kinds["output.stages"] == "wire 1"
    assert kinds["input.limit_x1"] == "string 1"
    assert kinds["input.hood_changed"] == "wire 1"
    assert [value for _, value in changes["output.spindle"]][-2:] == ["1", "0"], "an opened hood switches it off"
    assert changes["input.hood"][-1][1] == "open"
    assert changes["input.hood_changed"][-1][1] == "1"
    assert changes["output.brake"][-1][1] == "0", "and lets the brake fall in"
    assert any(name.startswith("level.") for name in kinds)


def test_table_and_stream_agree(traces: Path) -> None:
    table = pq.read_table(traces / "t.parquet").to_pydict()
    with np.load(traces / "t.npz") as stream:
        made = stream["delta"].astype(np.int64).cumsum(axis=0)
        last = stream["t_ns"].searchsorted(table["time_ns"], side="right") - 1
    begin = int((traces / "begin").read_text())  # the reference run is over, in which counters are set anew
    later = [row for row, time in enumerate(table["time_ns"]) if time >= begin]
    assert len(later) > 20
    for i, axis in enumerate("xyza"):
        way = made[last[later], i] - made[last[later[0]], i]
        counts = np.array(table[f"count_{axis}"])[later]
        assert (counts - counts[0]).tolist() == way.tolist()
    assert table["output_spindle"][-1] == 0
    assert 1 in table["output_spindle"]
