"""Files of measurements: what they may say, and the line that tells what is wrong."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from isel_twin.many.identification.measured import (
    Act,
    Measured,
    MeasuredError,
    Reading,
    Repeats,
    Stall,
    read_measured,
    written,
)

WHOLE = """
gauge_sigma_mm = 0.004
time_sigma_s = 0.001
[[reading]]
recording = "a"
command = 7
axis = "x"
mm = 0.0
push_n = -150
[[reading]]
recording = "b"
command = 9
axis = "y"
mm = 12.5
sigma_mm = 0.02
gauge = "scale"
at_s = 0.0
counter_mm = 12.0
[[act]]
recording = "a"
command = 8
after_s = 0.4
set = { estop = "pressed" }
[[stall]]
recording = "a"
axis = "x"
from_mm = 10
to_mm = 50
acceleration_hz_per_ms = 400
start_stop_hz = 300
held_hz = 24000
lost_hz = 25000
[[repeats]]
recording = "a"
axis = "x"
mm = [0.001, 0.011, -0.004]
"""
STALL = Stall("a", "x", 10.0, 50.0, 400, 300, 24000.0, 25000.0)


def put(folder: Path, content: str, name: str = "measured.toml") -> Path:
    path = folder / name
    path.write_text(content)
    return path


def test_all_that_a_file_can_say(tmp_path: Path) -> None:
    found = read_measured(put(tmp_path, WHOLE))
    assert found.readings == (
        Reading("a", 7, "x", 0.0, 0.004, "", -150.0),
        Reading("b", 9, "y", 12.5, 0.02, "scale", 0.0, 0.0, 12.0),
    )
    assert found.acts == (Act("a", 8, 0.4, {"set": {"estop": "pressed"}}),)
    assert found.stalls == (STALL,)
    assert found.repeats == (Repeats("a", "x", (0.001, 0.011, -0.004)),)
    assert (found.names, found.axes) == (["a", "b"], ["x", "y"])
    assert found.of("b").readings == found.readings[1:]
    assert found.of("b").time_sigma_s == 0.001


def test_what_is_written_reads_back_the_same(tmp_path: Path) -> None:
    found = read_measured(put(tmp_path, WHOLE))
    assert read_measured(put(tmp_path, written(found, {7: "read it"}))) == found


def test_a_csv_file_has_readings(tmp_path: Path) -> None:
    content = "recording,command,axis,mm,at_s,gauge\na,7,x,1.25,,g\na,7,x,1.5,0.01,g\n"
    found = read_measured(put(tmp_path, content, "scale.csv"))
    assert [(one.mm, one.at_s, one.gauge) for one in found.readings] == [(1.25, None, "g"), (1.5, 0.01, "g")]


def test_what_is_not_filled_in_is_left_out_and_counted(tmp_path: Path) -> None:
    template = Measured(
        (Reading("a", 1, "x", math.nan), Reading("a", 2, "x", 1.0), Reading("a", 3, "x", 1.0, counter_mm=math.nan)),
        stalls=(Stall("a", "x", 10.0, 50.0, 400, 300, math.nan, math.nan),),
    )
    found = read_measured(put(tmp_path, written(template)))
    assert ([one.command for one in found.readings], found.stalls, found.unread) == ([2], (), 3)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[[reading]]\nrecording='a'\ncommand=1\naxis='x'\n", "reading 1.mm: missing"),
        ("[[reading]]\nrecording='a'\ncommand=1\naxis='q'\nmm=1\n", "reading 1.axis: 'q'; allowed: x, y, z"),
        ("[[reading]]\nrecording='a'\ncommand=1.5\naxis='x'\nmm=1\n", "reading 1.command: 1.5"),
        ("[[reading]]\nrecording='a'\ncommand=1\naxis='x'\nmn=1\n", "did you mean 'mm'?"),
        ("[[act]]\nrecording='a'\ncommand=1\nafter_s=1\n", "act 1: says not what was done"),
        (WHOLE.replace("lost_hz = 25000", "lost_hz = 2000"), "stall 1.lost_hz: 2000; allowed: more than held_hz"),
        ("reading = 3\n", "must be a list of tables"),
        ("[[measure]]\n", "unknown key"),
        ("[[act]]\nrecording='a'\ncommand=1\nafter=1\n", "act 1.after: unknown key; did you mean 'after_s'?"),
        (WHOLE.replace("start_stop_hz", "start_hz"), "stall 1.start_hz: unknown key; did you mean 'start_stop_hz'?"),
        ("[[repeats]]\nrecording='a'\naxis='x'\nmn=[1]\n", "repeats 1.mn: unknown key; did you mean 'mm'?"),
    ],
)
def test_a_wrong_entry_is_named(tmp_path: Path, content: str, said: str) -> None:
    with pytest.raises(MeasuredError, match=r"^[^\n]*$") as told:
        read_measured(put(tmp_path, content))
    assert said in str(told.value)


def test_a_wrong_line_of_a_csv_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MeasuredError, match=r"line 3\.mm: 'one'"):
        read_measured(put(tmp_path, "recording,command,axis,mm\na,1,x,1\na,2,x,one\n", "m.csv"))


def test_a_stall_says_at_which_supply(tmp_path: Path) -> None:
    at = dataclasses.replace(STALL, supply_v=36.0)
    file = tmp_path / "day.toml"
    file.write_text(written(Measured(stalls=(at, STALL))))
    assert read_measured(file).stalls == (at, STALL)
    file.write_text(written(Measured(stalls=(at,))).replace("36.0", "3.0"))
    with pytest.raises(MeasuredError, match=r"stall.*supply_v: 3\.0; allowed: 5 \.\. 200 V"):
        read_measured(file)
