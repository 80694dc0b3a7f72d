"""What a real axis has beside play: errors of step and current, an uneven, soft and warm screw. Closed forms.

Machines without dry friction, play and detent, whose shafts are damped so that they settle within milliseconds: what is
measured is the error and nothing else.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from plant.energy import mechanical_energy_j

from isel_twin.machine import LEVELS, MachineError, describe, load_machine, machine_names, models_folder, with_overrides
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.mujoco import MujocoPlant

from .conftest import NONE, Bench, ramp_ns, ticks
from .test_frame import FREE, PUSH_N, without_detent

NEW = ("step_accuracy", "current_offset", "cyclic_error", "free_length", "growth")
KEYS = {
    "step_accuracy": "stage.step_accuracy",
    "current_offset": "stage.current_offset",
    "cyclic_error": "cyclic_error",
    "growth": "screw_warming",
}
"""By flag, the key of its number below [axes.all]; the free length has none of its own in the file of the 4030."""
RADIUS_M = 5e-3 / (2.0 * math.pi)
STEP_UM = 3.125
ROD_N = 206e9 * math.sqrt(0.85) * math.pi / 4.0 * 0.016**2
"""E A of the screws: the thread takes 1 - sqrt(0.85) of the section."""
TEST = 'grade = "setting", source = "test"'
ANYTHING = {f"axes.all.{key}": value for key, value in zip(KEYS.values(), (9.0, 7.0, 50.0, 40.0), strict=True)}


def quiet(
    folder: Path, flags: Mapping[str, Any], x_mm: float = 100.0, viscous: float = 0.1, damping: float = 0.0
) -> Bench:
    """The 4030 with nothing but the imperfections that are named."""
    overrides = {"imperfections": "ideal", **{f"axes.all.{key}": value for key, value in FREE.items()}}
    overrides |= {"axes.all.shaft_viscous": viscous, "axes.all.damping": 2e4}
    with (without_detent(folder, "4030") / "machine.toml").open("a") as file:
        file.write(f'[axes.all.stage]\ndamping_gain = {{ value = {damping}, unit = "1", {TEST} }}\n')
    machine = with_overrides(load_machine(folder), {**overrides, **flags})
    bench = Bench(MujocoPlant(machine, (), np.array([x_mm, 100.0, 30.0])))
    bench.plant.set_power(stages=True, brake_released=True, lowering=False)
    bench.wait(50)
    return bench


def walk(bench: Bench, steps: int, stride: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Go along X and stand every `stride` steps: float64 [n] twice, rotor in steps and position in um, less the way
    commanded."""
    step_um = 1e3 * bench.plant.machine.axes[0].step_mm
    rotor, position = [], []
    for k in range(steps // stride + 1):
        if k:
            t_ns = ramp_ns(stride, 500.0)
            bench.feed(int(t_ns[-1]), t_ns, ticks(stride, 1))
            bench.wait(60)
        rotor.append(bench.plant.rotor[0] - k * stride)
        position.append(1e3 * bench.plant.position_mm[0] - step_um * k * stride)
    return np.array(rotor), np.array(position)


@pytest.mark.parametrize("microsteps", [1, 2, 8])
def test_steps_err_by_their_accuracy_once_in_four_full_steps(tmp_path: Path, microsteps: int) -> None:
    flags = {
        "imperfections.step_accuracy": True,
        "axes.all.stage.step_accuracy": 5.0,
        "axes.all.steps_per_rev": 200 * microsteps,
    }
    rotor, position = walk(quiet(tmp_path, flags), 8 * microsteps, 1)
    expected = 0.05 * np.sin(2.0 * math.pi * np.arange(len(rotor)) / (4 * microsteps))
    assert rotor / microsteps == pytest.approx(expected, abs=5e-4)
    assert position - position[0] == pytest.approx(25.0 * expected, abs=0.03)


def test_a_stage_that_damps_errs_alike(tmp_path: Path) -> None:
    flags = {"imperfections.step_accuracy": True, "imperfections.current_offset": True}
    plain, _ = walk(quiet(tmp_path, flags), 32, 1)
    bench = quiet(tmp_path, flags, damping=2.0)
    assert bench.plant.machine.axes[0].stage.damping_gain == 2.0
    damped, _ = walk(bench, 32, 1)
    assert np.ptp(plain) > 0.8
    assert damped == pytest.approx(plain, abs=2e-3)


def test_an_offset_of_one_phase_turns_the_vector_once_in_four_full_steps(tmp_path: Path) -> None:
    flags = {"imperfections.current_offset": True, "axes.all.stage.current_offset": 2.0}
    rotor, position = walk(quiet(tmp_path, flags), 64, 1)
    phi = 2.0 * math.pi * np.arange(len(rotor)) / 32.0
    expected = (np.unwrap(np.arctan2(np.sin(phi) + 0.02, np.cos(phi))) - phi) * 32.0 / (2.0 * math.pi)
    assert rotor == pytest.approx(expected, abs=4e-3)
    assert np.ptp(rotor) == pytest.approx(2.0 * math.asin(0.02) * 32.0 / (2.0 * math.pi), rel=0.03)
    assert position - position[0] == pytest.approx(STEP_UM * (expected - expected[0]), abs=0.02)


def test_the_thread_wobbles_once_a_turn_and_errs_the_same_at_the_same_place(tmp_path: Path) -> None:
    flags = {"imperfections.cyclic_error": True, "axes.all.cyclic_error": 5.0}
    for start_mm in (100.0, 103.3):
        rotor, position = walk(quiet(tmp_path, flags, start_mm), 3200, 100)
        place_m = 1e-3 * start_mm + 1e-6 * STEP_UM * 100 * np.arange(len(position))
        wobble = 5.0 * np.sin(place_m / RADIUS_M)
        assert position - 1e3 * start_mm == pytest.approx(wobble - wobble[0], abs=0.02)
        assert rotor == pytest.approx(0.0, abs=2e-3)
    assert np.ptp(position) == pytest.approx(10.0, rel=0.02)


def give_um(folder: Path, flags: Mapping[str, Any], x_mm: float) -> float:
    """How far a push along X moves the tool, um."""
    bench = quiet(folder, flags, x_mm)
    before = bench.plant.position_mm[0]
    bench.plant.apply_force(0, PUSH_N)
    bench.wait(300)
    return float(1e3 * (bench.plant.position_mm[0] - before))


def test_a_screw_is_the_softer_the_farther_the_nut_is_from_its_bearing(tmp_path: Path) -> None:
    on = {"imperfections.free_length": True}
    near, middle, far = (give_um(tmp_path, on, x_mm) for x_mm in (20.0, 197.5, 375.0))
    assert middle == pytest.approx(give_um(tmp_path, {}, 197.5), abs=1e-3)
    assert far - near == pytest.approx(1e6 * PUSH_N * 0.355 / ROD_N, rel=0.01)
    assert middle - near == pytest.approx(far - middle, rel=0.02)
    assert give_um(tmp_path, {}, 20.0) == pytest.approx(give_um(tmp_path, {}, 375.0), abs=1e-3)


def test_stiffness_follows_the_carriage(tmp_path: Path) -> None:
    """It is not that of where the carriage stood at power-on."""
    bench = quiet(tmp_path, {"imperfections.free_length": True}, 20.0, viscous=0.01)
    bench.move((320 * 60, 0, 0), 10_000.0)
    bench.wait(300)
    place_m = 1e-3 * bench.plant.position_mm[0]
    assert place_m == pytest.approx(0.08, abs=1e-5)
    expected = 1.0 / (1.0 / 30e6 + (place_m - 0.1975) / ROD_N)
    assert bench.plant.parts.drives["stiffness_n_per_m"][0] == pytest.approx(expected, rel=1e-6)


def test_a_warm_screw_is_longer(tmp_path: Path) -> None:
    """1 K on 300 mm of steel: 3.45 um."""
    ends = []
    for warming_k in (0.0, 1.0):
        flags = {"imperfections.growth": True, "axes.all.screw_warming": warming_k}
        bench = quiet(tmp_path, flags, 50.0, viscous=0.01)
        bench.move((320 * 300, 0, 0), 10_000.0)
        bench.wait(300)
        ends.append(1e3 * bench.plant.position_mm[0])
    assert ends[0] == pytest.approx(350_000.0, abs=0.05)
    assert ends[1] - ends[0] == pytest.approx(3.45, abs=0.01)


def state(plant: MujocoPlant) -> bytes:
    return b"".join(a.tobytes() for a in (plant.position_mm, plant.rotor, plant.data.qpos, plant.data.qvel))


def job(plant: MujocoPlant, cuts: int) -> bytes:
    """A move there and back, a broken phase, limp axes; time in `cuts` pieces each."""
    bench, seen = Bench(plant), []
    plant.set_power(stages=True, brake_released=True, lowering=True)

    def feed(duration_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> None:
        start_ns, done = bench.now_ns, 0
        for until_ns in np.linspace(start_ns, start_ns + duration_ns, cuts + 1).astype(np.int64)[1:]:
            last = int(np.searchsorted(t_ns, until_ns - start_ns, side="right"))
            plant.advance(int(until_ns), start_ns + t_ns[done:last], delta[done:last], lead_ns)
            done = last
        bench.now_ns = start_ns + duration_ns
        seen.append(state(plant))

    feed(50_000_000, *NONE)
    for sign in (1, -1):
        t_ns = ramp_ns(2000, 9000.0)
        feed(int(t_ns[-1]) + 1_234_567, t_ns, ticks(2000, sign, sign, sign))
    led_ns = 4_000_000 * np.arange(1, 20, dtype=np.int64)
    feed(90_000_000, led_ns, 16 * ticks(19, 1, -1, 1).astype(np.int32), 4_000_000)
    plant.set_phase_lost(1, "b")
    feed(300_000_000, ramp_ns(200, 1000.0), ticks(200, 1, 1, 1))
    plant.set_power(stages=False, brake_released=True, lowering=True)
    plant.apply_force(0, 700.0)
    feed(100_000_000, *NONE)
    assert np.isfinite(plant.position_mm).all()
    return b"".join(seen)


def plant_of(overrides: Mapping[str, Any]) -> MujocoPlant:
    return MujocoPlant(with_overrides(load_machine("4030"), overrides), (), np.array([100.0, 100.0, 30.0]))


def test_what_is_off_changes_no_bit() -> None:
    assert job(plant_of({}), 1) == job(plant_of(ANYTHING), 1)


@pytest.mark.parametrize("flag", NEW)
def test_each_can_be_switched_on_alone(flag: str) -> None:
    assert job(plant_of({f"imperfections.{flag}": True}), 1) != job(plant_of({}), 1)


def test_a_real_machine_is_the_same_however_time_is_cut() -> None:
    whole = job(plant_of({"imperfections": "real"}), 1)
    assert whole == job(plant_of({"imperfections": "real"}), 7)
    assert whole == job(plant_of({"imperfections": "real"}), 1)


def test_errors_of_the_stage_are_none_without_current() -> None:
    ends = []
    for on in (False, True):
        plant = plant_of({"imperfections.step_accuracy": on, "imperfections.current_offset": on})
        plant.apply_force(0, 700.0)
        plant.advance(100_000_000, *NONE)
        ends.append(state(plant))
    assert ends[0] == ends[1]


def test_a_limp_uneven_screw_gains_no_energy() -> None:
    """Pushed to and let go: never more mechanical energy than before, within 1e-4 of what was spent."""
    flags = {"imperfections": "real", "axes.all.cyclic_error": 50.0, "axes.all.shaft_coulomb": 0.0}
    plant = plant_of({**flags, "axes.all.guide_friction": 0.0, "axes.all.efficiency": 1.0, "payload.mass": 20.0})
    plant.set_power(stages=False, brake_released=True, lowering=True)
    plant.apply_force(0, 400.0)
    plant.advance(100_000_000, *NONE)
    plant.apply_force(0, 0.0)
    plant.advance(100_500_000, *NONE)
    energies = []
    for k in range(1, 600):
        plant.advance(100_500_000 + k * 500_000, *NONE)
        energies.append(mechanical_energy_j(plant.built))
    rise = np.array(energies) - np.minimum.accumulate(energies)
    assert energies[0] - energies[-1] > 0.01
    assert rise.max() < 1e-4 * (energies[0] - energies[-1])


def test_a_real_machine_rests_and_is_frozen() -> None:
    plant = plant_of({"imperfections": "real"})
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(1_000_000_000, *NONE)
    assert plant.at_rest
    before = state(plant)
    plant.advance(3_600_000_000_000, *NONE)
    assert state(plant) == before


def test_the_kinematic_plant_has_no_imperfections() -> None:
    machine = with_overrides(load_machine("4030"), {"imperfections": "real"})
    plant = KinematicPlant(machine, (), np.array([100.0, 100.0, 30.0]))
    plant.advance(10_000_000, np.arange(1, 101, dtype=np.int64), ticks(100, 1, 0, 0))
    assert plant.position_mm[0] == pytest.approx(100.0 + 100 / 320.0, abs=1e-12)


# Files ---------------------------------------------------------------------------------------------------------------


def test_levels() -> None:
    machine = load_machine("4030")
    assert LEVELS["real"] - LEVELS["dynamic"] == {*NEW, "straightness", "abbe"}
    for name in NEW:
        assert not getattr(machine.imperfections, name)
    real = with_overrides(machine, {"imperfections": "real"}).axes[0]
    assert (real.stage.step_error, real.stage.current_offset) == (0.05, 0.02)
    assert (real.screw.cyclic_error_m, real.screw.warming_k) == pytest.approx((4e-6, 5.0))
    assert real.screw.rod_n == pytest.approx(ROD_N)
    assert real.screw.free_length_m == pytest.approx((600.0 - 395.0) / 2e3)
    off = with_overrides(machine, ANYTHING).axes[0]
    assert (off.stage, off.screw) == (machine.axes[0].stage, machine.axes[0].screw)


@pytest.mark.parametrize("name", machine_names())
def test_every_machine_describes_them_and_can_be_real(name: str) -> None:
    machine = with_overrides(load_machine(name), {"imperfections": "real"})
    listed = {row.parameter: row for row in describe(machine)}
    for key in KEYS.values():
        if not (machine.axes[0].closed_loop and key.startswith("stage.")):  # a servo drive has no steps to be off
            assert listed[f"axes.all.{key}"].source
    for flag in NEW:
        assert listed[f"imperfections.{flag}"].value is True
    MujocoPlant(machine, (), np.array([100.0, 100.0, 30.0]))


def stripped(folder: Path) -> Path:
    """The 4030's file as it was before there were these keys."""
    text = (models_folder() / "4030" / "machine.toml").read_text()
    names = (*NEW, *(key.rpartition(".")[2] for key in KEYS.values()), "screw_modulus")
    kept = [line for line in text.splitlines() if line.partition(" = ")[0] not in names]
    for model in (models_folder() / "4030").glob("*.xml"):
        shutil.copy(model, folder)
    (folder / "machine.toml").write_text("\n".join(kept) + "\n")
    return folder


def test_a_file_without_the_keys_is_as_good(tmp_path: Path) -> None:
    machine = load_machine(stripped(tmp_path))
    assert machine.axes == load_machine("4030").axes
    real = with_overrides(machine, {"imperfections": "real"}).axes[0]
    assert (real.stage.step_error, real.screw.cyclic_error_m) == (0.0, 0.0)
    assert real.screw.rod_n == pytest.approx(ROD_N)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"axes.x.stiffness": 200.0}, r"axes\.x: screw: a stiffness of 200 N/um is .*; allowed: below 127\.3 N/um$"),
        ({"axes.x.cyclic_error": 300.0}, r"axes\.x\.cyclic_error: 300\.0; allowed: 0 \.\. 200 um$"),
        ({"axes.x.stage.step_accuracy": 60.0}, r"step_accuracy: 60\.0; allowed: 0 \.\. 50 %$"),
    ],
)
def test_what_no_axis_has_is_refused(overrides: Mapping[str, Any], message: str) -> None:
    with pytest.raises(MachineError, match=message):
        with_overrides(load_machine("4030"), {"imperfections": "real", **overrides})


def test_a_free_length_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    value = '{ value = 210.0, unit = "mm", grade = "measured", source = "ruler" }'
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\n[axes.x]\nfree_length = {value}\n')
    with pytest.raises(MachineError, match=r"axes\.x\.free_length: 210 mm; allowed: .*, 205 mm$"):
        load_machine(tmp_path)


def test_the_stiffest_place_limits_the_time_step(bench: Callable[..., Bench]) -> None:
    """95 N/um in the middle of X are 190 near the bearing, on 12 kg more than 0.5 ms take."""
    stiff = {"imperfections": "ideal", "axes.x.stiffness": 95.0}
    bench(stiff)
    with pytest.raises(MachineError, match=r"too long for axes\.x\.stiffness"):
        bench({**stiff, "imperfections.free_length": True})
