"""Paths that never stop: the motion is handed over in mid-flight, and neither machine nor set points notice."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.firmware.bwo900.realtime import stretch
from isel_twin.motion import Motion, Steps
from isel_twin.recordings.runs import add_run, described

PIECE_MM = 0.2


def contour(count: int) -> str:
    """A closed zigzag curve of short pieces and arcs, all of one stretch, at F3000."""
    blocks = ["N1 G90 G1 F3000 X0 Y0 Z0"]
    for n in range(1, count):
        x, y = 10 + 8 * np.cos(n * PIECE_MM / 8), 10 + 8 * np.sin(n * PIECE_MM / 8)
        blocks.append(f"N{n + 1} X{x:.3f} Y{y:.3f} Z{1 + 0.5 * np.sin(n / 50):.3f}" + " P500:1" * (n % 97 == 0))
    return "\r\n".join(["P1", *blocks, f"N{count + 1} M30", "#", ""])


def drive(plant: str, pieces: int, most: int, monkeypatch: pytest.MonkeyPatch, *, meddle: bool) -> tuple[Twin, list]:
    """Run it; what was seen every 50 ms, and the twin."""
    with monkeypatch.context() as patched:
        patched.setattr(stretch, "MOST_PIECES", most)
        twin = Twin(controller="bwo900", machine="4030-servo", plant=plant, start_mm=(5.0, 5.0, 5.0))
        twin.write(b"D\r\nP8683: 1\r\nP12130: 1\r\nP12330: 1\r\nP12530: 1\r\n#\r\n")
        assert twin.run_until_idle(100.0)
        twin.write(contour(pieces).encode())
        twin.write(b"D\r\nP8800: 1\r\nP8683: 2\r\nP8684: 1\r\n#\r\n")
        seen = []
        for n in range(10_000):
            twin.run(0.05)
            seen.append((twin.counts.tolist(), twin.position_mm.tolist(), twin.time_ns))
            if meddle and n == 30:
                twin.press("override", 40.0)
            elif meddle and n == 60:
                twin.press("stop")
            elif meddle and n == 80:
                twin.press("start")
            elif meddle and n == 85:
                twin.press("override", 120.0)
            if n > 90 and twin.idle:
                break
        assert not twin.fault
        return twin, seen


@pytest.mark.parametrize("meddle", [False, True], ids=["undisturbed", "override, stop, start"])
def test_a_motion_is_handed_over_without_a_trace(meddle: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    short, seen = drive("kinematic", 1500, 300, monkeypatch, meddle=meddle)
    whole, same = drive("kinematic", 1500, 1 << 30, monkeypatch, meddle=meddle)
    assert seen == same
    assert len(short.steps.motions) >= len(whole.steps.motions) + 3
    assert np.array_equal(short.steps.t_ns, whole.steps.t_ns)
    assert np.array_equal(short.steps.delta, whole.steps.delta)


def test_the_machine_does_not_feel_it(monkeypatch: pytest.MonkeyPatch) -> None:
    _, seen = drive("mujoco", 700, 300, monkeypatch, meddle=True)
    _, same = drive("mujoco", 700, 1 << 30, monkeypatch, meddle=True)
    assert seen == same


def test_a_recording_of_it_has_every_set_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """Motions that begin in flight, written down and read as a recording does it."""
    monkeypatch.setattr(stretch, "MOST_PIECES", 300)
    twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(5.0, 5.0, 5.0))
    read, shown = Steps(3), list[Motion | None]([None])

    def note(time_ns: int, kind: str, what: Any) -> None:
        if kind == "motion":
            before = shown[-1]
            goes_on = what is not None and before is not None and what.continues(before)
            run = None if what is None else described(what, before if goes_on else None, time_ns)
            add_run(read, time_ns, json.loads(json.dumps({"run": run, "continues": goes_on})))
            shown.append(what)

    twin.listen(note)
    twin.write(b"D\r\nP8683: 1\r\nP12130: 1\r\nP12330: 1\r\nP12530: 1\r\n#\r\n")
    assert twin.run_until_idle(100.0)
    twin.write(contour(1500).encode() + b"D\r\nP8800: 1\r\nP8683: 2\r\nP8684: 1\r\n#\r\n")
    twin.run(1.5)
    twin.press("override", 40.0)
    assert twin.run_until_idle(100.0)
    made = read.until(twin.time_ns)
    assert sum(motion.first > 0 for motion in made.motions) >= 3
    assert np.array_equal(made.t_ns, twin.steps.t_ns)
    assert np.array_equal(made.delta, twin.steps.delta)
