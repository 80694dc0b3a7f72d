"""The growth of a swing against figures worked out independently (own law, sub-steps of 1 to 5 us), against closed
forms where there are any (a source of current, one of voltage, electronic damping), against the closed form of its
onset, and against the first loss of steps in the time domain.

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
from isel_twin.drives.stability import Bench, Rotation, _Map, limit_rad_s, rule_rpm
from isel_twin.drives.stage import Stage

pytestmark = pytest.mark.long(seconds=5)

NEMA23 = MOTORS["23HS32-4004S"]
INERTIA_KGM2 = 9.6e-5  # in all
AT_48_V = Stage(supply_v=48.0, current_a=4.2)


def limit_rpm(
    motor: Motor = NEMA23, stage: Stage = AT_48_V, load_nm: float = 0.12, inertia: float = INERTIA_KGM2
) -> float:
    found = Bench(motor, stage, load_nm, inertia - motor.rotor_inertia_kgm2).limit()
    assert found.swings
    return found.speed_rpm


@pytest.mark.parametrize(
    ("supply_v", "limits"),
    [
        (24.0, (470, 430, 410, 390)),
        (36.0, (630, 610, 590, 570)),
        (48.0, (810, 790, 770, 730)),
        (60.0, (1010, 970, 950, 890)),
        (72.0, (1190, 1170, 1110, 1070)),
    ],
)
def test_the_limit_rises_with_the_supply_and_hardly_falls_with_the_load(
    supply_v: float, limits: tuple[int, ...]
) -> None:
    """Found on a grid of 20 rev/min there."""
    found = [limit_rpm(stage=replace(AT_48_V, supply_v=supply_v), load_nm=nm) for nm in (0.05, 0.12, 0.3, 0.6)]
    assert found == pytest.approx(limits, abs=21)


@pytest.mark.parametrize(
    ("change", "limit"),
    [
        ({"inductance_h": 0.8 * 3.2e-3}, 910),
        ({"inductance_h": 1.2 * 3.2e-3}, 710),
        ({"torque_constant_nm_per_a": 0.9 * NEMA23.torque_constant_nm_per_a}, 830),
        ({"torque_constant_nm_per_a": 1.1 * NEMA23.torque_constant_nm_per_a}, 770),
        ({"resistance_ohm": 1.35 * 0.85 - 0.2}, 810),
        ({"iron_loss_ohm": NEMA23.iron_loss_ohm / 2.0}, 770),
        ({"iron_knee_rad_s": math.inf}, 890),
    ],
)
def test_what_moves_the_limit(change: dict[str, float], limit: int) -> None:
    assert limit_rpm(replace(NEMA23, **change)) == pytest.approx(limit, abs=26)


@pytest.mark.parametrize(("current_a", "limit"), [(0.7 * 4.2, 1010), (0.9 * 4.2, 850), (1.1 * 4.2, 750)])
def test_less_current_swings_later(current_a: float, limit: int) -> None:
    assert limit_rpm(stage=replace(AT_48_V, current_a=current_a)) == pytest.approx(limit, abs=21)


@pytest.mark.parametrize(("inertia", "swing_hz"), [(5.3e-5, 191.0), (2e-4, 98.0), (5e-4, 62.0)])
def test_inertia_moves_the_swing_and_not_the_limit(inertia: float, swing_hz: float) -> None:
    limit = limit_rpm(inertia=inertia)
    assert limit == pytest.approx(limit_rpm(), abs=5)
    (there,) = Bench(NEMA23, AT_48_V, 0.12, inertia - NEMA23.rotor_inertia_kgm2).rotations([limit])
    assert there is not None
    assert there.swing_hz == pytest.approx(swing_hz, rel=0.03)
    assert abs(there.growth_per_s) < 1.0


def test_a_small_motor_whose_resistance_takes_much_of_the_supply() -> None:
    """Where the rule of thumb fails."""
    assert limit_rpm(MOTORS["14HS17-0504S"], Stage(supply_v=20.0, current_a=0.5), 0.009, 3.6e-6) == pytest.approx(
        530, abs=21
    )


def test_growth_with_speed() -> None:
    on = Bench(NEMA23, AT_48_V, 0.12, INERTIA_KGM2 - NEMA23.rotor_inertia_kgm2)
    found = [
        0.0 if one is None else one.growth_per_s for one in on.rotations([300, 500, 600, 700, 798, 850, 900, 1000])
    ]
    assert found == pytest.approx([-17.0, -82.0, -59.0, -28.0, 0.0, 14.0, 17.0, 22.0], abs=2.5)


def test_a_load_that_no_current_carries_has_no_rotation() -> None:
    assert list(Bench(NEMA23, AT_48_V, 2.5).rotations([100.0, 200.0])) == [None, None]
    assert Bench(NEMA23, AT_48_V, 2.5).limit().speed_rpm == 0.0
    assert not Bench(NEMA23, AT_48_V, 2.5).limit().swings


def test_an_overloaded_motor_is_left_as_soon_as_it_is_out_of_step() -> None:
    """Under a little more torque than it has: half an electrical revolution behind it will not come back."""
    peak_nm = NEMA23.torque_constant_nm_per_a * AT_48_V.current_a
    on, omega = Bench(NEMA23, AT_48_V, 1.05 * peak_nm, 9.0 * NEMA23.rotor_inertia_kgm2), 200.0 * math.pi / 30.0
    sub_steps, quarter_s = 300, 0.5 * math.pi / (NEMA23.pole_pairs * omega)
    parameters = axis_parameters(on.motor, on.stage, on._screw, quarter_s / sub_steps)
    state = on._guess(omega)
    assert not _Map(parameters, on.stage, on.load_nm, omega, sub_steps, len(state) - 2).settle(state)
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
    found = Bench(replace(NEMA23, iron_knee_rad_s=math.inf, inductance_h=1e-4), strong, 0.12).limit(1500.0)
    assert not found.swings


STRONG = Stage(supply_v=200.0, current_a=4.2, supply_factor=1.0, extra_resistance_ohm=0.0)
QUICK = replace(NEMA23, inductance_h=1e-4, iron_loss_ohm=NEMA23.iron_loss_ohm)  # STRONG keeps its current at any speed
LOAD_NM = 0.12


def at(rpm: float, motor: Motor, stage: Stage, load_nm: float = LOAD_NM, inertia: float = INERTIA_KGM2) -> Rotation:
    (found,) = Bench(motor, stage, load_nm, inertia - motor.rotor_inertia_kgm2).rotations([rpm])
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
    assert found.growth_per_s == pytest.approx(-slope / (2.0 * INERTIA_KGM2), rel=1e-3, abs=1e-3)
    stiffness = QUICK.pole_pairs * peak_nm * math.cos(angle)
    assert found.swing_hz == pytest.approx(math.sqrt(stiffness / INERTIA_KGM2) / (2.0 * math.pi), rel=1e-3)
    sub_step_deg = min(90.0 / 80, 5e-6 * 6.0 * QUICK.pole_pairs * rpm)  # of which the mean current is half behind
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
    assert found.growth_per_s == pytest.approx(slowest.real, rel=0.015)
    assert found.swing_hz == pytest.approx(abs(slowest.imag) / (2.0 * math.pi), rel=1e-3, abs=0.5)


SATURATED = Stage(supply_v=12.0, current_a=20.0, supply_factor=1.0, extra_resistance_ohm=0.0)
"""Wants more current than its supply ever drives: a source of voltage, whose fundamental is 4/pi of it."""
PLAIN = replace(NEMA23, iron_loss_ohm=math.inf)


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
    assert found.growth_per_s == pytest.approx(largest.real, rel=0.01)
    assert found.swing_hz == pytest.approx(abs(largest.imag) / (2.0 * math.pi), rel=2e-3)
    assert not found.stable


@pytest.mark.parametrize("rpm", [600.0, 1200.0])
def test_a_slow_swing_on_a_source_of_voltage(rpm: float) -> None:
    """D = Km^2 R (R^2 - X^2)/(R^2 + X^2)^2, whatever the load: 9 Hz are slow beside R/L, 42 Hz."""
    r, x = PLAIN.resistance_ohm, PLAIN.pole_pairs * rpm * math.pi / 30.0 * PLAIN.inductance_h
    damping = PLAIN.torque_constant_nm_per_a**2 * r * (r**2 - x**2) / (r**2 + x**2) ** 2
    for load_nm in (0.1, 0.2):
        found = at(rpm, PLAIN, SATURATED, load_nm, 1e-2)
        assert found.growth_per_s == pytest.approx(-damping / 2e-2, rel=1e-3)
        assert found.swing_hz < 10.0


def test_the_limit_is_found_to_one_revolution_a_minute() -> None:
    limit = limit_rpm()
    assert at(limit, NEMA23, AT_48_V).growth_per_s <= 0.0 < at(limit + 1.0, NEMA23, AT_48_V).growth_per_s
    assert limit == limit_rpm(stage=replace(AT_48_V, step_error=0.1, current_offset=0.05)), "errors are left out"


def test_without_a_word_the_shaft_carries_what_the_rotor_has() -> None:
    (found,) = Bench(NEMA23, AT_48_V, 0.12).rotations([500.0])
    assert found == at(500.0, NEMA23, AT_48_V, 0.12, 2.0 * NEMA23.rotor_inertia_kgm2)


@pytest.mark.parametrize("load_nm", [-0.1, math.nan, math.inf])
def test_a_load_that_makes_no_sense_is_named(load_nm: float) -> None:
    with pytest.raises(ValueError, match="load_nm must be 0 or more"):
        Bench(NEMA23, AT_48_V, load_nm)


def test_the_limit_of_a_stage_is_that_under_a_tenth_of_its_torque() -> None:
    tenth = 0.1 * NEMA23.torque_constant_nm_per_a * AT_48_V.current_a
    own = 2.0 * NEMA23.rotor_inertia_kgm2
    assert limit_rad_s(NEMA23, AT_48_V) == pytest.approx(limit_rpm(load_nm=tenth, inertia=own) * math.pi / 30.0)
    assert limit_rad_s(replace(QUICK, iron_knee_rad_s=math.inf), STRONG) == math.inf


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
        limit_rpm(motor, stage, load_nm, 2.0 * motor.rotor_inertia_kgm2), rel=0.15
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
    """At 1.0 of it two seconds are held, at 1.3 they are not; constant torque, sub-steps of 5 us."""
    motor = MOTORS[name]
    limit = limit_rpm(motor, stage, load_nm, 2.0 * motor.rotor_inertia_kgm2)
    assert held(motor, stage, load_nm, limit)
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
