"""Motors by type name: what their sheets say, who says it, and what had to be estimated.

isel publishes no data of its motors; those of NEMA 23 with 0.6 to 1.2 ohm a phase bracket what is known of them. What a
sheet's current means decides more than the physics: the holding torque is with direct current in both phases whatever
the word, so the torque constant is the same; but a drive may be set to that current as the peak of the microstep wave,
or as its RMS value, with 41 % more torque.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

from isel_twin.drives.motor import Motor, from_datasheet
from isel_twin.drives.stage import Stage

PEAK = "peak"  # the maker's curve fits only if the sheet's current is the peak
RMS = "RMS"  # the sheet, or the chart of its drive, says so
DIRECT = "direct current in both phases, taken for the peak"
UNMARKED = "unmarked, taken for the peak"
NEVER_STATED = ("iron_loss_ohm", "iron_knee_rad_s")  # fields of `Motor` that are estimated for every motor


@dataclass(frozen=True)
class Sheet:
    """A motor and where its numbers come from."""

    motor: Motor
    frame: int  # NEMA size
    current: str  # what the sheet's current means
    source: str
    grade: str = "datasheet"  # of all numbers but the estimated ones
    estimated: tuple[str, ...] = ()  # fields of `Motor` that its sheet does not state, beside NEVER_STATED


def _sheet(
    frame: int,
    current: str,
    source: str,
    *numbers: float,
    detent_torque_nm: float | None = None,
    pole_pairs: int = 50,
    grade: str = "datasheet",
    estimated: tuple[str, ...] = (),
    back_emf_v_per_krpm: float = math.nan,
) -> Sheet:
    """numbers: holding torque in N m, current in A, ohm, mH, g cm^2. back_emf_v_per_krpm: amplitude of a phase."""
    holding_nm, sheet_a, ohm, millihenry, g_cm2 = numbers
    given = {"rated_current_rms_a" if current == RMS else "rated_current_a": sheet_a}
    if detent_torque_nm is None:
        estimated += ("detent_torque_nm",)
    else:
        given["detent_torque_nm"] = detent_torque_nm
    motor = from_datasheet(
        holding_nm,
        resistance_ohm=ohm,
        inductance_h=millihenry * 1e-3,
        rotor_inertia_kgm2=g_cm2 * 1e-7,
        pole_pairs=pole_pairs,
        back_emf_v_s_per_rad=back_emf_v_per_krpm * 1e-3 * 30.0 / math.pi,
        **given,
    )
    return Sheet(motor, frame, current, source, grade, estimated)


_SANYO = "Sanyo Denki, catalogue of unipolar motors, both halves in series: R and back-EMF twice, L four times"
_COLLECTION = "figures of the sheet as public collections have them"
_COMPARED = "StepperOnline sheet; a maker's curve was compared"
_INERTIA = ("rotor_inertia_kgm2",)
_DETENT = ("detent_torque_nm",)

SHEETS: Mapping[str, Sheet] = MappingProxyType(
    {
        "23HS32-4004S": _sheet(
            23, PEAK, _COMPARED, 2.40, 4.0, 0.65, 3.2, 530.0, detent_torque_nm=0.06, estimated=_DETENT
        ),
        "14HS17-0504S": _sheet(14, UNMARKED, _COMPARED, 0.23, 0.5, 15.0, 26.0, 18.0),
        "35STH48-1684AH": _sheet(14, UNMARKED, f"LDO; {_COLLECTION}", 0.40, 1.68, 1.65, 2.8, 49.0),
        "17HS19-2004S": _sheet(17, PEAK, _COMPARED, 0.52, 2.0, 1.4, 3.0, 82.0),
        "17HS24-2104S": _sheet(17, UNMARKED, f"StepperOnline; {_COLLECTION}", 0.65, 2.1, 1.6, 3.0, 148.0),
        "MS17HDBP4200": _sheet(17, UNMARKED, f"Moons; {_COLLECTION}", 0.83, 2.0, 1.49, 3.8, 123.0),
        "AS1010": _sheet(
            17, DIRECT, "Beckhoff, AS1000 in its information system", 0.38, 1.0, 4.10, 9.5, 56.0, detent_torque_nm=0.015
        ),
        "103-546-5342": _sheet(17, DIRECT, _SANYO, 0.19, 0.42, 13.4, 21.6, 30.0, back_emf_v_per_krpm=36.0),
        "103-547-52500": _sheet(17, DIRECT, _SANYO, 0.25, 0.7, 6.3, 12.0, 43.0, back_emf_v_per_krpm=28.0),
        "57HS56-2804": _sheet(
            23,
            UNMARKED,
            "sheet: detent 400 g cm, at most 2500 half steps/s from rest",
            1.236,
            2.8,
            1.1,
            3.0,
            300.0,
            detent_torque_nm=0.039,
        ),
        "23HS22-2804S": _sheet(
            23,
            UNMARKED,
            "StepperOnline sheet; inertia of the 57HS56 of the same length",
            1.24,
            2.8,
            0.92,
            2.68,
            300.0,
            estimated=_INERTIA,
        ),
        "cnc3d-NEMA23": _sheet(
            23, UNMARKED, "public data of a motor sold by cnc3d", 2.45, 3.0, 1.2, 4.0, 600.0, detent_torque_nm=0.09
        ),
        "57STH56-2804MAC": _sheet(
            23, UNMARKED, f"LDO, 0.9 degrees; {_COLLECTION}", 1.2, 2.8, 1.1, 3.4, 305.0, pole_pairs=100
        ),
        "23HS45-4204S": _sheet(
            23,
            UNMARKED,
            f"StepperOnline; {_COLLECTION}; a newer chart of the same body names RMS",
            3.0,
            4.2,
            0.88,
            3.4,
            800.0,
        ),
        "AS1050": _sheet(
            23,
            DIRECT,
            "Beckhoff, AS1000 in its information system",
            1.2,
            5.0,
            0.28,
            0.86,
            360.0,
            detent_torque_nm=0.052,
        ),
        "QSH6018-56-28-165": _sheet(24, RMS, "Trinamic QSH6018 manual, 1.2", 1.65, 2.8, 0.90, 3.6, 400.0),
        "QSH6018-65-28-210": _sheet(24, RMS, "Trinamic QSH6018 manual, 1.2", 2.10, 2.8, 1.20, 4.6, 570.0),
        "QSH6018-86-28-310": _sheet(24, RMS, "Trinamic QSH6018 manual, 1.2", 3.10, 2.8, 1.50, 6.8, 840.0),
        "103H7822-5740": _sheet(
            24, DIRECT, "Sanyo Denki, sheet of 60 mm motors; least holding torque", 1.37, 2.0, 1.55, 5.5, 400.0
        ),
        "103H7823-1740": _sheet(
            24, DIRECT, "Sanyo Denki, sheet of 60 mm motors; least holding torque", 2.7, 4.0, 0.65, 2.4, 840.0
        ),
        "AS1060": _sheet(
            34, DIRECT, "Beckhoff, AS1000 in its information system", 5.0, 5.0, 0.36, 2.8, 3000.0, detent_torque_nm=0.18
        ),
        "34HS59-6004D": _sheet(34, UNMARKED, f"StepperOnline; {_COLLECTION}", 12.0, 6.0, 0.53, 4.8, 3600.0),
    }
)
"""By type name: that of the machines here, then the others, smallest first."""

MOTORS: Mapping[str, Motor] = MappingProxyType({name: sheet.motor for name, sheet in SHEETS.items()})


def figures(data: Motor | Stage | Sheet) -> dict[str, Any]:
    """The fields for JSON; None for infinite."""
    return asdict(data, dict_factory=lambda items: {k: None if v == math.inf else v for k, v in items})
