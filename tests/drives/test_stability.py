"""The growth of a swing against kicks in the time domain (a motor that ran up from rest, sub-steps of 2 us), and
against closed forms where there are any (a source of current, one of voltage, electronic damping).

    J s^2 + D s + K = 0        growth = -D / 2J        K = Nr Km I cos(load angle)
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from isel_twin.drives.curves import follow
from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stability import LAST_RPM, Bench, Limit, Rotation, _Map, limit_rad_s, rule_rpm
from isel_twin.drives.stage import Stage
from tests import swings
from tests.swings import growth_per_s

pytestmark = pytest.mark.long(seconds=5)

NEMA23 = MOTORS["23HS32-4004S"]
INERTIA_KGM2 = 9.6e-5  # in all
AT_48_V = Stage(supply_v=48.0, current_a=4.2)


def shaft(inertia: float = INERTIA_KGM2, motor: Motor = NEMA23) -> Screw:
    return Screw(inertia - motor.rotor_inertia_kgm2)


def limit_rpm(
    motor: Motor = NEMA23, stage: Stage = AT_48_V, load_nm: float = 0.12, inertia: float = INERTIA_KGM2
) -> float:
    found = Bench(motor, stage, load_nm, shaft(inertia, motor)).limit()
    assert found.swings
    return found.speed_rpm


@pytest.mark.parametrize(
    ("motor", "stage", "load_nm"),
    [
        (NEMA23, replace(AT_48_V, supply_v=24.0), 0.05),
        (NEMA23, AT_48_V, 0.12),
        (NEMA23, replace(AT_48_V, supply_v=72.0), 0.6),
        (NEMA23, replace(AT_48_V, kind="mixed", mixed_decay=0.3), 0.12),
        (NEMA23, replace(AT_48_V, current_a=0.7 * 4.2), 0.12),
        (replace(NEMA23, inductance_h=0.8 * 3.2e-3), AT_48_V, 0.12),
        (replace(NEMA23, iron_loss_ohm=NEMA23.iron_loss_ohm / 2.0), AT_48_V, 0.12),
        (MOTORS["17HS19-2004S"], Stage(supply_v=24.0, current_a=2.0), 0.05),
        (MOTORS["14HS17-0504S"], Stage(supply_v=34.0, current_a=0.5), 0.009),
        (MOTORS["34HS59-6004D"], Stage(supply_v=48.0, current_a=4.2), 0.2),
    ],
)
def test_a_kick_dies_below_the_limit_and_grows_above(motor: Motor, stage: Stage, load_nm: float) -> None:
    screw = Screw(motor.rotor_inertia_kgm2)
    limit = Bench(motor, stage, load_nm, screw).limit()
    assert limit.swings
    assert growth_per_s(motor, stage, load_nm, screw, 0.95 * limit.speed_rpm) < -0.5
    assert growth_per_s(motor, stage, load_nm, screw, 1.05 * limit.speed_rpm) > 0.5


def test_where_a_kick_hardly_dies_no_limit_is_told() -> None:
    """A motor of little inductance with 0.7 of it: growth creeps through 0 about 955 rev/min, and is -0.3 to +0.1 a
    second at 0.95 of that."""
    motor = MOTORS["57STH56-2804MAC"]
    light = replace(motor, inductance_h=0.6 * 1.02**8 * motor.inductance_h)
    rest_nm, screw = motor.torque_constant_nm_per_a * motor.rated_current_a, Screw(motor.rotor_inertia_kgm2)
    screw, stage = replace(screw, coulomb_nm=swings.FRICTION * rest_nm), Stage(36.0, motor.rated_current_a)
    load_nm = swings.LOAD * rest_nm
    assert growth_per_s(light, stage, load_nm, screw, 0.95 * 955.0) > -0.5
    assert Bench(light, stage, load_nm, screw).limit().ends == "unsure"


@pytest.mark.parametrize(("name", "supply_v"), [("QSH6018-86-28-310", 29.65), ("AS1060", 36.0)])
def test_where_torque_ends_no_limit_of_a_swing_is_told(name: str, supply_v: float) -> None:
    """A stage that damps, to where the load angle is 160 degrees: little beyond there is no rotation, or what grows is
    no swing. A motor that runs up gently drops out before it is there."""
    motor = MOTORS[name]
    motor = replace(motor, inductance_h=(1.0 if supply_v < 36.0 else 0.6 * 1.02**16) * motor.inductance_h)
    stage = Stage(supply_v, motor.rated_current_a, kind="digital")
    rest_nm = motor.torque_constant_nm_per_a * motor.rated_current_a
    screw = Screw(motor.rotor_inertia_kgm2, swings.FRICTION * rest_nm)
    limit = Bench(motor, stage, swings.LOAD * rest_nm, screw).limit()
    assert not limit.swings
    assert growth_per_s(motor, stage, swings.LOAD * rest_nm, screw, 0.95 * limit.speed_rpm) == math.inf


def test_what_moves_the_limit() -> None:
    """Supply and inductance most, current less, load little, inertia not at all."""
    by_supply = [limit_rpm(stage=replace(AT_48_V, supply_v=v)) for v in (24.0, 36.0, 48.0, 60.0)]
    assert by_supply == pytest.approx([limit_rpm() * v / 48.0 for v in (24.0, 36.0, 48.0, 60.0)], rel=0.15)
    assert limit_rpm(replace(NEMA23, inductance_h=0.8 * 3.2e-3)) > 1.08 * limit_rpm()
    assert limit_rpm(stage=replace(AT_48_V, current_a=0.7 * 4.2)) > 1.15 * limit_rpm()
    assert limit_rpm(load_nm=0.6) == pytest.approx(limit_rpm(load_nm=0.05), rel=0.2)
    assert limit_rpm(inertia=4.0 * INERTIA_KGM2) == pytest.approx(limit_rpm(), rel=0.03)


@pytest.mark.parametrize("rpm", [700.0, 800.0, 900.0])
def test_growth_is_that_of_a_kick(rpm: float) -> None:
    kicked = growth_per_s(NEMA23, AT_48_V, 0.12, shaft(), rpm)
    assert at(rpm, NEMA23, AT_48_V).growth_per_s == pytest.approx(kicked, rel=0.15, abs=2.5)


@pytest.mark.parametrize("supply_v", [34.0, 35.0, 36.0, 37.0])
def test_a_damped_stage_holds_where_lone_sub_steps_saw_a_swing(supply_v: float) -> None:
    """About 1078 rev/min a derivative sees it grow by 6 a second with 80 sub-steps and die at 230 with 135."""
    stage = Stage(supply_v=supply_v, current_a=4.0, kind="digital")
    found = Bench(NEMA23, stage, 0.12).limit()
    assert (found.ends, found.speed_rpm) == ("", LAST_RPM)
    assert growth_per_s(NEMA23, stage, 0.12, Screw(NEMA23.rotor_inertia_kgm2), 1078.0) < -20.0


@pytest.mark.parametrize("supply_v", [34.0, 36.0, 40.0, 48.0])
def test_the_knee_of_the_iron_is_no_limit(supply_v: float) -> None:
    """Of a motor of little inductance on a stage that does not damp: from 688 rev/min on the law feeds a swing, by 4 a
    second at most."""
    quick = replace(NEMA23, inductance_h=0.8e-3, resistance_ohm=0.25, torque_constant_nm_per_a=0.21)
    limit = Bench(quick, Stage(supply_v=supply_v, current_a=4.0), 0.03).limit()
    assert limit.speed_rpm > 1400.0


def test_friction_of_the_shaft_damps_and_loads() -> None:
    """Viscous: D adds to D. Coulomb's is a load like any other, as the shaft never turns back."""
    viscous = Screw(shaft().inertia_kgm2, viscous_nm_s_per_rad=4e-4)
    (plain,), (damped,) = (list(Bench(QUICK, STRONG, LOAD_NM, each).rotations([400.0])) for each in (shaft(), viscous))
    assert plain is not None
    assert damped is not None
    assert damped.growth_per_s == pytest.approx(plain.growth_per_s - 4e-4 / (2.0 * INERTIA_KGM2), rel=0.01)
    (dry,) = Bench(QUICK, STRONG, 0.0, Screw(shaft().inertia_kgm2, coulomb_nm=LOAD_NM)).rotations([400.0])
    assert dry is not None
    assert dry.growth_per_s == pytest.approx(plain.growth_per_s, rel=1e-3)
    assert dry.load_angle_deg == pytest.approx(plain.load_angle_deg, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "kind", "quantity"),
    [
        ("23HS32-4004S", "fast", "supply"),
        ("23HS32-4004S", "digital", "supply"),
        ("17HS24-2104S", "mixed", "inductance"),
    ],
)
def test_small_steps_of_what_a_motor_has_move_its_limit_by_little(name: str, kind: str, quantity: str) -> None:
    """A part of what `python -m tests.swings` walks, in steps of 8 %."""
    row, wrong = swings.row(name, kind, quantity, step=1.08)
    assert not wrong, row


def test_a_load_that_no_current_carries_has_no_rotation() -> None:
    assert list(Bench(NEMA23, AT_48_V, 2.5).rotations([100.0, 200.0])) == [None, None]
    assert Bench(NEMA23, AT_48_V, 2.5).limit() == Limit(0.0, "torque")


def test_an_overloaded_motor_is_left_as_soon_as_it_is_out_of_step() -> None:
    """Under a little more torque than it has: half an electrical revolution behind it will not come back."""
    peak_nm = NEMA23.torque_constant_nm_per_a * AT_48_V.current_a
    on, omega = Bench(NEMA23, AT_48_V, 1.05 * peak_nm, Screw(9.0 * NEMA23.rotor_inertia_kgm2)), 200.0 * math.pi / 30.0
    state = on._guess(omega)
    assert _Map(on, omega, 0.5 * math.pi / (NEMA23.pole_pairs * omega), 300).settle(state) is None
    assert math.pi <= abs(state[3]) < 2.0 * math.pi


def test_electronic_damping_stills_the_swing_below_saturation() -> None:
    """Beyond, the stage can turn no current any more: the limit rises by little."""
    damped = replace(AT_48_V, damping_gain=2.0, damping_corner_hz=300.0)
    (plain,), (stilled,) = (list(Bench(NEMA23, stage, 0.12).rotations([300.0])) for stage in (AT_48_V, damped))
    assert plain is not None
    assert stilled is not None
    assert stilled.growth_per_s < 5.0 * plain.growth_per_s < 0.0


def test_a_current_source_that_nothing_limits_has_no_limit() -> None:
    """A supply that is never reached: the currents neither damp nor feed a swing, and iron without a knee damps it."""
    strong = replace(AT_48_V, supply_v=200.0, supply_factor=1.0)
    found = Bench(replace(NEMA23, iron_knee_rad_s=math.inf, inductance_h=1e-4), strong, 0.12).limit()
    assert found == Limit(LAST_RPM, "")


STRONG = Stage(supply_v=200.0, current_a=4.2, supply_factor=1.0, extra_resistance_ohm=0.0)
QUICK = replace(NEMA23, inductance_h=1e-4, iron_loss_ohm=NEMA23.iron_loss_ohm)  # STRONG keeps its current at any speed
LOAD_NM = 0.12


def at(rpm: float, motor: Motor, stage: Stage, load_nm: float = LOAD_NM, inertia: float = INERTIA_KGM2) -> Rotation:
    (found,) = Bench(motor, stage, load_nm, shaft(inertia, motor)).rotations([rpm])
    assert found is not None
    return found


def iron(rpm: float, motor: Motor) -> tuple[float, float]:
    """Torque of the iron loss, (Km^2/Rm) w/(1 + x^2), and its slope (Km^2/Rm) (1 - x^2)/(1 + x^2)^2, x = w/w_k."""
    omega = rpm * math.pi / 30.0
    x = omega / motor.iron_knee_rad_s
    drag = motor.torque_constant_nm_per_a**2 / motor.iron_loss_ohm
    return drag * omega / (1.0 + x * x), drag * (1.0 - x * x) / (1.0 + x * x) ** 2


@pytest.mark.parametrize("rpm", [200.0, 400.0, 690.0, 900.0, 1200.0])
def test_a_source_of_current_leaves_the_damping_to_the_iron(rpm: float) -> None:
    """Which damps below its knee at 690 rev/min, and feeds the swing above, at most at sqrt(3) times that."""
    found, (torque, slope) = at(rpm, QUICK, STRONG), iron(rpm, QUICK)
    peak_nm = QUICK.torque_constant_nm_per_a * STRONG.current_a
    angle = math.asin((LOAD_NM + torque) / peak_nm)
    assert found.growth_per_s == pytest.approx(-slope / (2.0 * INERTIA_KGM2), rel=0.01, abs=0.05)
    stiffness = QUICK.pole_pairs * peak_nm * math.cos(angle)
    assert found.swing_hz == pytest.approx(math.sqrt(stiffness / INERTIA_KGM2) / (2.0 * math.pi), rel=3e-3)
    sub_step_deg = min(90.0 / 80, 25e-6 * 6.0 * QUICK.pole_pairs * rpm)  # of which the mean current is half behind
    assert found.load_angle_deg == pytest.approx(math.degrees(angle) + 0.5 * sub_step_deg, abs=0.02)
    assert (found.speed_rpm, found.stable) == (rpm, slope > 0.0)


@pytest.mark.parametrize(("gain", "corner_hz"), [(2.0, 300.0), (0.5, 300.0), (1.0, 100.0)])
@pytest.mark.parametrize("rpm", [300.0, 900.0])
def test_electronic_damping_by_its_closed_form(gain: float, corner_hz: float, rpm: float) -> None:
    """J s^2 + D s + K (1 + g s/(s + w_c)) = 0; D of the iron is by far less."""
    stage = replace(STRONG, damping_gain=gain, damping_corner_hz=corner_hz)
    torque, slope = iron(rpm, QUICK)
    peak_nm = QUICK.torque_constant_nm_per_a * stage.current_a
    k = QUICK.pole_pairs * math.sqrt(peak_nm**2 - (LOAD_NM + torque) ** 2)
    j, corner = INERTIA_KGM2, 2.0 * math.pi * corner_hz
    roots = np.roots([j, j * corner + slope, slope * corner + k * (1.0 + gain), k * corner])
    slowest = roots[roots.real.argmax()]
    found = at(rpm, QUICK, stage)
    assert found.growth_per_s == pytest.approx(slowest.real, rel=0.025)
    assert found.swing_hz == pytest.approx(abs(slowest.imag) / (2.0 * math.pi), rel=0.01, abs=0.5)


SATURATED = Stage(supply_v=48.0, current_a=20.0, supply_factor=1.0, extra_resistance_ohm=0.0)
"""Wants fifty times the current that its supply drives: a source of voltage, whose fundamental is 4/pi of it."""
PLAIN = replace(  # wound with four times the turns
    NEMA23,
    resistance_ohm=16.0 * NEMA23.resistance_ohm,
    inductance_h=16.0 * NEMA23.inductance_h,
    torque_constant_nm_per_a=4.0 * NEMA23.torque_constant_nm_per_a,
    iron_loss_ohm=math.inf,
)


@pytest.mark.parametrize(("rpm", "growth_per_s"), [(400.0, 14.6), (600.0, 6.14), (800.0, 3.41), (1200.0, 1.51)])
def test_a_source_of_voltage_by_its_eigenvalues(rpm: float, growth_per_s: float) -> None:
    """d/dt of (i_d, i_q, w, delta) on sinusoidal voltage, delta where the torque is that of the load."""
    r, ell, km = PLAIN.resistance_ohm, PLAIN.inductance_h, PLAIN.torque_constant_nm_per_a
    omega, volts, teeth, j = rpm * math.pi / 30.0, 4.0 / math.pi * SATURATED.supply_v, PLAIN.pole_pairs, INERTIA_KGM2

    def current(delta: float) -> complex:
        return complex((volts * np.exp(1j * delta) - 1j * km * omega) / (r + 1j * teeth * omega * ell))

    low, high = 0.0, 0.5 * math.pi + math.atan(teeth * omega * ell / r)  # the largest torque is there
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if km * current(middle).imag < LOAD_NM else (low, middle)
    i, v = current(low), volts * np.exp(1j * low)
    law = [
        [-r / ell, teeth * omega, teeth * i.imag, -v.imag / ell],
        [-teeth * omega, -r / ell, -teeth * i.real - km / ell, v.real / ell],
        [0.0, km / j, 0.0, 0.0],
        [0.0, 0.0, -teeth, 0.0],
    ]
    values = np.linalg.eigvals(law)
    largest = values[values.real.argmax()]
    assert largest.real == pytest.approx(growth_per_s, abs=0.05)
    found = at(rpm, PLAIN, SATURATED)
    assert found.growth_per_s == pytest.approx(largest.real, rel=0.12)  # the current moves the instants, a little
    assert found.swing_hz == pytest.approx(abs(largest.imag) / (2.0 * math.pi), rel=0.02)
    assert not found.stable


@pytest.mark.parametrize("rpm", [600.0, 1200.0])
def test_a_slow_swing_on_a_source_of_voltage(rpm: float) -> None:
    """D = Km^2 R (R^2 - X^2)/(R^2 + X^2)^2, whatever the load: 9 Hz are slow beside R/L, 42 Hz."""
    r, x = PLAIN.resistance_ohm, PLAIN.pole_pairs * rpm * math.pi / 30.0 * PLAIN.inductance_h
    damping = PLAIN.torque_constant_nm_per_a**2 * r * (r**2 - x**2) / (r**2 + x**2) ** 2
    for load_nm in (0.1, 0.2):
        found = at(rpm, PLAIN, SATURATED, load_nm, 1e-2)
        assert found.growth_per_s == pytest.approx(-damping / 2e-2, abs=0.01)
        assert found.swing_hz < 10.0


def test_errors_of_the_stage_are_left_out() -> None:
    assert limit_rpm() == limit_rpm(stage=replace(AT_48_V, step_error=0.1, current_offset=0.05))


def test_without_a_word_the_shaft_carries_what_the_rotor_has() -> None:
    (found,) = Bench(NEMA23, AT_48_V, 0.12).rotations([500.0])
    assert found == at(500.0, NEMA23, AT_48_V, 0.12, 2.0 * NEMA23.rotor_inertia_kgm2)


@pytest.mark.parametrize("load_nm", [-0.1, math.nan, math.inf])
def test_a_load_that_makes_no_sense_is_named(load_nm: float) -> None:
    with pytest.raises(ValueError, match="load_nm must be 0 or more"):
        Bench(NEMA23, AT_48_V, load_nm)


def test_the_limit_of_an_axis_is_that_with_its_friction() -> None:
    """The guide's force on a screw of 5 mm at 90 %: 150 N are 0.133 N m."""
    screw = Screw(4e-5, 0.09, viscous_nm_s_per_rad=2e-4, lead_mm=5.0, efficiency=0.9, backlash_mm=0.02)
    friction = Screw(4e-5, 0.09, viscous_nm_s_per_rad=2e-4)
    limit = Bench(NEMA23, AT_48_V, 150.0 * 5e-3 / (2.0 * math.pi) / 0.9, friction).limit()
    assert limit_rad_s(NEMA23, AT_48_V, screw, 150.0) == pytest.approx(limit.speed_rpm * math.pi / 30.0)
    assert limit_rad_s(replace(QUICK, iron_knee_rad_s=math.inf), STRONG, screw, 0.0) == math.inf


def test_the_rule_of_thumb_by_hand() -> None:
    """(4/pi) 43.68 V / (3.2 mH 4.2 A) = 4138 rad/s, 50 pairs of poles."""
    assert rule_rpm(NEMA23, AT_48_V) == pytest.approx(790.3, abs=0.2)


@pytest.mark.parametrize(
    ("name", "supply_v", "current_a"),
    [("23HS32-4004S", 48.0, 4.2), ("23HS22-2804S", 36.0, 2.8), ("17HS19-2004S", 24.0, 2.0), ("AS1060", 50.0, 5.0)],
)
def test_the_rule_of_thumb_within_its_range(name: str, supply_v: float, current_a: float) -> None:
    """Where R I is small beside the supply."""
    motor, stage = MOTORS[name], Stage(supply_v=supply_v, current_a=current_a)
    load_nm = 0.07 * motor.torque_constant_nm_per_a * current_a
    assert rule_rpm(motor, stage) == pytest.approx(
        limit_rpm(motor, stage, load_nm, 2.0 * motor.rotor_inertia_kgm2), rel=0.2
    )


@pytest.mark.parametrize(
    ("name", "stage", "load_nm"),
    [
        ("23HS32-4004S", AT_48_V, 0.12),
        ("23HS32-4004S", replace(AT_48_V, supply_v=36.0), 0.6),
        ("17HS19-2004S", Stage(supply_v=24.0, current_a=2.0), 0.05),
        ("57HS56-2804", Stage(supply_v=32.0, current_a=2.0), 0.05),
        ("AS1060", Stage(supply_v=50.0, current_a=5.0), 0.3),
    ],
)
def test_steps_are_lost_at_little_more_than_the_limit(name: str, stage: Stage, load_nm: float) -> None:
    """At 0.95 of it two seconds are held, at 1.3 they are not; constant torque, sub-steps of 5 us."""
    motor = MOTORS[name]
    limit = limit_rpm(motor, stage, load_nm, 2.0 * motor.rotor_inertia_kgm2)
    assert held(motor, stage, load_nm, 0.95 * limit)
    assert not held(motor, stage, load_nm, 1.3 * limit)


def held(motor: Motor, stage: Stage, load_nm: float, speed_rpm: float) -> bool:
    """Run up gently, hold for two seconds."""
    dt_s, up_s = 5e-6, 1.0
    t = dt_s * np.arange(round((up_s + 2.0) / dt_s))
    hz = speed_rpm / 60.0 * motor.full_steps_per_rev * stage.microsteps
    command = hz * np.where(t < up_s, t * t / (2.0 * up_s), t - 0.5 * up_s)
    parameters = axis_parameters(motor, stage, Screw(inertia_kgm2=motor.rotor_inertia_kgm2), dt_s)
    done = follow(parameters, axis_states(1), command, np.full(len(t), load_nm), 4.0 * stage.microsteps)
    return bool(done == len(t))
