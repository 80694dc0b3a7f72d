"""The numbers of a machine, their units and limits.

The fields of these dataclasses, and of motor, stage and screw in isel_twin.drives, are the whole format of a
machine.toml (isel_twin.base.parameters: a number is a table with value, unit, grade and source). In a `Machine` the
motors have been looked up, and imperfections that are off are zero (plant/10).

Machine coordinates of an axis run from 0, the nominal trip point of the motor-end switch, away from the motor to
`travel_mm`, that of the far-end switch (decision plant/1).
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import FileError, check, flag, number, word
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.spindle import Spindle
from isel_twin.drives.stage import AnyStage, Stage
from isel_twin.drives.supply import Supply
from isel_twin.machine.fixture import Fixture

# imperfection levels and the sources of imperfection that each switches on
LEVELS: Mapping[str, frozenset[str]] = {
    "ideal": frozenset(),
    "static": frozenset({"lead_error", "squareness", "backlash"}),
    "dynamic": frozenset({"lead_error", "squareness", "backlash", "structure", "repeatability", "bounce"}),
    "real": frozenset(
        {"lead_error", "squareness", "backlash", "structure", "repeatability", "bounce"}
        | {"step_accuracy", "current_offset", "cyclic_error", "free_length", "growth", "straightness", "abbe"}
    ),
}

# kinds of control cabinet, and the contacts that each sets (isel_twin.wiring.cabinet)
#
# safety-relay: E-stop circuits, hood and supply hold a relay that gives the power stages and the spindle their power.
CABINETS: Final[Mapping[str, tuple[str, ...]]] = {
    "safety-relay": (
        *("estop_1", "estop_2", "overtemperature", "start", "stop", "probe", "spindle", "power_ok"),
        *("hood_automatic", "hood_setup", "key"),
        *(f"user_{bit}" for bit in range(8)),
    )
}
DEFAULT_CABINET: Final = "safety-relay"  # for a file without the key


class MachineError(FileError):
    """A machine folder is missing or wrong; one line that names the file, the key and what is allowed."""


@dataclass(frozen=True)
class Timing:
    """The fixed grid of the plant."""

    substep_ns: int = number("us", 1.0, 100.0, key="motor_substep", scale=1e3, whole=True)
    mujoco_step_ns: int = number("ms", 0.01, 1.0, key="mujoco_step", scale=1e6, whole=True)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Axis:
    """One linear axis: motor, stage, screw and nut. The carriage is in the MuJoCo model."""

    name: str
    motor: Motor | ServoMotor
    stage: AnyStage  # what drives the motor: a stage of a stepper motor, the drive of a servo motor
    screw: Screw  # its imperfections that are off are zero
    travel_mm: float = number("mm", 1.0, 10_000.0, key="travel")
    # from the trip point of each end switch on to the hard stop
    stop_margin_mm: float = number("mm", 0.1, 100.0, key="stop_margin")
    power_on_low_mm: float = number("mm", -100.0, 10_000.0, key="power_on_low")
    # where the carriage may stand when the mains is switched on: uniform between the two
    power_on_high_mm: float = number("mm", -100.0, 10_000.0, key="power_on_high")
    # without the drag at the shaft, which the screw has
    guide_friction_n: float = number("N", 0.0, 2000.0, key="guide_friction")
    # holding force of the brake at the carriage; 0: the axis has none
    brake_n: float = number("N", 0.0, 50_000.0, key="brake")

    def __post_init__(self) -> None:
        check(self)

    @property
    def closed_loop(self) -> bool:
        """True for a servo drive: it loses no steps, but lags, and switches itself off if it lags too far."""
        return isinstance(self.stage, ServoDrive)

    @property
    def swing_limit_rad_s(self) -> float:
        """Speed of the motor above which a swing of its rotor grows; inf: none is told, or it is a servo drive."""
        if not isinstance(self.motor, Motor) or not isinstance(self.stage, Stage):
            return math.inf
        from isel_twin.drives.stability import limit_rad_s  # loaded where it is asked for

        return limit_rad_s(self.motor, self.stage, self.screw, self.guide_friction_n)

    @property
    def turning_nm(self) -> float:
        """Torque by which the shaft is driven less before it turns round than when it begins to turn the other way."""
        guide_nm = self.guide_friction_n * self.screw.travel_m_per_rad / self.screw.efficiency
        return self.screw.coulomb_nm * (1.0 + self.screw.breakaway_ratio) + guide_nm

    @property
    def held_mm(self) -> float:
        """Following error by which the speed loop of a servo drive, without its integral, turns it round against
        friction; 0 for a stepper motor, which has its torque from a lag of less than a step."""
        if not isinstance(self.stage, ServoDrive):
            return 0.0
        inertia_kgm2 = self.motor.rotor_inertia_kgm2 + self.screw.inertia_kgm2
        stiffness_nm = inertia_kgm2 * self.stage.speed_bandwidth_rad_s * self.stage.position_gain_per_s  # a radian
        return self.turning_nm / stiffness_nm * 1e3 * self.screw.travel_m_per_rad

    @property
    def lost_mm(self) -> float:
        """By which the carriage stays behind the shaft in either sense: half the play, and the give of the nut under
        the friction of the guide. Twice that is the reversal error at rest."""
        give_m = self.guide_friction_n / self.screw.stiffness_n_per_m if self.screw.stiffness_n_per_m else 0.0
        return 0.5 * self.screw.backlash_mm + 1e3 * give_m

    @property
    def steps_per_rev(self) -> int:
        """Full steps of the motor times microsteps, or encoder increments."""
        if isinstance(self.stage, ServoDrive):
            return self.stage.increments_per_rev
        assert isinstance(self.motor, Motor)
        return self.motor.full_steps_per_rev * self.stage.microsteps

    @property
    def slip_steps(self) -> float:
        """Steps in one slip of the motor, a period of its torque; one for a servo motor, which does not slip."""
        return self.steps_per_rev / self.motor.pole_pairs if isinstance(self.motor, Motor) else 1.0

    @property
    def step_mm(self) -> float:
        """Nominal, without the lead error."""
        return self.screw.lead_mm / self.steps_per_rev

    @property
    def steps_per_mm(self) -> float:
        """Nominal, without the lead error."""
        return self.steps_per_rev / self.screw.lead_mm


@dataclass(frozen=True)
class Mode:
    """A structural mode: a passive joint of the MuJoCo model that moves along one axis. Its frequency follows from what
    the joint carries: f = sqrt(k / m) / 2 pi (`isel_twin.plant.model.mode_hz`)."""

    joint: str
    axis: str = word(*CARRIAGES)
    stiffness_n_per_m: float = number("N/um", 0.05, 200.0, key="stiffness", scale=1e6)
    damping_ratio: float = number("1", 0.0, 0.5, key="damping_ratio")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Squareness:
    """Deviations from right angles; a positive one tilts the second axis towards plus of the first."""

    xy: float = number("mm/m", -10.0, 10.0, key="xy", scale=1e-3)
    xz: float = number("mm/m", -10.0, 10.0, key="xz", scale=1e-3)
    yz: float = number("mm/m", -10.0, 10.0, key="yz", scale=1e-3)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Guides:
    """Guides that are not straight (isel_twin.plant.guides has the law). A bow: how far the middle of the travel of the
    first axis lies off towards plus of the second. A turn: by so much the carriage has tilted at the end of its travel,
    positive if a longer arm then goes farther."""

    x_y: float = number("um", -2000.0, 2000.0, key="x_y", scale=1e-3, optional=True, default=0.0)
    x_z: float = number("um", -2000.0, 2000.0, key="x_z", scale=1e-3, optional=True, default=0.0)
    y_x: float = number("um", -2000.0, 2000.0, key="y_x", scale=1e-3, optional=True, default=0.0)
    y_z: float = number("um", -2000.0, 2000.0, key="y_z", scale=1e-3, optional=True, default=0.0)
    z_x: float = number("um", -2000.0, 2000.0, key="z_x", scale=1e-3, optional=True, default=0.0)
    z_y: float = number("um", -2000.0, 2000.0, key="z_y", scale=1e-3, optional=True, default=0.0)
    turn_x: float = number("mm/m", -10.0, 10.0, key="turn_x", scale=1e-3, optional=True, default=0.0)
    turn_y: float = number("mm/m", -10.0, 10.0, key="turn_y", scale=1e-3, optional=True, default=0.0)
    # Abbe offset: from the screw of X, and of Y, to the tool at Z = 0, along Z
    arm_x: float = number("mm", -2000.0, 2000.0, key="arm_x", optional=True, default=0.0)
    arm_y: float = number("mm", -2000.0, 2000.0, key="arm_y", optional=True, default=0.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Imperfections:
    """Which sources of imperfection are on; those that are off are zero (structure: rigid)."""

    lead_error: bool = flag()
    squareness: bool = flag()
    backlash: bool = flag()
    structure: bool = flag()
    repeatability: bool = flag()
    bounce: bool = flag()
    step_accuracy: bool = flag(default=False)
    current_offset: bool = flag(default=False)
    cyclic_error: bool = flag(default=False)
    # the screw is softer the farther the nut is from the fixed bearing; off: everywhere as in the middle
    free_length: bool = flag(default=False)
    growth: bool = flag(default=False)  # of the screw by its warming
    straightness: bool = flag(default=False)  # bows of the guides
    abbe: bool = flag(default=False)  # turns of the guides, by their arms


@dataclass(frozen=True)
class Contact:
    """One contact of the machine; `Controller.terminals` says to which terminal it leads. Level there: high when the
    contact is closed, the other way round if `inverted`."""

    name: str
    # switch: struck by a carriage; signal: set from outside; bridge: always closed
    kind: str = word("switch", "signal", "bridge")
    # opener: closed at rest, open when struck or actuated; closer: the other way round
    type: str = word("opener", "closer", default="opener")
    inverted: bool = flag(default=False)
    axis: str = word("", *CARRIAGES, default="")
    end: str = word("", "motor", "far", default="")
    # trip point in machine coordinates; from `axis` and `end` unless the file gives it
    position_mm: float = number("mm", -100.0, 10_000.0, key="position", optional=True, default=0.0)
    hysteresis_mm: float = number("mm", 0.0, 5.0, key="hysteresis", optional=True, default=0.0)
    # standard deviation of the trip point
    repeatability_mm: float = number("mm", 0.0, 1.0, key="repeatability", optional=True, default=0.0)
    bounce_ms: float = number("ms", 0.0, 50.0, key="bounce", optional=True, default=0.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Feeler:
    """What gives way where it is touched, and closes the contact `probe`: a plate for tool lengths on the table, or a
    touch probe (isel_twin.plant.touch has its law)."""

    # deflection at which the contact changes
    pretravel_mm: float = number("um", 0.0, 500.0, key="pretravel", scale=1e-3)
    # by which it has to be less for the contact to change back
    hysteresis_mm: float = number("um", 0.0, 500.0, key="hysteresis", scale=1e-3)
    # standard deviation of the deflection at which it changes, from touch to touch
    repeatability_mm: float = number("um", 0.0, 100.0, key="repeatability", scale=1e-3)
    force_n: float = number("N", 0.0, 100.0, key="force")  # at the pretravel, across the tool's axis
    force_z_n: float = number("N", 0.0, 100.0, key="force_z")  # and along it
    rate_n_per_m: float = number("N/mm", 0.0, 1000.0, key="rate", scale=1e3)  # by which it grows from there
    overtravel_mm: float = number("mm", 0.1, 50.0, key="overtravel")  # deflection at which it breaks

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Probe(Feeler):
    """A touch probe in the spindle, in place of the cutter of the model."""

    enabled: bool = flag()
    ball_mm: float = number("mm", 0.1, 50.0, key="ball")  # diameter
    reach_mm: float = number("mm", 0.0, 300.0, key="reach")  # of the ball's lowest point below the model's tool
    # the pretravel is that much more or less three times a turn, by the probe's three seats
    lobing_mm: float = number("um", 0.0, 100.0, key="lobing", scale=1e-3)

    def __post_init__(self) -> None:
        check(self)
        if self.lobing_mm > self.pretravel_mm:
            raise ValueError("probe: lobing must not be more than pretravel")


@dataclass(frozen=True)
class Holder:
    """What holds the tool: collet, spindle nose and bearings, across at the end of the collet."""

    stiffness_n_per_m: float = number("N/um", 0.1, 1000.0, key="stiffness", scale=1e6)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Machine:
    """A machine as its folder describes it. It is shared: do not change its tables."""

    name: str
    description: str
    # table: the portal stands and the table moves along Y; portal: the portal moves along Y; traverse: a column along
    # X, a slide on it along Z, an arm along Y. Only shown to people: the plant has it from the model.
    kinematics: str
    cabinet: str  # kind of its control cabinet, one of CABINETS
    folder: Path
    model_file: Path  # MuJoCo model (MJCF) that the plant loads
    # MuJoCo model (MJCF) of what is clamped on the table, its origin in the middle of the table's surface
    fixture_file: Path | None
    fixtures: tuple[Fixture, ...]  # shapes that are clamped on the table
    timing: Timing
    axes: tuple[Axis, Axis, Axis]
    supply: Supply | None  # common to all stages; None: the file has none
    spindle: Spindle | None  # None: the contactor switches a spindle of which no more is known
    holder: Holder | None  # None: the file has none, and tools bend alone
    probe: Probe | None  # None: the file has none
    plate: Feeler | None  # what fixtures that are plates are; None: the file has none
    masses_kg: Mapping[str, float]  # by name of the body in the MuJoCo model
    payload_kg: float  # dead weight on the table
    structure: tuple[Mode, ...]
    squareness: Squareness
    guides: Guides | None  # what is off is zero; None: straight
    imperfections: Imperfections
    contacts: tuple[Contact, ...]  # imperfections that are off are zero
    motors: Mapping[str, Motor]  # motors of its own, by name, before those of `isel_twin.drives.library`
    controller: Mapping[str, Any]  # settings handed to the controller, such as program_memory_bytes
    # the file as read, with `based_on` and `all` resolved: where `describe` and `with_overrides` look
    tree: Mapping[str, Any] = field(repr=False, compare=False)

    @property
    def file(self) -> Path:
        """Its machine.toml."""
        return self.folder / "machine.toml"

    @cached_property
    def digest(self) -> str:
        """Hash of its numbers and its model, independent of paths."""
        fixture = self.fixture_file.read_bytes().hex() if self.fixture_file is not None else ""
        tree = {**self.tree, "model": self.model_file.read_bytes().hex(), "fixture": fixture}
        if self.fixtures:
            meshes = [one.file.read_bytes().hex() for one in self.fixtures if one.file is not None]
            tree["fixture"] = [self.tree["fixture"], meshes]
        return hashlib.sha256(json.dumps(tree, sort_keys=True, default=str).encode()).hexdigest()[:16]

    @property
    def is_clamped(self) -> bool:
        """Something stands on the table."""
        return bool(self.fixtures) or self.fixture_file is not None

    @property
    def feeler(self) -> Feeler | None:
        """What closes the contact `probe` by being touched: the probe in the spindle, or else plates on the table."""
        if self.probe is not None and self.probe.enabled:
            return self.probe
        return self.plate if any(fixture.plate for fixture in self.fixtures) else None

    @property
    def switches(self) -> tuple[Contact, ...]:
        """The position switches among the contacts, in the order of the file."""
        return tuple(contact for contact in self.contacts if contact.kind == "switch")
