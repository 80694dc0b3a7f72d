"""Where the margin of a motor lies, as far as its torque is known."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.drives.bands import torque_band
from isel_twin.drives.library import MOTORS
from isel_twin.jobs.checks.formats import as_words
from isel_twin.jobs.checks.job import check_job
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.jobs.result import in_percent
from isel_twin.language import create_language

MOVE = "@07\n@0N7\n@0A6400,{hz},0,30,0,30,0,30\n"
"""20 mm of X."""


@cache
def made(hz: int = 4000, torque: float = 1.0, plant: str = "mujoco") -> Any:
    lines = parse_job(MOVE.format(hz=hz), create_language("imc-s8"), "imc-s8")
    return played(TwinSpec(plant=plant, overrides={"axes.x.specimen.torque_constant": torque}).build(), lines)


@pytest.mark.parametrize("hz", [4000, 16_000])
def test_a_motor_as_weak_and_as_strong_as_its_band_says_keeps_what_lies_between_the_ends(hz: int) -> None:
    """Km of the X motor changed by as much."""
    motor, stage = MOTORS["23HS32-4004S"], TwinSpec().build().machine.axes[0].stage
    shares = torque_band(motor, stage, hz / 1600 * 60)
    low, high = made(hz).results[2].margin_band[0]
    assert all(low < made(hz, torque=share).results[2].margin[0] < high for share in shares)


def test_the_ends_are_those_of_the_torque_at_the_speed_of_the_line() -> None:
    """4000 Hz are 150 rev/min, 0.19 of the rule of thumb: 0.15 (1 + 0.8 x 0.19^2) = 0.154 in the logarithm."""
    result = made().results[2]
    used = 1.0 - result.margin[0]
    assert result.margin_band[0] == pytest.approx((1.0 - used * 1.167, 1.0 - used / 1.167), abs=1e-3)


def test_faster_moves_are_known_less() -> None:
    slow, fast = (made(hz).verdict.margin_band[0] for hz in (4000, 16_000))
    assert (fast[1] - fast[0]) > 1.5 * (slow[1] - slow[0])


def test_the_verdict_has_the_least_of_all_lines() -> None:
    run = made(16_000)
    for end in (0, 1):
        assert run.verdict.margin_band[0][end] == min(result.margin_band[0][end] for result in run.results)
    assert run.verdict.summary()["margin_band"][0] == list(run.verdict.margin_band[0])
    assert run.verdict.margin_told == in_percent(run.verdict.margin, run.verdict.margin_band)


def test_without_physics_there_is_neither() -> None:
    run = made(plant="kinematic")
    assert set(run.verdict.margin_band) == {None}
    assert run.verdict.margin_told == ""


def test_a_servo_axis_has_no_band_of_torque() -> None:
    """What it keeps is of its following error."""
    lines = parse_job("G90\n", create_language("gmi99"), "gmi99")
    verdict = played(TwinSpec("4030-servo", "gmi99").build(), lines).verdict
    assert verdict.margin[0] is not None
    assert verdict.margin_band[0] is None


def test_check_tells_it_with_the_verdict_and_the_finding(tmp_path: Path) -> None:
    lines = parse_job(MOVE.format(hz=16_000), create_language("imc-s8"), "imc-s8")
    report = check_job(tmp_path / "job.txt", TwinSpec(), lines, Bounds(margin=0.95))
    band = made(16_000).results[2]
    told = f"{100 * band.margin[0]:.0f} % ({100 * band.margin_band[0][0]:.0f} to {100 * band.margin_band[0][1]:.0f} %)"
    assert f"x keeps {told} torque; at least 95 %" in as_words(report)
    assert ", margin " in as_words(report).splitlines()[0]
    assert "%)" in as_words(report).splitlines()[0]


@pytest.mark.parametrize(
    ("margins", "bands", "words"),
    [
        ((0.71, None, 0.9), ((0.66, 0.752), None, (0.88, 0.915)), "71 % (66 to 75 %)"),
        ((1.0,), ((1.0, 1.0),), "100 %"),
        ((0.3,), (None,), "30 %"),
        ((None, None), (None, None), ""),
    ],
)
def test_the_words(margins: Any, bands: Any, words: str) -> None:
    assert in_percent(margins, bands) == words
