"""What a fit must not claim: numbers that no datum moves, and numbers of a model that does not explain the data."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from isel_twin.language import create_language, needed
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.machine.spread import numbers
from isel_twin.many.identification import fit as fit_module
from isel_twin.many.identification import replays as replays_module
from isel_twin.many.identification.experiment import assemble, blocks
from isel_twin.many.identification.fit import Fit, fit
from isel_twin.many.identification.measured import Measured, Reading
from isel_twin.many.identification.page import page
from isel_twin.many.identification.patch import as_json, patch
from isel_twin.many.identification.session import REST_SIGMA_MM, Datum, Session, session_of, stand_alone
from isel_twin.many.identification.stand_in import carry_out
from isel_twin.many.identification.unknowns import unknown
from tests.near import COARSE, near_switches

CONTROLLER = "imc-s8"
SCREW, BEAM, TABLE = "axes.y.stiffness", "structure.nod_y.stiffness", "structure.flex_y.stiffness"


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    return load_machine(near_switches(tmp_path_factory.mktemp("near"), 2.0, more=COARSE))


def pushed(near: Machine, place: str) -> Session:
    """Y pushed there, on a machine whose Y screw and what is below the table are half as stiff as believed."""
    hidden = with_overrides(near, {SCREW: 15.0, TABLE: 4.0})
    every = blocks(near, CONTROLLER, ["y"], [], seed=0)
    language = needed(create_language(CONTROLLER), CONTROLLER)
    chosen = [block for block in every if block.name.startswith("push") and block.name.endswith(place)]
    recorded, measured = carry_out(
        assemble("day", chosen, language), hidden, CONTROLLER, seed=1, noise_mm=0.002, time_noise_s=0.0005
    )
    return session_of(recorded, measured, CONTROLLER, near)


@pytest.fixture(scope="module")
def at_the_tool(near: Machine) -> Fit:
    return fit(near, [unknown(near, "stiffness.y")], [pushed(near, "tool")], [])


def test_a_screw_that_no_push_loads_is_untouched_and_said(at_the_tool: Fit, near: Machine, tmp_path: Path) -> None:
    """Where the table moves a pull at the tool bends the beam alone; the screw keeps value and grade."""
    assert [one.key for one in at_the_tool.unreached] == [SCREW, TABLE]
    said, _ = at_the_tool.doubts
    assert said.startswith("axes.y.stiffness: no datum moves it")
    assert "a push along y at what this axis moves" in said
    (tmp_path / "machine.toml").write_text(patch(at_the_tool, near, "4030", "found", CONTROLLER, ["day"], ["other"]))
    found = load_machine(tmp_path)
    assert found.tree["axes"]["y"]["stiffness"] == near.tree["axes"]["y"]["stiffness"]
    assert found.tree["structure"]["nod_y"]["stiffness"]["source"].startswith("identified")
    assert said in page("found", at_the_tool, ["day"], [])
    assert as_json(at_the_tool, ["day"], [])["unreached"] == [SCREW, TABLE]


def test_a_push_at_the_table_finds_the_screw(near: Machine) -> None:
    result = fit(near, [unknown(near, "stiffness.y")], [pushed(near, "table")], [])
    assert [one.key for one in result.unreached] == [BEAM]
    assert result.estimates[0].low <= 0.5 <= result.estimates[0].high
    assert result.estimates[0].remaining < 0.5


def test_a_model_that_does_not_explain_measures_nothing(at_the_tool: Fit, near: Machine) -> None:
    """Chi-square beyond its quantile: the readings are named, the grade is an estimate."""
    datum = at_the_tool.misfits[0][0] if at_the_tool.misfits else None
    assert at_the_tool.explains, datum
    wrong = dataclasses.replace(at_the_tool, chi2=4.2, chi2_limit=1.8)
    for result, grade in ((at_the_tool, "measured"), (wrong, "fitted")):
        text = patch(result, near, "4030", "found", CONTROLLER, ["day"], ["other"])
        assert f'grade = "{grade}", interval = [' in text
    assert "chi-square 4.2 per degree of freedom, by chance at most 1.8" in wrong.doubts[-2]
    assert "does not explain" in page("found", wrong, ["day"], [])


def test_the_limit_of_chi_square_is_its_quantile(at_the_tool: Fit) -> None:
    """Wilson and Hilferty: chi2/n at 99.9 % is (1 - 2/9n + 3.09 sqrt(2/9n))^3, within 1 %."""
    count = len(at_the_tool.prospect.singular)
    for freedom in range(1, 200):
        part = 2.0 / (9.0 * freedom)
        if (1.0 - part + 3.0902 * math.sqrt(part)) ** 3 == pytest.approx(at_the_tool.chi2_limit, rel=0.01):
            break
    else:
        pytest.fail(f"no degree of freedom has the limit {at_the_tool.chi2_limit}")
    assert count == 1


SPEEDS_MM_S = (20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 120.0)


def coasted_mm(machine: Machine) -> list[float]:
    """Overrun of X without power, m dv/dt = -(F + c v): d = m/c (v - F/c ln(1 + c v/F)). Guide and nut only add up."""
    axis = machine.axes[0]
    per_m = 2.0 * math.pi / (1e-3 * axis.screw.lead_mm)
    mass = 40.0 + (axis.motor.rotor_inertia_kgm2 + axis.screw.inertia_kgm2) * per_m**2
    dry_n = axis.guide_friction_n + axis.screw.coulomb_nm * per_m
    viscous = axis.screw.viscous_nm_s_per_rad * per_m**2
    speeds = (1e-3 * speed for speed in SPEEDS_MM_S)
    return [1e3 * mass / viscous * (v - dry_n / viscous * math.log1p(viscous * v / dry_n)) for v in speeds]


def test_guide_and_screw_friction_that_differ_are_called_inseparable(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Coasts see the sum of both. It is found, chi-square is content, and neither number is measured."""
    machine = load_machine("4030")
    guide, screw = machine.axes[0].guide_friction_n, machine.axes[0].screw.coulomb_nm
    hidden = with_overrides(machine, {"axes.x.guide_friction": 0.6 * guide, "axes.x.shaft_coulomb": 1.1 * screw})
    monkeypatch.setattr(replays_module, "predict", lambda session, one: np.array(coasted_mm(one)))
    draw = np.random.default_rng(2)
    overruns = [mm + draw.normal(0.0, 0.005) for mm in coasted_mm(hidden)]
    readings = tuple(Reading("day", n, "x", mm, sigma_mm=0.005) for n, mm in enumerate(overruns, 1))
    day = stand_alone("day", Measured(readings), CONTROLLER)
    result = fit(machine, [unknown(machine, "friction.x")], [day], [])
    assert result.explains
    (alike,) = result.alike
    assert set(alike.remaining) >= {"axes.x.guide_friction", "axes.x.shaft_coulomb"}
    assert "cannot be told apart by these data" in result.doubts[0]
    assert result.doubts[0] in page("found", result, ["day"], [])
    (told,) = as_json(result, ["day"], [])["not_told_apart"]
    assert told["name"] == "friction.x"
    (tmp_path / "machine.toml").write_text(patch(result, machine, "4030", "found", CONTROLLER, ["day"], ["other"]))
    content = load_machine(tmp_path).tree["axes"]["x"]
    for key, factor in (("guide_friction", 0.6), ("shaft_coulomb", 1.1)):
        entry = content[key]
        assert entry["grade"] == "fitted"
        low, _, high = entry["source"].partition("factor ")[2].partition(",")[0].partition(" .. ")
        assert float(low) <= factor <= float(high), entry["source"]
        least, most = entry["interval"]
        assert least <= factor * {"guide_friction": guide, "shaft_coulomb": screw}[key] <= most


def coasting(monkeypatch: pytest.MonkeyPatch, changed: dict[str, float], *names: str) -> Fit:
    """A fit to coasts of a machine with these numbers of the file multiplied."""
    machine = load_machine("4030")
    values = {key: float(entry["value"]) for key, entry in numbers(machine.tree)}
    hidden = with_overrides(
        machine, {f"axes.x.{key}": times * values[f"axes.x.{key}"] for key, times in changed.items()}
    )
    monkeypatch.setattr(replays_module, "predict", lambda session, one: np.array(coasted_mm(one)))
    draw = np.random.default_rng(4)
    overruns = [mm + draw.normal(0.0, 0.005) for mm in coasted_mm(hidden)]
    readings = tuple(Reading("day", n, "x", mm, sigma_mm=0.005) for n, mm in enumerate(overruns, 1))
    return fit(
        machine, [unknown(machine, name) for name in names], [stand_alone("day", Measured(readings), CONTROLLER)], []
    )


def test_what_is_within_the_scatter_tells_nothing_and_confounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two readings of one mounting, apart by A = 5 deviations of one number, and by B = 0.5 of the other, which is as
    little as their scatter. Their difference has twice the variance of one, so with a = A / sqrt 2 and b = B / sqrt 2
    the first keeps 1 / (1 + a^2 / (1 + b^2)) of its variance, and the second all."""
    machine = load_machine("4030")
    friction, backlash = (unknown(machine, name) for name in ("axes.x.guide_friction", "backlash.x"))
    sigma = math.hypot(0.005, REST_SIGMA_MM)

    def predicted(session: Session, one: Machine) -> np.ndarray:
        first, second = friction.at(one.axes[0].guide_friction_n), backlash.at(one.axes[0].screw.backlash_mm)
        return np.array([0.0, sigma * (5.0 * first + 0.5 * second)])

    monkeypatch.setattr(replays_module, "predict", predicted)
    readings = tuple(Reading("day", n, "x", 0.0, sigma_mm=0.005) for n in (1, 2))
    result = fit(machine, [friction, backlash], [stand_alone("day", Measured(readings), CONTROLLER)], [])
    first, second = result.estimates
    assert first.remaining**2 == pytest.approx(1.0 / (1.0 + 12.5 / 1.125), rel=1e-3)
    assert second.remaining == pytest.approx(1.0)


def test_a_search_that_had_not_ended_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """With two evaluations it is on its way; with as many as it wants it ends, and says nothing."""
    settled = coasting(monkeypatch, {"guide_friction": 1.6}, "axes.x.guide_friction")
    monkeypatch.setattr(fit_module, "MOST_SEARCHES", 1)
    monkeypatch.setattr(fit_module, "MOST_CALLS", 2)
    result = coasting(monkeypatch, {"guide_friction": 1.6}, "axes.x.guide_friction")
    (said,) = (line for line in result.doubts if line.startswith("the search had not ended"))
    assert f"still lowered chi-square by {result.unsettled:.1f}" in said
    assert result.unsettled > 100.0
    assert settled.unsettled == 0.0
    assert not any("search" in line for line in settled.doubts)


def test_a_law_that_was_not_fitted_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dry friction alone cannot imitate twice the viscous one; a lighter rotor nearly can."""
    result = coasting(monkeypatch, {"shaft_viscous": 2.0}, "axes.x.guide_friction")
    assert not result.explains
    assert result.suspects[0].key == "axes.x.shaft_viscous"
    assert "axes.x.shaft_viscous (viscous friction, " in result.doubts[-1]
    assert "viscous friction" in {one["law"] for one in as_json(result, ["day"], [])["suspects"]}
    told = coasting(monkeypatch, {"shaft_viscous": 2.0}, "axes.x.guide_friction", "axes.x.shaft_viscous")
    assert told.explains
    assert not told.suspects


def test_laws_that_data_do_not_tell_apart_are_named_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coast sees the sum of both dry frictions."""
    result = coasting(monkeypatch, {"guide_friction": 1.8}, "axes.x.shaft_viscous")
    assert {one.key for one in result.suspects} >= {"axes.x.guide_friction", "axes.x.shaft_coulomb"}
    assert result.doubts[-1].endswith("these data do not tell them apart")


def test_another_motor_is_refused_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction is known from coasts; three more numbers go with the torque that it leaves, K - F r. A motor of 0.7
    times the torque constant is no friction."""

    def seen(machine: Machine) -> list[float]:
        axis = machine.axes[0]
        torque = machine.tree["axes"]["x"]["specimen"]["torque_constant"]["value"]
        friction = axis.screw.coulomb_nm / 0.09
        return [*coasted_mm(machine), *(10.0 * (torque - 0.1 * share * friction) for share in (1.0, 1.5, 2.0))]

    machine = load_machine("4030")
    hidden = with_overrides(machine, {"axes.x.specimen.torque_constant": 0.7})
    monkeypatch.setattr(replays_module, "predict", lambda session, one: np.array(seen(one)))
    draw = np.random.default_rng(5)
    readings = tuple(
        Reading("day", n, "x", mm + draw.normal(0.0, 0.005), sigma_mm=0.005) for n, mm in enumerate(seen(hidden), 1)
    )
    monkeypatch.setattr("isel_twin.many.identification.session.Session.data", property(_without_zeros))
    day = stand_alone("day", Measured(readings), CONTROLLER)
    result = fit(machine, [unknown(machine, "friction.x")], [day], [])
    assert not result.explains
    assert result.suspects[0].law == "another motor"
    assert 'grade = "measured"' not in patch(result, machine, "4030", "found", CONTROLLER, ["day"], ["other"])


def _without_zeros(session: Session) -> tuple[Datum, ...]:
    """Readings of a scale, which has no zero of its own."""
    readings = session.measured.readings
    return tuple(Datum("reading", str(one.command), session.name, one.mm, one.sigma_mm, "mm") for one in readings)


def test_two_numbers_that_data_see_apart_are_not_called_alike(near: Machine) -> None:
    """Each of two readings loads one spring alone."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(
            replays_module,
            "predict",
            lambda session, one: np.array(
                [0.0, *(1.0 / one.tree[a][b]["stiffness"]["value"] for a, b in (("axes", "y"), ("structure", "nod_y")))]
            ),
        )
        stiff = dataclasses.replace(unknown(near, "stiffness.y"), keys=(SCREW, BEAM))
        screw, beam = (1.0 / near.tree[a][b]["stiffness"]["value"] for a, b in (("axes", "y"), ("structure", "nod_y")))
        values = (0.0, screw, beam)
        readings = tuple(Reading("day", n, "y", mm, sigma_mm=2e-3 * screw) for n, mm in enumerate(values, 1))
        patched.setattr("isel_twin.many.identification.session.REST_SIGMA_MM", 0.0)
        result = fit(near, [stiff], [stand_alone("day", Measured(readings), CONTROLLER)], [])
    assert not result.alike
    assert not result.unreached
