"""Files of a MuJoCo model, looked at before MuJoCo reads it, and without it, which is slower.

A model may come from anybody: what it includes, its meshes and textures lie in its folder or below, and the files that
it includes are few and not nested deeply (MuJoCo itself reads any path).
"""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path, PureWindowsPath
from typing import Any, NamedTuple

from isel_twin.base.errors import one_line
from isel_twin.base.parameters import Place
from isel_twin.machine.schema import MachineError

MOST_FILES = 64  # of a model with all that it includes
DEEPEST = 8  # includes in includes
_SIDES = (f"file{side}" for side in ("right", "left", "up", "down", "front", "back"))  # of the texture of a cube
_FILES = frozenset(("file", "filename", *_SIDES))  # attributes; filename: of URDF
_FOLDERS = frozenset(("meshdir", "texturedir", "assetdir"))


class _Content(NamedTuple):
    ends_mm: Mapping[str, float]  # upper limits of joints, by name
    included: tuple[str, ...]
    named: tuple[str, ...]  # all files
    folders: tuple[str, ...]  # in which they are looked for


def file_content(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except OSError:
        return None


def climbs(name: str) -> bool:
    """True for a path that does not stay below where it begins, on any system."""
    path = PureWindowsPath(name)  # takes both kinds of slashes
    return bool(path.anchor) or ".." in path.parts or name.startswith("~")


def model_files(file: Path) -> list[Path]:
    """A MuJoCo model, and the files that it includes. Raises MachineError for a path that leaves the folder of the
    model, for too many files, and for one that is no XML."""
    found: list[Path] = []
    waiting = [(file, 0)]
    while waiting:
        each, depth = waiting.pop()
        if depth > DEEPEST or len(found) >= MOST_FILES:
            raise MachineError(
                f"{file}: its includes do not end; allowed: {MOST_FILES} files, up to {DEEPEST} in each other"
            )
        found.append(each)
        content = _content_of(each)
        for name in (*content.named, *content.folders):
            places = [base / inside / name for base in (file.parent, each.parent) for inside in ("", *content.folders)]
            if climbs(name) or any(not is_below(place, file.parent) for place in places):
                raise MachineError(f"{each}: {name!r} lies elsewhere; allowed: files in {file.parent} and below")
        waiting += [(each.parent / name, depth + 1) for name in reversed(content.included)]
    return found


def check_near(name: str, folder: Path, where: Place) -> None:
    """Refuse a file of somebody's TOML file in this folder that lies neither below it nor beside it (plant/27)."""
    if PureWindowsPath(name).anchor or name.startswith("~") or not is_below(folder / name, folder.resolve().parent):
        raise where.wrong(f"{name!r} lies elsewhere; allowed: a path below {folder}, or beside it as in '../other'")


def check_meshes(fixtures: Any, where: Place, folder: Path) -> None:
    """The same for the meshes in the [[fixture]] tables of a file."""
    for number, fixture in enumerate(fixtures if isinstance(fixtures, list) else (), 1):
        if isinstance(fixture, dict) and isinstance(name := fixture.get("file"), str):
            check_near(name, folder, replace(where, key=f"{where.key} {number}.file"))


def is_below(path: Path, folder: Path) -> bool:
    """Follows links; a name that cannot be one is nowhere else."""
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # the last one of links in a circle
        return True


def model_travels_mm(file: Path) -> dict[str, float]:
    """Upper limits of the joints of a MuJoCo model by name. Errors: `model_files`."""
    ends: dict[str, float] = {}
    for each in model_files(file):
        ends |= _content_of(each).ends_mm
    return ends


def _content_of(file: Path) -> _Content:
    content = file_content(file)
    try:
        return _read(b"<mujoco/>" if content is None else content)  # MuJoCo says that it is missing
    except ElementTree.ParseError as error:  # MuJoCo reads some of these, and would read what they name
        raise MachineError(f"{file}: XML: {one_line(str(error))}") from None


@lru_cache(32)
def _read(content: bytes) -> _Content:
    ends: dict[str, float] = {}
    included: list[str] = []
    named: list[str] = []
    folders: list[str] = []
    for element in ElementTree.fromstring(content).iter():
        name, limits = element.get("name"), (element.get("range") or "").split()
        files = [value for key, value in element.attrib.items() if key in _FILES and value]
        named += files
        folders += [value for key, value in element.attrib.items() if key in _FOLDERS and value]
        if element.tag in ("include", "model"):
            included += files
        elif element.tag == "joint" and name and len(limits) == 2:
            with contextlib.suppress(ValueError):
                ends[name] = 1e3 * float(limits[1])
    return _Content(ends, tuple(included), tuple(named), tuple(folders))
