"""Axes that have left the interpolation (p4), on the whole machine."""

from __future__ import annotations

import pytest

from isel_twin import Twin


def started(plant: str) -> Twin:
    """Z has a program of its own, X and Y make a path, and all three are on their way."""
    twin = Twin("4030-servo", "gmi99", plant=plant, start_mm=(20.0, 20.0, 20.0), seed=1)
    for line in (
        "Q7;1",
        "M50000",
        "p3;100;0",
        "81h 1",
        "p3;101",
        "p3;100;1",
        "f8000",
        "84h 6000",
        "84h 1000",
        "p3;101",
    ):
        twin.query(line)
    twin.write(b"".join(twin.language.frame(line) for line in ("p4;1;513", "83h 30000 9000")))
    twin.run(0.7)
    return twin


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_the_carriages_get_where_program_and_path_send_them(plant: str) -> None:
    twin = started(plant)
    moving = twin.counts.tolist()
    assert 0 < moving[0] < 30_000
    assert 0 < moving[2] < 6_000
    twin.run_until_idle(60.0)
    twin.run(0.5)
    assert twin.counts[:3].tolist() == [30_000, 9_000, 1_000]
    assert twin.position_mm[:3].tolist() == pytest.approx([30.0, 9.0, 1.0], abs=0.05)
    assert not twin.fault


def test_saved_in_the_middle() -> None:
    twin = started("kinematic")
    other = Twin("4030-servo", "gmi99", plant="kinematic", start_mm=(20.0, 20.0, 20.0), seed=1)
    other.restore(twin.save())
    lives = []
    for one in (twin, other):
        one.run_until_idle(60.0)
        lives.append((one.time_ns, one.counts.tolist(), one.machine_position_mm.tolist()))
    assert lives[0] == lives[1]
