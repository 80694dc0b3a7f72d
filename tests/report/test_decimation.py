"""Pictures of more than a screen can hold show the extremes of what lies in a pixel, and each fault."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.base.thinning import extremes
from isel_twin.jobs.result import Result
from isel_twin.recordings.recorder import Change, Recorder
from isel_twin.report import columns
from isel_twin.report.times import time_plots

END_NS = 3_000_000_000
MILLISECOND_NS = 1_000_000


@pytest.mark.parametrize("most", [50, 399, 5000])
def test_points_that_are_left_out_lie_between_those_that_remain(most: int) -> None:
    """In each column and each stretch; n and most as they come."""
    random = np.random.default_rng(most)
    values = random.standard_normal((10_007, 3)).cumsum(axis=0)
    values[random.integers(0, 10_007, 5), 1] = np.nan
    kept = extremes(values, most)
    assert len(kept) <= most
    assert kept[0] == 0
    assert kept[-1] == 10_006
    assert np.array_equal(np.nanmin(values[kept], axis=0), np.nanmin(values, axis=0))
    assert np.array_equal(np.nanmax(values[kept], axis=0), np.nanmax(values, axis=0))
    spiked = np.zeros((10_007, 1))
    spiked[100::2500] = 1.0
    assert spiked[extremes(spiked, most)].sum() == spiked.sum()


def test_few_points_all_remain() -> None:
    assert extremes(np.zeros((40, 3)), 40).tolist() == list(range(40))


def test_a_path_of_many_vertices_keeps_its_corners() -> None:
    """Teeth of 0.05 mm on a line back and forth, 200 000 vertices in all, of which one reaches out."""
    x = np.abs(np.arange(200_000) % 20_000 - 10_000) / 10_000 * 100.0
    y = np.arange(200_000) % 2 * 0.2
    y[123_457] = 7.0
    position_mm = np.stack([x, y, np.zeros_like(x)], axis=1)
    maker = columns._WayMaker(0.05)
    for part in range(0, 200_000, 50_000):
        maker.add(np.arange(50_000) + part, position_mm[part : part + 50_000], np.zeros(50_000))
    way = maker.made()
    assert len(way.time_ns) <= columns.MOST_WAY
    assert way.position_mm[:, 1].max() == 7.0
    assert (way.position_mm[:, 0].min(), way.position_mm[:, 0].max()) == (0.0, 100.0)


def plots_of(results: Sequence[Result] = (), changes: Sequence[Change] = (), events: int = 0) -> str:
    """The time plots of three seconds at rest."""
    twin = Twin(plant="kinematic")
    with Recorder(twin, 10 * MILLISECOND_NS) as recorder:
        twin.run(END_NS / 1e9)
        recorder.changes += changes
        recorder.events += [(k * MILLISECOND_NS, "remark", f"number {k}") for k in range(events)]
        return time_plots(columns.columns(recorder, twin.step_mm, twin.time_ns), results, recorder, [], {}).svg


def test_the_least_margin_of_many_short_lines_is_drawn() -> None:
    """3000 lines of a millisecond with a margin of 0.9, one of them with 0.25: 80 px * 0.65 lower."""
    results = [
        Result(k, f"line {k}", "", True, k * MILLISECOND_NS, (k + 1) * MILLISECOND_NS, (0,), (0.0,), (margin,))
        for k, margin in enumerate([0.9] * 1501 + [0.25] + [0.9] * 1498)
    ]
    (path,) = re.findall(r"<g id='curves-margin'>.*?<path class='line x' d='([^']*)'", plots_of(results))
    levels = {float(level) for level in re.findall(r" ([\d.]+)[VH]|V([\d.]+)H", path) for level in level if level}
    assert len(levels) == 2
    assert max(levels) - min(levels) == pytest.approx(0.65 * 80.0, abs=0.11)


def test_a_short_fault_among_many_changes_is_drawn() -> None:
    """A contact that is struck and free 3000 times, and once, for half a millisecond, broken."""
    states = ["struck" if k % 2 else "free" for k in range(3000)]
    changes = [Change(k * MILLISECOND_NS, "input", "limit_x1", state) for k, state in enumerate(states)]
    changes[1503:1503] = [Change(1_502_500_000, "input", "limit_x1", "broken")]
    svg = plots_of(changes=changes)
    (fault,) = re.findall(r"<rect class='fault' x='([\d.]+)' y='[\d.]+' width='([\d.]+)'", svg)
    assert float(fault[0]) - 1.0 <= 1.5025 / 3.0 * 1020 <= float(fault[0]) + float(fault[1])


def test_every_event_has_a_mark_within_a_pixel_of_it() -> None:
    places = np.array([float(x) for x in re.findall(r"<path class='event'[^>]* d='M([\d.]+)", plots_of(events=2900))])
    assert np.diff(places).max() < 1.5
    assert places[-1] == pytest.approx(2.899 / 3.0 * 1020, abs=1.0)
