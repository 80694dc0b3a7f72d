"""Machine files: what they hold, how they are combined, and what is said about wrong ones."""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage
from isel_twin.machine import (
    LEVELS,
    MachineError,
    describe,
    load_machine,
    machine_names,
    models_folder,
    with_overrides,
)
from isel_twin.plant.mujoco import MujocoPlant


def test_the_default_machine_is_the_one_of_the_data_sheets():
    machine = load_machine("4030")
    assert [axis.travel_mm for axis in machine.axes] == [395.0, 300.0, 140.0]
    assert {axis.steps_per_mm for axis in machine.axes} == {320.0}
    assert {axis.motor for axis in machine.axes} == {MOTORS["23HS32-4004S"]}
    assert {axis.stage for axis in machine.axes} == {
        Stage(supply_v=48.0, current_a=4.2, microsteps=8, idle_current_fraction=0.5, idle_delay_s=0.2)
    }
    assert {axis.screw.stiffness_n_per_m for axis in machine.axes} == {30e6}
    assert machine.axes[0].screw.inertia_kgm2 == pytest.approx(
        0.85 * math.pi / 32 * 7850 * 0.016**4 * 0.6 + 5e-6, rel=1e-12
    )
    assert machine.axes[0].screw.stribeck_rad_s == pytest.approx(2.0 / 5.0 * 2 * math.pi)
    assert machine.cabinet == "safety-relay"
    assert [(mode.joint, mode.stiffness_n_per_m, mode.damping_ratio) for mode in machine.structure] == [
        ("flex_x", 5e6, 0.03), ("nod_y", 5e6, 0.03), ("flex_y", 8e6, 0.03)
    ]  # fmt: skip
    assert not machine.imperfections.lead_error
    assert machine.imperfections.backlash
    assert machine.controller["program_memory_bytes"] == 32768


def test_switches_stand_at_the_ends_of_the_travel():
    switches = {switch.name: switch for switch in load_machine("4030").switches}
    assert {name: (s.axis, s.end, s.position_mm) for name, s in switches.items()} == {
        "limit_x1": ("x", "motor", 0.0),
        "limit_x2": ("x", "far", 395.0),
        "limit_y1": ("y", "motor", 0.0),
        "limit_y2": ("y", "far", 300.0),
        "limit_z1": ("z", "motor", 0.0),
        "limit_z2": ("z", "far", 140.0),
    }
    assert {(s.type, s.hysteresis_mm, s.repeatability_mm, s.bounce_ms) for s in switches.values()} == {
        ("opener", 0.2, 0.01, 1.0)
    }


def test_machines_of_the_package():
    assert machine_names() == ["4030", "4030-hf", "4030-portal", "4030-servo", "4030-servo-hf", "traverse"]
    traverse = load_machine("traverse")
    assert {axis.travel_mm for axis in traverse.axes} == {1025.0}
    assert {switch.position_mm for switch in traverse.switches} == {0.0, 1025.0}
    assert load_machine("4030-portal").kinematics == "portal"


@pytest.mark.parametrize("name", machine_names())
def test_description_has_a_row_with_source_and_grade_for_every_number(name):
    rows = describe(load_machine(name))
    assert len({row.parameter for row in rows}) == len(rows)
    for row in rows:
        if isinstance(row.value, int | float) and not isinstance(row.value, bool):
            assert row.unit, row
            assert row.source, row
        assert row.grade in ("measured", "datasheet", "estimate", "setting"), row
    values = {row.parameter: (row.value, row.unit, row.grade) for row in rows}
    assert values["axes.all.lead"] == (5.0, "mm", "setting")
    if name.startswith("4030-servo"):
        assert values["axes.all.drive"] == ("servo", "", "setting")
        assert values["axes.all.servo.supply"] == (60.0, "V", "estimate")
        assert not any(key.startswith(("axes.all.stage", "axes.all.motor", "axes.all.steps")) for key in values)
    else:
        assert values["axes.all.stage.supply"] == (48.0, "V", "estimate")
        assert values["axes.all.motor"] == ("23HS32-4004S", "", "setting")
    assert values["cabinet"] == ("safety-relay", "", "setting")
    assert values["contacts.start.type"] == ("closer", "", "setting")


def test_a_setting_that_the_file_leaves_to_the_manual_can_be_set():
    machine = load_machine("4030")
    assert "extra_values" not in machine.controller
    changed = with_overrides(machine, {"controller.extra_values": True})
    assert changed.controller == {**machine.controller, "extra_values": True}
    assert {r.parameter: (r.value, r.grade) for r in describe(changed)}["controller.extra_values"] == (True, "setting")
    for name, value, message in (
        ("extra_valus", True, "did you mean 'extra_values'"),
        ("extra_values", 7, "true, false"),
    ):
        with pytest.raises(MachineError, match=message):
            with_overrides(machine, {f"controller.{name}": value})


def test_overrides_are_in_the_units_of_the_file():
    machine = with_overrides(
        load_machine("4030"),
        {"axes.all.steps_per_rev": 400, "axes.x.stiffness": 20, "axes.y.stage.idle_delay": 100, "payload.mass": 5},
    )
    assert [axis.steps_per_mm for axis in machine.axes] == [80.0, 80.0, 80.0]
    assert [axis.step_mm for axis in machine.axes] == [0.0125, 0.0125, 0.0125]
    assert [(axis.steps_per_rev, axis.stage.microsteps) for axis in machine.axes] == [(400, 2)] * 3
    assert [axis.screw.stiffness_n_per_m for axis in machine.axes] == [20e6, 30e6, 30e6]
    assert [axis.stage.idle_delay_s for axis in machine.axes] == [0.2, 0.1, 0.2]
    assert machine.payload_kg == 5.0
    assert {r.parameter: r.source for r in describe(machine)}["payload.mass"] == "override"


def test_imperfection_levels():
    machine = load_machine("4030")
    for level, on in LEVELS.items():
        flags = with_overrides(machine, {"imperfections": level}).imperfections
        assert {name for name in LEVELS["real"] if getattr(flags, name)} == set(on)
    ideal = with_overrides(machine, {"imperfections": "ideal", "imperfections.backlash": True})
    assert ideal.imperfections.backlash
    assert {(s.repeatability_mm, s.bounce_ms) for s in ideal.switches} == {(0.0, 0.0)}
    assert {(axis.screw.lead_error, axis.screw.backlash_mm) for axis in ideal.axes} == {(0.0, 0.02)}
    static = with_overrides(machine, {"imperfections": "static", "imperfections.backlash": False})
    assert {(axis.screw.lead_error, axis.screw.backlash_mm) for axis in static.axes} == {(0.00046, 0.0)}
    assert {row.parameter: row.value for row in describe(static)}["axes.all.backlash"] == 0.02, "off, not forgotten"


def test_a_machine_of_ones_own_says_what_differs(tmp_path):
    (tmp_path / "machine.toml").write_text(
        'based_on = "4030"\nname = "mine"\n[axes.x]\n'
        'travel = { value = 200.0, unit = "mm", grade = "measured", source = "ruler" }\n'
    )
    for where in (tmp_path, str(tmp_path), tmp_path / "machine.toml"):
        machine = load_machine(where)
        assert (machine.name, machine.folder) == ("mine", tmp_path)
        assert [axis.travel_mm for axis in machine.axes] == [200.0, 300.0, 140.0]
        assert machine.model_file == models_folder() / "4030" / "scene.xml"
        assert {s.name: s.position_mm for s in machine.switches}["limit_x2"] == 200.0


def test_a_machine_based_on_ones_own_finds_its_files(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    (first / "vise.xml").write_text("<mujoco/>")
    (first / "machine.toml").write_text('based_on = "4030"\nname = "first"\nfixture = "vise.xml"\n')
    (second / "machine.toml").write_text('based_on = "../first"\nname = "second"\n')
    assert load_machine(second).fixture_file.resolve() == first / "vise.xml"
    assert load_machine(second).model_file == models_folder() / "4030" / "scene.xml"


def test_the_cabinet_is_inherited_and_has_a_default(tmp_path):
    (tmp_path / "machine.toml").write_text('based_on = "4030"\nname = "mine"\n')
    assert load_machine(tmp_path).cabinet == "safety-relay"

    folder = models_folder() / "4030"
    text = (folder / "machine.toml").read_text()
    for model in folder.glob("*.xml"):
        shutil.copy(model, tmp_path)
    (tmp_path / "machine.toml").write_text(text.replace('cabinet = "safety-relay"\n', ""))
    silent = load_machine(tmp_path)
    assert silent.cabinet == "safety-relay"
    assert "cabinet" in {row.parameter for row in describe(silent)}

    (tmp_path / "machine.toml").write_text(text.replace('"safety-relay"', '"cupboard"'))
    heir = tmp_path / "heir"
    heir.mkdir()
    (heir / "machine.toml").write_text('based_on = ".."\n')
    with pytest.raises(MachineError, match=r"heir/machine\.toml: cabinet: 'cupboard'; allowed: safety-relay"):
        load_machine(heir)


RMS = '{ value = 3.0, unit = "A", grade = "datasheet", source = "switches of the drive" }'


@pytest.mark.parametrize(
    "tables", [f"[axes.all.stage]\ncurrent_rms = {RMS}\n", f"[axes.x.stage]\ncurrent_rms = {RMS}\n"]
)
def test_a_current_given_as_rms_is_a_peak_of_1_414_times_it(tmp_path, tables):
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\n{tables}')
    machine = load_machine(tmp_path)
    assert machine.axes[0].stage.current_a == pytest.approx(3.0 * 2**0.5, abs=1e-4)
    assert machine.axes[1].stage.current_a == (4.2 if "axes.x" in tables else machine.axes[0].stage.current_a)
    said = [row for row in describe(machine) if row.parameter.endswith("stage.current")]
    assert {(row.unit, row.source) for row in said} >= {("A peak", "3 A RMS; switches of the drive")}
    assert with_overrides(machine, {"axes.x.stage.current": 2.0}).axes[0].stage.current_a == 2.0


def test_an_override_of_the_current_may_be_its_rms_value():
    machine = load_machine("4030")
    assert [axis.stage.current_a for axis in with_overrides(machine, {"axes.all.stage.current_rms": 2.0}).axes] == (
        pytest.approx([2.0 * 2**0.5] * 3, abs=1e-4)
    )
    assert with_overrides(machine, {"axes.y.stage.current_rms": 2.0}).axes[0].stage.current_a == 4.2
    with pytest.raises(MachineError, match=r"axes\.y\.stage\.current: .*42\.42"):
        with_overrides(machine, {"axes.y.stage.current_rms": 30.0})
    with pytest.raises(MachineError, match=r"axes\.y\.stage\.current_rms: unknown key; did you mean"):
        with_overrides(machine, {"axes.y.stage.current_rms": "much"})


def test_a_current_given_twice_is_refused(tmp_path):
    peak = RMS.replace("3.0", "4.0")
    (tmp_path / "machine.toml").write_text(
        f'based_on = "4030"\n[axes.x.stage]\ncurrent_rms = {RMS}\ncurrent = {peak}\n'
    )
    with pytest.raises(
        MachineError, match=r"axes\.x\.stage\.current_rms: given beside current; give the peak \(current\)"
    ):
        load_machine(tmp_path)


def test_the_kind_of_a_stage_can_be_overridden(tmp_path):
    machine = load_machine("4030")
    assert machine.axes[0].stage.kind == "fast"
    assert with_overrides(machine, {"axes.x.stage.kind": "slow"}).axes[0].stage.fast_share == 0.0
    with pytest.raises(MachineError, match=r"axes\.x\.stage\.kind: 'quick'; allowed: slow, mixed, fast, digital"):
        with_overrides(machine, {"axes.x.stage.kind": "quick"})


def test_electronic_damping_is_off_unless_a_machine_file_sets_it(tmp_path):
    setting = 'grade = "setting", source = "digital drive"'
    (tmp_path / "machine.toml").write_text(
        'based_on = "4030"\n[axes.x.stage]\n'
        f'damping_gain = {{ value = 2.0, unit = "1", {setting} }}\n'
        f'damping_corner = {{ value = 250.0, unit = "Hz", {setting} }}\n'
    )
    x, y, _ = load_machine(tmp_path).axes
    assert (x.stage.damping_gain, x.stage.damping_corner_hz) == (2.0, 250.0)
    assert y.stage.damping_gain == 0.0


UNITS = {
    "resistance_ohm": "ohm",
    "inductance_h": "H",
    "torque_constant_nm_per_a": "N m/A",
    "rotor_inertia_kgm2": "kg m2",
    "iron_loss_ohm": "ohm",
    "pole_pairs": "1",
}


def motor(name: str, **values: float | str) -> str:
    """A section of a machine file."""
    usual = {"resistance_ohm": 1.0, "inductance_h": 3e-3, "torque_constant_nm_per_a": 0.4, "rotor_inertia_kgm2": 5e-5}
    lines = [
        f'{key} = {{ value = {value}, unit = "{UNITS[key]}", grade = "datasheet", source = "label" }}\n'
        for key, value in {**usual, **values}.items()
    ]
    return f"[motors.{name}]\n{''.join(lines)}"


def test_a_motor_of_the_machines_own_goes_before_that_of_the_table(tmp_path):
    (tmp_path / "machine.toml").write_text(
        'based_on = "4030"\n[axes.x]\nmotor = "mine"\n'
        + motor("mine", resistance_ohm=0.5, inductance_h=1e-3, pole_pairs=25, iron_loss_ohm="inf")
        + motor("23HS32-4004S", resistance_ohm=0.7)
    )
    machine = load_machine(tmp_path)
    x, y, _ = machine.axes
    assert x.motor == Motor(0.5, 1e-3, 0.4, 5e-5, iron_loss_ohm=math.inf, pole_pairs=25)
    assert (x.steps_per_rev, x.stage.microsteps) == (1600, 16)
    assert y.motor.resistance_ohm == 0.7
    assert machine.motors == {"mine": x.motor, "23HS32-4004S": y.motor}
    (row,) = [row for row in describe(machine) if row.parameter == "motors.mine.resistance_ohm"]
    assert (row.value, row.unit, row.grade, row.source) == (0.5, "ohm", "datasheet", "label")
    assert with_overrides(machine, {"motors.mine.resistance_ohm": 0.6}).axes[0].motor.resistance_ohm == 0.6


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("travel = 395.0", r"axes\.x\.travel: 395\.0; allowed: a table such as .*1 \.\. 10000 mm"),
        ("travel = { value = -1, %s }", r"axes\.x\.travel: -1; allowed: 1 \.\. 10000 mm"),
        ("travel = { value = nan, %s }", r"axes\.x\.travel: nan; allowed: 1 \.\. 10000 mm"),
        ('travel = { value = "long", %s }', r"axes\.x\.travel: 'long'; allowed: 1 \.\. 10000 mm"),
        ("travel = { value = true, %s }", r"axes\.x\.travel: True; allowed"),
        (
            'travel = { value = 1, unit = "m", grade = "estimate", source = "" }',
            r"axes\.x\.travel: unit 'm'; allowed: 'mm'",
        ),
        (
            'travel = { value = 9, unit = "mm", grade = "guess", source = "" }',
            r"travel\.grade: 'guess'; allowed: measured",
        ),
        ('travel = { value = 9, unit = "mm", grade = "estimate" }', r"axes\.x\.travel\.source: missing"),
        ("travl = { value = 9, %s }", r"axes\.x\.travl: unknown key; did you mean 'travel'\?"),
        (
            "steps_per_rev = { value = 450, %s }",
            r"axes\.x\.steps_per_rev: 450; allowed with the motor 23HS32-4004S: whole multiples of 200",
        ),
        ("steps_per_rev = { value = 51400, %s }", r"axes\.x\.steps_per_rev: 51400; allowed: 200 \.\. 51200 1"),
        (
            'stribeck_speed = { value = 0, unit = "mm/s", grade = "estimate", source = "" }',
            r"stribeck_speed: 0; allowed: 0\.01 \.\. 100 mm/s",
        ),
        ("steps_per_rev = { value = 450.5, %s }", r"axes\.x\.steps_per_rev: 450\.5; allowed: whole numbers"),
        ("power_on_high = { value = 900.0, %s }", r"power_on_low: 20\.0 \.\. 900\.0 mm; allowed: a range within"),
        ("motor = 3", r"axes\.x\.motor: 3; allowed: 23HS32-4004S, "),
        ('motor = "steam"', r"axes\.x\.motor: 'steam'; allowed: 23HS32-4004S, .*57STH56-2804MAC"),
        ("stage = 3", r"axes\.x\.stage: 3; allowed: a table"),
        ("[axes]\ny = 3", r"axes\.y: 3; allowed: a table"),
        ("[imperfections]\nbacklash = 1", r"imperfections\.backlash: 1; allowed: true, false"),
        (
            '[contacts]\nlimit_x1 = { kind = "gate" }',
            r"contacts\.limit_x1\.kind: 'gate'; allowed: switch, signal, bridge",
        ),
        ('[contacts]\nnew = { kind = "switch" }', r"contacts\.new: a switch needs axis \(x, y, z\)"),
        (
            '[contacts]\nstart = { kind = "signal", terminal = "p1.3" }',
            r"contacts\.start\.terminal: terminals belong to the controller; remove the key$",
        ),
        ('[contacts]\nlimit_x1 = { end = "left" }', r"contacts\.limit_x1\.end: 'left'; allowed: \"\", motor, far"),
        (
            "[timing]\nmujoco_step = { value = 0.51, %s }",
            r"mujoco_step: 0\.51 ms; allowed: whole multiples of motor_sub",
        ),
        ("[motors.q]\n", r"motors\.q\.resistance_ohm: missing"),
        ("[motors.q]\nresistance = 1.0", r"motors\.q\.resistance: unknown key; did you mean 'resistance_ohm'\?"),
        (
            "[motors.q]\nresistance_ohm = 1.0",
            r"motors\.q\.resistance_ohm: 1\.0; allowed: a table such as .*unit = \"ohm\".*, 0\.001 \.\. 1000 ohm$",
        ),
        (motor("q", resistance_ohm='"x"'), r"motors\.q\.resistance_ohm: 'x'; allowed: 0\.001 \.\. 1000 ohm$"),
        (motor("q", resistance_ohm=-1.0), r"motors\.q\.resistance_ohm: -1\.0; allowed: 0\.001 \.\. 1000 ohm$"),
        (motor("q", inductance_h="inf"), r"motors\.q\.inductance_h: inf; allowed: 1e-06 \.\. 10 H$"),
        (motor("q", iron_loss_ohm="nan"), r"motors\.q\.iron_loss_ohm: nan; allowed: 0\.001 \.\. inf ohm$"),
        (motor("q").replace('"H"', '"mH"'), r"motors\.q\.inductance_h: unit 'mH'; allowed: 'H'$"),
        ("screw_length = { value = 390.0, %s }", r"axes\.x\.travel: 395 mm; allowed: up to the length of the screw, "),
        ("travel = { value = 600.5, %s }", r"axes\.x\.travel: 600\.5 mm; allowed: .* screw_length = 600 mm$"),
        (
            "travel = { value = 398.5, %s }",
            r"axes\.x\.travel: 398\.5 mm; allowed: up to 398 mm, where joint x ends in .*4030/scene\.xml$",
        ),
        (
            "[contacts]\nestopp_1 = { kind = 'signal' }",
            r"contacts\.estopp_1: unknown key; did you mean 'estop_1'\?$",
        ),
        (
            "[controller]\nprogram_memory_bites = 4096",
            r"controller\.program_memory_bites: unknown key; did you mean 'program_memory_bytes'\?$",
        ),
        (
            "[controller]\nprogram_memory_bytes = 0",
            r"controller\.program_memory_bytes: 0; allowed: 1 \.\. 1e\+09$",
        ),
        ("[controller]\nprogram_memory_bytes = 4.5", r"program_memory_bytes: 4\.5; allowed: whole numbers$"),
        ("[controller]\nprogram_memory_bytes = true", r"program_memory_bytes: True; allowed: 1 \.\. 1e\+09$"),
        ("[controller]\nfrequency_error_ppm = 60000", r"frequency_error_ppm: 60000; allowed: -50000 \.\. 50000$"),
        ("[controller]\nreference_hz = [1, 2]", r"controller\.reference_hz: unknown key"),
        ("[tming]\n", r"tming: unknown key; did you mean 'timing'\?"),
        ("[axes.w]\n", r"axes\.w: unknown key"),
        ("travel = ", r"not a TOML file: Invalid value"),
    ],
)
def test_a_wrong_value_is_named_with_file_key_and_what_is_allowed(tmp_path, line, message):
    unit = "1" if "steps_per_rev" in line else "ms" if "mujoco_step" in line else "mm"
    filled = line.replace("%s", f'unit = "{unit}", grade = "estimate", source = "test"')
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\nname = "wrong"\n[axes.x]\n{filled}\n')
    with pytest.raises(MachineError, match=message) as error:
        load_machine(tmp_path)
    text = str(error.value)
    assert "\n" not in text
    assert str(tmp_path / "machine.toml") in text


def test_unknown_machines_and_circles_are_named(tmp_path):
    with pytest.raises(MachineError, match=r"unknown machine 'nope'.*4030, 4030-hf, .*4030-servo-hf, traverse"):
        load_machine("nope")
    (tmp_path / "machine.toml").write_text('based_on = "."\n')
    with pytest.raises(MachineError, match="circle"):
        load_machine(tmp_path)
    (tmp_path / "machine.toml").write_text('based_on = "4030"\nmodel = "none.xml"\n')
    with pytest.raises(MachineError, match=re.escape(str(Path("none.xml"))) + " does not exist"):
        load_machine(tmp_path)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"axes.x.backlsh": 0}, r"unknown key; did you mean 'axes\.x\.backlash'"),
        ({"axes.x": 0}, r"axes\.x: is a section"),
        ({"axes.x.backlash": 2}, r"axes\.x\.backlash: 2; allowed: 0 \.\. 1 mm"),
        ({"imperfections": "some"}, "unknown level 'some'; allowed: ideal, static, dynamic, real$"),
    ],
)
def test_a_wrong_override_is_named(overrides, message):
    with pytest.raises(MachineError, match=message):
        with_overrides(load_machine("4030"), overrides)


@pytest.mark.parametrize(
    ("base", "lines", "message"),
    [
        ("4030", 'drive = "hydraulic"', "axes.x.drive: 'hydraulic'; allowed: stepper, servo"),
        ("4030", 'drive = "servo"', "axes.x.servo: missing"),
        (
            "4030-servo",
            'motor = "23HS32-4004S"',
            'axes.x.motor: of stepper drives, but drive = "servo"; allowed: servo',
        ),
        (
            "4030-servo",
            'servo.peak_current = { value = 3.0, unit = "A", grade = "setting", source = "test" }',
            "axes.x.servo.peak_current: 3 A; allowed: from rated_current on, 4 A",
        ),
        (
            "4030-servo",
            'servo.loop_period = { value = 260.0, unit = "us", grade = "setting", source = "test" }',
            "axes.x: servo: loop_period 260 us; allowed: whole multiples of motor_substep, 25 us",
        ),
    ],
)
def test_drives_that_do_not_fit_are_refused_in_one_line(tmp_path, base, lines, message):
    (tmp_path / "machine.toml").write_text(f'based_on = "{base}"\n[axes.x]\n{lines}\n')
    with pytest.raises(MachineError) as caught:
        MujocoPlant(load_machine(tmp_path), [], np.array([100.0, 100.0, 50.0]))
    assert str(caught.value) == f"{tmp_path / 'machine.toml'}: {message}"


@pytest.mark.parametrize(
    ("name", "key", "message"),
    [
        ("4030-servo", "axes.all.steps_per_rev", "axes.x.steps_per_rev: this is of stepper drives"),
        ("4030-servo", "axes.z.stage.supply", "axes.z.stage.supply: this is of stepper drives"),
        ("4030", "axes.y.servo.position_gain", "axes.y.servo.position_gain: this is of servo drives"),
    ],
)
def test_overrides_for_the_other_kind_of_drive_name_a_machine_that_has_it(name, key, message):
    with pytest.raises(MachineError) as caught:
        with_overrides(load_machine(name), {key: 400})
    other = {"4030": "4030-servo", "4030-servo": "4030"}[name]
    assert message in str(caught.value)
    assert str(caught.value).endswith(f"such as {other}")


def test_an_axis_alone_can_have_a_servo_drive(tmp_path):
    """The others keep their stepper motors."""
    text = (models_folder() / "4030-servo" / "machine.toml").read_text().replace("axes.all", "axes.y")
    (tmp_path / "machine.toml").write_text(text)
    x, y, z = load_machine(tmp_path).axes
    assert (x.closed_loop, y.closed_loop, z.closed_loop) == (False, True, False)
    assert (x.steps_per_mm, y.steps_per_mm) == (320.0, 1000.0)
    plant = MujocoPlant(load_machine(tmp_path), [], np.array([100.0, 100.0, 50.0]))
    plant.set_power(stages=True, brake_released=True, lowering=True)
    t_ns = np.arange(1, 1001, dtype=np.int64) * 1_000_000
    plant.advance(2_500_000_000, t_ns, np.tile(np.array([1, 1, 0, 0], dtype=np.int8), (1000, 1)))
    np.testing.assert_allclose(plant.position_mm[:2], (103.125, 101.0), atol=0.03)
    assert plant.slip_steps.tolist() == [32.0, 1.0, 32.0, 1.0]
