"""The numbers of a machine: what `models/<name>/machine.toml` says, read, checked and frozen.

Goal: every constant of the physics has a name, a unit, a source and a grade, and a wrong one is named before it does
harm. The dataclasses below are the whole format: a field made with `_number` is a table in the file,

    travel = { value = 395.0, unit = "mm", grade = "datasheet", source = "operating manual 2002" }

and carries its unit and allowed range here. Words and switches are plain values. Three rules make files short:

    based_on = "4030"     start from another machine, by name or by path relative to this folder, and say what differs;
                          with a `model` of its own a machine also brings all of its own [masses] and [structure]
    [axes.all]            holds for X, Y and Z; [axes.x] and so on override it
    [switches]            holds for all position switches; an entry in [contacts] may override it

Machine coordinates of an axis run from 0, the nominal trip point of the motor-end switch, away from the motor to
`travel_mm`, that of the far-end switch (decision P1).
"""

from __future__ import annotations

import copy
import dataclasses
import difflib
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage
from isel_twin.models import machine_names, models_folder

AXIS_NAMES = ("x", "y", "z")
GRADES = ("measured", "datasheet", "estimate", "setting")
LEVELS: Mapping[str, frozenset[str]] = {
    "ideal": frozenset(),
    "static": frozenset({"lead_error", "squareness", "backlash"}),
    "dynamic": frozenset({"lead_error", "squareness", "backlash", "structure", "repeatability", "bounce"}),
}
"""Imperfection levels: the sources of imperfection that are on."""

T = TypeVar("T")


class MachineError(ValueError):
    """A machine folder is missing or wrong; one line that names the file, the key and what is allowed."""


def _number(key: str, unit: str, low: float, high: float, default: Any = MISSING, scale: float = 1.0) -> Any:
    """A field read from the table `key`, in `unit`, within [low, high]; the dataclass holds value * scale."""
    return field(
        default=default, metadata={"key": key, "unit": unit, "low": low, "high": high, "scale": scale}, kw_only=True
    )


def _word(key: str, choices: tuple[str, ...] = (), default: Any = MISSING) -> Any:
    """A field read from the string `key`; no choices: any string."""
    return field(default=default, metadata={"key": key, "choices": choices}, kw_only=True)


def _flag(key: str, default: Any = MISSING) -> Any:
    """A field read from the boolean `key`."""
    return field(default=default, metadata={"key": key, "flag": True}, kw_only=True)


@dataclass(frozen=True)
class Timing:
    """The fixed grid of the plant."""

    substep_ns: int = _number("motor_substep", "us", 1.0, 100.0, scale=1000.0)
    mujoco_step_ns: int = _number("mujoco_step", "ms", 0.01, 1.0, scale=1e6)


@dataclass(frozen=True)
class StageSettings:
    """One power stage."""

    supply_v: float = _number("supply", "V", 5.0, 200.0)
    current_a: float = _number("current", "A", 0.1, 20.0)
    """Peak of the phase current."""
    idle_fraction: float = _number("idle_current", "1", 0.0, 1.0)
    """Current at rest as a fraction of nominal, while the controller asks for current lowering."""
    idle_delay_s: float = _number("idle_delay", "ms", 0.0, 10_000.0, scale=1e-3)
    """Time after the last pulse of the axis until the current is lowered."""
    thermal_resistance_k_per_w: float = _number(
        "thermal_resistance", "K/W", 0.0, 1000.0, default=Stage.thermal_resistance_k_per_w
    )
    thermal_time_constant_s: float = _number(
        "thermal_time_constant", "s", 1.0, 1e6, default=Stage.thermal_time_constant_s
    )
    ambient_c: float = _number("ambient", "C", -50.0, 150.0, default=Stage.ambient_c)
    thermal_limit_c: float = _number("thermal_limit", "C", -50.0, 300.0, default=Stage.thermal_limit_c)
    """Where the stage opens the over-temperature contact."""


@dataclass(frozen=True)
class Axis:
    """One linear axis: motor, screw and nut. What the nut pushes is in the MuJoCo model."""

    name: str
    motor: str = _word("motor")
    """A motor of [motors] in the machine file or of `isel_twin.drives.MOTORS`."""
    travel_mm: float = _number("travel", "mm", 1.0, 10_000.0)
    stop_margin_mm: float = _number("stop_margin", "mm", 0.1, 100.0)
    """From the trip point of each end switch on to the hard stop."""
    power_on_low_mm: float = _number("power_on_low", "mm", -100.0, 10_000.0)
    power_on_high_mm: float = _number("power_on_high", "mm", -100.0, 10_000.0)
    """Where the carriage may stand when the mains is switched on: uniform between the two."""
    steps_per_rev: int = _number("steps_per_rev", "1", 200.0, 51_200.0)
    """200 full steps times the stage's microsteps."""
    lead_mm: float = _number("lead", "mm", 0.5, 100.0)
    lead_error: float = _number("lead_error", "%", -1.0, 1.0, scale=1e-2)
    """Relative: +0.00046 is a carriage that goes 0.46 mm too far in 1 m."""
    screw_diameter_mm: float = _number("screw_diameter", "mm", 4.0, 100.0)
    screw_length_mm: float = _number("screw_length", "mm", 10.0, 10_000.0)
    screw_fill: float = _number("screw_fill", "1", 0.3, 1.0)
    """Inertia of the threaded screw over that of a plain rod of the nominal diameter."""
    coupling_inertia_kgm2: float = _number("coupling_inertia", "kg m2", 0.0, 1e-2)
    efficiency: float = _number("efficiency", "1", 0.2, 1.0)
    backlash_mm: float = _number("backlash", "mm", 0.0, 1.0)
    stiffness_n_per_m: float = _number("stiffness", "N/um", 1.0, 200.0, scale=1e6)
    """Axial: screw, bearing and nut in series."""
    damping_n_s_per_m: float = _number("damping", "N s/m", 0.0, 20_000.0)
    """Of the same axial spring."""
    coulomb_nm: float = _number("shaft_coulomb", "N m", 0.0, 5.0)
    """Drag at the shaft from nut preload and bearings; the guides' friction is `guide_friction_n`."""
    viscous_nm_s: float = _number("shaft_viscous", "N m s", 0.0, 0.1)
    breakaway: float = _number("breakaway", "1", 1.0, 3.0)
    """Static over Coulomb friction at the shaft."""
    stribeck_mm_s: float = _number("stribeck_speed", "mm/s", 0.01, 100.0)
    """Carriage speed at which half of the excess over Coulomb friction is gone."""
    guide_friction_n: float = _number("guide_friction", "N", 0.0, 2000.0)
    brake_n: float = _number("brake", "N", 0.0, 50_000.0)
    """Holding force of the brake at the carriage; 0: the axis has none."""
    stage: StageSettings = field(metadata={"key": "stage", "section": StageSettings}, kw_only=True)

    @property
    def steps_per_mm(self) -> float:
        """Nominal steps per mm of carriage travel (the lead error is not in it)."""
        return self.steps_per_rev / self.lead_mm


@dataclass(frozen=True)
class Mode:
    """A structural mode: a passive joint of the MuJoCo model that moves along one axis."""

    joint: str
    axis: str = _word("axis", AXIS_NAMES)
    frequency_hz: float = _number("frequency", "Hz", 5.0, 200.0)
    damping_ratio: float = _number("damping_ratio", "1", 0.0, 0.5)


@dataclass(frozen=True)
class Squareness:
    """Deviations from right angles; a positive one tilts the second axis towards plus of the first."""

    xy: float = _number("xy", "mm/m", -10.0, 10.0, scale=1e-3)
    xz: float = _number("xz", "mm/m", -10.0, 10.0, scale=1e-3)
    yz: float = _number("yz", "mm/m", -10.0, 10.0, scale=1e-3)


@dataclass(frozen=True)
class Imperfections:
    """Which sources of imperfection are on; what is off counts as zero (structure: as rigid)."""

    lead_error: bool = _flag("lead_error")
    squareness: bool = _flag("squareness")
    backlash: bool = _flag("backlash")
    structure: bool = _flag("structure")
    repeatability: bool = _flag("repeatability")
    bounce: bool = _flag("bounce")


@dataclass(frozen=True)
class Contact:
    """One contact of the machine and the controller terminal it leads to.

    Level at the terminal: high when the contact is closed, the other way round if `inverted`.
    """

    name: str
    kind: str = _word("kind", ("switch", "signal", "bridge"))
    """switch: struck by a carriage; signal: set from outside; bridge: always closed."""
    terminal: str = _word("terminal")
    type: str = _word("type", ("opener", "closer"), "opener")
    """opener: closed at rest, open when struck or actuated; closer: the other way round."""
    inverted: bool = _flag("inverted", False)
    axis: str = _word("axis", ("", *AXIS_NAMES), "")
    end: str = _word("end", ("", "motor", "far"), "")
    position_mm: float = _number("position", "mm", -100.0, 10_000.0, default=0.0)
    """Trip point in machine coordinates; from `axis` and `end` unless the file gives it."""
    hysteresis_mm: float = _number("hysteresis", "mm", 0.0, 5.0, default=0.0)
    repeatability_mm: float = _number("repeatability", "mm", 0.0, 1.0, default=0.0)
    """Standard deviation of the trip point."""
    bounce_ms: float = _number("bounce", "ms", 0.0, 50.0, default=0.0)


@dataclass(frozen=True)
class Machine:
    """A machine as its folder describes it."""

    name: str
    description: str
    kinematics: str
    """table: the portal stands and the table moves along Y; portal: the portal moves along Y;
    traverse: a column along X, a slide on it along Z, an arm along Y. For people: the model says it to the plant."""
    folder: Path
    model_file: Path
    """MuJoCo model (MJCF) that the plant loads."""
    fixture_file: Path | None
    """MuJoCo model (MJCF) of what is clamped on the table, its origin in the middle of the table's surface."""
    timing: Timing
    axes: tuple[Axis, Axis, Axis]
    masses_kg: Mapping[str, float]
    """By name of the body in the MuJoCo model."""
    payload_kg: float
    """Dead weight on the table."""
    structure: tuple[Mode, ...]
    squareness: Squareness
    imperfections: Imperfections
    contacts: tuple[Contact, ...]
    motors: Mapping[str, Mapping[str, float]]
    """Motors of this machine's own: fields of `isel_twin.drives.Motor` by name."""
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


@dataclass(frozen=True)
class Row:
    """One line of `describe`."""

    parameter: str
    value: Any
    unit: str
    source: str
    grade: str


def load_machine(name_or_path: str | Path) -> Machine:
    """Read a machine by its name, or by the path of a folder with a machine.toml (or of that file).

    Raises MachineError with one line that names the file, the key and what is allowed.
    """
    file = _find(name_or_path)
    return _build(_read_file(file), file)


def with_overrides(machine: Machine, overrides: Mapping[str, Any]) -> Machine:
    """The machine with some of its numbers changed, for experiments.

    Keys are those of `describe`, values are in the file's unit: {"axes.x.backlash": 0.0, "axes.all.lead": 4.0}.
    The key "imperfections" takes a level: "ideal", "static" or "dynamic".
    Raises MachineError for an unknown key or a value out of range.
    """
    tree = copy.deepcopy(dict(machine.tree))
    file = machine.file
    for key, value in overrides.items():
        if key == "imperfections":
            if value not in LEVELS:
                raise MachineError(f"imperfections: unknown level {value!r}; allowed: {', '.join(LEVELS)}")
            tree["imperfections"] = {name: name in LEVELS[value] for name in LEVELS["dynamic"]}
        elif key.startswith("axes.all."):
            for axis in AXIS_NAMES:
                _override(tree, f"axes.{axis}.{key.removeprefix('axes.all.')}", value, file)
        else:
            _override(tree, key, value, file)
    return _build(tree, file)


def describe(machine: Machine) -> list[Row]:
    """All parameters of a machine; those that are equal on X, Y and Z in one row `axes.all...`."""
    rows = list(_rows(machine.tree))
    per_axis = {(row.parameter.split(".")[1], row.parameter.split(".", 2)[2]): row for row in rows if _is_axis_row(row)}
    result = []
    for row in rows:
        if not _is_axis_row(row):
            result.append(row)
            continue
        _, axis, key = row.parameter.split(".", 2)
        same = [per_axis.get((other, key)) for other in AXIS_NAMES]
        if all(
            other and dataclasses.replace(other, parameter="") == dataclasses.replace(row, parameter="")
            for other in same
        ):
            if axis == AXIS_NAMES[0]:
                result.append(dataclasses.replace(row, parameter=f"axes.all.{key}"))
        else:
            result.append(row)
    return result


def _is_axis_row(row: Row) -> bool:
    return row.parameter.startswith("axes.")


def _rows(tree: Mapping[str, Any], prefix: str = "") -> Iterator[Row]:
    for key, value in tree.items():
        if isinstance(value, Mapping) and "value" in value:
            yield Row(prefix + key, value["value"], value["unit"], value["source"], value["grade"])
        elif isinstance(value, Mapping):
            yield from _rows(value, f"{prefix}{key}.")
        else:
            yield Row(prefix + key, value, "", "", "setting")


# Reading ------------------------------------------------------------------------------------------------------------


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
    if file in seen:
        raise MachineError(f"{file}: based_on: goes round in a circle; allowed: a machine that does not need this one")
    try:
        tree = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise MachineError(f"{file}: cannot be read: {error}") from None
    _spread(tree, "axes", AXIS_NAMES, file)
    if "based_on" in tree:
        parent_file = _find(str(tree.pop("based_on")), file.parent)
        parent = _read_file(parent_file, (*seen, file))
        if "model" in tree:
            parent = {**parent, "masses": {}, "structure": {}}
        for key in ("model", "fixture"):
            if key not in tree and parent.get(key):
                tree[key] = str(parent_file.parent / str(parent[key]))
        tree = _merge(parent, tree)
    return tree


def _spread(tree: dict[str, Any], section: str, names: tuple[str, ...], file: Path) -> None:
    """Copy tree[section]["all"] under every name, below what the name itself says."""
    table = _table(tree.get(section, {}), section, file)
    shared = table.pop("all", {})
    _known(table, names, section, file)
    for name in names:
        table[name] = _merge(copy.deepcopy(shared), table.get(name, {}))
    tree[section] = table


def _merge(base: dict[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """`change` laid over `base`; numbers (tables with a value) are replaced as a whole."""
    result = dict(base)
    for key, value in change.items():
        old = result.get(key)
        deep = isinstance(old, dict) and isinstance(value, Mapping) and "value" not in value
        result[key] = _merge(old, value) if deep and isinstance(old, dict) else value
    return result


def _override(tree: dict[str, Any], key: str, value: Any, file: Path) -> None:
    *path, last = key.split(".")
    table: Any = tree
    for name in path:
        table = table.get(name) if isinstance(table, dict) else None
    if not isinstance(table, dict) or last not in table:
        known = [row.parameter for row in _rows(tree)]
        raise MachineError(f"{file}: {key}: unknown key{_nearest(key, known)}")
    if isinstance(table[last], dict):
        if "value" not in table[last]:
            raise MachineError(f"{file}: {key}: is a section; allowed: one of its keys: {', '.join(table[last])}")
        table[last] = {**table[last], "value": value, "grade": "setting", "source": "override"}
    else:
        table[last] = value


_TEXTS: Mapping[str, tuple[str, ...]] = {
    "name": (),
    "description": (),
    "kinematics": ("table", "portal", "traverse"),
    "model": (),
    "fixture": (),
}
"""Words at the top of the file, and what each may be."""
_SECTIONS = ("axes", "masses", "payload", "structure", "switches", "contacts", "motors", "controller")
_FIXED_SECTIONS = ("timing", "squareness", "imperfections")


def _build(tree: dict[str, Any], file: Path) -> Machine:
    known = (*_TEXTS, *_SECTIONS, *_FIXED_SECTIONS)
    _known(tree, known, "", file)
    for key in known:
        if key not in (*tree, "motors", "controller"):
            raise MachineError(f"{file}: {key}: missing")
    texts = {key: _text(tree[key], key, choices, file) for key, choices in _TEXTS.items()}
    sections = {key: _table(tree.get(key, {}), key, file) for key in _SECTIONS}
    axes = tuple(_section(Axis, sections["axes"][name], f"axes.{name}", file, name=name) for name in AXIS_NAMES)
    imperfections = _section(Imperfections, tree["imperfections"], "imperfections", file)
    mass = {"unit": "kg", "low": 1e-3, "high": 1e4, "scale": 1.0}
    _known(sections["payload"], ("mass",), "payload", file)
    machine = Machine(
        name=texts["name"],
        description=texts["description"],
        kinematics=texts["kinematics"],
        folder=file.parent,
        model_file=file.parent / texts["model"],
        fixture_file=file.parent / texts["fixture"] if texts["fixture"] else None,
        timing=_section(Timing, tree["timing"], "timing", file),
        axes=(axes[0], axes[1], axes[2]),
        masses_kg={key: _quantity(value, mass, f"masses.{key}", file) for key, value in sections["masses"].items()},
        payload_kg=_quantity(sections["payload"].get("mass"), {**mass, "low": 0.0}, "payload.mass", file),
        structure=tuple(
            _section(Mode, value, f"structure.{key}", file, joint=key) for key, value in sections["structure"].items()
        ),
        squareness=_section(Squareness, tree["squareness"], "squareness", file),
        imperfections=imperfections,
        contacts=tuple(
            _as_good_as(_contact(key, value, sections["switches"], axes, file), imperfections)
            for key, value in sections["contacts"].items()
        ),
        motors={key: _motor(key, value, file) for key, value in sections["motors"].items()},
        controller={key: _free(value, f"controller.{key}", file) for key, value in sections["controller"].items()},
        tree=tree,
    )
    _check(machine, file)
    return machine


def _motor(name: str, table: Any, file: Path) -> dict[str, float]:
    """Fields of a motor of the machine's own, tried out here, so that a wrong one is named with its file."""
    where = f"motors.{name}"
    table = _table(table, where, file)
    fields = dataclasses.fields(Motor)
    _known(table, [f.name for f in fields], where, file)
    for f in fields:
        if f.name not in table and f.default is MISSING:
            raise MachineError(f"{file}: {where}.{f.name}: missing")
    values = {key: _free(value, f"{where}.{key}", file) for key, value in table.items()}
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise MachineError(f"{file}: {where}.{key}: {value!r}; allowed: a number")
    try:
        Motor(**values)
    except ValueError as error:
        raise MachineError(f"{file}: {where}: {error}") from None
    return values


def _check(machine: Machine, file: Path) -> None:
    """What no single value can say."""
    timing = machine.timing
    if timing.mujoco_step_ns % timing.substep_ns:
        raise MachineError(
            f"{file}: timing.mujoco_step: {timing.mujoco_step_ns / 1e6} ms; "
            f"allowed: whole multiples of motor_substep ({timing.substep_ns / 1e3} us)"
        )
    for axis in machine.axes:
        low, high = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        if not low <= axis.power_on_low_mm <= axis.power_on_high_mm <= high:
            raise MachineError(
                f"{file}: axes.{axis.name}.power_on_low: {axis.power_on_low_mm} .. {axis.power_on_high_mm} mm; "
                f"allowed: a range within the hard stops, {low} .. {high} mm"
            )
        if axis.steps_per_rev % 200:
            raise MachineError(
                f"{file}: axes.{axis.name}.steps_per_rev: {axis.steps_per_rev}; allowed: whole multiples of 200"
            )
    for key, path in (("model", machine.model_file), ("fixture", machine.fixture_file)):
        if path is not None and not path.is_file():
            raise MachineError(f"{file}: {key}: {path} does not exist; allowed: an MJCF file")


def _contact(name: str, table: Any, shared: dict[str, Any], axes: tuple[Axis, ...], file: Path) -> Contact:
    where = f"contacts.{name}"
    table = _table(table, where, file)
    if table.get("kind") != "switch":
        return _section(Contact, table, where, file, name=name)
    contact = _section(Contact, {**shared, **table}, where, file, name=name)
    if not (contact.axis and contact.end):
        raise MachineError(f"{file}: {where}: a switch needs axis ({', '.join(AXIS_NAMES)}) and end (motor, far)")
    if "position" in table or contact.end == "motor":
        return contact
    return dataclasses.replace(contact, position_mm=axes[AXIS_NAMES.index(contact.axis)].travel_mm)


def _as_good_as(contact: Contact, on: Imperfections) -> Contact:
    """The contact without those of its imperfections that are off."""
    return dataclasses.replace(
        contact,
        repeatability_mm=contact.repeatability_mm if on.repeatability else 0.0,
        bounce_ms=contact.bounce_ms if on.bounce else 0.0,
    )


def _section(cls: type[T], table: Any, where: str, file: Path, **given: Any) -> T:
    """An instance of the dataclass from its table: numbers, words, flags and sections as its fields say."""
    table = _table(table, where, file)
    fields = [item for item in dataclasses.fields(cls) if item.metadata]  # type: ignore[arg-type]
    _known(table, [item.metadata["key"] for item in fields], where, file)
    values = dict(given)
    for item in fields:
        key = item.metadata["key"]
        path = f"{where}.{key}"
        if key not in table:
            if item.default is MISSING:
                raise MachineError(f"{file}: {path}: missing")
        elif "section" in item.metadata:
            values[item.name] = _section(item.metadata["section"], table[key], path, file)
        elif "flag" in item.metadata:
            if not isinstance(table[key], bool):
                raise MachineError(f"{file}: {path}: {table[key]!r}; allowed: true, false")
            values[item.name] = table[key]
        elif "choices" in item.metadata:
            values[item.name] = _text(table[key], path, item.metadata["choices"], file)
        else:
            number = _quantity(table[key], item.metadata, path, file)
            if item.type == "int":
                if abs(number - round(number)) > 1e-6:
                    raise MachineError(f"{file}: {path}: {table[key]['value']}; allowed: whole numbers")
                number = round(number)
            values[item.name] = number
    return cls(**values)


def _quantity(table: Any, rule: Mapping[str, Any], where: str, file: Path) -> float:
    allowed = f"{rule['low']:g} .. {rule['high']:g} {rule['unit']}"
    if not isinstance(table, Mapping):
        example = f'{{ value = {rule["low"]:g}, unit = "{rule["unit"]}", grade = "estimate", source = "..." }}'
        raise MachineError(f"{file}: {where}: {table!r}; allowed: a table such as {example}, {allowed}")
    _known(table, ("value", "unit", "grade", "source"), where, file)
    for key in ("value", "unit", "grade", "source"):
        if key not in table:
            raise MachineError(f"{file}: {where}.{key}: missing")
    value = table["value"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise MachineError(f"{file}: {where}: {value!r}; allowed: {allowed}")
    if table["unit"] != rule["unit"]:
        raise MachineError(f"{file}: {where}: unit {table['unit']!r}; allowed: {rule['unit']!r}")
    if not rule["low"] <= value <= rule["high"]:
        raise MachineError(f"{file}: {where}: {value}; allowed: {allowed}")
    _text(table["grade"], f"{where}.grade", GRADES, file)
    _text(table["source"], f"{where}.source", (), file)
    return float(value * rule["scale"])


def _free(value: Any, where: str, file: Path) -> Any:
    """A value whose meaning belongs to somebody else: a plain one, or a number with any unit."""
    if not isinstance(value, Mapping):
        return value
    unit = value.get("unit", "1")
    number = _quantity(value, {"unit": unit, "low": -math.inf, "high": math.inf, "scale": 1.0}, where, file)
    return int(number) if isinstance(value["value"], int) else number


def _text(value: Any, where: str, choices: tuple[str, ...], file: Path) -> str:
    if not isinstance(value, str) or (choices and value not in choices):
        raise MachineError(f"{file}: {where}: {value!r}; allowed: {', '.join(c for c in choices if c) or 'text'}")
    return value


def _table(value: Any, where: str, file: Path) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise MachineError(f"{file}: {where}: {value!r}; allowed: a table")
    return value


def _known(table: Mapping[str, Any], known: Any, where: str, file: Path) -> None:
    for key in table:
        if key not in known:
            path = f"{where}.{key}" if where else key
            raise MachineError(f"{file}: {path}: unknown key{_nearest(key, list(known))}")


def _nearest(key: str, known: list[str]) -> str:
    match = difflib.get_close_matches(key, known, 1, 0.5)
    return f"; did you mean {match[0]!r}?" if match else f"; allowed: {', '.join(known)}"
