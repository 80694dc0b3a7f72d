"""Machines whose reference run is short."""

from __future__ import annotations

from pathlib import Path

NEAR = tuple(
    word
    for axis in "xyz"
    for end, mm in (("low", 2.0), ("high", 3.0))
    for word in ("--set", f"axes.{axis}.power_on_{end}={mm}")
)
"""Options of a command that make any machine one of them."""
COARSE = """[timing]
motor_substep = { value = 50.0, unit = "us", grade = "setting", source = "a quick test" }
"""
"""Motors computed half as often, in two thirds of the time: where both sides of a comparison are such machines."""


def near_switches(folder: Path, mm: float, machine: str = "4030", more: str = "") -> Path:
    """A machine that is found so near its switches, or up to 1 mm farther, that the reference run is short.
    more: sections of its file, such as COARSE."""
    found = "".join(
        f'power_on_{end} = {{ value = {value}, unit = "mm", grade = "setting", source = "a short test" }}\n'
        for end, value in (("low", mm), ("high", mm + 1.0))
    )
    axes = "\n".join(f"[axes.{axis}]\n{found}" for axis in "xyz")
    (folder / "machine.toml").write_text(f'name = "near"\nbased_on = "{machine}"\n{axes}\n{more}')
    return folder
