"""What is sampled in the compiled loop is, to the bit, what looking at every time of the grid shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.envs import JOB, Settings
from isel_twin.envs.moves import Move, Setup, make_move, referenced_twin
from isel_twin.envs.watching import Watch, error_mm

SCENARIO = """
[[event]]
at = 2.1
force_n = { x = 60.0 }
[[event]]
at = 2.15
payload_kg = { table = 5.0 }
"""


def moves(setup: Setup, settings: list[Settings]) -> list[Move]:
    twin = referenced_twin(setup)
    return [make_move(twin, target, one, setup, 5.0) for target, one in zip(setup.job, settings, strict=False)]


@pytest.mark.parametrize("machine", ["4030", "4030-portal"])
def test_moves_are_measured_alike_either_way(machine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Good moves, one that loses steps, one that is broken off, pushes from outside."""
    file = tmp_path / "events.toml"
    file.write_text(SCENARIO)
    setup = Setup(machine=machine, seed=3, scenario=file, job=[*JOB[:3], (30.0, 0.0, 0.0)])
    settings = [
        Settings(20_000, 400, 300),
        Settings(2_000, 40, 300),
        Settings(39_000, 4000, 3900),
        Settings(900, 9, 90),
    ]
    sampled = moves(setup, settings)
    monkeypatch.setattr(Twin, "sample", lambda *_, **__: None)
    looked = moves(setup, settings)
    assert [move.slipped for move in looked] == [False, False, True, False]
    assert [move.done for move in looked][3] is False
    for one, other in zip(sampled, looked, strict=True):
        for name, value in vars(one).items():
            assert np.asarray(value).tobytes() == np.asarray(getattr(other, name)).tobytes(), name


def test_odd_instants_and_a_machine_that_does_not_stop() -> None:
    """Instants between two sub-steps, ticks after the last of them."""
    seen = []
    for look in (True, False):
        twin = Twin(seed=3, start_mm=(3.0, 2.0, 1.0))
        for text in ("@07", "@0R7"):
            twin.query(text)
        twin.write(b"@0A6400,19777,900,3000,0,100,0,100\r")
        twin.run_until(twin.time_ns + 30_012_347)
        begin_ns = twin.time_ns
        if look:
            errors = []
            for number in range(1, 301):
                twin.run_until(begin_ns + number * 1_000_000)
                errors.append(error_mm(twin))
            seen.append(np.array(errors))
        else:
            watch = Watch(twin, 1_000_000)
            assert watch.in_loop
            twin.run_until(begin_ns + 300_000_000)
            seen.append(watch.errors_mm())
        assert not twin.idle
    assert seen[0].shape == (300, 3)
    assert np.ptp(seen[0][:, 0]) > 0.001
    assert seen[0].tobytes() == seen[1].tobytes()
