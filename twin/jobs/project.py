"""The settings file of a project, isel-twin.toml: where it is, what it has clamped on the table, and how files of CAM
programs are made ([cam]). What it asks of a job stands in checks/settings.py."""

from __future__ import annotations

from pathlib import Path

from isel_twin.base.parameters import FileError, Place, table
from isel_twin.base.toml_lines import read_lines
from isel_twin.cam.settings import CamSettings, read_cam
from isel_twin.machine import Fixture, Machine, check_meshes, read_fixtures

FILE = "isel-twin.toml"


class SettingsError(FileError):
    """A settings file is wrong; the message is one line that names file, key and what is allowed."""


def find(job: Path) -> Path | None:
    """The settings file for a job: in its folder, or the nearest one above it."""
    folder = job.resolve().parent
    return next((path for above in (folder, *folder.parents) if (path := above / FILE).is_file()), None)


def fixtures(path: Path) -> tuple[Fixture, ...]:
    """What is clamped on the table for jobs below a settings file: its [[fixture]] tables. Raises as `load`."""
    content, lines = read_lines(path, SettingsError)
    tables, place, folder = content.get("fixture", []), lines.at("fixture"), path.resolve().parent
    check_meshes(tables, place, folder)
    return read_fixtures(tables, place, folder)


def cam(path: Path | None, machine: Machine) -> CamSettings:
    """The [cam] table of a machine's folder, with that of a settings file laid over it. Raises as `load`."""
    own = dict(machine.tree.get("cam", {}))
    place = Place(machine.file, SettingsError).at("cam")
    if path is not None:
        content, place = read_lines(path, SettingsError)
        place = place.at("cam")
        own |= table(content.get("cam", {}), place)
    return read_cam(own, place)
