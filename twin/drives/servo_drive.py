"""Servo motors and their drives as data: name-plate values and drive settings.

A brushless motor with its commutation equals a direct-current motor: one winding, one current, and one constant for
torque and back-EMF (the same number in N m/A and V s/rad; plates may give it per phase or as RMS value).

    U = R i + L di/dt + K w          T = K i

The drive closes three loops (servo.h): current in every sub-step, speed and position every `loop_period`. Its encoder
on the motor counts whole increments, the unit of the commands. It limits the current to `peak_current`, and to
`rated_current` after the I2t, the low pass of (i / rated)^2, has passed 1 until it is back below I2T_BACK. If the
following error passes its limit it switches itself off until the fault is cleared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from isel_twin.base.parameters import check, number

I2T_BACK = 0.9  # I2t below which an overload is over
IN_C = ("I2T_BACK",)  # records.h has them, too


@dataclass(frozen=True)
class ServoMotor:
    """A direct-current motor. Raises ValueError for a value that no motor can have."""

    resistance_ohm: float = number("ohm", 1e-3, 1e3, key="resistance")
    inductance_h: float = number("mH", 1e-3, 1e4, key="inductance", scale=1e-3)
    # k: torque over current, and back-EMF over speed
    torque_constant_nm_per_a: float = number("N m/A", 1e-4, 1e3, key="torque_constant")
    rotor_inertia_kgm2: float = number("kg m2", 1e-9, 10.0, key="rotor_inertia")
    rated_current_a: float = number("A", 1e-3, 1e3, key="rated_current")

    def __post_init__(self) -> None:
        check(self)

    def torque_nm(self, drive: ServoDrive, speed_rad_s: float, current_a: float) -> float:
        """Torque at a speed with at most this current, limited by the voltage left above the back-EMF."""
        voltage_v = drive.drive_v - self.torque_constant_nm_per_a * speed_rad_s
        by_voltage_a = voltage_v / (self.resistance_ohm + drive.extra_resistance_ohm)
        return self.torque_constant_nm_per_a * max(0.0, min(current_a, by_voltage_a))

    def corner_rad_s(self, drive: ServoDrive, current_a: float) -> float:
        """Highest speed at which the voltage drives this current; 0 if there is none."""
        left_v = drive.drive_v - (self.resistance_ohm + drive.extra_resistance_ohm) * current_a
        return max(0.0, left_v / self.torque_constant_nm_per_a)


@dataclass(frozen=True)
class ServoDrive:
    """Amplifier, encoder and loops of one servo axis. Raises ValueError for settings that no drive can have."""

    supply_v: float = number("V", 5.0, 800.0, key="supply")  # largest voltage at the motor
    peak_current_a: float = number("A", 1e-3, 1e3, key="peak_current")
    # of the encoder, all edges counted: the unit of the commands
    increments_per_rev: int = number("1", 50, 10_000_000, key="increments_per_rev", whole=True)
    # kv: wanted speed over following error; without feed-forward an axis at speed v lags by v / Kv
    position_gain_per_s: float = number("1/s", 0.1, 1000.0, key="position_gain")
    # part of the command's speed that is added to it; 1: no lag at constant speed
    feed_forward: float = number("1", 0.0, 1.5, key="feed_forward")
    # w_v: of the speed loop without its integral, by the inertia of all that turns (the carriage not counted)
    speed_bandwidth_rad_s: float = number("Hz", 1.0, 1000.0, key="speed_bandwidth", scale=2.0 * math.pi)
    # ti w_v: reset time of the speed loop over the time of its bandwidth
    integral_ratio: float = number("1", 0.5, 1e6, key="integral_ratio")
    # from sample to sample of position and speed; whole sub-steps of the plant
    loop_period_s: float = number("us", 1.0, 10_000.0, key="loop_period", scale=1e-6)
    # following error beyond which the drive switches itself off
    lag_limit: float = number("increments", 1.0, 1e9, key="following_error_limit")
    # following error up to which the axis counts as in position ...
    window: float = number("increments", 0.0, 1e6, key="in_position_window")
    # ... after it has been within for this long
    window_time_s: float = number("ms", 0.0, 10_000.0, key="in_position_time", scale=1e-3)
    i2t_time_constant_s: float = number("s", 0.01, 1e5, key="i2t_time_constant")
    # switches and cable, in series with the winding
    extra_resistance_ohm: float = number("ohm", 0.0, 100.0, key="amplifier_resistance", optional=True, default=0.0)
    # losses while switched on, beside those of the current (estimate)
    quiescent_w: float = number("W", 0.0, 1000.0, key="quiescent_power", optional=True, default=5.0)
    # from the switches through the heat sink to the air (estimate)
    thermal_resistance_k_per_w: float = number("K/W", 0.0, 1000.0, key="thermal_resistance", optional=True, default=2.0)
    # of amplifier and heat sink (estimate)
    thermal_time_constant_s: float = number("s", 1.0, 1e6, key="thermal_time_constant", optional=True, default=600.0)
    # temperature of the air in the cabinet
    ambient_c: float = number("C", -50.0, 150.0, key="ambient", optional=True, default=25.0)
    # where the over-temperature contact opens (estimate)
    thermal_limit_c: float = number("C", -50.0, 300.0, key="thermal_limit", optional=True, default=85.0)
    rated_current_a: float = number("A", 1e-3, 1e3, default=math.nan)  # of the motor, for the I2t

    def __post_init__(self) -> None:
        check(self)

    @property
    def drive_v(self) -> float:
        return self.supply_v

    @property
    def supply_factor(self) -> float:
        return 1.0

    @property
    def current_a(self) -> float:
        return self.peak_current_a

    @property
    def lag_s(self) -> float:
        """By which the axis is behind at constant speed."""
        return (1.0 - self.feed_forward) / self.position_gain_per_s

    @property
    def reset_s(self) -> float:
        """In which the integral of an error of the speed has as much effect as the error itself."""
        return self.integral_ratio / self.speed_bandwidth_rad_s

    def loss_w(self, current_fraction: float) -> float:
        """Heat it makes while switched on, at a fraction of the rated current."""
        return self.quiescent_w + self.extra_resistance_ohm * (self.rated_current_a * current_fraction) ** 2
