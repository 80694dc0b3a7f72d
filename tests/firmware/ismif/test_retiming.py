"""Jobs with other settings (6.8 to 6.10, 6.14): what is set before which vector, and that the way stays."""

from __future__ import annotations

from isel_twin import Twin
from isel_twin.firmware.ismif.language import IsmifLanguage
from isel_twin.language import JobMove, MoveSettings

LANGUAGE = IsmifLanguage()
JOB = ["$HZXY<1>", "#E1,1200", "#E2,400", "L1,X1600,Y1600", "L2,Z320", "W100", "L1,X0,Y0<1>", "@LX"]
FAST = MoveSettings(speed_hz=3000, acceleration_hz_per_ms=20, start_stop_hz=300)


def test_moves_are_vectors_with_the_end_speed_of_their_index() -> None:
    """Factory: start speed 200 Hz, ramps of 500 ms (5.2): (1200 - 200) / 500 = 2 Hz/ms; 0.4 is 1."""
    assert LANGUAGE.job_moves(JOB) == [
        JobMove(3, (1200,), 2, 200),
        JobMove(4, (400,), 1, 200),
        JobMove(6, (1200,), 2, 200),
    ]
    assert LANGUAGE.job_moves(["L7,X5", "#S400", "#R0", "L7,X5", "@R", "L7,X5"]) == [
        JobMove(0, (600,), 1, 200),
        JobMove(3, (600,), 4000, 400),
        JobMove(5, (600,), 1, 200),
    ]


def test_end_speeds_are_replaced_feeds_stay_and_ramps_take_no_less_than_asked() -> None:
    """(3000 - 300) / 20 = 135 ms; of the feed (400 - 300) / 20 = 5 ms."""
    made = LANGUAGE.retimed(JOB, dict.fromkeys((3, 4, 6), FAST), rapid_hz=600)
    assert [line for each in made for line in each] == [
        "$HZXY<1>", "#E1,3000", "#E2,400", "#S300", "#R135", "L1,X1600,Y1600", "#R5", "L2,Z320", "W100", "#R135",
        "L1,X0,Y0<1>", "@LX"
    ]  # fmt: skip


def test_lines_that_set_something_get_the_value_of_the_next_vector() -> None:
    made = LANGUAGE.retimed(["#S100", "#R900", "#E1,700", "L1,X5<1>"], {3: FAST}, rapid_hz=600)
    assert made == [["#S300"], ["#R135"], ["#E1,3000"], ["L1,X5<1>"]]


def test_a_reset_forgets_what_was_set() -> None:
    lines = ["L1,X5<1>", "@R", "L1,X9<1>", "<253>", "L1,X5<1>"]
    made = LANGUAGE.retimed(lines, dict.fromkeys((0, 2, 4), FAST), 600)
    assert made == [["#S300", "#E1,3000", "#R135", line] if "L" in line else [line] for line in lines]


def test_what_is_no_line_of_the_manual_stays() -> None:
    lines = ["L1,X", "#E1,99999", "hello", "<0.5s>", "#E200,400"]
    assert LANGUAGE.job_moves(lines) == []
    assert LANGUAGE.retimed(lines, {}, 600) == [[line] for line in lines]
    assert LANGUAGE.faster(lines, 2.0) == lines


def test_faster_scales_end_speeds_also_beyond_what_the_interface_puts_out() -> None:
    """65 to 5000 Hz; more is refused."""
    assert LANGUAGE.faster(["#S300", "#E1,1200", "#E2,3000", "#R50", "L1,X5<1>"], 2.0) == [
        "#S300", "#E1,2400", "#E2,6000", "#R50", "L1,X5<1>"
    ]  # fmt: skip
    assert LANGUAGE.faster(["#E1,4000"], 1.5) == ["#E1,6000"]


def test_the_way_stays_and_takes_less() -> None:
    """Of 3200 half steps at 600 Hz, or at 3000."""
    lines = ["L1,X3200,Y-1600<1>", "L1,X0,Y0<1>"]
    made = [line for each in LANGUAGE.retimed(lines, dict.fromkeys((0, 1), FAST), 500) for line in each]
    ends = []
    for job in (lines, made):
        twin = Twin(controller="ismif", plant="kinematic", start_mm=(5.0, 5.0, 5.0))
        for line in job:
            twin.write(line.removesuffix("<1>").encode() + (b"\x01" if line.endswith("<1>") else b"\r"))
            twin.run_until_idle()
        ends.append((len(twin.steps), twin.counts.tolist(), twin.time_ns))
    (way, counts, slow_ns), (other_way, other_counts, fast_ns) = ends
    assert (way, counts) == (other_way, other_counts)
    assert fast_ns < 0.35 * slow_ns


def test_nothing_is_permanent() -> None:
    """Settings are lost without power (5.2)."""
    assert list(LANGUAGE.permanent(FAST)) == []
