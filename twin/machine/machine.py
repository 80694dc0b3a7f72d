"""The numbers of a machine: what `models/<name>/machine.toml` says, read, checked and frozen.

Goal: every constant of the physics has a name, a unit, a source and a grade, and a wrong one is named before it does
harm. The fields of the dataclasses below, and those of motor, stage and screw in isel_twin.drives, are the whole format
(isel_twin.base.parameters: a number is a table with value, unit, grade and source). Three rules make files short:

    based_on = "4030"     start from another machine, by name or by path relative to this folder, and say what differs;
                          with a `model` of its own a machine also brings all of its own [masses] and [structure]
    [axes.all]            holds for X, Y and Z; [axes.x] and so on override it
    [switches]            holds for all position switches; an entry in [contacts] may override it

Settings under [controller] belong to the controllers, who tell which there are (`isel_twin.controller.takes`).
A machine is built whole: a motor has been found, the microsteps follow from it, imperfections that are off are zero.

Machine coordinates of an axis run from 0, the nominal trip point of the motor-end switch, away from the motor to
`travel_mm`, that of the far-end switch (decision P1).
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import (
    FileError,
    Limits,
    Place,
    Row,
    check,
    flag,
    free,
    gather,
    keys,
    known,
    merge,
    number,
    override,
    quantity,
    read,
    read_toml,
    rows,
    section,
    spread,
    table,
    text,
    word,
)
from isel_twin.drives.motor import MOTORS, Motor
from isel_twin.drives.screw import Rod, Screw
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.stage import AnyStage, Stage
from isel_twin.drives.supply import Supply, check_fit
from isel_twin.models import machine_names, models_folder

LEVELS: Mapping[str, frozenset[str]] = {
    "ideal": frozenset(),
    "static": frozenset({"lead_error", "squareness", "backlash"}),
    "dynamic": frozenset({"lead_error", "squareness", "backlash", "structure", "repeatability", "bounce"}),
    "real": frozenset(
        {"lead_error", "squareness", "backlash", "structure", "repeatability", "bounce"}
        | {"step_accuracy", "current_offset", "cyclic_error", "free_length", "growth"}
    ),
}
"""Imperfection levels: the sources of imperfection that are on."""

CABINETS: Final[Mapping[str, tuple[str, ...]]] = {
    "safety-relay": (
        "estop_1",
        "estop_2",
        "overtemperature",
        "start",
        "stop",
        "probe",
        "spindle",
        "power_ok",
        "hood_automatic",
        "hood_setup",
        "key",
        *(f"user_{bit}" for bit in range(8)),
    )
}
"""Kinds of control cabinet that a machine can have, and the contacts that each works (isel_twin.wiring.cabinet).

safety-relay: E-stop circuits, hood and supply hold a relay that gives the power stages and the spindle their power.
"""
DEFAULT_CABINET: Final = "safety-relay"
"""That of a file that names none."""

_STEPS_PER_REV = Limits("1", 200.0, 51_200.0, whole=True)
"""Full steps of the motor times the stage's microsteps."""
_STRIBECK_MM_S = Limits("mm/s", 0.01, 100.0)
"""Carriage speed at which half of the excess over Coulomb friction is gone."""
_MASS_KG = Limits("kg", 1e-3, 1e4)
_PAYLOAD_KG = Limits("kg", 0.0, 100.0)
"""What tables of this class carry; ten times as much would be another machine."""


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
    """One linear axis: motor, stage, screw and nut. What the nut pushes is in the MuJoCo model."""

    name: str
    motor: Motor | ServoMotor
    stage: AnyStage
    """What drives the motor: a stage of a stepper motor, the drive of a servo motor."""
    screw: Screw
    """With those of its imperfections that are on."""
    travel_mm: float = number("mm", 1.0, 10_000.0, key="travel")
    stop_margin_mm: float = number("mm", 0.1, 100.0, key="stop_margin")
    """From the trip point of each end switch on to the hard stop."""
    power_on_low_mm: float = number("mm", -100.0, 10_000.0, key="power_on_low")
    power_on_high_mm: float = number("mm", -100.0, 10_000.0, key="power_on_high")
    """Where the carriage may stand when the mains is switched on: uniform between the two."""
    guide_friction_n: float = number("N", 0.0, 2000.0, key="guide_friction")
    """Of the guides; drag at the shaft is the screw's."""
    brake_n: float = number("N", 0.0, 50_000.0, key="brake")
    """Holding force of the brake at the carriage; 0: the axis has none."""

    def __post_init__(self) -> None:
        check(self)

    @property
    def closed_loop(self) -> bool:
        """A servo drive: it loses nothing, but lags, and switches itself off if it lags too far."""
        return isinstance(self.stage, ServoDrive)

    @property
    def steps_per_rev(self) -> int:
        """Steps of the commands in a revolution: full steps of the motor times microsteps, or encoder increments."""
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
        """Nominal carriage travel a step (the lead error is not in it)."""
        return self.screw.lead_mm / self.steps_per_rev

    @property
    def steps_per_mm(self) -> float:
        """Nominal steps per mm of carriage travel (the lead error is not in it)."""
        return self.steps_per_rev / self.screw.lead_mm


@dataclass(frozen=True)
class Mode:
    """A structural mode: a passive joint of the MuJoCo model that moves along one axis.

    Its frequency follows from what the joint carries: f = sqrt(k / m) / 2 pi (`isel_twin.plant.model.mode_hz`).
    """

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
class Imperfections:
    """Which sources of imperfection are on; what is off counts as zero (structure: as rigid)."""

    lead_error: bool = flag()
    squareness: bool = flag()
    backlash: bool = flag()
    structure: bool = flag()
    repeatability: bool = flag()
    bounce: bool = flag()
    step_accuracy: bool = flag(default=False)
    current_offset: bool = flag(default=False)
    cyclic_error: bool = flag(default=False)
    free_length: bool = flag(default=False)
    """The screw is the softer the farther the nut is from the fixed bearing; off: everywhere as in the middle."""
    growth: bool = flag(default=False)
    """Of the screw by its warming."""


@dataclass(frozen=True)
class Contact:
    """One contact of the machine. The terminal it leads to is the controller's affair (`Controller.terminals`).

    Level at the terminal: high when the contact is closed, the other way round if `inverted`.
    """

    name: str
    kind: str = word("switch", "signal", "bridge")
    """switch: struck by a carriage; signal: set from outside; bridge: always closed."""
    type: str = word("opener", "closer", default="opener")
    """opener: closed at rest, open when struck or actuated; closer: the other way round."""
    inverted: bool = flag(default=False)
    axis: str = word("", *CARRIAGES, default="")
    end: str = word("", "motor", "far", default="")
    position_mm: float = number("mm", -100.0, 10_000.0, key="position", optional=True, default=0.0)
    """Trip point in machine coordinates; from `axis` and `end` unless the file gives it."""
    hysteresis_mm: float = number("mm", 0.0, 5.0, key="hysteresis", optional=True, default=0.0)
    repeatability_mm: float = number("mm", 0.0, 1.0, key="repeatability", optional=True, default=0.0)
    """Standard deviation of the trip point."""
    bounce_ms: float = number("ms", 0.0, 50.0, key="bounce", optional=True, default=0.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Machine:
    """A machine as its folder describes it."""

    name: str
    description: str
    kinematics: str
    """table: the portal stands and the table moves along Y; portal: the portal moves along Y;
    traverse: a column along X, a slide on it along Z, an arm along Y. For people: the model says it to the plant."""
    cabinet: str
    """Kind of its control cabinet, one of CABINETS."""
    folder: Path
    model_file: Path
    """MuJoCo model (MJCF) that the plant loads."""
    fixture_file: Path | None
    """MuJoCo model (MJCF) of what is clamped on the table, its origin in the middle of the table's surface."""
    timing: Timing
    axes: tuple[Axis, Axis, Axis]
    supply: Supply | None
    """Common to all stages; None: the file has none."""
    masses_kg: Mapping[str, float]
    """By name of the body in the MuJoCo model."""
    payload_kg: float
    """Dead weight on the table."""
    structure: tuple[Mode, ...]
    squareness: Squareness
    imperfections: Imperfections
    contacts: tuple[Contact, ...]
    """With those of their imperfections that are on."""
    motors: Mapping[str, Motor]
    """Motors of its own, by name; they go before those of `isel_twin.drives.MOTORS`."""
    controller: Mapping[str, Any]
    """Settings handed to the controller, such as program_memory_bytes."""
    tree: Mapping[str, Any] = field(repr=False, compare=False)
    """The file as read, with `based_on` and `all` resolved: where `describe` and `with_overrides` look."""

    @property
    def file(self) -> Path:
        """The machine.toml it was read from."""
        return self.folder / "machine.toml"

    @property
    def switches(self) -> tuple[Contact, ...]:
        """The position switches among the contacts, in the order of the file."""
        return tuple(contact for contact in self.contacts if contact.kind == "switch")


def load_machine(name_or_path: str | Path) -> Machine:
    """Read a machine by its name, or by the path of a folder with a machine.toml (or of that file).

    Raises MachineError with one line that names the file, the key and what is allowed.
    """
    file = _find(name_or_path)
    tree = _read_file(file)
    tree.setdefault("cabinet", DEFAULT_CABINET)
    return _build(tree, file)


def machine_from_tree(tree: Mapping[str, Any], file: Path) -> Machine:
    """The machine of a tree (`Machine.tree`) that was read some other time; file: where a machine.toml would be.

    Raises MachineError as `load_machine` does.
    """
    return _build(copy.deepcopy(dict(tree)), file)


def with_overrides(machine: Machine, overrides: Mapping[str, Any]) -> Machine:
    """The machine with some of its numbers changed, for experiments.

    Keys are those of `describe`, values are in the file's unit: {"axes.x.backlash": 0.0, "axes.all.lead": 4.0}.
    The key "imperfections" takes a level: "ideal", "static", "dynamic" or "real".
    Raises MachineError for an unknown key or a value out of range.
    """
    tree = copy.deepcopy(dict(machine.tree))
    place = Place(machine.file, MachineError)
    for key, value in overrides.items():
        _check_drive(tree, key, value, place)
        if key.startswith("axes.") and key.endswith(".drive"):
            continue  # it is so
        if key == "imperfections":
            if value not in LEVELS:
                raise MachineError(f"imperfections: unknown level {value!r}; allowed: {', '.join(LEVELS)}")
            tree["imperfections"] = {name: name in LEVELS[value] for name in keys(Imperfections)}
        elif key.startswith("axes.all."):
            for axis in CARRIAGES:
                override(tree, f"axes.{axis}.{key.removeprefix('axes.all.')}", value, place)
        else:
            override(tree, key, value, place)
    return _build(tree, machine.file)


def describe(machine: Machine) -> list[Row]:
    """All parameters of a machine; those that are equal on X, Y and Z in one row `axes.all...`."""
    return gather(rows(machine.tree), "axes", CARRIAGES)


# Reading -------------------------------------------------------------------------------------------------------------


def _find(name_or_path: str | Path, relative_to: Path | None = None) -> Path:
    """The machine.toml that a name or a path means."""
    candidates = [models_folder() / name_or_path] if str(name_or_path) in machine_names() else []
    path = Path(name_or_path).expanduser()
    candidates.append(relative_to / path if relative_to else path)
    for candidate in candidates:
        file = candidate if candidate.is_file() else candidate / "machine.toml"
        if file.is_file():
            return file.resolve()
    raise MachineError(
        f"unknown machine {str(name_or_path)!r}: not a folder with a machine.toml and not one of "
        f"{', '.join(machine_names())}"
    )


def _read_file(file: Path, seen: tuple[Path, ...] = ()) -> dict[str, Any]:
    """The file's tree with `based_on` and the tables that hold for all resolved."""
    place = Place(file, MachineError)
    if file in seen:
        raise place.at("based_on").wrong("goes round in a circle; allowed: a machine that does not need this one")
    try:
        tree = read_toml(place)
    except OSError as error:
        raise place.wrong(f"cannot be read: {error}") from None
    spread(tree, "axes", CARRIAGES, place)
    if "based_on" in tree:
        parent_file = _find(str(tree.pop("based_on")), file.parent)
        parent = _read_file(parent_file, (*seen, file))
        if "model" in tree:
            parent = {**parent, "masses": {}, "structure": {}}
        for key in ("model", "fixture"):
            if key not in tree and parent.get(key):
                tree[key] = str(parent_file.parent / str(parent[key]))
        tree = merge(_without_other_drives(parent, tree, place), tree)
    return tree


_DRIVES: Mapping[str, tuple[str, ...]] = {"stepper": ("motor", "stage", "steps_per_rev"), "servo": ("servo",)}
"""Kinds of drives, and the keys of an axis that are of that kind only."""
_DRIVE: Final = "stepper"
"""That of an axis that names none."""


def _without_other_drives(parent: Mapping[str, Any], tree: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The parent without the keys of its drives where the tree says another kind."""
    result = copy.deepcopy(dict(parent))
    for name, axis in table(tree.get("axes", {}), place.at("axes")).items():
        before = result["axes"][name]
        was = before.get("drive", _DRIVE)
        if axis.get("drive", was) != was:
            result["axes"][name] = {key: value for key, value in before.items() if key not in _DRIVES.get(was, ())}
    return result


def _check_drive(tree: Mapping[str, Any], key: str, value: Any, place: Place) -> None:
    """Refuse an override that is for the other kind of drive: whoever wants it needs another machine."""
    section_name, _, rest = key.partition(".")
    member, _, inside = rest.partition(".")
    own = inside.partition(".")[0]
    if section_name != "axes" or member not in ("all", *CARRIAGES):
        return
    for name in CARRIAGES if member == "all" else (member,):
        has = tree["axes"][name].get("drive", _DRIVE)
        for kind, kinds in _DRIVES.items():
            if kind != has and (own in kinds or (own == "drive" and value == kind)):
                needed = f"{kind} drives are asked for" if own == "drive" else f"this is of {kind} drives"
                models = {"stepper": "4030", "servo": "4030-servo"}
                raise place.at(f"axes.{name}.{inside}").wrong(
                    f"{needed}, and the machine has {has} drives; "
                    f"take a machine with {kind} drives, such as {models[kind]}"
                )
        if own == "drive" and value not in _DRIVES:
            raise place.at(f"axes.{name}.drive").wrong(f"{value!r}; allowed: {', '.join(_DRIVES)}")


_TEXTS: Mapping[str, tuple[str, ...]] = {
    "name": (),
    "description": (),
    "kinematics": ("table", "portal", "traverse"),
    "cabinet": tuple(CABINETS),
    "model": (),
    "fixture": (),
}
"""Words at the top of the file, and what each may be."""
_SECTIONS = ("axes", "masses", "payload", "structure", "switches", "contacts", "motors", "controller")
_FIXED_SECTIONS = ("timing", "squareness", "imperfections")


def _build(tree: dict[str, Any], file: Path) -> Machine:
    place = Place(file, MachineError)
    allowed = (*_TEXTS, *_SECTIONS, *_FIXED_SECTIONS, "supply")
    known(tree, allowed, place)
    for key in allowed:
        if key not in (*tree, "motors", "controller", "supply"):
            raise place.at(key).wrong("missing")
    texts = {key: text(tree[key], place.at(key), choices) for key, choices in _TEXTS.items()}
    sections = {key: table(tree.get(key, {}), place.at(key)) for key in _SECTIONS}
    imperfections = section(Imperfections, tree["imperfections"], place.at("imperfections"))
    motors = {key: section(Motor, value, place.at("motors").at(key)) for key, value in sections["motors"].items()}
    axes = tuple(
        _axis(name, sections["axes"][name], {**motors, **MOTORS, **motors}, imperfections, place.at("axes").at(name))
        for name in CARRIAGES
    )
    known(sections["payload"], ("mass",), place.at("payload"))
    machine = Machine(
        name=texts["name"],
        description=texts["description"],
        kinematics=texts["kinematics"],
        cabinet=texts["cabinet"],
        folder=file.parent,
        model_file=file.parent / texts["model"],
        fixture_file=file.parent / texts["fixture"] if texts["fixture"] else None,
        timing=section(Timing, tree["timing"], place.at("timing")),
        axes=(axes[0], axes[1], axes[2]),
        supply=section(Supply, tree["supply"], place.at("supply")) if "supply" in tree else None,
        masses_kg={
            key: quantity(value, _MASS_KG, place.at("masses").at(key)) for key, value in sections["masses"].items()
        },
        payload_kg=quantity(sections["payload"].get("mass"), _PAYLOAD_KG, place.at("payload").at("mass")),
        structure=tuple(
            section(Mode, value, place.at("structure").at(key), joint=key)
            for key, value in sections["structure"].items()
        ),
        squareness=section(Squareness, tree["squareness"], place.at("squareness")),
        imperfections=imperfections,
        contacts=tuple(
            _contact(key, value, sections["switches"], axes, imperfections, place.at("contacts").at(key))
            for key, value in sections["contacts"].items()
        ),
        motors=motors,
        controller=_settings(sections["controller"], place.at("controller")),
        tree=tree,
    )
    _check(machine, place)
    return machine


def _settings(content: dict[str, Any], place: Place) -> dict[str, Any]:
    """Settings for controllers, which may be of several: those that one of the installed ones takes."""
    from isel_twin.controller import controller_settings

    rules = controller_settings(content)
    known(content, rules, place)
    return {key: free(value, rules[key], place.at(key)) for key, value in content.items()}


def _axis(name: str, value: Any, motors: Mapping[str, Motor], on: Imperfections, place: Place) -> Axis:
    """An axis from its table, in which the keys of its screw stand beside its own."""
    content = table(value, place)
    kind = text(content.get("drive", _DRIVE), place.at("drive"), tuple(_DRIVES))
    beside = (*_DRIVES[kind], "stribeck_speed")
    for other, foreign in _DRIVES.items():
        if other != kind and any(key in content for key in foreign):
            key = next(key for key in foreign if key in content)
            raise place.at(key).wrong(f'of {other} drives, but drive = "{kind}"; allowed: {", ".join(_DRIVES[kind])}')
    known(content, ("drive", *beside, *keys(Axis), *keys(Screw), *keys(Rod)), place)
    for key in beside:
        if key not in content:
            raise place.at(key).wrong("missing")
    motor, stage = (_servo if kind == "servo" else _stepper)(content, motors, on, place)
    screw = read(Screw, content, place)
    if not on.lead_error:
        screw["lead_error"] = 0.0
    if not on.backlash:
        screw["backlash_mm"] = 0.0
    if not on.cyclic_error:
        screw["cyclic_error_m"] = 0.0
    if not on.growth:
        screw["warming_k"] = 0.0
    rod = Rod(**read(Rod, content, place))
    own = read(Axis, content, place)
    if own["travel_mm"] > rod.length_mm:
        raise place.at("travel").wrong(
            f"{own['travel_mm']:g} mm; allowed: up to the length of the screw, screw_length = {rod.length_mm:g} mm"
        )
    if rod.free_length_mm + own["travel_mm"] > rod.length_mm:
        raise place.at("free_length").wrong(
            f"{rod.free_length_mm:g} mm; allowed: up to what the screw is longer than the travel, "
            f"{rod.length_mm - own['travel_mm']:g} mm"
        )
    if on.free_length:
        free_mm = 0.5 * (rod.length_mm - own["travel_mm"]) if math.isnan(rod.free_length_mm) else rod.free_length_mm
        screw |= {"rod_n": rod.rod_n, "free_length_m": 1e-3 * free_mm, "middle_m": 0.5e-3 * own["travel_mm"]}
    stribeck_mm_s = quantity(content["stribeck_speed"], _STRIBECK_MM_S, place.at("stribeck_speed"))
    try:
        return Axis(
            name=name,
            motor=motor,
            stage=stage,
            screw=Screw(
                inertia_kgm2=rod.inertia_kgm2,
                stribeck_rad_s=stribeck_mm_s / screw["lead_mm"] * 2.0 * math.pi,
                **screw,
            ),
            **own,
        )
    except ValueError as error:
        raise place.wrong(str(error)) from None


def _stepper(
    content: Mapping[str, Any], motors: Mapping[str, Motor], on: Imperfections, place: Place
) -> tuple[Motor, Stage]:
    """A stepper motor by its name, and its stage."""
    motor = motors[text(content["motor"], place.at("motor"), tuple(motors))]
    steps_per_rev = quantity(content["steps_per_rev"], _STEPS_PER_REV, place.at("steps_per_rev"))
    microsteps, rest = divmod(int(steps_per_rev), motor.full_steps_per_rev)
    if rest or not microsteps:
        raise place.at("steps_per_rev").wrong(
            f"{steps_per_rev}; allowed with the motor {content['motor']}: whole multiples of {motor.full_steps_per_rev}"
        )
    stage = section(Stage, content["stage"], place.at("stage"), microsteps=microsteps)
    return motor, dataclasses.replace(
        stage,
        step_error=stage.step_error if on.step_accuracy else 0.0,
        current_offset=stage.current_offset if on.current_offset else 0.0,
    )


def _servo(
    content: Mapping[str, Any], motors: Mapping[str, Motor], on: Imperfections, place: Place
) -> tuple[ServoMotor, ServoDrive]:
    """A servo motor and its drive, whose keys stand in one table."""
    where = place.at("servo")
    both = table(content["servo"], where)
    known(both, (*keys(ServoMotor), *keys(ServoDrive)), where)
    motor = ServoMotor(**read(ServoMotor, both, where))
    drive = ServoDrive(**read(ServoDrive, both, where), rated_current_a=motor.rated_current_a)
    if drive.peak_current_a < motor.rated_current_a:
        raise where.at("peak_current").wrong(
            f"{drive.peak_current_a:g} A; allowed: from rated_current on, {motor.rated_current_a:g} A"
        )
    return motor, drive


def _check(machine: Machine, place: Place) -> None:
    """What no single value can say."""
    timing = machine.timing
    if timing.mujoco_step_ns % timing.substep_ns:
        raise place.at("timing.mujoco_step").wrong(
            f"{timing.mujoco_step_ns / 1e6} ms; "
            f"allowed: whole multiples of motor_substep ({timing.substep_ns / 1e3} us)"
        )
    for axis in machine.axes:
        low, high = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        if not low <= axis.power_on_low_mm <= axis.power_on_high_mm <= high:
            raise place.at(f"axes.{axis.name}.power_on_low").wrong(
                f"{axis.power_on_low_mm} .. {axis.power_on_high_mm} mm; "
                f"allowed: a range within the hard stops, {low} .. {high} mm"
            )
    if machine.supply is not None and machine.supply.enabled:
        try:
            check_fit(machine.supply, [axis.stage for axis in machine.axes], timing.mujoco_step_ns * 1e-9)
        except ValueError as error:
            raise place.at("supply").wrong(str(error)) from None
    for key, path in (("model", machine.model_file), ("fixture", machine.fixture_file)):
        if path is not None and not path.is_file():
            raise place.at(key).wrong(f"{path} does not exist; allowed: an MJCF file")
    longest_mm = _model_travels_mm(machine.model_file)
    for axis in machine.axes:
        if axis.travel_mm > longest_mm.get(axis.name, math.inf):
            raise place.at(f"axes.{axis.name}.travel").wrong(
                f"{axis.travel_mm:g} mm; allowed: up to {longest_mm[axis.name]:g} mm, "
                f"where joint {axis.name} ends in {machine.model_file}"
            )
    _check_signals(machine, place.at("contacts"))


def _check_signals(machine: Machine, place: Place) -> None:
    """A signal is worked by the cabinet; one that it does not know would never change."""
    known([c.name for c in machine.contacts if c.kind == "signal"], CABINETS[machine.cabinet], place)


def _model_travels_mm(file: Path) -> dict[str, float]:
    """Where the joints of a MuJoCo model end, by name, as far as its files say so; without MuJoCo, which takes longer.

    A file that cannot be read says nothing here: whoever loads the model says what is wrong with it.
    """
    ends: dict[str, float] = {}
    try:
        root = ElementTree.parse(file).getroot()
    except (OSError, ElementTree.ParseError):
        return ends
    for element in root.iter():
        name, limits = element.get("name"), (element.get("range") or "").split()
        if element.tag == "include" and element.get("file"):
            ends |= _model_travels_mm(file.parent / str(element.get("file")))
        elif element.tag == "joint" and name and len(limits) == 2:
            with contextlib.suppress(ValueError):
                ends[name] = 1e3 * float(limits[1])
    return ends


def _contact(
    name: str, value: Any, shared: dict[str, Any], axes: tuple[Axis, ...], on: Imperfections, place: Place
) -> Contact:
    content = table(value, place)
    if "terminal" in content:
        raise place.at("terminal").wrong("terminals belong to the controller; remove the key")
    if content.get("kind") != "switch":
        contact = section(Contact, content, place, name=name)
    else:
        contact = section(Contact, {**shared, **content}, place, name=name)
        if not (contact.axis and contact.end):
            raise place.wrong(f"a switch needs axis ({', '.join(CARRIAGES)}) and end (motor, far)")
        if "position" not in content and contact.end == "far":
            travel_mm = axes[CARRIAGES.index(contact.axis)].travel_mm
            contact = dataclasses.replace(contact, position_mm=travel_mm)
    return dataclasses.replace(
        contact,
        repeatability_mm=contact.repeatability_mm if on.repeatability else 0.0,
        bounce_ms=contact.bounce_ms if on.bounce else 0.0,
    )
