"""Each limit stands once: a file and a call in Python are refused at the same value, and say the same range."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import pytest

from isel_twin.base.parameters import FileError, Limits, changed
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Rod, Screw
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.stage import Stage
from isel_twin.machine import (
    Axis,
    Contact,
    Guides,
    Holder,
    MachineError,
    Mode,
    Squareness,
    Timing,
    describe,
    load_machine,
    machine_names,
)
from isel_twin.wiring import ScenarioError

MACHINE = load_machine("4030")
AXIS = MACHINE.axes[0]
SERVO = load_machine("4030-servo").axes[0]

INSTANCES: dict[str, Any] = {
    "timing": MACHINE.timing,
    "axes.x": AXIS,
    "axes.x.screw": AXIS.screw,
    "axes.x.rod": Rod(diameter_mm=16.0, length_mm=600.0, fill=0.85, coupling_inertia_kgm2=5e-6),
    "axes.x.stage": AXIS.stage,
    "structure.flex_x": MACHINE.structure[0],
    "squareness": MACHINE.squareness,
    "guides": Guides(),
    "holder": MACHINE.holder,
    "contacts.limit_x1": MACHINE.switches[0],
    "motors.own": AXIS.motor,
    "axes.x.servo": dataclasses.replace(SERVO.stage, rated_current_a=math.nan),
    "axes.x.servo.motor": SERVO.motor,
}
"""An instance of every dataclass that has numbers, and the section of the file that it comes from."""

FIELDS = [(where, item) for where, instance in INSTANCES.items() for item in dataclasses.fields(instance)]
NUMBERS = [(where, item, item.metadata["rule"]) for where, item in FIELDS if item.type in ("int", "float")]


def outside(limits: Limits) -> list[float]:
    """Values just outside, in the file's unit; none beyond an infinite limit."""
    margin = 1.0 / limits.scale if limits.whole else 1e-4 * min(limits.high - limits.low, abs(limits.low) or math.inf)
    return [low for low in (limits.low - margin, limits.high + margin) if math.isfinite(low)]


NEEDED = [item for item in dataclasses.fields(Motor) if not item.metadata["optional"]]


def toml(value: float, limits: Limits) -> str:
    """A number as files have it."""
    return f'{{ value = {value!r}, unit = "{limits.unit}", grade = "estimate", source = "test" }}'


def section_of(where: str) -> str:
    """Keys of screw and rod stand beside those of their axis, those of a servo motor beside those of its drive."""
    return where.removesuffix(".screw").removesuffix(".rod").removesuffix(".motor")


def refusal(folder: Path, where: str, line: str) -> str:
    """What is said about a machine with one changed line, its file left out."""
    file = folder / "machine.toml"
    base = "4030-servo" if "servo" in where else "4030"
    file.write_text(f'based_on = "{base}"\n[{section_of(where)}]\n{line}\n')
    with pytest.raises(MachineError) as error:
        load_machine(file)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{file}: ")
    return str(error.value).removeprefix(f"{file}: ")


def test_all_numbers_of_all_dataclasses_have_limits() -> None:
    assert {type(instance) for instance in INSTANCES.values()} == {
        Timing, Axis, Screw, Rod, Stage, Mode, Squareness, Guides, Holder, Contact, Motor, ServoDrive, ServoMotor
    }  # fmt: skip
    assert len(NUMBERS) > 50
    assert all(isinstance(limits, Limits) for _, _, limits in NUMBERS)


@pytest.mark.parametrize(("where", "item", "limits"), NUMBERS, ids=[f"{w}.{item.name}" for w, item, _ in NUMBERS])
def test_just_outside_is_refused_by_python_and_by_the_file(
    tmp_path: Path, where: str, item: dataclasses.Field[Any], limits: Limits
) -> None:
    low, high = limits.low * limits.scale, limits.high * limits.scale
    said = f"{item.name} must lie in {low:g} .. {high:g}, not "
    for value in (limits.low, limits.high):
        dataclasses.replace(INSTANCES[where], **{item.name: value * limits.scale})
    for value in outside(limits):
        with pytest.raises(ValueError, match=re.escape(said)):
            dataclasses.replace(INSTANCES[where], **{item.name: value * limits.scale})
        if key := item.metadata["key"]:
            lines = {key: toml(value, limits)}
            if where == "motors.own":  # there is no other from which it could have the rest
                lines = {f.name: toml(f.metadata["rule"].low, f.metadata["rule"]) for f in NEEDED} | lines
            message = refusal(tmp_path, where, "\n".join(f"{name} = {given}" for name, given in lines.items()))
            assert message == f"{section_of(where)}.{key}: {value!r}; allowed: {limits}"


@pytest.mark.parametrize("name", machine_names())
def test_every_number_that_files_must_have_is_described(name: str) -> None:
    listed = {row.parameter.replace("axes.all.", "axes.x.") for row in describe(load_machine(name))}
    other = "stage" if load_machine(name).axes[0].closed_loop else "servo"
    for where, item, _ in NUMBERS:
        if f".{other}" in where or where == "motors.own":
            continue
        if item.metadata["key"] and not item.metadata["optional"]:
            assert f"{section_of(where)}.{item.metadata['key']}" in listed


def test_whole_numbers_and_words_are_checked_in_python_too() -> None:
    with pytest.raises(ValueError, match=r"stage: microsteps must be a whole number, not 2\.5"):
        Stage(48.0, 4.0, 2.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="contact: kind must be one of switch, signal, bridge, not 'gate'"):
        Contact("door", kind="gate")


def test_what_stands_for_none_or_unknown_is_allowed() -> None:
    assert Screw().stiffness_n_per_m == 0.0
    assert math.isinf(Motor(0.65, 3e-3, 0.4, 5e-5).rated_current_a)


def test_one_error_for_files_that_are_wrong() -> None:
    assert issubclass(MachineError, FileError)
    assert issubclass(ScenarioError, FileError)
    assert issubclass(FileError, ValueError)


@pytest.mark.parametrize("of", [name for name in INSTANCES if name != "axes.x.servo"])
def test_a_changed_section_is_what_replace_makes_and_as_strict(of: str) -> None:
    section = INSTANCES[of]
    assert changed(section) == dataclasses.replace(section)
    name, limits = next((f.name, f.metadata["rule"]) for f in dataclasses.fields(section) if _limited(f))
    lowest = limits.low * limits.scale
    assert changed(section, **{name: lowest}) == dataclasses.replace(section, **{name: lowest})
    with pytest.raises(ValueError, match=name):
        changed(section, **{name: lowest - 1.0})


def _limited(field: dataclasses.Field[Any]) -> bool:
    return isinstance(field.metadata.get("rule"), Limits)


def test_what_was_found_out_about_a_machine_is_not_taken_over() -> None:
    machine = load_machine("4030")
    assert machine.digest
    heavy = changed(machine, payload_kg=3.0)
    assert "digest" not in vars(heavy)
    assert heavy == dataclasses.replace(machine, payload_kg=3.0)
