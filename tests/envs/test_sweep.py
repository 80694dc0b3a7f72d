"""Tables of jobs: what was asked for, on whatever executor, and what the table says."""

from __future__ import annotations

import dataclasses
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin.envs import Settings, Setup, fastest, grid, run_job, sweep

SETUP = Setup(job=[(10.0, 4.0, 1.0), (0.0, 8.0, 2.0)])
LONG_X = Setup(job=[(100.0, 0.0, 0.0)])
TRIALS = grid(speed_hz=[10_000, 40_000], acceleration_hz_per_ms=[100, 4000], start_stop_hz=[300])


def test_a_grid_is_every_combination_in_order() -> None:
    expected = [
        Settings(10_000, 100, 300),
        Settings(10_000, 4000, 300),
        Settings(40_000, 100, 300),
        Settings(40_000, 4000, 300),
    ]
    assert expected == TRIALS


def test_rows_do_not_depend_on_who_computes_them() -> None:
    here = sweep(SETUP, TRIALS)
    assert [(row.speed_hz, row.acceleration_hz_per_ms) for row in here] == [
        (10_000, 100), (10_000, 4000), (40_000, 100), (40_000, 4000)
    ]  # fmt: skip
    with ThreadPoolExecutor(2) as threads:
        assert sweep(SETUP, TRIALS[:2], threads) == here[:2]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as processes:
        assert sweep(SETUP, TRIALS[2:], processes) == here[2:]


def test_work_items_and_rows_travel() -> None:
    row = run_job(SETUP, TRIALS[0])
    for item in (SETUP, TRIALS[0], row):
        assert pickle.loads(pickle.dumps(item)) == item


def test_what_the_reference_axis_can_and_cannot_do() -> None:
    """48 V, 0.6 Nm extra load: 100 Hz/ms to 16000 Hz loses nothing, 4000 Hz/ms does."""
    loaded = dataclasses.replace(LONG_X, load_nm=0.6)
    gentle, harsh = sweep(loaded, grid([16_000], [100, 4000]))
    assert (gentle.good, gentle.reply, gentle.moves, gentle.load_nm) == (True, "0", 1, 0.6)
    assert gentle.lost_steps < 8.0, "load angle: less than one full step"
    assert not harsh.good
    assert harsh.lost_steps > 32.0


def test_the_load_adds_to_what_drags_already() -> None:
    free, dragging, loaded = (
        run_job(setup, Settings(5000))
        for setup in (
            LONG_X,
            dataclasses.replace(LONG_X, overrides={"axes.all.shaft_coulomb": 0.59}),
            dataclasses.replace(LONG_X, load_nm=0.5),
        )
    )
    assert dataclasses.replace(loaded, load_nm=0.0) == dragging, "0.09 Nm of the machine and 0.5 Nm of load"
    assert loaded.deviation_mm > free.deviation_mm


def test_a_job_ends_with_the_first_refusal(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('[[event]]\nat = 6.0\nset = { limit_x2 = "broken" }', encoding="utf-8")
    job = [(100.0, 0.0, 0.0), (0.0, 0.0, 0.0), (50.0, 0.0, 0.0)]  # 3.3 s, and two s before for the reference run
    row = run_job(Setup(job=job, plant="kinematic", scenario=scenario), Settings(10_000, 100, 300))
    assert (row.reply, row.moves, row.good) == ("2", 2, False)


def test_the_fastest_ramp_stands_the_load_and_a_little_more_does_not() -> None:
    setup = Setup(job=[(30.0, 0.0, 0.0)])
    found = fastest(setup, Settings(16_000), "acceleration_hz_per_ms", margin_nm=0.3, resolution=0.1)
    ramp = found.settings.acceleration_hz_per_ms
    assert found.row == run_job(setup, found.settings)
    assert found.loaded == run_job(dataclasses.replace(setup, load_nm=0.3), found.settings)
    assert (found.row.good, found.loaded.good, found.loaded.load_nm) == (True, True, 0.3)
    assert found.failed is not None
    assert not found.failed.good
    assert 1.0 < found.failed.acceleration_hz_per_ms / ramp < 1.11
    assert 400 < ramp < 4000, "above the field's settings, below what loses steps with any load"


def test_without_physics_the_controller_is_the_limit() -> None:
    setup = Setup(job=[(30.0, 0.0, 0.0)], plant="kinematic")
    found = fastest(setup, Settings(), "speed_hz", margin_nm=0.3)
    assert (found.settings.speed_hz, found.failed) == (40_000, None)


@pytest.mark.parametrize(
    ("settings", "vary", "options", "message"),
    [
        (Settings(), "speed", {}, "vary is 'speed'; it can be: speed_hz"),
        (Settings(40_000, 4000, 4000), "speed_hz", {}, "speed_hz = 40000 is already too fast"),
        (Settings(), "speed_hz", {"resolution": 0.0}, "resolution is 0.0"),
    ],
)
def test_bad_questions_get_one_clear_line(settings: Settings, vary: str, options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        fastest(LONG_X, settings, vary, margin_nm=0.1, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("values", [(29,), (200_001,), (5000, 0), (5000, 4001), (5000, 1, 19), (5000, 1, 4001), (5e3,)])
def test_settings_outside_the_controllers_ranges_are_refused(values: Any) -> None:
    with pytest.raises(ValueError, match="must be a whole number from"):
        Settings(*values)


def test_settings_that_this_controller_cannot_be_told_are_named() -> None:
    with pytest.raises(ValueError, match=r"speed_hz is 40001; .* 30 to 40000"):
        run_job(Setup(job=[(1.0, 0.0, 0.0)], plant="kinematic"), Settings(40_001))
    with pytest.raises(ValueError, match="speed_hz is 10000; the controller takes 65 to 5000"):
        run_job(Setup(job=[(1.0, 0.0, 0.0)], plant="kinematic", controller="ismif"), Settings())


def test_the_fastest_setting_is_looked_for_in_the_range_of_the_controller() -> None:
    setup = Setup(job=[(30.0, 0.0, 0.0)], plant="kinematic", controller="ismif")
    found = fastest(setup, Settings(1000), "speed_hz", margin_nm=0.0)
    assert (found.settings.speed_hz, found.failed) == (5000, None)


def test_numpy_integers_are_welcome() -> None:
    assert grid(np.arange(1000, 3000, 1000)) == [Settings(1000), Settings(2000)]
