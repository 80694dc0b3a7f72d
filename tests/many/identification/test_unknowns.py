"""Named parameters: the keys they stand for, their priors, and the machines made of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from isel_twin.base.errors import CallError
from isel_twin.cli.identify import unknowns_of
from isel_twin.machine import MachineError, load_machine, with_overrides
from isel_twin.many.identification import replays
from isel_twin.many.identification.fit import fit
from isel_twin.many.identification.measured import Measured, Reading
from isel_twin.many.identification.model import BOUND, STEP, searched
from isel_twin.many.identification.session import stand_alone
from isel_twin.many.identification.unknowns import candidate, changes, default_names, parse_prior, unknown

MACHINE = load_machine("4030")


def test_a_factor_moves_all_that_brakes_an_axis() -> None:
    friction = unknown(MACHINE, "friction.x")
    x, y, _ = candidate(MACHINE, [friction], [2.0]).axes
    was = MACHINE.axes[0]
    assert x.guide_friction_n == 2.0 * was.guide_friction_n
    assert x.screw.coulomb_nm == 2.0 * was.screw.coulomb_nm
    assert x.screw.viscous_nm_s_per_rad == 2.0 * was.screw.viscous_nm_s_per_rad
    assert y == MACHINE.axes[1]


def test_what_a_gauge_at_the_tool_sees_in_series_has_one_factor() -> None:
    stiff = unknown(MACHINE, "stiffness.x")
    assert stiff.keys == ("axes.x.stiffness", "structure.flex_x.stiffness")
    soft = candidate(MACHINE, [stiff], [0.7])
    flex = next(mode for mode in soft.structure if mode.joint == "flex_x")
    assert flex.stiffness_n_per_m == pytest.approx(0.7 * 5e6)
    assert soft.axes[0].screw.stiffness_n_per_m == pytest.approx(0.7 * 30e6)


def test_a_model_has_no_luck() -> None:
    assert not candidate(MACHINE, [], []).imperfections.repeatability


def test_the_prior_range_follows_from_the_grade() -> None:
    backlash = unknown(MACHINE, "backlash.x")  # an estimate: half to twice
    assert (backlash.low, backlash.prior, backlash.high) == pytest.approx((0.01, 0.02, 0.04))
    current = unknown(MACHINE, "axes.x.stage.current")  # from a data sheet: a fifth
    assert current.high / current.prior == pytest.approx(1.2)
    assert current.source.startswith("datasheet: ")


def test_a_range_that_is_said_goes_before() -> None:
    item = unknown(MACHINE, "backlash.x", (0.004, 0.016))
    assert (item.low, item.high) == (0.004, 0.016)
    assert item.prior == pytest.approx(0.008)  # the file's 0.02 lies outside: the middle, on a scale of ratios


def test_values_and_standard_deviations() -> None:
    backlash = unknown(MACHINE, "backlash.x")
    assert backlash.deviation == pytest.approx(math.log(4.0) / 4.0)
    assert backlash.value(2.0) == pytest.approx(0.04)
    assert backlash.at(backlash.value(-1.3)) == pytest.approx(-1.3)
    switch = unknown(MACHINE, "switch.limit_x2")
    assert (switch.prior, switch.value(2.0)) == (395.0, 397.0)
    moved = candidate(MACHINE, [switch], [394.2])
    assert next(contact.position_mm for contact in moved.switches if contact.name == "limit_x2") == 394.2


def test_an_imperfection_that_is_looked_for_is_on() -> None:
    lead = unknown(MACHINE, "lead.x")
    found = candidate(MACHINE, [lead], [0.05])
    assert found.imperfections.lead_error
    assert found.axes[0].screw.lead_error == pytest.approx(5e-4)
    assert lead.prior == 0.0  # it is off in the file, whatever number stands there
    assert lead.low < -0.22 < 0.22 < lead.high, "a router with screws sold as C7 was 0.22 % off"


def test_settings_of_a_controller_are_whole_where_the_file_has_whole_numbers() -> None:
    ramp = unknown(MACHINE, "controller.acceleration_hz_per_ms", (50.0, 200.0))
    assert ramp.prior == pytest.approx(100.0)
    assert changes(MACHINE, [ramp], [81.4]) == {"controller.acceleration_hz_per_ms": 81}
    assert candidate(MACHINE, [ramp], [81.4]).controller["acceleration_hz_per_ms"] == 81


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("fricton.x", "did you mean 'friction.x'"),
        ("axes.x.backlas", "did you mean 'axes.x.backlash'"),
        ("axes.x.motor", "which is no number"),
        ("payload.mass", "say a range: --prior payload.mass=LOW..HIGH"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(name: str, said: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]*$") as told:
        unknown(MACHINE, name)
    assert said in str(told.value)


def test_a_value_out_of_its_limits_is_refused() -> None:
    with pytest.raises(MachineError, match=r"axes\.x\.backlash"):
        candidate(MACHINE, [unknown(MACHINE, "backlash.x")], [5.0])


def test_priors_as_they_are_written() -> None:
    assert parse_prior("backlash.x = 0.005 .. 0.08") == ("backlash.x", 0.005, 0.08)
    for text in ("backlash.x", "backlash.x=1", "backlash.x=2..1", "=1..2", "a=1..nan"):
        with pytest.raises(ValueError, match="LOW"):
            parse_prior(text)


def test_what_is_fitted_if_nobody_says() -> None:
    assert default_names(["x"], MACHINE) == ["friction.x", "backlash.x", "stiffness.x", "supply", "mass"]


def test_a_machine_with_servo_drives_has_no_supply_of_stages_to_be_fitted() -> None:
    servo = load_machine("4030-servo")
    for name in default_names(["x", "z"], servo):
        assert unknown(servo, name).name == name
    with pytest.raises(ValueError, match="fit 'supply': no such parameter") as caught:
        unknown(servo, "supply")
    assert "did you mean 'supply'" not in str(caught.value)


# ---- the ends of what a machine file allows --------------------------------------------------------------------------

FARTHEST_U = BOUND + STEP


@pytest.mark.parametrize(
    ("name", "keys", "end"),
    [
        ("backlash.x", ("axes.x.backlash",), 1.0),
        ("supply", ("axes.all.stage.supply",), 200.0),
        ("supply", ("axes.all.stage.supply",), 5.0),
        ("friction.x", ("axes.x.guide_friction", "axes.x.shaft_coulomb"), 5.0),
        ("stiffness.x", ("axes.x.stiffness", "structure.flex_x.stiffness"), 200.0),
        ("damping.y", ("axes.y.shaft_viscous",), 0.1),
        ("iron_loss.z", ("axes.z.specimen.iron_loss",), 10.0),
        ("axes.x.efficiency", ("axes.x.efficiency",), 1.0),
        ("lead.x", ("axes.x.lead_error",), 1.0),
        ("squareness.xy", ("squareness.xy",), -10.0),
        ("repeatability", ("switches.repeatability",), 1.0),
        ("axes.x.steps_per_rev", ("axes.x.steps_per_rev",), 200.0),
    ],
)
def test_a_search_ends_where_the_range_of_the_number_does(name: str, keys: tuple[str, ...], end: float) -> None:
    """Candidates at all that a search may try can be built, wherever the prior is, and the end itself is one."""
    machine = with_overrides(MACHINE, {**dict.fromkeys(keys, end), "imperfections": "static"})
    item = unknown(machine, name)
    tried = [item.value(u) for u in (-FARTHEST_U, -1.0, 0.0, 1.0, FARTHEST_U)]
    for value in tried:
        if not item.whole:
            candidate(machine, [item], [value])
    assert end in [value * (end if item.factor else 1.0) for value in (min(tried), max(tried))]
    least, most = searched(item)
    assert max(0.0 - least, most - 0.0) > 0.5, "there is a way to go inwards"
    assert min(-least, most) == pytest.approx(0.0, abs=1e-9)


def test_a_fit_finds_a_number_at_the_end_of_its_range(monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine has 1 mm of play, all that a file may say, and 0.6 mm are believed."""
    machine = with_overrides(MACHINE, {"axes.x.backlash": 0.6})
    monkeypatch.setattr(replays, "predict", lambda session, one: np.array([0.0, one.axes[0].screw.backlash_mm] * 2))
    readings = tuple(Reading("day", n, "x", mm, sigma_mm=0.005) for n, mm in enumerate((0.0, 1.004, 0.003, 0.997), 1))
    session = stand_alone("day", Measured(readings), "imc-s8")
    (found,) = fit(machine, [unknown(machine, "backlash.x", (0.3, 1.0))], [session], []).estimates
    assert found.value <= 1.0
    assert found.high <= 1.0
    assert found.low > 0.9


def test_a_candidate_that_cannot_be_built_tells_nothing() -> None:
    """A travel beyond the rail of the model: no range of a number says so."""
    item = unknown(MACHINE, "axes.x.travel")
    session = stand_alone("day", Measured((Reading("day", 1, "x", 1.0, sigma_mm=0.005),)), "imc-s8")
    told = replays.replayed((session, MACHINE, (item,), [9000.0]))
    assert np.isnan(told).all()


def test_a_range_that_no_machine_file_may_have_is_refused() -> None:
    with pytest.raises(CallError, match=r"prior backlash\.x: 0\.5 \.\. 2; allowed: within 0 \.\. 1 mm"):
        unknowns_of(MACHINE, ["backlash.x"], ["backlash.x=0.5..2"], ["x"])
