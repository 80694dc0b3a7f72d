"""A machine with some of its numbers changed, and the list of them all."""

from __future__ import annotations

import dataclasses
import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Place, Row, gather, keys, override, rows
from isel_twin.machine.build import DEFAULT_DRIVE, DRIVES, build, check_plates
from isel_twin.machine.fixture import Fixture
from isel_twin.machine.schema import LEVELS, Imperfections, Machine, MachineError
from isel_twin.machine.spread import band, numbers


class _Made(NamedTuple):
    base: Machine  # kept alive so that its id stays unique
    machine: Machine


_RMS = ".stage.current_rms"
_MOST_MADE = 64
# cache: machines by base and overrides, the last used at the end
_made: OrderedDict[tuple[Any, ...], _Made] = OrderedDict()


def with_overrides(machine: Machine, overrides: Mapping[str, Any]) -> Machine:
    """The machine with some of its numbers changed, for experiments.

    Keys are those of `describe`, values are in the file's unit: {"axes.x.backlash": 0.0, "axes.all.lead": 4.0}. As in
    files the current of a stage may be given as RMS: {"axes.all.stage.current_rms": 2.0} is its peak, 2.83 A.
    The key "imperfections" takes a level: "ideal", "static", "dynamic" or "real".
    Raises MachineError for an unknown key or a value out of range.
    """
    key = (id(machine), *((name, type(value), repr(value)) for name, value in overrides.items()))
    if (made := _made.get(key)) is not None:
        _made.move_to_end(key)
        return made.machine
    place = Place(machine.file, MachineError)
    tree: Mapping[str, Any] = machine.tree
    for name, value in overrides.items():
        tree = _changed(tree, name, value, place)
    result = machine if tree is machine.tree else build(dict(tree), machine.file, machine)
    _made[key] = _Made(machine, result)
    if len(_made) > _MOST_MADE:
        _made.popitem(last=False)
    return result


def with_fixtures(machine: Machine, fixtures: Sequence[Fixture]) -> Machine:
    """The machine with these on its table, too. Raises MachineError for a name that is there already."""
    taken = [fixture.name for fixture in machine.fixtures]
    for fixture in fixtures:
        if fixture.name in taken:
            where = f"{fixture.shown}.name: {fixture.name!r} stands on the table of {machine.name} already"
            raise MachineError(f"{where}; allowed: a name of its own")
        taken.append(fixture.name)
    if not fixtures:
        return machine
    result = dataclasses.replace(machine, fixtures=(*machine.fixtures, *fixtures))
    check_plates(result)
    return result


def _changed(tree: Mapping[str, Any], key: str, value: Any, place: Place) -> Mapping[str, Any]:
    """The tree with one override; unchanged parts are shared."""
    if key.endswith(_RMS) and isinstance(value, int | float) and not isinstance(value, bool):
        key, value = key.removesuffix("_rms"), round(math.sqrt(2.0) * value, 4)
    _check_drive(tree, key, value, place)
    if key.startswith("axes.") and key.endswith(".drive"):
        return tree  # already at that level
    if key == "imperfections":
        if value not in LEVELS:
            raise MachineError(f"imperfections: unknown level {value!r}; allowed: {', '.join(LEVELS)}")
        return {**tree, "imperfections": {name: name in LEVELS[value] for name in keys(Imperfections)}}
    section, _, setting = key.partition(".")
    if section == "controller" and setting and setting not in tree["controller"]:  # its manual's default until now
        return {**tree, "controller": {**tree["controller"], setting: value}}
    if not key.startswith("axes.all."):
        return override(tree, key, value, place)
    for axis in CARRIAGES:
        tree = override(tree, f"axes.{axis}.{key.removeprefix('axes.all.')}", value, place)
    return tree


def describe(machine: Machine) -> list[Row]:
    """All parameters of a machine; those that are equal on X, Y and Z in one row `axes.all...`, fixtures by name.
    The interval is that of spread.py. The unit of a stage's current says that it is the peak."""
    tree = dict(machine.tree)
    if machine.fixtures:
        tree["fixture"] = ", ".join(fixture.name for fixture in machine.fixtures)
    bands = {key: band(key, entry) for key, entry in numbers(tree)}
    with_bands = (dataclasses.replace(row, interval=bands.get(row.parameter)) for row in rows(tree))
    listed = gather(with_bands, "axes", CARRIAGES)
    return [
        dataclasses.replace(row, unit="A peak") if row.parameter.endswith(".stage.current") else row for row in listed
    ]


def _check_drive(tree: Mapping[str, Any], key: str, value: Any, place: Place) -> None:
    """Refuse an override for the other kind of drive, which needs another machine (plant/19)."""
    section_name, _, rest = key.partition(".")
    member, _, inside = rest.partition(".")
    own = inside.partition(".")[0]
    if section_name != "axes" or member not in ("all", *CARRIAGES):
        return
    for name in CARRIAGES if member == "all" else (member,):
        has = tree["axes"][name].get("drive", DEFAULT_DRIVE)
        for kind, kinds in DRIVES.items():
            if kind != has and (own in kinds or (own == "drive" and value == kind)):
                needed = f"{kind} drives are asked for" if own == "drive" else f"this is of {kind} drives"
                models = {"stepper": "4030", "servo": "4030-servo"}
                raise place.at(f"axes.{name}.{inside}").wrong(
                    f"{needed}, and the machine has {has} drives; "
                    f"take a machine with {kind} drives, such as {models[kind]}"
                )
        if own == "drive" and value not in DRIVES:
            raise place.at(f"axes.{name}.drive").wrong(f"{value!r}; allowed: {', '.join(DRIVES)}")
