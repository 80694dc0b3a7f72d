"""Programs with other settings: rapid speed (P8816) and ramps of the axes (P12008 and on, 8.7)."""

from __future__ import annotations

import pytest

from isel_twin import Twin
from isel_twin.firmware.bwo900.language import Bwo900Language
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import JobMove, MoveSettings

LANGUAGE = Bwo900Language()
FAST = MoveSettings(speed_hz=90_000, acceleration_hz_per_ms=800)
SETS = "P8816:5400.000 P12008:125.000 P12208:125.000 P12408:125.000"  # 90 mm/s, 100 mm/s in 125 ms
PROGRAM = ["P1", "N10 G90 G53 G94", "N20 P8816:2400 {P8816:2400}", "N30 G0 X60", "N40 G1 X70 F600", "N50 M30", "#"]


def retimed(lines: list[str], rapid_hz: int = 20_000) -> list[str]:
    numbers = [move.line for move in LANGUAGE.job_moves(lines)]
    return [line for each in LANGUAGE.retimed(lines, dict.fromkeys(numbers, FAST), rapid_hz) for line in each]


def test_a_program_is_one_motion_at_its_first_block() -> None:
    """2400 mm/min are 40 mm/s; as delivered 6000 mm/min, in 250 ms (8.7)."""
    assert LANGUAGE.job_moves(PROGRAM) == [JobMove(1, (40_000,), 400, 0, straight=False)]
    assert LANGUAGE.job_moves(["N1 G0 X5 P12208=500"]) == [JobMove(0, (100_000,), 200, 0, straight=False)]
    assert LANGUAGE.job_moves(["Z5", "N1 G1 X5", "#", "P2", "; a remark", "N1 G0 X9", "#"])[0].line == 5
    assert LANGUAGE.job_moves(["P1", "#", "D", "K1:P8816: 500"]) == []


def test_rapid_and_ramps_are_set_before_the_first_block_and_where_the_program_sets_them() -> None:
    assert retimed(PROGRAM) == [
        "P1", f"N9 {SETS}", PROGRAM[1], "N20 P8816:5400.000 {P8816:2400}", *PROGRAM[3:]
    ]  # fmt: skip


def test_a_slow_rapid_stays() -> None:
    made = retimed(PROGRAM, 50_000)
    assert made[1] == "N9 P12008:125.000 P12208:125.000 P12408:125.000"
    assert [made[0], *made[2:]] == PROGRAM


def test_values_that_are_computed_and_texts_stay() -> None:
    lines = ["N10 P8816:P20*2 P12008:9+1", "N20 P20:5 !P8816:700", ";P8816:700"]
    assert retimed(lines) == [f"N9 {SETS}", *lines]


@pytest.mark.parametrize(
    ("numbers", "new"), [((10, 20), 9), ((1, 2), 3), ((5, 4), 1), ((0, 1), 2), ((1, 3), 2), ((30, 29), 1)]
)
def test_the_new_block_has_a_number_of_its_own(numbers: tuple[int, ...], new: int) -> None:
    assert retimed([f"N{number} G4" for number in numbers])[0] == f"N{new} {SETS}"


def test_faster_scales_feeds_and_rapids() -> None:
    assert LANGUAGE.faster(["N10 G1 X5 F600 P8816:1200", "N20 F:P4 {F600}", "N30 X5F60.5"], 2.0) == [
        "N10 G1 X5 F1200.000 P8816:2400.000", "N20 F:P4 {F600}", "N30 X5F121.000"
    ]  # fmt: skip


def test_the_way_stays_and_takes_less() -> None:
    """60 mm at 40 mm/s in 1.6 s; at 90 mm/s in 0.78."""
    ends = []
    for lines in (PROGRAM, retimed(PROGRAM)):
        twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(5.0, 5.0, 5.0))
        job = parse_job("\n".join(lines), LANGUAGE, "bwo900")
        made = played(twin, job, timeout_s=600.0)
        assert made.ok
        result = made.results[-1]
        ends.append((result.counts[:3], result.end_ns - result.time_ns))
    (counts, slow_ns), (other_counts, fast_ns) = ends
    assert counts == other_counts == (70_000, 0, 0)
    assert slow_ns - fast_ns == pytest.approx(0.82e9, abs=0.05e9)


def test_nothing_is_permanent() -> None:
    assert LANGUAGE.permanent(FAST) == ()


def test_a_file_without_its_last_line_end_is_made_as_with_it() -> None:
    text = "N10 G90 G53\nN20 G1 X6 F600\nN30 M30"
    ends = []
    for end in ("", "\n"):
        twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(5.0, 5.0, 5.0))
        job = played(twin, parse_job(text + end, LANGUAGE, "bwo900"))
        assert job.ok, job.verdict.problems()
        ends.append((job.verdict.counts, job.verdict.ended_ns))
    assert ends[0] == ends[1]
