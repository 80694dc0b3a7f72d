"""The torque-speed curve of a servo motor on its drive, as a table, as bars in a terminal and as a picture.

Two closed forms: the torque at the peak current, for moments, and at the rated current, for ever. Both reach 0 at U /
K, where the back-EMF leaves no voltage:

       rpm    peak Nm (least to most)   rated Nm (least to most)    0 ... Nm
         0      1.200 (1.104 to 1.296)     0.400 (0.368 to 0.432)    #############---------------------------
      5500      0.301 (0.000 to 0.612)     0.301 (0.000 to 0.432)    ##########      # for ever, - for moments

Least and most: of motors as makers spread K, on supplies as transformers spread them (machine/spread.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from json import dumps
from pathlib import Path

from isel_twin.base.pictures import Curve, draw_curves
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor

BAR = 40  # characters of the longest bar
CONSTANTS, SUPPLIES = (0.92, 1.0, 1.08), (0.88, 1.04)  # with the ends of what is drawn of either, over the stated one
LINES = 13  # speeds in the table, from 0 to that of no torque
_RPM = 30.0 / math.pi


@dataclass(frozen=True)
class ServoPoint:
    speed_rpm: float
    peak_nm: float
    rated_nm: float
    peak_band_nm: tuple[float, float]
    rated_band_nm: tuple[float, float]


def servo_table(motor: ServoMotor, drive: ServoDrive, speeds_rpm: Sequence[float] = ()) -> list[ServoPoint]:
    """Torques at some speeds; (): evenly from 0 to the highest possible."""
    highest_rpm = motor.corner_rad_s(drive, 0.0) * _RPM
    speeds = speeds_rpm or [highest_rpm * k / (LINES - 1) for k in range(LINES)]
    peak_a, rated_a = drive.peak_current_a, motor.rated_current_a
    others = [
        (
            replace(motor, torque_constant_nm_per_a=constant * motor.torque_constant_nm_per_a),
            replace(drive, supply_v=supply * drive.supply_v),
        )
        for constant, supply in product(CONSTANTS, SUPPLIES)
    ]

    def band(rpm: float, current_a: float) -> tuple[float, float]:
        found = [one.torque_nm(on, rpm / _RPM, current_a) for one, on in others]
        return min(found), max(found)

    return [
        ServoPoint(
            speed_rpm=rpm,
            peak_nm=motor.torque_nm(drive, rpm / _RPM, peak_a),
            rated_nm=motor.torque_nm(drive, rpm / _RPM, rated_a),
            peak_band_nm=band(rpm, peak_a),
            rated_band_nm=band(rpm, rated_a),
        )
        for rpm in speeds
    ]


def show_servo(
    name: str, motor: ServoMotor, drive: ServoDrive, lead_mm: float, picture: Path | None = None, *, json: bool = False
) -> None:
    """Print the torque curve of an axis, as a table or as one JSON object, and draw it into `picture`. lead_mm: of its
    screw. Raises ValueError for a picture without matplotlib.
    """
    table = servo_table(motor, drive)
    if json:
        print(dumps({"axis": name, "data": asdict(motor), "drive": asdict(drive), "curve": [asdict(p) for p in table]}))
    else:
        print("\n".join(_text(name, motor, drive, lead_mm, table)))
    if picture is not None:
        speeds = [point.speed_rpm for point in table]
        curves = [
            Curve("peak current, for moments", speeds, [point.peak_nm for point in table], "--"),
            Curve("rated current, for ever", speeds, [point.rated_nm for point in table]),
        ]
        draw_curves(picture, _title(name, drive), "speed, rev/min", "torque, Nm", curves)


def _title(name: str, drive: ServoDrive) -> str:
    amps = f"{drive.rated_current_a:g} A, {drive.peak_current_a:g} A peak"
    return f"servo motor of {name} at {drive.supply_v:g} V, {amps}"


def _text(name: str, motor: ServoMotor, drive: ServoDrive, lead_mm: float, table: Sequence[ServoPoint]) -> list[str]:
    """Lines for a terminal: data, the table with bars, corner speeds, lag and overload."""
    top = max(point.peak_nm for point in table) or 1.0
    lines = [
        _title(name, drive),
        f"R {motor.resistance_ohm:g} ohm, L {motor.inductance_h * 1e3:g} mH, "
        f"K {motor.torque_constant_nm_per_a:g} Nm/A, J {motor.rotor_inertia_kgm2:g} kg m^2, "
        f"{drive.increments_per_rev} increments a revolution",
        "",
        f"{'rpm':>6} {'mm/s':>8} {'peak Nm':>10} (least to most) {'rated Nm':>10} (least to most)",
    ]
    for point in table:
        for_ever, moments = (round(BAR * nm / top) for nm in (point.rated_nm, point.peak_nm))
        bar = "#" * for_ever + "-" * (moments - for_ever)
        figures = f"{point.speed_rpm:6.0f} {point.speed_rpm / 60.0 * lead_mm:8.0f}"
        peak, rated = ("({:.3f} to {:.3f})".format(*band) for band in (point.peak_band_nm, point.rated_band_nm))
        lines.append(f"{figures} {point.peak_nm:10.3f} {peak} {point.rated_nm:10.3f} {rated}  {bar}".rstrip())
    corners = [motor.corner_rad_s(drive, amps) * _RPM for amps in (drive.peak_current_a, motor.rated_current_a)]
    mm = drive.increments_per_rev / lead_mm
    most_mm_s = drive.lag_limit / mm * drive.position_gain_per_s / max(1e-9, 1.0 - drive.feed_forward)
    ratio = (drive.peak_current_a / motor.rated_current_a) ** 2
    overload_s = drive.i2t_time_constant_s * math.log(ratio / (ratio - 1.0)) if ratio > 1.0 else math.inf
    at = 100.0 * mm / drive.position_gain_per_s * (1.0 - drive.feed_forward)
    limit = (
        f"at its limit of {drive.lag_limit:g} at {most_mm_s:.0f} mm/s" if most_mm_s < 1e6 else "no limit of speed by it"
    )
    return [
        *lines,
        "",
        f"peak torque up to {corners[0]:.0f} rpm, for {overload_s:.2g} s from cold; "
        f"rated torque up to {corners[1]:.0f} rpm",
        f"lags by {at:.0f} increments at 100 mm/s; {limit}",
        "closed forms; nothing was compared with a maker's curve: see docs/fidelity.md",
    ]
