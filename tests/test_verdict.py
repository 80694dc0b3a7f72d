"""The verdict on a job, and the one rule for "a step is lost", on closed cases."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from isel_twin.core.twin import Twin
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.sending import play
from isel_twin.jobs.verdict import SETTLE_S, Verdict, halfway, judge, lost

SLIP = 32.0
"""Four full steps at 1600 steps a revolution."""


@pytest.mark.parametrize(
    ("steps", "is_lost"),
    [
        (0.0, False),
        (7.9, False),
        (math.nextafter(16.0, 0.0), False),
        (16.0, True),
        (-16.0, True),
        (math.nextafter(-16.0, 0.0), False),
        (32.0, True),
        (-1e9, True),
        (math.inf, True),
        (math.nan, True),
    ],
)
def test_half_a_slip_is_lost(steps: float, is_lost: bool) -> None:
    assert lost([steps], [SLIP]).tolist() == [is_lost]


def test_each_axis_has_its_own_slip() -> None:
    """Half steps: eight in a slip. An axis without a motor has one step."""
    found = lost(np.array([5.0, 5.0, 0.4, 0.5]), np.array([32.0, 8.0, 1.0, 1.0]))
    assert found.dtype == np.bool_
    assert found.tolist() == [False, True, False, True]


WELL = Verdict(
    commands=5,
    refused=0,
    lost_steps=(0.25, -1.0, 3.00049, 0.0),
    forgotten_steps=(0.0, 0.0, 0.0, 0.0),
    slip_steps=(SLIP, SLIP, SLIP, 1.0),
    fault_cause="",
    faults={},
    ticks=24_000,
    counts=(16_000, 8_000, 0, 0),
    position_mm=(50.0000004, 25.0, 0.0),
    position_error_mm=(4e-7, 0.0, 0.0),
    began_ns=0,
    ended_ns=4_000_000_000,
    time_ns=4_500_000_000,
    machine="4030",
    margin=(0.71, 0.9, 0.93, None),
    margin_band=((0.66, 0.75), (0.89, 0.91), (0.92, 0.94), None),
)


@pytest.mark.parametrize(
    ("change", "ok", "lost_axes"),
    [
        ({}, True, (False, False, False, False)),
        ({"refused": 1}, False, (False, False, False, False)),
        ({"fault_cause": "emergency stop"}, False, (False, False, False, False)),
        ({"flash_fault": True}, False, (False, False, False, False)),
        ({"unsent": 1}, False, (False, False, False, False)),
        ({"interrupted": True}, False, (False, False, False, False)),
        ({"unfinished": 1}, False, (False, False, False, False)),
        ({"restarts": 1}, False, (False, False, False, False)),
        ({"unpowered_steps": 1}, False, (False, False, False, False)),
        ({"stores_lost": 1}, False, (False, False, False, False)),
        ({"events_after_end": 3, "events_without_effect": 2}, True, (False, False, False, False)),
        ({"faults": {"limit_x1": "broken"}}, True, (False, False, False, False)),
        ({"lost_steps": (0.0, -16.0, 0.0, 0.0)}, False, (False, True, False, False)),
        ({"lost_steps": (8.0, -8.0, 11.9, 0.0)}, True, (False, False, False, False)),
        ({"lost_steps": (0.0, -15.9, 0.0, 0.0)}, False, (False, False, False, False)),
        ({"lost_steps": (0.0, 47.9, 0.0, 0.0)}, False, (False, True, False, False)),
        ({"forgotten_steps": (0.0, 0.0, SLIP, 0.0)}, False, (False, False, True, False)),
    ],
)
def test_what_makes_a_job_well_done(change: dict[str, object], ok: bool, lost_axes: tuple[bool, ...]) -> None:
    verdict = dataclasses.replace(WELL, **change)
    assert (verdict.ok, verdict.lost) == (ok, lost_axes)
    assert verdict.summary()["ok"] is ok
    assert verdict.accepted == 5 - verdict.refused - verdict.unfinished


def test_the_summary_has_the_keys_of_the_json_line_in_their_order() -> None:
    assert list(WELL.summary().items()) == [
        ("ok", True),
        ("commands", 5),
        ("refused", 0),
        ("lost_steps", [0, 0, 0, 0]),
        ("lost_before_reference", [0, 0, 0, 0]),
        ("controller_fault", False),
        ("fault_cause", ""),
        ("steps", 24_000),
        ("counts", [16_000, 8_000, 0, 0]),
        ("position_mm", [50.0, 25.0, 0.0]),
        ("time_ns", 4_500_000_000),
        ("machine", "4030"),
        ("unsent", 0),
        ("interrupted", False),
        ("unfinished", 0),
        ("restarts", 0),
        ("unpowered_steps", 0),
        ("stores_lost", 0),
        ("physics", True),
        ("odd", []),
        ("flash_fault", False),
        ("events_after_end", 0),
        ("events_without_effect", 0),
        ("margin", [0.71, 0.9, 0.93, None]),
        ("margin_band", [[0.66, 0.75], [0.89, 0.91], [0.92, 0.94], None]),
        ("edge", {}),
        ("halfway", [False, False, False, False]),
        ("expectations", 0),
        ("unmet", []),
        ("bytes_ns", 0),
        ("line_counts", False),
    ]


def test_a_job_is_judged_at_rest() -> None:
    twin = Twin(plant="kinematic")
    lines = parse_job("@07\n@0R7\n@0M16000,5000,8000,5000,0,5000,0,30\nnonsense", twin.language, "imc-s8")
    results = list(play(twin, lines, 3600.0))
    twin.set_input("limit_x2", "stuck_closed")
    verdict = judge(twin, results)
    assert (verdict.commands, verdict.accepted, verdict.refused, verdict.ok) == (4, 3, 1, False)
    assert verdict.counts == (16_000, 8_000, 0, 0)
    assert verdict.position_mm == pytest.approx((50.0, 25.0, 0.0), abs=1e-9)
    assert verdict.position_error_mm == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert verdict.faults == {"limit_x2": "stuck_closed"}
    assert verdict.ticks == len(twin.steps)
    assert (verdict.began_ns, verdict.ended_ns) == (0, results[-1].end_ns)
    assert verdict.time_ns == verdict.ended_ns + round(SETTLE_S * 1e9) == twin.time_ns


def test_a_job_without_commands_is_well_done() -> None:
    verdict = judge(Twin(plant="kinematic"), [])
    assert verdict.ok
    assert (verdict.commands, verdict.began_ns, verdict.ended_ns, verdict.time_ns) == (0, 0, 0, 500_000_000)


def test_a_rotor_between_two_places_that_hold_is_told_as_such() -> None:
    """A slip is 32 microsteps: 16 and 48 are the middles; a motor at its greatest load lags by 8."""
    lags = [0.0, 8.0, -8.0, 15.9, -16.1, 32.0, 47.5, 64.2]
    assert halfway(lags, [SLIP] * len(lags)).tolist() == [False, False, False, True, True, False, True, False]
