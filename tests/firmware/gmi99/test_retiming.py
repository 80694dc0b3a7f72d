"""Jobs with other settings (3.1.1): what is set before which line, and that the way stays."""

from __future__ import annotations

import pytest

from isel_twin import Twin
from isel_twin.firmware.gmi99.language import Gmi99Language
from isel_twin.language import JobMove, MoveSettings

LANGUAGE = Gmi99Language()
FAST = MoveSettings(speed_hz=90_000, acceleration_hz_per_ms=250)
JOB = ["Q7;1", "M40000", "B100", "f30000", "83h 9000 0", "f5000 | 84h 900", "84h 0", "f30000", "83h 0 0"]


def retimed(lines: list[str], rapid_hz: int = 20_000) -> list[str]:
    numbers = [move.line for move in LANGUAGE.job_moves(lines)]
    return [line for each in LANGUAGE.retimed(lines, dict.fromkeys(numbers, FAST), rapid_hz) for line in each]


def test_moves_are_lines_with_the_feed_that_is_in_force() -> None:
    assert LANGUAGE.job_moves(JOB) == [
        JobMove(4, (30_000,), 100, 0),
        JobMove(5, (5000,), 100, 0),
        JobMove(6, (5000,), 100, 0),
        JobMove(8, (30_000,), 100, 0),
    ]


def test_a_card_as_it_was_delivered_makes_rapids_of_2000_hz() -> None:
    """M is 2000 and B 50 (3.1.1); `r` brings them back; a feed above M is M; a rapid (G0) has M."""
    lines = ["81h 5", "f9000 | 81h 9", "M8000", "G0 | V 5 5 5", "f100 | 83h 1 1 | 83h 2 2", "r", "81h 1"]
    assert [(move.line, move.speeds_hz, move.acceleration_hz_per_ms) for move in LANGUAGE.job_moves(lines)] == [
        (0, (2000,), 50),
        (1, (2000,), 50),
        (3, (8000,), 50),
        (4, (100, 100), 50),
        (6, (2000,), 50),
    ]


def test_rapids_get_the_speed_and_feeds_of_a_process_stay() -> None:
    assert retimed(JOB) == [
        "Q7;1", "M90000", "B250", "f90000", "83h 9000 0", "f5000 | 84h 900", "84h 0", "f90000", "83h 0 0"
    ]  # fmt: skip


def test_what_the_job_does_not_set_is_set_before_its_first_move() -> None:
    assert retimed(["Q7;1", "f30000 | 83h 9 9", "G0", "83h 0 0"], 1000) == [
        "Q7;1", "M90000", "B250", "f90000 | 83h 9 9", "G0", "83h 0 0"
    ]  # fmt: skip


def test_slow_rapids_are_those_of_a_process() -> None:
    """Of M3000, where rapid begins at 20000 Hz."""
    made = retimed(["M30000", "f30000 | 81h 9", "M3000", "G0", "81h 0"])
    assert made == ["M90000", "B250", "f90000 | 81h 9", "M3000", "G0", "81h 0"]


def test_a_top_speed_is_never_below_a_feed_of_the_line() -> None:
    slow = MoveSettings(speed_hz=8000, acceleration_hz_per_ms=250)
    lines = ["M40000", "B9", "f15000", "81h 9", "G0", "81h 0"]
    made = LANGUAGE.retimed(lines, dict.fromkeys((3, 5), slow), 20_000)
    assert made == [["M15000"], ["B250"], ["f15000"], ["81h 9"], ["G0"], ["M8000", "81h 0"]]


def test_reset_and_bytes_forget_what_was_set() -> None:
    assert retimed(["M40000", "81h 9", "r", "81h 0", "<68>", "81h 5"], 1000) == [
        "M90000", "B250", "81h 9", "r", "M90000", "B250", "81h 0", "<68>", "M90000", "B250", "81h 5"
    ]  # fmt: skip


def test_recorded_programs_and_limits_of_single_axes_stay() -> None:
    lines = ["M40000", "B100", "M30000;2", "p3;100;0", "f40000", "M50000", "84h 9", "p3;101", "p3;1;0"]
    assert LANGUAGE.job_moves(lines) == [JobMove(8, (), 100, 0, straight=False)]
    assert retimed(lines) == ["M90000", "B250", *lines[2:]]


def test_what_is_no_command_stays() -> None:
    lines = ["hello", "5: #1", "#1", "T0;0", "<0.5s>", "f"]
    assert LANGUAGE.job_moves(lines) == []
    assert LANGUAGE.retimed(lines, {}, 600) == [[line] for line in lines]
    assert LANGUAGE.faster(lines, 2.0) == lines


def test_faster_scales_top_speeds_and_feeds_also_beyond_what_the_card_takes() -> None:
    assert LANGUAGE.faster(["M40000", "B100", "f5000 | 81h 9", "M900000;0"], 2.0) == [
        "M80000", "B100", "f10000 | 81h 9", "M1800000"
    ]  # fmt: skip
    assert LANGUAGE.faster(["M40", "f3"], 2.5) == ["M100", "f8"]


def test_the_way_stays_and_takes_less() -> None:
    """60.67 mm there and back, at 30 mm/s with ramps of 0.3 s and at 90 mm/s with 0.36 s: t = s / v + v / a."""
    lines = ["Q7;1", "M40000", "B100", "f30000", "83h 60000 9000", "83h 0 0"]
    ends = []
    for job in (lines, retimed(lines)):
        twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic", start_mm=(5.0, 5.0, 5.0))
        begun_ns = 0
        for number, line in enumerate(job):
            begun_ns = twin.time_ns if number == len(job) - 2 else begun_ns
            twin.write(LANGUAGE.frame(line))
            twin.run_until_idle()
        ends.append((twin.counts[:3].tolist(), twin.time_ns - begun_ns))
    (counts, slow_ns), (other_counts, fast_ns) = ends
    assert counts == other_counts
    assert slow_ns == pytest.approx(2 * (60.67 / 30.0 + 0.3) * 1e9, rel=0.02)
    assert fast_ns == pytest.approx(2 * (60.67 / 90.0 + 0.36) * 1e9, rel=0.03)


def test_permanent_is_the_acceleration() -> None:
    assert LANGUAGE.permanent(FAST) == ["B250", "s"]
