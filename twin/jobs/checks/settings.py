"""Bounds of a project for its jobs: the file isel-twin.toml, searched from the folder of a job upwards.

    [check]                          # for every job below this folder; all of it may be left out
    machine = "machines/mine"        # paths relative to this file
    controller = "imc-s8"
    plant = "mujoco"
    seed = 0
    set.payload.mass = 8             # parameters of the machine
    scenario = "hood.toml"
    margin = 0.2                     # least pull-out margin of each motor
    edge = 1.2                       # least factor on the speed of each motor until it swings (docs/fidelity.md)
    deviation_mm = 0.05              # most difference between counter and true position
    contour_mm = 0.05                # most distance of the carriages from what a file of a CAM program cuts
    cycle_s = 60.0                   # most time from the first command to the end of the last one
    clearance = 2.0                  # least distance of what must not meet, mm
    spindle = true                   # the spindle turns in every cut (the default); false: switched by hand, or none
    rapid = true                     # no rapid, no change of a tool in stock (the default)
    may_strike = ["limit_x1"]        # end switches that may be struck outside a reference run; ["all"]
    golden = true                    # compare a job with its golden run, if it has one (the default)
    robust = 20                      # repetitions on other machines of the kind
    uncertain = 20                   # and on what this machine may be, as far as its numbers are known
    timeout_s = 600.0                # of each command
    line_speed = 19200               # baud: bytes take their time on the line, which cycle_s judges, too
    adapter_ms = 16                  # and replies wait for the timer of a USB adapter
    strict = true                    # warnings make a job fail, too: cautions of a CAM file, moves that crawl
    jobs = ["jobs", "tests/*.nc"]    # what `isel-twin check` alone takes: files, folders, patterns; from this file

    [[fixture]]                      # clamped on the table, for every job below this folder
    name = "vise"                    # (isel_twin.machine.fixture); `run`, `golden` and `tune` see it, too
    shape = "box"
    size_mm = [100, 20, 40]
    at_mm = [197.5, 120, 0]

    [cam]                            # how files of CAM programs are made; isel_twin.cam.settings has its keys
    zero = [100, 80, 60]

    [[check.job]]                    # for some jobs, in the order of the file; the last match wins
    match = "pocket*.txt"            # path relative to this file, with * and ?
    cycle_s = 40.0
    margin = "off"                   # no bound for these

Options of the command line win over all of them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from isel_twin.base.errors import CallError
from isel_twin.base.parameters import Limits, Place, boolean, known, plain, table, text
from isel_twin.base.toml_lines import read_lines
from isel_twin.cam.section import WHOLE
from isel_twin.controller import controller_names
from isel_twin.core.assembly import PLANTS
from isel_twin.core.spec import BAUD, MOST_ADAPTER_MS, TwinSpec
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.project import SettingsError, fixtures
from isel_twin.jobs.robust import MOST_REPETITIONS
from isel_twin.jobs.sending import MOST_EDGE
from isel_twin.jobs.toolpaths import AS_IT_LOOKS, Reading
from isel_twin.machine import Fixture, Machine, machine_names
from isel_twin.plant import MOST_CLEARANCE_MM

_NUMBERS: Mapping[str, Limits] = {
    "seed": Limits("", 0, 2**63, whole=True),
    "margin": Limits("", 0.0, 1.0),
    "edge": Limits("", 0.0, MOST_EDGE),
    "deviation_mm": Limits("mm", 0.0, 1e5),
    "contour_mm": Limits("mm", 0.0, 1e5),
    "cycle_s": Limits("s", 0.0, 1e9),
    "clearance": Limits("mm", 0.0, MOST_CLEARANCE_MM),
    "robust": Limits("repetitions", 0, MOST_REPETITIONS, whole=True),
    "uncertain": Limits("repetitions", 0, MOST_REPETITIONS, whole=True),
    "timeout_s": Limits("s", 0.0, 1e9),
    "line_speed": Limits("baud", *BAUD, whole=True),
    "adapter_ms": Limits("ms", 0.0, MOST_ADAPTER_MS),
}
_OFF = [item.name for item in dataclasses.fields(Bounds) if item.default is None]  # bounds that may be "off"
_WORDS = ("machine", "controller", "plant", "scenario")
_FLAGS = ("golden", "strict", "spindle", "rapid")
KEYS = (*_WORDS, *_NUMBERS, *_FLAGS, "may_strike", "set")


@dataclass(frozen=True)
class Task:
    """A job with all that its check needs; small enough to be sent to another process."""

    job: Path
    call: TwinSpec = field(default_factory=TwinSpec)
    bounds: Bounds = field(default_factory=Bounds)
    golden: bool = True
    reading: Reading = AS_IT_LOOKS  # a part of the file is compared with no golden run


def load(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """The content of a settings file as pairs of pattern and values, the general one ("*") first. Raises SettingsError
    for anything wrong in it, OSError if it cannot be read."""
    content, place = read_lines(path, SettingsError)
    known(content, ("check", "fixture", "cam"), place)
    section = dict(table(content.get("check", {}), place.at("check")))
    _jobs(section.pop("jobs", []), place.at("check.jobs"))
    jobs = section.pop("job", [])
    if not isinstance(jobs, list):
        raise place.at("check.job").wrong(f"{jobs!r}; it must be written as [[check.job]] tables")
    demands = [("*", _values(section, place.at("check")))]
    for number, entry in enumerate(jobs, 1):
        where = place.at(f"check.job {number}")
        values = dict(table(entry, where))
        if "match" not in values:
            raise where.at("match").wrong('missing; allowed: a path with * and ?, such as "pocket*.txt"')
        pattern = text(values.pop("match"), where.at("match"))
        demands.append((pattern, _values(values, where)))
    return demands


def jobs_of(path: Path) -> list[str]:
    """Files, folders and patterns that a settings file names for a check of all. Raises as `load`."""
    content, place = read_lines(path, SettingsError)
    section = place.at("check")
    return _jobs(table(content.get("check", {}), section).get("jobs", []), section.at("jobs"))


def _jobs(value: Any, place: Place) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(name, str) and name for name in value):
        raise place.wrong(f'{value!r}; allowed: a list of files, folders and patterns, such as ["jobs"]')
    return value


def _values(content: Mapping[str, Any], place: Place) -> dict[str, Any]:
    known(content, KEYS, place)
    return {key: _value(key, value, place.at(key)) for key, value in content.items()}


def _value(key: str, value: Any, place: Place) -> Any:
    if key in _WORDS:
        return _word(key, text(value, place), place)
    if key in _FLAGS:
        return boolean(value, place)
    if key == "set":
        return dict(_flat(table(value, place), ""))
    if key == "may_strike":
        return switch_names(value, place)
    if key in _OFF and value == "off":
        return None
    number = plain(value, _NUMBERS[key], place)
    if not _NUMBERS[key].whole:
        return number
    if number != int(number):
        raise place.wrong(f"{value}; allowed: a whole number")
    return int(number)


def _word(key: str, value: str, place: Place) -> str:
    """A path is as seen from the folder of the file."""
    beside = Path(place.file).resolve().parent / Path(value).expanduser()
    there = {"plant": PLANTS, "controller": controller_names(), "machine": machine_names()}.get(key)
    if key == "scenario" or (key == "machine" and beside.exists()):
        return str(beside)
    if there is not None and value not in there:
        folder = "a folder with a machine.toml, as seen from this file, or " if key == "machine" else ""
        raise place.wrong(f"{value!r}; allowed: {folder}{', '.join(there)}")
    return value


def switch_names(value: Any, place: Place) -> tuple[str, ...]:
    """The value of `may_strike`."""
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise place.wrong(f'{value!r}; allowed: a list of end switches, or ["all"]')
    return tuple(value)


def check_switches(bounds: Bounds, machine: Machine) -> None:
    """Raise CallError for a name in `may_strike` that no end switch of the machine has."""
    names = {switch.name for switch in machine.switches} | {"all"}
    if unknown := sorted(set(bounds.may_strike) - names):
        raise CallError(f"may-strike {unknown[0]}: is no end switch; there are: {', '.join(sorted(names))}")


def _flat(tree: Mapping[str, Any], above: str) -> Iterator[tuple[str, Any]]:
    """All values of a nested table, by keys joined with dots."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def task(job: Path, settings: Path | None, options: Mapping[str, Any]) -> Task:
    """The task of a job from its settings file and options (same keys, None: not given). Raises as `load`."""
    values: dict[str, Any] = {}
    clamped: tuple[Fixture, ...] = ()
    if settings is not None:
        folder, clamped = settings.resolve().parent, fixtures(settings)
        seen = job.resolve()
        name = seen.relative_to(folder).as_posix() if seen.is_relative_to(folder) else seen.as_posix()
        for pattern, demanded in load(settings):
            if fnmatchcase(name, pattern):
                values |= demanded
    overrides = {**values.pop("set", {}), **(options.get("set") or {})}
    values |= {key: value for key, value in options.items() if value is not None and key not in ("set", "reading")}
    if values.get("scenario") is not None:
        values["scenario"] = Path(values["scenario"])
    reading: Reading = options.get("reading", AS_IT_LOOKS)
    golden = values.pop("golden", True) and reading.part == WHOLE
    of_call = {item.name for item in dataclasses.fields(TwinSpec)}
    call = TwinSpec(
        overrides=overrides, fixtures=clamped, **{key: value for key, value in values.items() if key in of_call}
    )
    bounds = Bounds(**{key: value for key, value in values.items() if key not in of_call})
    return Task(job, call, bounds, golden, reading)
