"""The stage of the twin, a current source that the supply limits, beside a switched bridge with the whole supply.

The reference (bridge.py) has a 20 kHz chopper with a peak-current comparator and the usual decay: slow while the
current is to rise, mixed while it is to fall. It has no supply factor; see decision drives/1.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from drives.bridge import AUTO, MIXED, SLOW, Rig, pull_out, run, run_adaptive
from numpy.typing import NDArray

from isel_twin.drives.curves import follow, mean_command, pull_out_torque
from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.library import MOTORS
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage

pytestmark = pytest.mark.long(seconds=4)

IRON = 1650 * 3.2e-3 ** (2 / 3) * 0.65 ** (1 / 3)
NEMA23 = Rig(0.65, 3.2e-3, 2.4 / (math.sqrt(2) * 4.0), 2 * 530e-7, 0.06, IRON, 72.0, supply=48.0, current=4.2)
NEMA17 = Rig(
    1.4, 3.0e-3, 0.52 / (math.sqrt(2) * 2.0), 2 * 82e-7, 0.12 * 0.52 / (math.sqrt(2) * 2.0) / math.sqrt(1.4),
    1650 * 3.0e-3 ** (2 / 3) * 1.4 ** (1 / 3), 72.0, supply=24.0, current=2.0,
)  # fmt: skip


def rig(motor: str, supply: float, decay: int = AUTO) -> Rig:
    base = NEMA23 if motor == "23HS32-4004S" else NEMA17
    return Rig(**{**vars(base), "supply": supply, "decay": decay})


def stage(motor: str, supply: float, **settings: float | str) -> Stage:
    current = 4.2 if motor == "23HS32-4004S" else 2.0
    return Stage(**{"supply_v": supply, "current_a": current, "microsteps": 10, **settings})


@pytest.mark.parametrize(
    ("motor", "supply", "rpm"),
    [
        ("23HS32-4004S", 36.0, 90),
        ("23HS32-4004S", 36.0, 390),
        ("23HS32-4004S", 48.0, 210),
        ("23HS32-4004S", 48.0, 510),
        ("23HS32-4004S", 48.0, 600),
        ("17HS19-2004S", 24.0, 600),
    ],
)
def test_pull_out_is_that_of_a_switched_bridge(motor: str, supply: float, rpm: float) -> None:
    expected = pull_out(rig(motor, supply), rpm)
    assert pull_out_torque(MOTORS[motor], stage(motor, supply), rpm) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(("supply", "rpm"), [(36.0, 390), (48.0, 510)])
@pytest.mark.parametrize(("kind", "decay"), [("slow", SLOW), ("mixed", MIXED)])
def test_torque_of_a_stage_of_another_kind_is_that_of_such_a_bridge(
    kind: str, decay: int, supply: float, rpm: float
) -> None:
    """Mixed: 30 % of the time against the supply. At 90 rev/min they agree as well, to 1 and 4 %."""
    expected = pull_out(rig("23HS32-4004S", supply, decay), rpm)
    like = stage("23HS32-4004S", supply, kind=kind, mixed_decay=0.3)
    found = pull_out_torque(MOTORS["23HS32-4004S"], like, rpm)
    assert found == pytest.approx(expected, rel=0.07)


FIRST_LOST = {"slow": (SLOW, 0.0, 300), "mixed 0.3": (MIXED, 0.3, 500), "mixed 0.6": (MIXED, 0.6, 650)}
"""Of the bridge with a constant load of 0.6 Nm at 48 V, rev/min, in steps of 50."""


@pytest.mark.parametrize("name", FIRST_LOST)
def test_the_kind_of_the_stage_decides_when_a_motor_swings_itself_out_of_step(name: str) -> None:
    decay, share, first_lost = FIRST_LOST[name]
    bridge = dataclasses.replace(rig("23HS32-4004S", 48.0, decay), fast_share=share)
    like = stage("23HS32-4004S", 48.0, kind=name.split()[0], mixed_decay=share)
    assert [_bridge_holds(bridge, rpm) for rpm in (first_lost - 50, first_lost)] == [True, False]
    assert [_twin_holds(like, rpm) for rpm in (0.8 * first_lost, 1.2 * first_lost)] == [True, False]


def test_electronic_damping_alone_moves_the_first_loss() -> None:
    """Kind digital is kind fast that damps; 48 V and 0.6 Nm: first lost at 800 and at 1600 rev/min."""
    holds = {kind: _twin_holds(stage("23HS32-4004S", 48.0, kind=kind), 1100) for kind in ("fast", "digital")}
    assert holds == {"fast": False, "digital": True}


def _rise(t: NDArray[np.float64], over_s: float) -> NDArray[np.float64]:
    q = np.clip(t / over_s, 0.0, 1.0)
    return q * q * (3 - 2 * q)


def _ramp_s(rpm: float) -> float:
    return max(0.3, 30 * NEMA23.inertia * (rpm - 60) * math.pi / 30 / (math.sqrt(2) * NEMA23.km * NEMA23.current))


def _bridge_holds(bridge: Rig, rpm: float) -> bool:
    """Two seconds against 0.6 Nm, which rise within 0.2 s."""
    end_s = _ramp_s(rpm) + 2.0
    return run(bridge.array(), 2000.0, rpm / 60 * 2000, _ramp_s(rpm), 2.0, 0.6, 0.2, 10)[0] >= end_s - 1e-9


def _twin_holds(like: Stage, rpm: float) -> bool:
    dt, ramp_s, rate = 25e-6, _ramp_s(rpm), rpm / 60 * 2000
    t = dt * np.arange(round((ramp_s + 2.0) / dt) + 1)
    q = np.minimum(t / ramp_s, 1.0)
    phase = 2000.0 * t + (rate - 2000.0) * (ramp_s * q**3 * (1 - q / 2) + np.maximum(t - ramp_s, 0.0))
    states = axis_states(1)
    states["omega_rad_s"] = 2 * math.pi
    parameters = axis_parameters(MOTORS["23HS32-4004S"], like, Screw(inertia_kgm2=530e-7), dt)
    made = follow(parameters, states, mean_command(phase), 0.6 * _rise(t[1:] - ramp_s, 0.2), 40.0)
    return bool(made == len(phase) - 1)


def test_a_rising_load_stalls_the_motor_where_it_stalls_on_a_switched_bridge() -> None:
    """48 V, 300 rev/min: a load that rises to 2.5 Nm within half a second."""
    rpm, top_nm, rise_s = 300.0, 2.5, 0.5
    rate = rpm / 60 * 2000
    stalled_s = run(NEMA23.array(), 2000.0, rate, 0.3, 0.6, top_nm, rise_s, 10)[0] - 0.3

    dt = 25e-6
    t = dt * np.arange(round(0.9 / dt) + 1)
    q = np.minimum(t / 0.3, 1.0)
    phase = 2000.0 * t + (rate - 2000.0) * (0.3 * q**3 * (1 - q / 2) + np.maximum(t - 0.3, 0.0))
    q = np.clip((t[1:] - 0.3) / rise_s, 0, 1)
    screw = Screw(inertia_kgm2=530e-7)
    states = axis_states(1)
    states["omega_rad_s"] = 2 * math.pi
    parameters = axis_parameters(MOTORS["23HS32-4004S"], stage("23HS32-4004S", 48.0), screw, dt)
    steps = follow(parameters, states, mean_command(phase), top_nm * q * q * (3 - 2 * q), 40.0)

    def load(seconds: float) -> float:
        q = seconds / rise_s
        return top_nm * q * q * (3 - 2 * q)

    assert 0.1 < stalled_s < 0.5
    assert load(steps * dt - 0.3) == pytest.approx(load(stalled_s), rel=0.05)


def test_the_supply_factor_stands_for_what_a_chopper_leaves_unused() -> None:
    """Where the supply limits, an ideal source at the whole supply has more than the bridge; at low speed not."""
    name = "23HS32-4004S"
    slow, fast = (
        pull_out_torque(MOTORS[name], stage(name, supply, supply_factor=1.0), rpm) / pull_out(rig(name, supply), rpm)
        for supply, rpm in ((48.0, 210), (36.0, 510))
    )
    assert slow == pytest.approx(1.0, abs=0.03)
    assert fast > 1.1


@pytest.mark.parametrize("decay", [SLOW, MIXED, AUTO])
def test_the_fast_solver_of_the_reference_is_right(decay: int) -> None:
    """20 ms at 300 rev/min against 0.3 Nm: Runge-Kutta at 1 and 5 us beside DOP853 from switching to switching.

    The fast one sees a current reach its reference up to a step too late: 1 us is 15 mA, 5 us are 75 mA of 4.2 A.
    """
    reference = rig("23HS32-4004S", 48.0, decay)
    rate = 300 / 60 * 2000
    angle, torque = run_adaptive(reference, rate, 0.02, 0.3)
    for steps, tolerance in ((50, 0.02), (10, 0.05)):
        _, fast_angle, fast_torque = run(reference.array(), rate, rate, 1e-9, 0.02, 0.3, 0.0, steps)
        assert fast_torque == pytest.approx(torque, rel=tolerance)
        assert fast_angle == pytest.approx(angle, abs=tolerance * 2 * math.pi / 50)
