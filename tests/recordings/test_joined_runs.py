"""Recordings of joined set points: every tick that was made, described instead of listed, one by one as they change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.motion import SetPointRun, Steps
from isel_twin.motion.joined import Joined, joined
from isel_twin.motion.pieces import piece
from isel_twin.recordings.reading import read
from isel_twin.recordings.recording import FileRecording
from isel_twin.recordings.runs import add_run, described, motion_from


def test_a_session_of_joined_moves_is_read_to_the_bit(tmp_path: Path) -> None:
    """Moves that arrive in motion, an override, a stop flag and an abort."""
    twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic", start_mm=(200.0, 150.0, 70.0))
    path = tmp_path / "session.mcap"
    recording = FileRecording(path, twin, 10_000_000)

    def tell(*lines: str) -> None:
        for line in lines:
            assert twin.language is not None
            twin.write(twin.language.frame(line))
            twin.run(0.0)
            assert twin.read() == b"\xe5"

    tell("Q7;0")
    assert twin.run_until_idle()
    tell("M50000", "f10000", "N1000;11", "N500;16", "G91")
    for k in range(60):
        tell(f"83h {300 + k} {(-1) ** k * 40}")
        twin.run(0.013)
        tell(*{20: ["#9 60"], 30: ["p11;0;1"], 45: ["p11;0;0"]}.get(k, []))
    twin.run(0.4)
    tell("#0")
    assert twin.run_until_idle()
    tell("81h -500")
    assert twin.run_until_idle()
    assert recording.close()
    recorded = read(path)
    assert len(twin.steps) > 300
    assert np.array_equal(recorded.steps().t_ns, twin.steps.t_ns)
    assert np.array_equal(recorded.steps().delta, twin.steps.delta)
    runs = [entry.content["run"] for entry in recorded.of("/runs") if entry.content["run"] is not None]
    assert sum("joined" in run for run in runs) > 40
    assert sum(run.get("later", False) for run in runs) > 30


def test_what_follows_costs_what_is_new() -> None:
    """A day of one move, then another at its end: the second message has no more than two pieces."""
    before = SetPointRun(joined(piece((25_000_000.0,), 25_000_000, 300, 50_000), 4_000_000), 4_000_000, 0)
    late_ns = 80_000 * 10**9
    plan = before.plan
    assert isinstance(plan, Joined)
    after = SetPointRun(plan.replanned(before.count(late_ns), append=piece((1000.0,), 1000, 300, 50_000)), 4_000_000, 0)
    whole, later = described(before), described(after, before, late_ns)
    assert len(str(whole)) < 1000
    assert len(str(later)) < 1000
    steps = Steps(1)
    add_run(steps, 0, {"run": whole, "continues": False})
    add_run(steps, late_ns, {"run": later, "continues": True})
    assert len(steps) == after.last
    assert steps.motions[0].displacement(after.end_ns) == (25_001_000,)


def test_what_comes_later_needs_the_beginning() -> None:
    run = SetPointRun(joined(piece((2500.0,), 2500, 300, 50_000), 4_000_000), 4_000_000, 0)
    with pytest.raises(ValueError, match="beginning"):
        motion_from(described(run, run, 10**9))
    table = described(run)
    table["joined"]["piece"] = "nonsense"
    with pytest.raises(ValueError, match=r"no motion|stretch|padding|Incorrect"):
        motion_from(table)
