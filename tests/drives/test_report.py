"""What `isel-twin motor NAME` shows."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from isel_twin.drives.curves import pull_out_envelope, pull_out_prediction, pull_out_torque
from isel_twin.drives.library import MOTORS
from isel_twin.drives.report import default_stage, draw_torque, show_motor, torque_table
from isel_twin.drives.stage import Stage

pytestmark = pytest.mark.long(seconds=4)


def test_the_table_puts_bench_and_closed_form_side_by_side() -> None:
    motor, stage = MOTORS["57HS56-2804"], Stage(32.0, 2.0, 2)
    (point,) = torque_table(motor, stage, [360])
    assert point.speed_rpm == 360
    assert point.pull_out_nm == pull_out_torque(motor, stage, 360)
    assert point.predicted_nm == pull_out_prediction(motor, stage, 360)
    assert point.envelope_nm == pull_out_envelope(motor, stage, 360)


def test_no_torque_is_printed_without_its_band(capsys: pytest.CaptureFixture[str]) -> None:
    """Far beyond what was compared, too; and so is what follows from the torque."""
    show_motor("34HS59-6004D", Stage(24.0, 8.5))
    out = capsys.readouterr().out
    rows = [line.replace("~", " ").split() for line in out.splitlines() if line.endswith("|")]
    assert [float(row[0]) for row in rows][-1] == 1000
    for _, pull_out, least, most, predicted, *_ in rows:
        assert float(least) <= min(float(pull_out), float(predicted))
        assert float(most) >= max(float(pull_out), float(predicted))
        assert float(most) > float(least)
    assert re.search(r"up to \d+ steps/s of this stage \(\d+ to \d+; ", out)
    assert re.search(r"resonance, unloaded: \d+ Hz \(\d+ to \d+\)", out)
    assert re.search(r"beyond \d+ rev/min nobody compared", out)


def test_as_json_each_point_has_the_ends_and_what_they_are_off(capsys: pytest.CaptureFixture[str]) -> None:
    show_motor("23HS32-4004S", json=True)
    point = json.loads(capsys.readouterr().out)["curve"][0]
    torque, least, most = (point[key] for key in ("pull_out_nm", "least_nm", "most_nm"))
    assert least < torque < most
    assert point["band"] == pytest.approx(max(most / torque - 1.0, 1.0 - least / torque))


def test_in_full_step_the_makers_limit_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """QSH6018 manual: 228.9 rev/min at 24 V and 2.8 A."""
    show_motor("QSH6018-65-28-210", Stage(24.0, 2.8, 1))
    (limit,) = re.findall(r"limits of two motors would be (\d+) rev/min", capsys.readouterr().out)
    assert float(limit) == pytest.approx(228.9, rel=0.03)


def test_a_motor_is_shown_on_the_stage_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    show_motor("57HS56-2804", Stage(32.0, 2.0, 2))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "57HS56-2804 at 32 V, 2 A peak (1.41 A RMS), half step, fast stage"
    speeds = [float(line.split()[0]) for line in lines if line.endswith("|")]
    assert speeds[:3] == [30, 60, 90]
    assert speeds[-1] == 1000


def test_the_range_that_was_compared_is_marked(capsys: pytest.CaptureFixture[str]) -> None:
    """Curve C of 14HS17-0504S: from 90 (below lies the resonance) to 450 rev/min."""
    show_motor("14HS17-0504S", Stage(20.0, 0.5, 2))
    out = capsys.readouterr().out
    marked = [float(line.split()[0]) for line in out.splitlines() if line.strip()[:1].isdigit() and " * " in line]
    assert marked == [90, 150, 200, 250, 300, 350, 400, 450]
    assert "* compared with the maker's curve, at 20 V, 0.5 A, half step, 90 to 450 rev/min" in out
    show_motor("14HS17-0504S", Stage(24.0, 0.5, 2))
    assert " * " not in capsys.readouterr().out
    show_motor("57HS56-2804", Stage(32.0, 2.0, 2))
    assert "no maker's curve of this motor was compared" in capsys.readouterr().out


def test_by_default_1600_microsteps_a_revolution_at_rated_current() -> None:
    assert default_stage(MOTORS["23HS32-4004S"]) == Stage(48.0, 4.0, 8)
    assert default_stage(MOTORS["57STH56-2804MAC"]) == Stage(48.0, 2.8, 4)


def test_an_unknown_motor_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"nema17.*23HS32-4004S"):
        show_motor("nema17")


def test_the_curve_can_be_drawn(tmp_path: Path) -> None:
    file = tmp_path / "curve.svg"
    draw_torque(torque_table(MOTORS["57HS56-2804"], Stage(36.0, 2.8), [90, 300]), "a title", file)
    drawn = file.read_text()
    assert drawn.count('<g id="axes_') == 2, "torque, and the growth of a swing"
