"""Builds a `Machine` from the tree of its file, and checks it.

After a change only the parts that depend on it are built again.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Limits, Place, free, keys, known, quantity, read, section, table, text
from isel_twin.base.toml_lines import LinePlace
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor, Specimen
from isel_twin.drives.screw import Rod, Screw
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.spindle import Spindle
from isel_twin.drives.stage import MOST_DAMPING, Stage
from isel_twin.drives.supply import Supply, check_fit
from isel_twin.machine.fixture import read_fixtures
from isel_twin.machine.mjcf import file_content, model_files, model_travels_mm
from isel_twin.machine.schema import (
    CABINETS,
    Axis,
    Contact,
    Feeler,
    Guides,
    Holder,
    Imperfections,
    Machine,
    MachineError,
    Mode,
    Probe,
    Squareness,
    Timing,
)

T = TypeVar("T")
F = TypeVar("F", bound=Feeler)

STEPS_PER_REV = Limits("1", 200.0, 51_200.0, whole=True)  # full steps of the motor times the stage's microsteps
_DECAY: Final[Mapping[str, Any]] = {  # of a stage that does not say it (drives/14)
    "kind": {"value": "fast", "grade": "estimate", "source": "not stated; analogue choppers decay fast or mixed"},
    "mixed_decay": {"value": 0.6, "unit": "1", "grade": "estimate", "source": "of kind mixed: amid what is drawn"},
}
STRIBECK_MM_S = Limits("mm/s", 0.01, 100.0)  # carriage speed at which half of the excess over Coulomb friction is gone
MASS_KG = Limits("kg", 1e-3, 1e4)
PAYLOAD_KG = Limits("kg", 0.0, 100.0)  # what tables of this class can carry


# kinds of drives, and the keys of an axis that are of that kind only
DRIVES: Mapping[str, tuple[str, ...]] = {"stepper": ("motor", "stage", "steps_per_rev"), "servo": ("servo",)}
DEFAULT_DRIVE: Final = "stepper"  # for an axis without the key


_BESIDES: Mapping[str, tuple[str, ...]] = {"stepper": ("specimen",), "servo": ()}  # keys that a drive may have

# words at the top of the file, and the choices of each
_TEXTS: Mapping[str, tuple[str, ...]] = {
    "name": (),
    "description": (),
    "kinematics": ("table", "portal", "traverse"),
    "cabinet": tuple(CABINETS),
    "model": (),
}
_FIXTURE: Final = "fixture"  # text: the MJCF file of what is clamped on the table; tables: its shapes
_SECTIONS = ("axes", "masses", "payload", "structure", "switches", "contacts", "motors", "controller")
_FIXED_SECTIONS = ("timing", "squareness", "imperfections")
_OPTIONAL = ("supply", "spindle", "holder", "probe", "plate", "cam", "guides")


def build(tree: dict[str, Any], file: Path, like: Machine | None = None) -> Machine:
    """The machine of a tree, which it keeps. like: a machine whose parts are reused where the tables are the same
    objects. Raises MachineError."""
    place = Place(file, MachineError)
    _complete(tree)
    allowed = (*_TEXTS, _FIXTURE, *_SECTIONS, *_FIXED_SECTIONS, *_OPTIONAL)
    known(tree, allowed, place)
    for key in allowed:
        if key not in (*tree, "motors", "controller", *_OPTIONAL):
            raise place.at(key).wrong("missing")
    texts = {key: text(tree[key], place.at(key), choices) for key, choices in _TEXTS.items()}
    sections = {key: table(tree.get(key, {}), place.at(key)) for key in _SECTIONS}
    clamped = tree[_FIXTURE]
    shaped = isinstance(clamped, list)
    clamped_file = "" if shaped else text(clamped, place.at(_FIXTURE))

    def part(old: Callable[[Machine], T], new: Callable[[], T], *names: str) -> T:
        """The old part if the tables of these names are the same, else a new one."""
        if like is not None and all(tree.get(name) is like.tree.get(name) for name in names):
            return old(like)
        return new()

    def fixed(name: str, cls: type[T]) -> T:
        return part(lambda m: getattr(m, name), lambda: section(cls, tree[name], place.at(name)), name)

    imperfections = fixed("imperfections", Imperfections)

    def _feeler(name: str, cls: type[F]) -> F | None:
        def read_it() -> F | None:
            if name not in tree:
                return None
            found = section(cls, tree[name], place.at(name))
            return found if imperfections.repeatability else dataclasses.replace(found, repeatability_mm=0.0)

        return part(lambda m: getattr(m, name), read_it, name, "imperfections")

    motors = part(
        lambda m: m.motors,
        lambda: {key: section(Motor, value, place.at("motors").at(key)) for key, value in sections["motors"].items()},
        "motors",
    )
    axes = part(
        lambda m: m.axes,
        lambda: _axes(sections["axes"], {**motors, **MOTORS, **motors}, imperfections, place.at("axes")),
        *("axes", "motors", "imperfections"),
    )
    same_travel = like is not None and all(a.travel_mm == b.travel_mm for a, b in zip(like.axes, axes, strict=True))
    known(sections["payload"], ("mass",), place.at("payload"))
    machine = Machine(
        name=texts["name"],
        description=texts["description"],
        kinematics=texts["kinematics"],
        cabinet=texts["cabinet"],
        folder=file.parent,
        model_file=file.parent / texts["model"],
        fixture_file=file.parent / clamped_file if clamped_file else None,
        fixtures=part(
            lambda m: m.fixtures,
            lambda: read_fixtures(clamped, _lines(file, _FIXTURE), file.parent) if shaped else (),
            _FIXTURE,
        ),
        timing=fixed("timing", Timing),
        axes=axes,
        supply=fixed("supply", Supply) if "supply" in tree else None,
        spindle=fixed("spindle", Spindle) if "spindle" in tree else None,
        holder=fixed("holder", Holder) if "holder" in tree else None,
        probe=_feeler("probe", Probe),
        plate=_feeler("plate", Feeler),
        masses_kg={
            key: quantity(value, MASS_KG, place.at("masses").at(key)) for key, value in sections["masses"].items()
        },
        payload_kg=quantity(sections["payload"].get("mass"), PAYLOAD_KG, place.at("payload").at("mass")),
        structure=part(
            lambda m: m.structure,
            lambda: tuple(
                section(Mode, value, place.at("structure").at(key), joint=key)
                for key, value in sections["structure"].items()
            ),
            "structure",
        ),
        squareness=fixed("squareness", Squareness),
        guides=part(lambda m: m.guides, lambda: _guides(tree, imperfections, place), "guides", "imperfections"),
        imperfections=imperfections,
        contacts=part(
            lambda m: m.contacts,
            lambda: tuple(
                _contact(key, value, sections["switches"], axes, imperfections, place.at("contacts").at(key))
                for key, value in sections["contacts"].items()
            ),
            *("contacts", "switches", "imperfections", *(() if same_travel else ("axes",))),
        ),
        motors=motors,
        controller=part(
            lambda m: m.controller, lambda: _settings(sections["controller"], place.at("controller")), "controller"
        ),
        tree=tree,
    )
    _check(machine, place)
    return machine


def _guides(tree: Mapping[str, Any], on: Imperfections, place: Place) -> Guides | None:
    """None if nothing of them is on."""
    if "guides" not in tree:
        return None
    found = section(Guides, tree["guides"], place.at("guides"))
    bows = [item.name for item in dataclasses.fields(Guides) if "_" in item.name and item.name[0] in CARRIAGES]
    off = {name: 0.0 for name in bows if not on.straightness}
    off |= {} if on.abbe else {"turn_x": 0.0, "turn_y": 0.0}
    return dataclasses.replace(found, **off) if on.straightness or on.abbe else None


_SPREAD = {"resistance": "sheets: +-10 %", "inductance": "sheets: +-20 %", "torque_constant": "typical values: +-8 %"}
_AS_ITS_SHEET = {
    key: {"value": 1.0, "unit": "1", "grade": "estimate", "source": f"as its sheet; {_SPREAD.get(key, 'not stated')}"}
    for key in keys(Specimen)
}


def _complete(tree: dict[str, Any]) -> None:
    """Add to the axes of stepper motors what they need not say, so that it can be overridden: a specimen that is as its
    sheet, and the kind of the stage."""
    axes = tree.get("axes")
    if not isinstance(axes, dict):
        return
    for name, axis in axes.items():
        if isinstance(axis, dict) and axis.get("drive", DEFAULT_DRIVE) == "stepper":
            whole = {"specimen": _AS_ITS_SHEET, **axis}
            if isinstance(own := axis.get("specimen"), dict):
                whole["specimen"] = {**_AS_ITS_SHEET, **own}
            if isinstance(stage := axis.get("stage"), dict):
                whole["stage"] = {**_DECAY, **stage}
            if whole != axis:
                tree["axes"] = axes = {**axes, name: whole}


def _axes(
    content: Mapping[str, Any], motors: Mapping[str, Motor], on: Imperfections, place: Place
) -> tuple[Axis, Axis, Axis]:
    x, y, z = (_axis(name, content[name], motors, on, place.at(name)) for name in CARRIAGES)
    return x, y, z


def _settings(content: dict[str, Any], place: Place) -> dict[str, Any]:
    """Settings for controllers: any that an installed one takes."""
    from isel_twin.controller import controller_settings

    rules = controller_settings(content)
    known(content, rules, place)
    return {key: free(value, rules[key], place.at(key)) for key, value in content.items()}


def _axis(name: str, value: Any, motors: Mapping[str, Motor], on: Imperfections, place: Place) -> Axis:
    """An axis; the keys of its screw are in the same table."""
    content = table(value, place)
    kind = text(content.get("drive", DEFAULT_DRIVE), place.at("drive"), tuple(DRIVES))
    beside = (*DRIVES[kind], "stribeck_speed")
    for other, foreign in DRIVES.items():
        if other != kind and any(key in content for key in foreign):
            key = next(key for key in foreign if key in content)
            raise place.at(key).wrong(f'of {other} drives, but drive = "{kind}"; allowed: {", ".join(DRIVES[kind])}')
    known(
        content,
        ("drive", *beside, *_BESIDES[kind], *keys(Axis), *keys(Screw), *keys(Rod)),
        place,
    )
    for key in beside:
        if key not in content:
            raise place.at(key).wrong("missing")
    motor, stage = (_servo if kind == "servo" else _stepper)(content, motors, on, place)
    screw = read(Screw, content, place)
    sources = {"lead_error": on.lead_error, "backlash_mm": on.backlash, "cyclic_error_m": on.cyclic_error}
    screw |= {key: 0.0 for key, is_on in {**sources, "warming_k": on.growth}.items() if not is_on}
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
    stribeck_mm_s = quantity(content["stribeck_speed"], STRIBECK_MM_S, place.at("stribeck_speed"))
    try:
        return Axis(
            name=name,
            motor=motor,
            stage=stage,
            screw=Screw(
                inertia_kgm2=rod.inertia_kgm2, stribeck_rad_s=stribeck_mm_s / screw["lead_mm"] * 2.0 * math.pi, **screw
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
    steps_per_rev = quantity(content["steps_per_rev"], STEPS_PER_REV, place.at("steps_per_rev"))
    microsteps, rest = divmod(int(steps_per_rev), motor.full_steps_per_rev)
    if rest or not microsteps:
        raise place.at("steps_per_rev").wrong(
            f"{steps_per_rev}; allowed with the motor {content['motor']}: whole multiples of {motor.full_steps_per_rev}"
        )
    stage = section(Stage, content["stage"], place.at("stage"), microsteps=microsteps)
    specimen = section(Specimen, content["specimen"], place.at("specimen"))
    return specimen.of(motor), dataclasses.replace(
        stage,
        supply_factor=min(1.0, stage.supply_factor * specimen.supply_factor),
        damping_gain=min(MOST_DAMPING, stage.damping_gain * specimen.damping_gain),
        step_error=stage.step_error if on.step_accuracy else 0.0,
        current_offset=stage.current_offset if on.current_offset else 0.0,
    )


def _servo(
    content: Mapping[str, Any], motors: Mapping[str, Motor], on: Imperfections, place: Place
) -> tuple[ServoMotor, ServoDrive]:
    """A servo motor and its drive, whose keys are in one table."""
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
    if machine.fixture_file is not None:
        model_files(machine.fixture_file)
    longest_mm = model_travels_mm(machine.model_file)
    for axis in machine.axes:
        if axis.travel_mm > longest_mm.get(axis.name, math.inf):
            raise place.at(f"axes.{axis.name}.travel").wrong(
                f"{axis.travel_mm:g} mm; allowed: up to {longest_mm[axis.name]:g} mm, "
                f"where joint {axis.name} ends in {machine.model_file}"
            )
    check_plates(machine)
    signals = [contact.name for contact in machine.contacts if contact.kind == "signal"]
    known(signals, CABINETS[machine.cabinet], place.at("contacts"))


def check_plates(machine: Machine) -> None:
    """Refuse a plate where the machine's file does not say how plates give way."""
    for fixture in machine.fixtures:
        if fixture.plate and machine.plate is None:
            raise MachineError(
                f"{fixture.shown}.plate: {machine.file} does not say how plates give way; allowed: with a [plate] there"
            )


def _lines(file: Path, key: str) -> LinePlace:
    """The place of a key that knows its line, if the file has it."""
    return LinePlace(file, MachineError, key, (file_content(file) or b"").decode("utf-8", "replace"))


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
