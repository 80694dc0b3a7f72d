"""What a CAM program says that a job takes, beside what the machine takes."""

from __future__ import annotations

import math

import pytest
from cam.played import END, FAST, P, arc, line, played, rapid

from isel_twin.cam.estimate import Estimate
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Dwell, Element, Rapid, Spindle


def seconds_of(path: list[Element], settings: CamSettings) -> float:
    sums = Estimate(settings)
    assert list(sums.watched(iter(path))) == path
    return sums.seconds


def test_ways_by_their_feeds() -> None:
    """30 mm at 30 mm/s, 10 mm at 10 mm/s, 5 mm at 5 mm/s, a half circle of r = 10, pauses of 2 and 0.5 s."""
    path = [
        rapid(30, 0, 0),
        Spindle(P, 1, 12000.0, 2.0),
        line(30, 0, -10),
        Rapid(P, (30.0, 0.0, -5.0), 5.0),
        arc((50, 0, -5), (40, 0, 0), -1),
        Dwell(P, 0.5),
        END,
    ]
    assert seconds_of(path, FAST) == pytest.approx(1 + 2 + 1 + 1 + math.pi + 0.5)


def test_a_helix_and_a_start() -> None:
    """Two turns of r = 5 and 3 mm down at 10 mm/s; the rapid of 30 mm begins where the tool stands."""
    settings = CamSettings(rapid_mm_s=30.0, start=(15.0, 0.0, 0.0))
    path = [rapid(45, 0, 0), arc((45, 0, -3), (40, 0, 0), 2), END]
    assert seconds_of(path, settings) == pytest.approx(1 + math.hypot(20 * math.pi, 3) / 10)


def test_short_chords_take_the_machine_longer_than_the_cam_program_says() -> None:
    """158 chords of a circle with r = 10 at 10 mm/s (2 um): 6.28 s there; here each has ramps of its own, 0.03 s more
    for chords along an axis, less for others."""
    angles = [2 * math.pi * k / 158 for k in range(159)]
    path = [rapid(60, 50, 0), *(line(50 + 10 * math.cos(a), 50 + 10 * math.sin(a), 0) for a in angles), END]
    said_s = seconds_of(path[1:-1], CamSettings(rapid_mm_s=30.0, start=(60.0, 50.0, 0.0)))
    assert said_s == pytest.approx(2 * math.pi, abs=0.001)
    run = played("imc-s8", path)
    began = int(run.t_ns[(run.counts[1:] == run.counts[-1]).all(axis=1)][0])  # the end of the rapid is that of the path
    assert 8.5 < (int(run.t_ns[-1]) - began) / 1e9 < 10.42
