"""The power stage as data: a chopper that drives two phase currents from a limited supply.

The current it wants is I (cos phi, sin phi), phi being the electrical angle of the microstep counter. In half and full
step the two waves are switched instead:

    half step, A:  1  1  0 -1 -1 -1  0  1        full step, A:  1 -1 -1  1       (B: a quarter period later)

so the torque at standstill is Km I in microstep, alternately Km I and sqrt(2) Km I in half step, and sqrt(2) Km I in
full step. The supply limits it: supply_factor * supply_v drives a rising current, and a falling one flows back against
supply_v.

How a current falls that is too large for the wanted one decides at which speed a motor swings itself out of step
(`kind`, drives/14). As soon as the wanted current has the other sign, the whole supply drives the current there.

    kind       voltage against a falling current
    slow       none: the winding is short-circuited
    mixed      the supply for `mixed_decay` of the time, then short-circuited
    fast       the supply
    digital    the supply; and electronic damping, as digital microstep drives have against mid-band instability

Two errors that repeat every electrical period, four full steps, and do not add up (drives/11; a full step is pi/2):

    step accuracy e     the vector is turned by  e pi/2 sin(phi - phi_0)        phi_0: phi at counter 0
    offset o            I o more in phase B: the vector is turned by  o cos(phi)  to first order
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from isel_twin.base.parameters import check, number, word
from isel_twin.drives.servo_drive import ServoDrive

KINDS = ("slow", "mixed", "fast", "digital")
DIGITAL_GAIN = 2.0  # electronic damping of a digital drive (drives/9)
MOST_DAMPING = 5.0


@dataclass(frozen=True)
class Stage:
    """A two-phase power stage. Raises ValueError for an impossible setting."""

    supply_v: float = number("V", 5.0, 200.0, key="supply")
    current_a: float = number("A", 0.1, 20.0, key="current")  # peak phase current in motion
    # microsteps a full step: 1 full step (both phases on), 2 half step, 8 for 1600 a revolution at 1.8 degrees
    microsteps: int = number("1", 1, 256, whole=True, default=8)
    # current at rest over current in motion, while the controller asks for current lowering
    idle_current_fraction: float = number("1", 0.0, 1.0, key="idle_current", default=0.5)
    # rest after the last pulse of the axis before the current is lowered
    idle_delay_s: float = number("ms", 0.0, 10_000.0, key="idle_delay", scale=1e-3, default=0.2)
    # part of the supply that can drive a current: drops, dead time, sag (fitted, decision drives/1); 1: all of it
    supply_factor: float = number("1", 0.1, 1.0, default=0.82)
    # switches, sense resistor and cable in each phase (estimate); 0: none
    extra_resistance_ohm: float = number("ohm", 0.0, 100.0, default=0.2)
    # losses while switched on, beside those of the current (estimate)
    quiescent_w: float = number("W", 0.0, 1000.0, default=2.0)
    # from the switches through the heat sink to the air (estimate)
    thermal_resistance_k_per_w: float = number("K/W", 0.0, 1000.0, key="thermal_resistance", optional=True, default=8.0)
    # of stage and heat sink (estimate)
    thermal_time_constant_s: float = number("s", 1.0, 1e6, key="thermal_time_constant", optional=True, default=300.0)
    # temperature of the air in the cabinet
    ambient_c: float = number("C", -50.0, 150.0, key="ambient", optional=True, default=25.0)
    # where the over-temperature contact opens (estimate)
    thermal_limit_c: float = number("C", -50.0, 300.0, key="thermal_limit", optional=True, default=85.0)
    # how a current falls
    kind: str = word(*KINDS, default="fast")
    # of kind mixed: part of the time in which a falling current flows against the supply; amid what is drawn (jobs/19)
    mixed_decay: float = number("1", 0.0, 1.0, key="mixed_decay", optional=True, default=0.6)
    # electronic damping: advance of the current vector over the swing of the load angle; 0: none; nan: by kind.
    # Microstep only.
    damping_gain: float = number("1", 0.0, MOST_DAMPING, key="damping_gain", optional=True, default=math.nan)
    # corner of the low pass that separates the mean load angle from its swing
    damping_corner_hz: float = number("Hz", 10.0, 2000.0, key="damping_corner", optional=True, default=300.0)
    # largest error of the angle at which motor and stage hold, over a full step
    step_error: float = number("%", 0.0, 50.0, key="step_accuracy", scale=1e-2, optional=True, default=0.0)
    # offset of the current of phase B, over the peak current that is set at that time
    current_offset: float = number("%", -50.0, 50.0, key="current_offset", scale=1e-2, optional=True, default=0.0)

    def __post_init__(self) -> None:
        check(self)
        if math.isnan(self.damping_gain):
            object.__setattr__(self, "damping_gain", DIGITAL_GAIN if self.kind == "digital" else 0.0)

    @property
    def fast_share(self) -> float:
        """Part of the supply against which a current falls that is too large."""
        return {"slow": 0.0, "mixed": self.mixed_decay}.get(self.kind, 1.0)

    @property
    def drive_v(self) -> float:
        """Largest voltage that drives a phase current (it flows back against supply_v)."""
        return self.supply_factor * self.supply_v

    def loss_w(self, current_fraction: float) -> float:
        """Heat it makes while switched on, at a fraction of its current; both phases together."""
        return self.quiescent_w + self.extra_resistance_ohm * (self.current_a * current_fraction) ** 2

    @property
    def vector(self) -> float:
        """Mean length of the current vector over the peak current: more than 1 in half and full step."""
        return {1: math.sqrt(2.0), 2: 0.5 + math.sqrt(0.5)}.get(self.microsteps, 1.0)

    @property
    def vector_a(self) -> float:
        return self.vector * self.current_a

    @property
    def current_rms_a(self) -> float:
        """RMS value of the phase current of a sine."""
        return self.current_a / math.sqrt(2.0)

    @property
    def stepped(self) -> bool:
        """True in full and half step, where the phases are switched instead of following a sine."""
        return self.microsteps <= 2


AnyStage: TypeAlias = Stage | ServoDrive  # both have supply, losses and heat under the same names
