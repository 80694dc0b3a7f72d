"""Two-phase hybrid stepper motors as data: data-sheet values, and rules for values that sheets leave out.

A data sheet gives phase resistance and inductance, rated current, holding torque and rotor inertia. The torque constant
follows from the holding torque, which is measured with both phases at rated current:

    Km = T_hold / (sqrt(2) I)

Sheets do not say whether that current is the peak of the microstep wave or its RMS value. Km is the same, but the drive
may then be set to I or to sqrt(2) I, with as much difference in torque. It is taken as the peak unless called RMS
(drives/10).

Some sheets also give the back-EMF, which is Km without current. Where the holding torque is less than goes with it, the
iron saturates: with a current vector of length i

    Km(i) = Km / sqrt(1 + (i / i_s)^2)        i = sqrt(2) I at rated current, from which i_s follows

A stage holds the length of its vector, so the motor has one constant on one stage (`at_current`, drives/15).

The magnets of a turning rotor drive eddy currents through the iron of the teeth, with phases open or on. Their path has
a resistance and an inductance, like a short-circuited winding, so the drag has a knee:

    T_fe(w) = (Km^2 / Rm) w / (1 + (w / w_k)^2)

    T_fe |        _.-''-._            below the knee the current is e/Rm, and the drag grows with speed
         |     .-'        '-.._       above it the field of the current itself keeps the flux out: the drag falls
         |   .'                 '-..
         | .'
         +------------|------------- w
                     w_k

Three quantities are rarely printed. The rules for them do not depend on the winding (z times the turns: R, L and Rm
grow with z^2, Km with z), so they describe the iron and not the wire:

    iron loss   Rm = 1650 s^(-2/3) L^(2/3) R^(1/3)   31 ohm at 3.2 mH, 0.65 ohm
    its knee    w_k = 3600 rad/s / Nr                at 1.8 degrees 72 rad/s, 690 rev/min
    detent      Td = 0.12 sqrt(W) * Km / sqrt(R)     0.11 .. 0.17 sqrt(W) for the motors that state it

Motors of all sizes have sheets of 0.5 mm and gaps of 0.05 to 0.1 mm; the rest grows with the size s. At one flux
density eddy currents lose as much in each volume, s^3, so Rm = e^2/P goes with z^2 s; and L with z^2 s^2, R with z^2/s.
Hence the powers of L and R. The flux in the teeth alternates with Nr w: its skin depth sqrt(2 rho / (Nr w mu)) falls to
half a sheet's thickness d at 8 rho / (mu d^2), 3600 rad/s for 0.3 uohm m and mu = 2100 mu_0 (decision drives/2).
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace

from isel_twin.base.parameters import check, number

log = logging.getLogger("isel_twin")
IRON_LOSS = 1650.0  # iron-loss resistance over L^(2/3) R^(1/3), s^(-2/3) (fitted to two curves; decision drives/2)
IRON_KNEE_RAD_S = 3600.0  # electrical angular frequency of the knee of the iron drag, rad/s (decision drives/2)
RUNNING_SHARE = (0.8, 1.15)  # plausible torque at low speed over Km times the peak current
READING = 1.03  # within which two figures of a sheet are the same (three sheets agree to 1.5 %)
DETENT_PER_MOTOR_CONSTANT = 0.12  # detent torque over Km / sqrt(R), sqrt(W) (estimate, decision drives/3)


@dataclass(frozen=True)
class Motor:
    """The first four fields suffice; others have rules as defaults. Raises ValueError for an impossible value."""

    resistance_ohm: float = number("ohm", 1e-3, 1e3, key="resistance_ohm")  # of a phase
    inductance_h: float = number("H", 1e-6, 10.0, key="inductance_h")  # of a phase
    # km: peak torque of one phase per ampere, and back-EMF in V s/rad
    torque_constant_nm_per_a: float = number("N m/A", 1e-4, 1e3, key="torque_constant_nm_per_a")
    rotor_inertia_kgm2: float = number("kg m2", 1e-9, 10.0, key="rotor_inertia_kgm2")
    # peak detent torque; nan: by rule from Km and R
    detent_torque_nm: float = number("N m", 0.0, 1e3, key="detent_torque_nm", optional=True, default=math.nan)
    # resistance that stands for the iron loss, math.inf for none; nan: by rule from L and R
    iron_loss_ohm: float = number("ohm", 1e-3, math.inf, key="iron_loss_ohm", optional=True, default=math.nan)
    # rotor teeth: 50 for 1.8 degrees, 100 for 0.9 degrees a full step
    pole_pairs: int = number("1", 1, 1000, key="pole_pairs", whole=True, optional=True, default=50)
    # peak of the phase current that the maker allows; inf: unknown
    rated_current_a: float = number("A", 1e-3, 1e3, key="rated_current_a", optional=True, default=math.inf)
    # speed at which the iron drag is largest, math.inf for drag that grows without end; nan: by rule
    iron_knee_rad_s: float = number("rad/s", 1e-3, math.inf, key="iron_knee_rad_s", optional=True, default=math.nan)

    # length of the current vector at which saturation has taken 29 % of Km; inf: none
    saturation_current_a: float = number("A", 1e-3, math.inf, key="saturation_current", optional=True, default=math.inf)

    def __post_init__(self) -> None:
        check(self)
        if math.isnan(self.detent_torque_nm):
            rule = DETENT_PER_MOTOR_CONSTANT * self.torque_constant_nm_per_a / math.sqrt(self.resistance_ohm)
            object.__setattr__(self, "detent_torque_nm", rule)
        if math.isnan(self.iron_loss_ohm):
            rule = IRON_LOSS * self.inductance_h ** (2.0 / 3.0) * self.resistance_ohm ** (1.0 / 3.0)
            object.__setattr__(self, "iron_loss_ohm", rule)
        if math.isnan(self.iron_knee_rad_s):
            object.__setattr__(self, "iron_knee_rad_s", IRON_KNEE_RAD_S / self.pole_pairs)

    def at_current(self, vector_a: float) -> Motor:
        """This motor as it is with a current vector of that length: its Km, without saturation. What the iron takes of
        a turning rotor without current stays."""
        if math.isinf(self.saturation_current_a):
            return self
        share = 1.0 / math.hypot(1.0, vector_a / self.saturation_current_a)
        return replace(
            self,
            torque_constant_nm_per_a=share * self.torque_constant_nm_per_a,
            iron_loss_ohm=share**2 * self.iron_loss_ohm,  # the drag is Km^2 / Rm
            saturation_current_a=math.inf,
        )

    @property
    def full_steps_per_rev(self) -> int:
        return 4 * self.pole_pairs

    @property
    def iron_drag_nm_s_per_rad(self) -> float:
        """Drag torque of the iron loss over speed, well below the knee: Km^2 / Rm."""
        return self.torque_constant_nm_per_a**2 / self.iron_loss_ohm

    def iron_torque_nm(self, omega_rad_s: float) -> float:
        """Drag torque of the iron loss at a speed, with and without current."""
        return self.iron_drag_nm_s_per_rad * omega_rad_s / (1.0 + (omega_rad_s / self.iron_knee_rad_s) ** 2)


@dataclass(frozen=True)
class Specimen:
    """How one motor on its stage differs from its sheet: factors of its numbers. Raises ValueError."""

    resistance: float = number("1", 0.5, 2.0, key="resistance", default=1.0)
    inductance: float = number("1", 0.2, 5.0, key="inductance", default=1.0)
    torque_constant: float = number("1", 0.5, 2.0, key="torque_constant", default=1.0)
    rotor_inertia: float = number("1", 0.5, 2.0, key="rotor_inertia", default=1.0)
    detent_torque: float = number("1", 0.0, 5.0, key="detent_torque", default=1.0)
    iron_loss: float = number("1", 0.0, 10.0, key="iron_loss", default=1.0)
    iron_knee: float = number("1", 0.1, 10.0, key="iron_knee", default=1.0)
    supply_factor: float = number("1", 0.5, 1.2, key="supply_factor", default=1.0)  # of the stage
    damping_gain: float = number("1", 0.1, 10.0, key="damping_gain", default=1.0)  # of the stage, where it damps

    def __post_init__(self) -> None:
        check(self)

    def of(self, motor: Motor) -> Motor:
        """This one of the motors of that type."""
        if self == Specimen():
            return motor
        return replace(
            motor,
            resistance_ohm=motor.resistance_ohm * self.resistance,
            inductance_h=motor.inductance_h * self.inductance,
            torque_constant_nm_per_a=motor.torque_constant_nm_per_a * self.torque_constant,
            rotor_inertia_kgm2=motor.rotor_inertia_kgm2 * self.rotor_inertia,
            detent_torque_nm=motor.detent_torque_nm * self.detent_torque,
            iron_loss_ohm=self._iron_loss_ohm(motor),
            iron_knee_rad_s=motor.iron_knee_rad_s * self.iron_knee,
        )

    def _iron_loss_ohm(self, motor: Motor) -> float:
        """The drag is Km^2 / Rm, and the factor is that of the drag."""
        return motor.iron_loss_ohm * self.torque_constant**2 / self.iron_loss if self.iron_loss else math.inf


def from_datasheet(
    holding_torque_nm: float,
    rated_current_a: float = math.nan,
    resistance_ohm: float = math.nan,
    inductance_h: float = math.nan,
    rotor_inertia_kgm2: float = math.nan,
    detent_torque_nm: float = math.nan,
    pole_pairs: int = 50,
    *,
    rated_current_rms_a: float = math.nan,
    running_torque_nm: float = math.nan,
    back_emf_v_s_per_rad: float = math.nan,
) -> Motor:
    """A motor from data-sheet figures; the holding torque is with both phases at the printed current.

    rated_current_a      the printed current, taken for the peak of the microstep wave, or else
    rated_current_rms_a  taken for its RMS value: the peak, `Motor.rated_current_a`, is 41 % more, and so is the torque
    running_torque_nm    where the sheet's torque curve in microstep begins, if it has one; about Km times the peak. The
    log warns if it does not fit, and tells whether it fits the other meaning of the current
    back_emf_v_s_per_rad the amplitude of a phase over the speed, if the sheet has it: Km, and saturation where the
    holding torque is less than that

    Raises ValueError for no current or for both, and for what `Motor` refuses.
    """
    given = [current for current in (rated_current_a, rated_current_rms_a) if not math.isnan(current)]
    if len(given) != 1:
        raise ValueError("motor: give either rated_current_a (peak) or rated_current_rms_a")
    rms = math.isnan(rated_current_a)
    vector_a = math.sqrt(2.0) * given[0]
    held = holding_torque_nm / vector_a
    if back_emf_v_s_per_rad * READING < held:
        raise ValueError(
            f"motor: a holding torque of {holding_torque_nm:g} Nm at {given[0]:g} A needs a back-EMF of {held:.3g} "
            f"V s/rad, not {back_emf_v_s_per_rad:g}: is that the amplitude of one phase, with the same windings?"
        )
    saturates = back_emf_v_s_per_rad > held * READING
    motor = Motor(
        resistance_ohm=resistance_ohm,
        inductance_h=inductance_h,
        torque_constant_nm_per_a=held if math.isnan(back_emf_v_s_per_rad) else back_emf_v_s_per_rad,
        saturation_current_a=(
            vector_a / math.sqrt((back_emf_v_s_per_rad / held) ** 2 - 1.0) if saturates else math.inf
        ),
        rotor_inertia_kgm2=rotor_inertia_kgm2,
        detent_torque_nm=detent_torque_nm,
        pole_pairs=pole_pairs,
        rated_current_a=math.sqrt(2.0) * given[0] if rms else given[0],
    )
    km = motor.at_current(motor.rated_current_a).torque_constant_nm_per_a
    share = running_torque_nm / (km * motor.rated_current_a)
    if share > RUNNING_SHARE[1] or share < RUNNING_SHARE[0]:
        reading, other = ("RMS", "peak") if rms else ("peak", "RMS")
        fits = RUNNING_SHARE[0] <= share * (math.sqrt(2.0) if rms else math.sqrt(0.5)) <= RUNNING_SHARE[1]
        remedy = f"it fits {other}: give rated_current{'' if rms else '_rms'}_a" if fits else f"nor does it fit {other}"
        log.warning(
            "motor: a running torque of %.3g Nm with a holding torque of %.3g Nm does not fit %.3g A as %s "
            "(%.3g Nm at most); %s (41 %% between them)",
            running_torque_nm, holding_torque_nm, given[0], reading,
            km * motor.rated_current_a, remedy,
        )  # fmt: skip
    return motor
