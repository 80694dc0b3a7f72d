"""The numbers of a machine: what `models/<name>/machine.toml` says, read, checked and frozen.

Every constant of the physics has a name, a unit, a source and a grade; a wrong one is an error that names it.

schema.py      what a machine is: names, units, limits
build.py       from its tables to a `Machine`
fixture.py     what is clamped on the table
reader.py      from its file to its tables
overrides.py   another one with some numbers changed
spread.py      how far a number may be from what the file says
"""

from isel_twin.machine.fixture import Fixture, fixture_table, read_fixtures
from isel_twin.machine.mjcf import check_meshes
from isel_twin.machine.overrides import describe, with_fixtures, with_overrides
from isel_twin.machine.reader import load_machine, machine_from_tree
from isel_twin.machine.schema import (
    CABINETS,
    DEFAULT_CABINET,
    LEVELS,
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
from isel_twin.models import machine_names, models_folder

__all__ = [
    "CABINETS",
    "DEFAULT_CABINET",
    "LEVELS",
    "Axis",
    "Contact",
    "Feeler",
    "Fixture",
    "Guides",
    "Holder",
    "Imperfections",
    "Machine",
    "MachineError",
    "Mode",
    "Probe",
    "Squareness",
    "Timing",
    "check_meshes",
    "describe",
    "fixture_table",
    "load_machine",
    "machine_from_tree",
    "machine_names",
    "models_folder",
    "read_fixtures",
    "with_fixtures",
    "with_overrides",
]
