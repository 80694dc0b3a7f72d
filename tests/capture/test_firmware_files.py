"""Klipper's commands and grblHAL's positions as ticks, against their definitions, step by step."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.capture.load import load
from isel_twin.capture.ticks import Ticks
from isel_twin.capture.wave import CaptureError
from tests.in_process import isel_twin

HEAD = """config_stepper oid=4 step_pin=PA1 dir_pin=PA2 invert_step=0 step_pulse_ticks=32
config_stepper oid=7 step_pin=PA3 dir_pin=PA4 invert_step=0 step_pulse_ticks=32
"""


def read(folder: Path, text: str, kind: str = "dump") -> Ticks:
    path = folder / f"part.{kind}"
    path.write_text(text)
    return load(path, sample_rate_hz=1e6 if kind == "dump" else None)


def by_hand(start: int, queued: list[tuple[int, int, int]]) -> list[int]:
    """MCU_Commands.md, in its own words: add the interval to the time, then `add` to the interval."""
    times, t = [], start
    for interval, count, add in queued:
        for _ in range(count):
            t += interval
            times.append(t)
            interval += add
    return times


def test_steps_of_klipper(tmp_path: Path) -> None:
    """Two axes, a change of direction, a clock that wraps; 1 MHz: a tick is a microsecond."""
    start = (1 << 32) - 500
    x = [(100, 5, 7), (140, 3, -10)]
    text = HEAD + f"reset_step_clock oid=4 clock={start}\nset_next_step_dir oid=4 dir=1\n"
    text += "".join(f"queue_step oid=4 interval={i} count={n} add={a}\n" for i, n, a in x)
    text += "set_next_step_dir oid=4 dir=0\nqueue_step oid=4 interval=2000 count=1 add=0\n"
    text += f"reset_step_clock oid=7 clock={(start + 600) % (1 << 32)}\nset_next_step_dir oid=7 dir=0\n"
    text += "queue_step oid=7 interval=50 count=2 add=0\nget_clock\n"
    ticks = read(tmp_path, text)
    wanted = by_hand(start, [*x, (2000, 1, 0)])
    first = wanted[0]
    x_ns = ticks.t_ns[ticks.delta[:, 0] != 0]
    assert x_ns.tolist() == [(t - first) * 1000 + 1_000_000 for t in wanted]
    assert ticks.delta[ticks.delta[:, 0] != 0, 0].tolist() == [1] * 8 + [-1]
    y_ns = ticks.t_ns[ticks.delta[:, 1] != 0]
    assert y_ns.tolist() == [(start + 600 + after - first) * 1000 + 1_000_000 for after in (50, 100)]
    assert ticks.delta[:, 1].sum() == -2
    assert ticks.delta.shape[1] == 3


def test_a_fresh_board_has_no_reset(tmp_path: Path) -> None:
    """It counts from 0. X moves for 30 s; Y is still until 25 s, when its first interval has passed 2^32 at 180 MHz."""
    rate_hz, apart, wrap = 180_000_000, 180_000, 1 << 32
    late = 25 * rate_hz
    x = "queue_step oid=4 interval=180000 count=5000 add=0\n"
    text = HEAD + "set_next_step_dir oid=4 dir=1\n" + x * 5
    text += f"set_next_step_dir oid=7 dir=0\nqueue_step oid=7 interval={late - wrap} count=1 add=0\n"
    text += "queue_step oid=7 interval=180000 count=2 add=0\n" + x
    path = tmp_path / "part.dump"
    path.write_text(text)
    ticks = load(path, sample_rate_hz=rate_hz)
    x_ns, y_ns = (ticks.t_ns[ticks.delta[:, axis] != 0].tolist() for axis in (0, 1))
    assert x_ns == [1_000_000 * k for k in range(1, 30_001)]  # from a millisecond before the first step on
    assert y_ns == [1_000_000 * k for k in range(25_000, 25_003)]
    assert apart * 1000 == rate_hz
    assert ticks.delta.sum(axis=0).tolist() == [30_000, -3, 0]


def test_positions_of_grblhal(tmp_path: Path) -> None:
    text = "# block number 0\n0.00100 0, 0, 0, 0\n0.00200 4, -2, 0, 0\n0.00300 4, -2, 0, 0\n0.00400 3, -2, 1, 0\n"
    ticks = read(tmp_path, text, "out")
    assert ticks.t_ns.tolist() == [1_125_000, 1_250_000, 1_375_000, 1_625_000, 1_750_000, 1_875_000, 3_500_000]
    assert ticks.delta.sum(axis=0).tolist() == [3, -2, 1]
    assert ticks.end_ns == 4_000_000


@pytest.mark.parametrize(
    ("text", "kind", "reason"),
    [
        ("hello\n", "dump", "no config_stepper"),
        (HEAD + "queue_step oid=9 interval=1 count=1 add=0\n", "dump", "part.dump:3: 'queue_step oid=9"),
        (HEAD + "queue_step oid=4 interval=1 add=0\n", "dump", "part.dump:3: .* lacks something"),
        (HEAD + "queue_step oid=4 interval=1 count=-1 add=0\n", "dump", "count=-1; allowed"),
        (HEAD + f"queue_step oid=4 interval=1 count={10**15} add=0\n", "dump", "allowed: 1 and more"),
        (HEAD, "dump", "has no step in it"),
        (HEAD + "queue_step oid=4 interval=-5 count=3 add=0\n", "dump", "go back in time"),
        (HEAD + "queue_step oid=4 interval=9000000000000000000 count=3 add=0\n", "dump", "go back in time"),
        (HEAD + f"reset_step_clock oid=4 clock={2**70}\n", "dump", "part.dump:3: .* go back in time, or too far"),
        (HEAD + f"reset_step_clock oid=4 clock={'9' * 5000}\n", "dump", "part.dump:3: "),
        (HEAD + f"queue_step oid=4 interval=1 count=1 add={2**70}\n", "dump", "part.dump:3: "),
        ("0.1 1 2\n", "out", "part.out:1: '0.1 1 2'; a line is a time"),
        ("0.2 1 2 3\n0.1 1 2 3\n", "out", "part.out:2: "),
        ("nan 1 2 3\n", "out", "part.out:1: "),
        ("0.1 0 0 0\n0.1 1 0 0\n", "out", "moves in no time"),
        ("0.1 99999999999 0 0\n", "out", "part.out:1: "),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, kind: str, reason: str) -> None:
    with pytest.raises(CaptureError, match=reason):
        read(tmp_path, text, kind)


def test_drive_plays_it_and_asks_for_the_clock(tmp_path: Path) -> None:
    path = tmp_path / "part.dump"
    path.write_text(HEAD + "set_next_step_dir oid=4 dir=1\nqueue_step oid=4 interval=1000 count=800 add=0\n")
    call = ("drive", path, "--plant", "kinematic", "--start", "50,50,20")
    assert isel_twin(*call, "--sample-rate", "1e6").returncode == 0
    refused = isel_twin(*call)
    assert refused.returncode == 2
    assert "sample-rate: a Klipper dump needs the clock of its board" in refused.stderr
