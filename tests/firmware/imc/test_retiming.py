"""Other settings for a job that exists: which lines change and which do not, and what the controller makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.controller import offers
from isel_twin.language import JobMove, MoveSettings, RetimesJobs, create_language

FAST = MoveSettings(22_000, 900, 800)
BRISK = MoveSettings(15_000, 400, 800)


def language(name: str = "imc-s8") -> RetimesJobs:
    found = create_language(name)
    assert offers(found, RetimesJobs)
    return found


def retimed(lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int = 5000) -> list[str]:
    return [line for made in language().retimed(lines, settings, rapid_hz) for line in made]


def test_defaults_are_those_of_the_manual() -> None:
    assert language().defaults == {"start_stop_hz": 300, "acceleration_hz_per_ms": 100}  # 2.2.15, 2.2.16


def test_moves_are_found_with_the_ramps_they_are_made_with() -> None:
    lines = ["@07", "@0R7", "@0m1600,9000,0,30,0,30,0,30", "@0J250", "<1s>", "@0A0,30,8,1500", "@0y400,1500,119", "@0P"]
    assert list(language().job_moves(lines)) == [
        JobMove(2, (9000, 30, 30, 30), 100, 300),
        JobMove(5, (30, 1500), 250, 300),
        JobMove(6, (), 250, 300, straight=False),
    ]


def test_ramps_are_set_where_they_stand_or_before_the_move() -> None:
    assert retimed(["@0j300", "@0M1,9000,2,9000"], {1: FAST}) == ["@0j800", "@0J900", "@0M1,22000,2,22000"]
    assert retimed(["@0M1,9000", "@0M2,9000"], {0: FAST, 1: FAST}) == ["@0j800", "@0J900", "@0M1,22000", "@0M2,22000"]


def test_between_moves_only_what_differs_is_set() -> None:
    lines = ["@0M1,9000", "@0M2,9000", "@0M3,9000"]
    assert retimed(lines, {0: FAST, 1: BRISK, 2: FAST}) == [
        "@0j800", "@0J900", "@0M1,22000", "@0J400", "@0M2,15000", "@0J900", "@0M3,22000"
    ]  # fmt: skip


def test_a_feed_keeps_its_speed_and_gets_the_ramp() -> None:
    assert retimed(["@0A0,30,0,30,1920,1600,-1920,9000"], {0: FAST}) == [
        "@0j800", "@0J900", "@0A0,30,0,30,1920,1600,-1920,22000"
    ]  # fmt: skip
    assert retimed(["@0M1,4999"], {0: FAST})[-1] == "@0M1,4999"
    assert retimed(["@0y400,9000,119,-141,141,-1,-1"], {0: FAST})[-1] == "@0y400,9000,119,-141,141,-1,-1"


def test_what_was_in_force_before_unknown_bytes_is_set_again() -> None:
    for between in ("<254>", "@0IL", "@0IJ50"):
        made = retimed(["@0M1,9000", between, "@0M2,9000"], {0: FAST, 2: FAST})
        assert made == ["@0j800", "@0J900", "@0M1,22000", between, "@0j800", "@0J900", "@0M2,22000"]


def test_a_pause_changes_nothing() -> None:
    assert retimed(["@0M1,9000", "<0.5s> <1s>", "@0M2,9000"], {0: FAST, 2: FAST})[-2:] == ["<0.5s> <1s>", "@0M2,22000"]


def test_a_stored_program_stays_as_it_is_and_gets_its_ramps_when_started() -> None:
    program = ["@0i", "J100", "m3200,6000,1600,6000,0,30,0,30", "3 2,-2", "9"]
    assert retimed([*program, "@0S"], {5: FAST}) == [*program, "@0j800", "@0J900", "@0S"]
    assert [move.line for move in language().job_moves([*program, "@0S"])] == [5]


@pytest.mark.parametrize(
    "line", ["", "@", "@0", "@0M", "@0Mx,y", "@0j", "@0J1,2,3", "@xM1,2", "hello", "@0M1,9000<13>", "é"]
)
def test_what_is_no_command_stays(line: str) -> None:
    assert retimed([line, "@0P"], {}) == [line, "@0P"]
    assert list(language().job_moves([line])) in ([], [JobMove(0, (), 100, 300)])


def test_another_device_number_is_kept() -> None:
    assert retimed(["@3M1,9000"], {0: FAST}) == ["@3j800", "@3J900", "@3M1,22000"]


def steps_of(twin: Twin, lines: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Times since the first line and pulses of what the lines make."""
    began_ns, before = twin.time_ns, len(twin.steps)
    for line in lines:
        assert twin.query(line) == "0", line
    stream = twin.steps
    return stream.t_ns[before:] - began_ns, stream.delta[before:]


def test_permanent_commands_make_the_ramps_those_of_a_controller_switched_on_anew() -> None:
    """4.2.3, 4.2.4, 4.2.18: what has been written is there after power-off; nothing else that was tried is."""
    move = "@0A1600,9000,0,30,0,30,0,30"
    first = Twin(plant="kinematic", start_mm=(1.0, 1.0, 1.0))
    assert first.query("@07") == "0"
    assert first.query("@0IT4") == "0", "tried, never written"
    for line in language().permanent(FAST):
        assert first.query(line) == "0", line

    def made(before: Sequence[str], flash: bytes | None) -> tuple[np.ndarray, np.ndarray]:
        twin = Twin(plant="kinematic", start_mm=(1.0, 1.0, 1.0), flash=flash)
        for line in ("@07", "@0R7", *before):
            assert twin.query(line) == "0"
        return steps_of(twin, [move])

    by_flash, by_job = made([], first.flash), made(["@0j800", "@0J900"], None)
    np.testing.assert_array_equal(by_flash[0], by_job[0])
    np.testing.assert_array_equal(by_flash[1], by_job[1])
    assert len(by_flash[0]) == 1600
    assert b'"rotary":0' in (first.flash or b"")
