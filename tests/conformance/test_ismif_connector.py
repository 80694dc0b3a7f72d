"""The iSMIF's socket: clock and direction signals (6.5, 7), in a VCD as a logic analyser would have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from conformance.rows import shows

from isel_twin import Twin
from isel_twin.capture.load import load
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.vcd import write_vcd

PIN_X, PIN_Y = 2, 4
"""Manual, 7: pins 2, 4, 6 are the clock of X, Y, Z, pins 3, 5, 7 their direction."""


def written(path: Path, *lines: str) -> Twin:
    """Jobs on a referenced kinematic machine, and what was seen meanwhile as a VCD."""
    twin = Twin("4030", "ismif", plant="kinematic", start_mm=(5.0, 5.0, 5.0))
    twin.query("$HZXY\x01")
    with Recorder(twin, 1_000_000) as recorder:
        for line in lines:
            twin.query(f"{line}\x01")
        write_vcd(path, twin.steps, recorder)
    return twin


def edges(path: Path, name: str) -> list[tuple[int, int]]:
    """Time in ns and level of each change of a wire after the beginning."""
    text = path.read_text()
    code = next(line.split()[3] for line in text.splitlines() if line.startswith("$var") and f" {name} " in line)
    found, now = [], 0
    for line in text.partition("$enddefinitions $end")[2].splitlines():
        if line[:1] == "#":
            now = int(line[1:])
        elif line[1:] == code and line[0] in "01" and now:
            found.append((now, int(line[0])))
    return found


@shows("ismif-6.5-2", "ismif-7-5")
def test_clock_and_direction_leave_by_their_pins(tmp_path):
    """T1, then X 12 steps forth and 5 back, Y 7 back: so many pulses, with the direction before them."""
    path = tmp_path / "job.vcd"
    twin = written(path, "T1", "L1,x12,y-7", "L1,x-5")
    for pin, steps in ((PIN_X, 12 + 5), (PIN_Y, 7)):
        assert sum(level for _, level in edges(path, f"pin{pin}")) == steps
    rises = [time for time, level in edges(path, f"pin{PIN_X}") if level]
    turned = edges(path, f"pin{PIN_X + 1}")
    assert [level for _, level in turned][-1:] == [1]
    assert rises[11] < turned[-1][0] < rises[12]
    assert rises == [int(t) for t, delta in zip(twin.steps.t_ns, twin.steps.delta, strict=True) if delta[0]][-17:]


@shows("ismif-6.5-1")
def test_with_pbl_the_pins_of_the_clock_are_still(tmp_path):
    """What PBL puts on them is not known (ismif/6)."""
    path = tmp_path / "job.vcd"
    written(path, "T0", "L1,x12")
    assert edges(path, "pin2") == []


@shows("ismif-6.5-2")
def test_what_leaves_can_be_played(tmp_path):
    """As `isel-twin drive job.vcd --map ...` reads it."""
    path = tmp_path / "job.vcd"
    written(path, "T1", "L1,x12,y-7", "L1,x-5")
    ticks = load(path, ["x.step=pin2,x.dir=pin3,y.step=pin4,y.dir=pin5"])
    assert np.abs(ticks.delta.sum(axis=0))[:2].tolist() == [7, 7]
