"""Two-phase hybrid stepper motors as data: what a data sheet says, and what follows when it is silent.

A data sheet gives phase resistance and inductance, rated current, holding torque and rotor inertia. The torque constant
follows from the holding torque, which is measured with both phases at rated current:

    Km = T_hold / (sqrt(2) I)

Two quantities are rarely printed. Both rules below survive a rewinding of the same motor (z times the turns: R, L and
Rm grow with z^2, Km with z), so they say something about the iron and not about the wire:

    iron loss   Rm = 15000 1/s * L                   48 ohm at 3.2 mH, where torque curves were compared
    detent      Td = 0.12 sqrt(W) * Km / sqrt(R)     0.11 .. 0.17 sqrt(W) for the motors that state it
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from isel_twin.parameters import check, number

IRON_LOSS_PER_INDUCTANCE = 15000.0
"""Iron-loss resistance over phase inductance, ohm/H (estimate; see decision D2)."""

DETENT_PER_MOTOR_CONSTANT = 0.12
"""Detent torque over Km / sqrt(R), sqrt(W) (estimate; see decision D3)."""


@dataclass(frozen=True)
class Motor:
    """A two-phase hybrid stepper motor. The first four fields suffice; what is left out follows from rules.

    Raises ValueError for a value that no motor can have.
    """

    resistance_ohm: float = number("ohm", 1e-3, 1e3, key="resistance_ohm")
    """Phase resistance."""
    inductance_h: float = number("H", 1e-6, 10.0, key="inductance_h")
    """Phase inductance."""
    torque_constant_nm_per_a: float = number("N m/A", 1e-4, 1e3, key="torque_constant_nm_per_a")
    """Km: peak torque of one phase per ampere, and back-EMF in V s/rad."""
    rotor_inertia_kgm2: float = number("kg m2", 1e-9, 10.0, key="rotor_inertia_kgm2")
    """Rotor inertia."""
    detent_torque_nm: float = number("N m", 0.0, 1e3, key="detent_torque_nm", optional=True, default=math.nan)
    """Peak detent torque; nan: by rule from Km and R."""
    iron_loss_ohm: float = number("ohm", 1e-3, math.inf, key="iron_loss_ohm", optional=True, default=math.nan)
    """Resistance that stands for the iron loss, math.inf for none; nan: by rule from L."""
    pole_pairs: int = number("1", 1, 1000, key="pole_pairs", whole=True, optional=True, default=50)
    """Rotor teeth: 50 for 1.8 degrees, 100 for 0.9 degrees a full step."""
    rated_current_a: float = number("A", 1e-3, 1e3, key="rated_current_a", optional=True, default=math.nan)
    """Phase current the maker allows with both phases on; nan: unknown."""

    def __post_init__(self) -> None:
        check(self)
        if math.isnan(self.detent_torque_nm):
            rule = DETENT_PER_MOTOR_CONSTANT * self.torque_constant_nm_per_a / math.sqrt(self.resistance_ohm)
            object.__setattr__(self, "detent_torque_nm", rule)
        if math.isnan(self.iron_loss_ohm):
            object.__setattr__(self, "iron_loss_ohm", IRON_LOSS_PER_INDUCTANCE * self.inductance_h)

    @property
    def full_steps_per_rev(self) -> int:
        """Full steps in a revolution: four a pole pair."""
        return 4 * self.pole_pairs

    @property
    def iron_drag_nm_s_per_rad(self) -> float:
        """Drag torque of the iron loss over speed, Km^2 / Rm."""
        return self.torque_constant_nm_per_a**2 / self.iron_loss_ohm


def from_datasheet(
    holding_torque_nm: float,
    rated_current_a: float,
    resistance_ohm: float,
    inductance_h: float,
    rotor_inertia_kgm2: float,
    detent_torque_nm: float = math.nan,
    pole_pairs: int = 50,
) -> Motor:
    """The motor whose data sheet gives these figures; the holding torque with both phases at rated current."""
    return Motor(
        resistance_ohm=resistance_ohm,
        inductance_h=inductance_h,
        torque_constant_nm_per_a=holding_torque_nm / (math.sqrt(2.0) * rated_current_a),
        rotor_inertia_kgm2=rotor_inertia_kgm2,
        detent_torque_nm=detent_torque_nm,
        pole_pairs=pole_pairs,
        rated_current_a=rated_current_a,
    )


MOTORS: Mapping[str, Motor] = MappingProxyType(
    {
        # StepperOnline data sheet; detent torque estimated.
        "23HS32-4004S": from_datasheet(2.40, 4.0, 0.65, 3.2e-3, 530e-7, detent_torque_nm=0.06),
        # Data sheet: detent 400 g cm, at most 2500 half steps/s from rest.
        "57HS56-2804": from_datasheet(1.236, 2.8, 1.1, 3.0e-3, 300e-7, detent_torque_nm=0.039),
        # StepperOnline data sheet; rotor inertia not stated there, taken from the 57HS56 of the same length (estimate).
        "23HS22-2804S": from_datasheet(1.24, 2.8, 0.92, 2.68e-3, 300e-7),
        # Public data of a NEMA 23 sold by cnc3d, 600 g cm^2, detent 0.09 Nm.
        "cnc3d-NEMA23": from_datasheet(2.45, 3.0, 1.2, 4.0e-3, 600e-7, detent_torque_nm=0.09),
        # LDO, 0.9 degrees; figures of the public stepper-calculator collection.
        "57STH56-2804MAC": from_datasheet(1.2, 2.8, 1.1, 3.4e-3, 305e-7, pole_pairs=100),
    }
)
"""Stand-in motors by type name (isel publishes no motor data): NEMA 23, 0.6 .. 1.2 ohm as isel states for its own."""
