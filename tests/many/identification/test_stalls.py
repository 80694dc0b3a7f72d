"""Stall series as data: two speeds, one that held, one that lost; and what they tell of damping and iron loss.

Where a fit is tested the stall speed of a machine is a closed form, the torque balance of its pull-out curve, with the
scatter of real series on the data: the inference is on trial here, and costs no physics.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isel_twin.drives.curves import pull_out_prediction
from isel_twin.language import create_language, needed
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.many.identification import session as session_module
from isel_twin.many.identification.experiment import series_hz
from isel_twin.many.identification.fit import Fit, fit
from isel_twin.many.identification.measured import Measured, MeasuredError, Stall, read_measured, written
from isel_twin.many.identification.model import Model
from isel_twin.many.identification.session import STALL_SCATTER, predict, stand_alone
from isel_twin.many.identification.stand_in import _stalled as stalled
from isel_twin.many.identification.unknowns import unknown

MACHINE = load_machine("4030")
STALL = Stall("day", "x", 15.0, 55.0, 1000, 300, 24000.0, 25000.0)
NEVER = replace(STALL, lost_hz=math.inf)
AT_ONCE = replace(STALL, held_hz=0.0)
DAMPING, IRON = 1.5e-3, 0.5
HIDDEN = with_overrides(MACHINE, {"axes.x.shaft_viscous": DAMPING, "axes.x.specimen.iron_loss": IRON})
UNKNOWNS = [unknown(MACHINE, "damping.x", (3e-4, 4e-3)), unknown(MACHINE, "iron_loss.x", (0.3, 3.0))]


def balance_hz(machine: Machine, stall: Stall) -> float:
    """The speed at which the pull-out torque is what ramp and friction take."""
    axis = machine.axes[0]
    stage = axis.stage if stall.supply_v is None else replace(axis.stage, supply_v=stall.supply_v)
    per_rev = axis.steps_per_mm * axis.screw.lead_mm
    inertia_kgm2 = axis.motor.rotor_inertia_kgm2 + axis.screw.inertia_kgm2
    ramp_nm = inertia_kgm2 * stall.acceleration_hz_per_ms * 1e3 / per_rev * 2.0 * math.pi

    def spare_nm(speed_hz: float) -> float:
        rev_s = speed_hz / per_rev
        taken = ramp_nm + axis.screw.coulomb_nm + axis.screw.viscous_nm_s_per_rad * 2.0 * math.pi * rev_s
        return pull_out_prediction(axis.motor, stage, 60.0 * rev_s) - taken

    low, high = 1000.0, 60_000.0
    while high - low > 1.0:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if spare_nm(middle) > 0.0 else (low, middle)
    return low


@pytest.fixture
def by_balance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "referenced", lambda controller, machine: machine)
    monkeypatch.setattr(session_module, "stall_speed_hz", balance_hz)


def series(machine: Machine, *, ramps: Sequence[int] = (1000, 3000), ended_early: bool = False) -> Measured:
    """Series at three supplies for each ramp; a step is 4 %, and real series scatter. Ended early: none has lost."""
    draw = np.random.default_rng(3)
    found = []
    for supply_v, ramp in itertools.product((24.0, 36.0, 48.0), ramps):
        one = replace(STALL, acceleration_hz_per_ms=ramp, supply_v=supply_v)
        at = balance_hz(machine, one) * math.exp(draw.normal(0.0, STALL_SCATTER))
        found.append(replace(one, held_hz=at / 1.02, lost_hz=math.inf if ended_early else at * 1.02))
    return Measured(stalls=tuple(found))


def fit_series(measured: Measured) -> Fit:
    return fit(MACHINE, UNKNOWNS, [stand_alone("day", measured, "imc-s8")], [])


def test_damping_and_iron_loss_that_nobody_has_measured_get_a_posterior(by_balance: None) -> None:
    """At three ramps, twice each: six series at two ramps leave it open whether the rotor is another one."""
    result = fit_series(series(HIDDEN, ramps=(500, 1000, 3000) * 2))
    for estimate, true in zip(result.estimates, (DAMPING, IRON), strict=True):
        assert estimate.low <= true <= estimate.high, estimate
        assert estimate.remaining < 0.6, estimate
        assert estimate.high / estimate.low < estimate.unknown.high / estimate.unknown.low


def test_series_that_never_lost_bound_from_one_side(by_balance: None) -> None:
    """All six held where the machine file has them lose: damping and loss are less, by how much nobody knows."""
    light = with_overrides(MACHINE, {"axes.x.shaft_viscous": 3e-4, "axes.x.specimen.iron_loss": 0.5})
    measured = series(light, ended_early=True)
    damping, iron = fit_series(measured).estimates
    assert damping.value < damping.unknown.prior
    assert iron.value <= iron.unknown.prior
    assert damping.high < 0.5 * damping.unknown.high
    model = Model(MACHINE, UNKNOWNS, [stand_alone("day", measured, "imc-s8")])
    lossy, loss_free = (float((model.residuals_at(np.full(2, u)) ** 2).sum()) for u in (2.0, -2.0))
    assert lossy > 20.0  # more is excluded
    assert loss_free < 2.0  # less is not


@pytest.mark.parametrize(("stall", "side"), [(NEVER, 1.0), (AT_ONCE, -1.0)])
def test_a_bound_costs_what_its_outcome_is_unlikely(stall: Stall, side: float) -> None:
    """r^2 = -2 ln P: of a half where the prediction is the bound, of a standard normal distribution elsewhere."""
    model = Model(MACHINE, [], [stand_alone("day", Measured(stalls=(stall,)), "imc-s8")])
    at = math.log(stall.middle_hz)
    for deviations in (-3.0, 0.0, 3.0):
        (r,) = model.residuals(np.array([at + side * deviations * STALL_SCATTER]))
        likely = 0.5 * math.erfc(-deviations / math.sqrt(2.0))
        assert r**2 == pytest.approx(-2.0 * math.log(likely))
        assert math.copysign(1.0, r) == side


def test_a_bound_is_no_degree_of_freedom() -> None:
    stalls = (STALL, STALL, STALL, NEVER, AT_ONCE)
    model = Model(MACHINE, [], [stand_alone("day", Measured(stalls=stalls), "imc-s8")])
    residuals = np.array([1.0, 1.0, 2.0, 0.5, 0.0])
    assert (model.squares(residuals), model.freedom(residuals, 0)) == (pytest.approx(6.0), 3)


def test_a_bound_that_is_missed_counts() -> None:
    """As what it costs more than a prediction that is the bound."""
    model = Model(MACHINE, [], [stand_alone("day", Measured(stalls=(STALL, NEVER)), "imc-s8")])
    residuals = np.array([1.0, 4.0])
    assert model.squares(residuals) == pytest.approx(1.0 + 16.0 - 2.0 * math.log(2.0))
    assert model.freedom(residuals, 0) == 2


def test_the_search_ends_soon_beyond_a_speed_that_held() -> None:
    """4030 with half of its iron loss stalls at 28 kHz, with twice as much at 22.5: 24 kHz held tells them apart."""
    session = stand_alone("day", Measured(stalls=(NEVER,)), "imc-s8")
    light, lossy = (with_overrides(MACHINE, {"axes.x.specimen.iron_loss": factor}) for factor in (0.5, 2.0))
    model = Model(MACHINE, [], [session])
    (found,), (lost,) = predict(session, light), predict(session, lossy)
    assert math.exp(found) == pytest.approx(24000.0 * 1.1, rel=1e-3)
    assert model.residuals(np.array([found])) == pytest.approx(0.0, abs=0.1)
    assert model.residuals(np.array([lost]))[0] > 1.5


def test_a_stand_in_tells_that_the_first_speed_lost_and_that_none_did(monkeypatch: pytest.MonkeyPatch) -> None:
    from isel_twin.many.identification import stand_in

    slow = replace(STALL, held_hz=1000.0, lost_hz=1040.0)
    language = needed(create_language("imc-s8"), "imc-s8")
    monkeypatch.setattr(stand_in, "Twin", lambda *args, **more: None)
    monkeypatch.setattr(stand_in, "converse", lambda twin, data: b"")
    for loses, held_hz, lost_hz in (
        (True, 0.0, float(series_hz(slow, language)[0])),
        (False, float(series_hz(slow, language)[-1]), math.inf),
    ):
        monkeypatch.setattr(stand_in, "stalls", lambda twin, stall, speed, loses=loses: loses)
        found = stalled(slow, MACHINE, "imc-s8", 1)
        assert (found.held_hz, found.lost_hz) == (held_hz, lost_hz)


@pytest.mark.parametrize(
    ("controller", "machine", "middle_hz"),
    [("imc-s8", "4030", 3000.0), ("imc-s8", "4030", 20000.0), ("bwo900", "4030-servo", 10000.0)],
)
def test_a_move_that_is_not_made_has_neither_held_nor_lost(controller: str, machine: str, middle_hz: float) -> None:
    """Beyond its travel of 395 mm an axis runs into its switch, and stops there at any speed; without a ramp it loses
    steps by that, from some speed on."""
    beyond = replace(STALL, to_mm=1000.0, held_hz=middle_hz / 1.02, lost_hz=middle_hz * 1.02)
    session = stand_alone("day", Measured(stalls=(beyond,)), controller)
    with pytest.raises(MeasuredError, match=r"^stall of x: [^\n]* the move to 1000 mm"):
        Model(load_machine(machine), [], [session]).predictions([np.zeros(0)])


def test_a_file_keeps_what_was_seen_from_one_side(tmp_path: Path) -> None:
    file = tmp_path / "day.toml"
    file.write_text(written(Measured(stalls=(NEVER, AT_ONCE))))
    assert read_measured(file).stalls == (NEVER, AT_ONCE)
    file.write_text(
        file.read_text().replace("lost_hz = inf", "").replace("held_hz = 0.0", "")
    )  # left out says the same
    assert read_measured(file).stalls == (NEVER, AT_ONCE)
    file.write_text(written(Measured(stalls=(STALL,))).replace("lost_hz = 25000.0", "lost_hz = nan"))
    assert read_measured(file).unread == 1
    file.write_text(written(Measured(stalls=(replace(NEVER, held_hz=0.0),))))
    with pytest.raises(MeasuredError, match="stall 1: has neither held_hz nor lost_hz"):
        read_measured(file)


def test_a_foreign_motor_is_refused_and_the_series_that_misfit_are_named(by_balance: None) -> None:
    """Another winding holds less and keeps it longer; damping and iron loss cannot imitate that at three supplies."""
    result = fit_series(series(with_overrides(MACHINE, {"axes.x.motor": "QSH6018-86-28-310"})))
    assert not result.explains
    assert result.misfits
    *_, misfit, explained = result.doubts
    assert all(item.label in misfit for item, _ in result.misfits)
    assert "(another motor" in explained
