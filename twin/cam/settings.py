"""Settings that a job file does not hold: the [cam] table of isel-twin.toml, or of a machine's folder.

[cam]                                # all of it may be left out
zero = [100, 80, 60]                 # of the workpiece, as the operator reads the counters, mm
zeros = { 2 = [200, 80, 60] }        # of G55; 1 .. 9: G54 .. G59.3, WPREG1ACT .. WPREG8ACT
tool_length_mm = { 1 = 32.5 }
park = [0, 0, 0]
feed_mm_s = 10.0
outputs = { spindle = 1, "A4.1" = 2 }
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from isel_twin.base.parameters import Limits, Place, boolean, check, flag, known, number, plain, table, text, word
from isel_twin.cam.toolpath import Point

_MM = Limits("mm", -1e5, 1e5)
# unit, digits before and behind the point, the zeros that are written; each may be left out
DRILL_FORMAT = re.compile(r"\s*(inch|mm)?\s*(?:\b([1-9]):([0-9])\b)?\s*(LZ|TZ)?\s*", re.I | re.A)
_OUTPUT = Limits("", 0, 65_535, whole=True)
FEED_UNITS: Mapping[str, float] = {"mm/min": 60.0, "mm/s": 1.0, "um/s": 1000.0}  # in 1 mm/s


def _read_point(value: Any, place: Place) -> Point:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise place.wrong(f"{value!r}; allowed: three numbers [x, y, z], mm")
    x, y, z = (plain(each, _MM, place) for each in value)
    return x, y, z


def _by_number(limits: Limits | None, least: int, most: int) -> Callable[[Any, Place], dict[int, Any]]:
    def read(value: Any, place: Place) -> dict[int, Any]:
        found = {}
        for key, each in _entries(value, place):
            name = str(key)
            if not (name.isascii() and name.isdigit() and len(name) < 9 and least <= int(name) <= most):
                raise place.at(name).wrong(f"is no number; allowed: {least} .. {most}")
            where = place.at(name)
            found[int(name)] = _read_point(each, where) if limits is None else plain(each, limits, where)
        return found

    return read


def _read_outputs(value: Any, place: Place) -> dict[str, int]:
    return {str(key): _whole(each, _OUTPUT, place.at(str(key))) for key, each in _entries(value, place)}


def _entries(value: Any, place: Place) -> list[tuple[Any, Any]]:
    return list(value.items()) if isinstance(value, Mapping) else list(table(value, place).items())


def _whole(value: Any, limits: Limits, place: Place) -> int:
    given = plain(value, limits, place)
    if given != int(given):
        raise place.wrong(f"{value}; allowed: a whole number")
    return int(given)


def _read_sign(value: Any, place: Place) -> int:
    if isinstance(value, bool) or value not in (1, -1):
        raise place.wrong(f"{value!r}; allowed: 1, -1")
    return int(value)


def _read_drill_format(value: Any, place: Place) -> str:
    if not isinstance(value, str) or not DRILL_FORMAT.fullmatch(value):
        raise place.wrong(f'{value!r}; allowed: as much as is needed of "inch 2:4 LZ", "mm 3:3 TZ"')
    return value


_READ: Mapping[str, Callable[[Any, Place], Any]] = {
    **dict.fromkeys(("zero", "start", "park", "tool_change"), _read_point),
    "zeros": _by_number(None, 1, 9),
    "z_sign": _read_sign,
    "tool_length_mm": _by_number(Limits("mm", -1e3, 1e3), 0, 1_000_000),
    "pen_depth_mm": _by_number(Limits("mm", 0.0, 1e3), 0, 1000),
    "outputs": _read_outputs,
    "depth_mm": lambda value, place: plain(value, Limits("mm", 0.0, 1e3), place),
    "drill_format": _read_drill_format,
}


@dataclass(frozen=True)
class CamSettings:
    """Settings for reading and making job files on this machine. Raises ValueError for values that are not possible.

    Heights of HPGL and of drill files are of the workpiece, Z upwards; all other points are of the machine.
    """

    format: str = word(default="")  # of all files, whatever they look like; "": by their content
    zero: Point = (0.0, 0.0, 0.0)  # of the workpiece: mm in the sense of the counters, as the operator reads them
    zeros: Mapping[int, Point] = field(default_factory=dict)
    # of G54 .. G59.3 (1 .. 9), WPREG1ACT .. 8; G54 without one: zero; others are refused (cam/13)
    z_sign: int = -1  # 1: the counter of Z grows upwards; -1: downwards
    file_z_up: bool = flag(True)  # False: files in which a cut is positive
    tool_length_mm: Mapping[int, float] = field(default_factory=dict)
    start: Point = (0.0, 0.0, 0.0)  # counters' sense, mm: where the tool stands before the job
    park: Point | None = None  # counters' sense, mm: where it goes at the end (Z first); None: it stays
    tool_change: Point | None = None  # as park, for the change of a tool
    rapid_mm_s: float = number("mm/s", 0.001, 1e4, default=40.0)
    feed_mm_s: float = number("mm/s", 0.0, 1e4, default=0.0)  # for files that cut before they give a feed; 0: refused
    feed_unit: str = word("", *FEED_UNITS, default="")
    # of F, VEL, ..; "": of the format: G-code mm/min (inch/min in inch), WinPC-NC mm/s, NCP um/s
    plunge_mm_s: float = number("mm/s", 0.001, 1e4, default=5.0)  # HPGL, drill files: into the work
    safe_mm: float = number("mm", 0.0, 1e3, default=5.0)  # the same: height of the raised tool above the work
    depth_mm: float | None = None  # the same: of the lowered tool below its surface; None: as usual in the format
    pen_depth_mm: Mapping[int, float] = field(default_factory=dict)  # the same, by its number
    drill_format: str = ""  # of numbers in drill files, whatever they say: "mm 3:3 TZ"
    tolerance_mm: float = number("mm", 1e-4, 10.0, default=0.01)  # chords leave an arc by at most this
    following_mm: float = number("mm", 0.0, 10.0, default=0.02)
    # by which drives that follow may round corners and arcs of cuts; 0: as they do by themselves
    reversal_mm: float = number("mm", 0.0, 10.0, default=0.0)
    # by which an arc may leave a drive that friction holds where it turns round; 0: as it does by itself
    spindle_max_rpm: float = number("1/min", 0.0, 1e6, default=0.0)  # at 10 V; 0: as the machine file has it
    peck_clearance_mm: float = number("mm", 0.0, 100.0, default=0.25)  # NCP, C2: above the last depth
    optional_stop: bool = flag(True)  # M1 stops
    block_delete: bool = flag(False)  # lines that begin with / are left out
    dialect: str = word("", "rs274", "din", "winpc", default="")
    # of G-code; din: as DIN 66025; winpc: as WinPC-NC, with I J K as offsets and feeds in mm/s; "": by the file
    strict: bool = flag(False)  # what rs274 of LinuxCNC refuses is refused
    outputs: Mapping[str, int] = field(default_factory=dict)
    # the controller's output bit of spindle, coolant, A4.1, ..

    def __post_init__(self) -> None:
        check(self)
        for name, read in _READ.items():
            if (value := getattr(self, name)) is not None:
                read(value, Place("camsettings", key=name))

    @property
    def din(self) -> bool:
        """G-code of DIN 66025, in any dialect of it."""
        return self.dialect in ("din", "winpc")

    def per_mm_s(self, usual: float) -> float:
        """A feed of 1 mm/s as files have it, `usual` in their format."""
        return FEED_UNITS.get(self.feed_unit, usual)

    def depth_of(self, tool: int, usual_mm: float) -> float:
        """The depth of a lowered tool, in a format in which usual_mm is usual."""
        return self.pen_depth_mm.get(tool, usual_mm if self.depth_mm is None else self.depth_mm)

    def machine_point(self, counters_mm: Point) -> Point:
        """A point in the sense of the counters as a point of the machine, Z upwards."""
        x, y, z = counters_mm
        return x, y, self.z_sign * z


def read_cam(content: Any, place: Place) -> CamSettings:
    """The settings of a [cam] table. Raises the place's FileError, one line, for anything wrong in it."""
    fields = {item.name: item for item in dataclasses.fields(CamSettings)}
    given = table(content, place)
    known(given, tuple(fields), place)
    return CamSettings(**{key: _value(fields[key], value, place.at(key)) for key, value in given.items()})


def _value(item: dataclasses.Field[Any], value: Any, place: Place) -> Any:
    if (read := _READ.get(item.name)) is not None:
        return read(value, place)
    rule = item.metadata["rule"]
    if isinstance(rule, Limits):
        return plain(value, rule, place)
    return boolean(value, place) if rule is bool else text(value, place, rule)
