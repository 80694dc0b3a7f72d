"""Fixtures: what is clamped on the table, as shapes in a TOML file, beside a job or in a machine.toml.

    [[fixture]]
    name = "vise_jaw_left"
    shape = "box"                    # box, cylinder, ring (both upright) or mesh (STL in mm; its convex hull counts)
    size_mm = [100, 20, 40]          # along X, along Y, upwards; of a cylinder: diameter, height; of a ring: outer and
                                     # inner diameter, height; of a mesh: nothing
    at_mm = [197.5, 120, 0]          # X and Y, in machine coordinates, where the tool stands over the middle of its
                                     # foot, and how high that is above the table; of a mesh: where its origin is
    turn_deg = 0                     # about the vertical, from X towards Y
    file = "clamp.stl"               # of a mesh, as seen from this file
    may_touch = ["probe"]            # what may touch it, and is stopped by it
    stock = false                    # true: the cutter goes through it, and nothing is felt
    plate = false                    # true: a plate for tool lengths; the cutter presses it down, and closes `probe`

Whatever else it meets is a collision.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from isel_twin.base.parameters import Limits, Place, boolean, known, plain, table, text

SHAPES = {"box": 3, "cylinder": 2, "ring": 3, "mesh": 0}
"""Numbers of a size, by shape."""
KEYS = ("name", "shape", "size_mm", "at_mm", "turn_deg", "file", "may_touch", "stock", "plate")
CUTTER = "cutter"  # name of what goes through stock
_LENGTH_MM = Limits("mm", 0.01, 10_000.0)
_PLACE_MM = Limits("mm", -10_000.0, 10_000.0)
_TURN_DEG = Limits("degrees", -360.0, 360.0)
_NAME = re.compile(r"[\w.-]{1,60}")


@dataclass(frozen=True)
class Fixture:
    """A body that stands on the table; see the module."""

    name: str
    shape: str = "box"
    size_mm: tuple[float, ...] = ()
    at_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_deg: float = 0.0
    file: Path | None = None
    may_touch: tuple[str, ...] = ()
    stock: bool = False
    plate: bool = False
    place: str = field(default="", repr=False, compare=False)  # file, line and key of its table, for errors

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise ValueError(f"fixture {self.name}: shape {self.shape!r}; allowed: {', '.join(SHAPES)}")
        if len(self.size_mm) != SHAPES[self.shape]:
            raise ValueError(f"fixture {self.name}: a {self.shape} has {SHAPES[self.shape]} numbers in size_mm")
        if (self.file is None) != (self.shape != "mesh"):
            raise ValueError(f"fixture {self.name}: a mesh has a file, and nothing else has one")
        if self.shape == "ring" and self.size_mm[1] >= self.size_mm[0]:
            raise ValueError(f"fixture {self.name}: the inner diameter of a ring is less than its outer one")
        if self.plate and (self.stock or self.shape not in ("box", "cylinder")):
            raise ValueError(f"fixture {self.name}: a plate is a box or a cylinder, and no stock")
        if len(self.at_mm) != 3 or not all(map(math.isfinite, (*self.size_mm, *self.at_mm, self.turn_deg))):
            raise ValueError(f"fixture {self.name}: at_mm must be three numbers, and all numbers finite")

    @property
    def shown(self) -> str:
        """Where it is written down, or its name."""
        return self.place or f"fixture {self.name}"

    @property
    def permitted(self) -> frozenset[str]:
        """Names of what may touch it."""
        return frozenset((*self.may_touch, *([CUTTER] if self.stock or self.plate else [])))


def read_fixtures(entries: Any, place: Place, folder: Path, taken: Sequence[str] = ()) -> tuple[Fixture, ...]:
    """The fixtures of the [[fixture]] tables of a file in this folder. taken: names of others that are there. Raises
    the error of `place`."""
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise place.wrong(f"{entries!r}; it must be written as [[{place.key}]] tables")
    fixtures: list[Fixture] = []
    for number, entry in enumerate(entries, 1):
        where = type(place)(**{**vars(place), "key": f"{place.key} {number}"})
        one = _fixture(entry, where, folder)
        if one.name in (*taken, *(other.name for other in fixtures)):
            raise where.at("name").wrong(f"{one.name!r} is there already; allowed: a name of its own")
        fixtures.append(one)
    return tuple(fixtures)


def fixture_table(fixture: Fixture, file: str = "") -> dict[str, Any]:
    """The [[fixture]] table of a fixture; file: of its mesh, where the table is going to be read."""
    content: dict[str, Any] = {"name": fixture.name, "shape": fixture.shape, "at_mm": list(fixture.at_mm)}
    content |= {"size_mm": list(fixture.size_mm), "turn_deg": fixture.turn_deg, "stock": fixture.stock}
    content |= {"plate": True} if fixture.plate else {}
    content |= {"may_touch": list(fixture.may_touch), **({"file": file or str(fixture.file)} if fixture.file else {})}
    return content


def _fixture(entry: Any, place: Place, folder: Path) -> Fixture:
    content = table(entry, place)
    known(content, KEYS, place)
    for key, allowed in (("name", "a word"), ("shape", ", ".join(SHAPES)), ("at_mm", "three numbers in mm")):
        if key not in content:
            raise place.at(key).wrong(f"missing; allowed: {allowed}")
    name = text(content["name"], place.at("name"))
    if not _NAME.fullmatch(name):
        raise place.at("name").wrong(f"{name!r}; allowed: a word of letters, digits, _ . -")
    shape = text(content["shape"], place.at("shape"), tuple(SHAPES))
    size_mm = _numbers(content.get("size_mm", []), SHAPES[shape], _LENGTH_MM, place.at("size_mm"), shape)
    x, y, z = _numbers(content["at_mm"], 3, _PLACE_MM, place.at("at_mm"), "place")
    file = None
    if shape == "mesh":
        if "file" not in content:
            raise place.at("file").wrong("missing; allowed: the STL file of the mesh")
        file = folder / text(content["file"], place.at("file"))
        if file.suffix.lower() != ".stl" or not file.is_file():
            raise place.at("file").wrong(f"{file} is no STL file that exists; allowed: the path of one")
    elif "file" in content:
        raise place.at("file").wrong(f"a {shape} has none; allowed: beside shape = 'mesh'")
    touching = content.get("may_touch", [])
    if not isinstance(touching, list) or not all(isinstance(one, str) for one in touching):
        raise place.at("may_touch").wrong(f"{touching!r}; allowed: a list of names, such as ['probe']")
    if shape == "ring" and size_mm[1] >= size_mm[0]:
        raise place.at("size_mm").wrong(f"{list(size_mm)}; allowed: an inner diameter below the outer one")
    stock, plate = (boolean(content.get(key, False), place.at(key)) for key in ("stock", "plate"))
    if plate and (stock or shape not in ("box", "cylinder")):
        raise place.at("plate").wrong("true; allowed: of a box or a cylinder that is no stock")
    turn_deg = plain(content.get("turn_deg", 0.0), _TURN_DEG, place.at("turn_deg"))
    return Fixture(name, shape, size_mm, (x, y, z), turn_deg, file, tuple(touching), stock, plate, str(place))


def _numbers(value: Any, count: int, limits: Limits, place: Place, of: str) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        raise place.wrong(f"{value!r}; allowed: {count} numbers of a {of}, each {limits}")
    return tuple(plain(one, limits, place) for one in value)
