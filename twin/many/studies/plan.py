"""Plans of sweeps: what stays the same, what varies, and how often, in a TOML file that is checked when it is read.

    [sweep]                          # what stays the same
    job = "pocket.txt"               # or moves = [[60, 0, 0], [0, 0, 0]], targets in mm after a reference run
    scenario = "stuck.toml"
    seeds = 20                       # 0 .. 19, or a list of them
    samples = 64                     # of the parameters that have a range

    [machine]                        # what varies: keys of `isel-twin describe`, with their unit, or as multiples
    payload.mass = { values = [0, 4, 8], unit = "kg" }
    axes.all.guide_friction = { low = 0.8, high = 1.5, unit = "times" }

    [settings]                       # of a job of moves: speed_hz, acceleration_hz_per_ms, start_stop_hz
    speed_hz = { low = 5000, high = 20000, steps = 4 }

    [job]                            # of a job file: {speed} in it, or a whole line
    speed = [5000, 10000, 20000]
    "line 4" = ["@0J100", "@0J400"]

    [scenario]                       # of the scenario: EVENT.KEY, by name or number; which events happen
    jam.friction_n.x = { low = 0, high = 400 }
    events = ["", "jam", "jam stick"]

A parameter is one of

    values = [...]                   each of them; a list alone is short for it
    low, high, steps                 so many values, evenly spaced
    low, high                        somewhere between: the samples say where

with `unit`, `name` (its column in the table), `log = true` (evenly by ratio) and `whole = true` (whole numbers). Values
and steps make a grid; each of its points has all samples; each of those has all seeds (points.py).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import FileError, Limits, Place, hint, known, plain, read_toml, rows, table, text
from isel_twin.base.toml_lines import read_lines
from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import PLANTS
from isel_twin.jobs.checks.job import Bounds
from isel_twin.jobs.job import JobError, check_controller, decode_job
from isel_twin.language import SETTINGS_RANGES, create_language
from isel_twin.machine import LEVELS, Machine, load_machine
from isel_twin.many.studies.row import OUTCOMES, Work
from isel_twin.version import VERSION
from isel_twin.wiring import EVENT_KEYS
from isel_twin.wiring.scenario import TIME_KEYS

SECTIONS = ("machine", "settings", "job", "scenario")
"""Of a plan, beside [sweep]: whose parameters vary."""
TIMES = "times"
"""Unit of a value that multiplies what the file has."""
EVENTS = "events"
"""The parameter of [scenario] that says which of the named events happen, with blanks between them."""
MOST_POINTS = 1_000_000
"""Rows of a table at most."""

_WORDS = ("machine", "controller", "plant", "scenario", "job")
_NUMBERS: Mapping[str, Limits] = {
    "samples": Limits("samples", 1, 1 << 20, whole=True),
    "sample_seed": Limits("", 0, 2**63, whole=True),
    "timeout_s": Limits("s", 0.0, 1e9),
    "margin": Limits("", 0.0, 1.0),
    "deviation_mm": Limits("mm", 0.0, 1e5),
    "cycle_s": Limits("s", 0.0, 1e9),
}
_OTHERS = ("moves", "seeds", "start_mm", "may_strike", "perturbed", "sampling")
KEYS = (*_WORDS, *_NUMBERS, *_OTHERS)
"""Of the table [sweep]."""
_FORM = ("values", "low", "high", "steps", "unit", "name", "log", "whole")
"""Keys of a parameter."""
SAMPLINGS = ("sobol", "saltelli")
_STEPS = Limits("steps", 2, 100_000, whole=True)
_ANY = Limits("", -1e300, 1e300)
_SEED = Limits("", 0, 2**63, whole=True)
_SEEDS = Limits("seeds", 1, 1_000_000, whole=True)
_PLACEHOLDER = re.compile(r"[A-Za-z_]\w*")
_COLUMN = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")
_OWN = ("row", "point", "seed", *OUTCOMES)
"""Columns that every table has."""


class PlanError(FileError):
    """A plan is wrong; the message is one line that names file, line, key and what is allowed."""


@dataclass(frozen=True)
class Parameter:
    """Something that varies."""

    section: str
    """One of SECTIONS."""
    key: str
    """Within it."""
    name: str
    """Of its column."""
    unit: str = ""
    """As the file of the machine has it; TIMES: a factor; "": none."""
    values: tuple[Any, ...] = ()
    """All of one kind; none: it is sampled between `low` and `high`."""
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    whole: bool = False

    @property
    def sampled(self) -> bool:
        """It has a range and no values."""
        return not self.values

    @property
    def kind(self) -> str:
        """Of its column: bool, int64, float64 or string."""
        if self.sampled:
            return "int64" if self.whole else "float64"
        if isinstance(self.values[0], str):
            return "string"
        if isinstance(self.values[0], bool):
            return "bool"
        return "int64" if all(isinstance(value, int) for value in self.values) else "float64"


@dataclass(frozen=True)
class Plan:
    """A plan that has been read."""

    file: Path
    text: str
    call: TwinSpec
    """The twin of all rows, but for what varies; its scenario is the file itself."""
    work: Work
    parameters: tuple[Parameter, ...] = ()
    """In the order of the file."""
    samples: int = 1
    sampling: str = "sobol"
    sample_seed: int = 0
    seeds: tuple[int, ...] = (0,)


def load_plan(path: str | Path) -> Plan:
    """Read a plan and what it names: job, machine and scenario, as seen from the folder of the plan.

    Raises PlanError for anything wrong in it, JobError, MachineError for what is wrong with those, and OSError for what
    cannot be read.
    """
    file = Path(path)
    document, place = read_lines(file, PlanError)
    known(document, ("sweep", *SECTIONS), place)
    same = table(document.get("sweep", {}), place.at("sweep"))
    call, work = _same(same, place.at("sweep"), file.parent)
    machine = call.as_built
    parameters = tuple(
        _parameter(section, key, form, place.at(section).at(key), work, machine)
        for section in SECTIONS
        for key, form in _flat(table(document.get(section, {}), place.at(section)), place.at(section))
    )
    _check_names(parameters, place)
    _check_placeholders(parameters, work, place)
    samples, sampled = same.get("samples"), [parameter for parameter in parameters if parameter.sampled]
    where = place.at("sweep").at("samples")
    if samples is not None and not sampled:
        raise where.wrong("no parameter has a range; allowed: beside one with low and high, without steps")
    if "sampling" in same and not sampled:
        raise place.at("sweep").at("sampling").wrong("no parameter has a range; allowed: beside one without steps")
    if samples is None and sampled:
        one = sampled[0]
        raise (
            place.at(one.section)
            .at(one.key)
            .wrong("a range is sampled; allowed: beside samples in [sweep], or with steps")
        )
    if samples is not None and samples & (samples - 1):
        raise where.wrong(f"{samples}; allowed: a power of two, such as {1 << samples.bit_length()}")
    seeds = _seeds(same.get("seeds", 1), place.at("sweep").at("seeds"))
    number = len(seeds) * (samples or 1) * (len(sampled) + 2 if same.get("sampling") == "saltelli" else 1)
    for parameter in parameters:
        number *= len(parameter.values) or 1
    if number > MOST_POINTS:
        raise place.at("sweep").wrong(f"{number} points; allowed: up to {MOST_POINTS}")
    return Plan(
        file=file,
        text=place.text,
        call=call,
        work=replace(work, parameters=tuple((p.section, p.key, p.unit) for p in parameters)),
        parameters=parameters,
        samples=samples or 1,
        sampling=text(same.get("sampling", "sobol"), place.at("sweep").at("sampling"), SAMPLINGS),
        sample_seed=int(same.get("sample_seed", 0)),
        seeds=seeds,
    )


def _same(content: Mapping[str, Any], place: Place, folder: Path) -> tuple[TwinSpec, Work]:
    """What stays the same."""
    known(content, KEYS, place)
    for key in _WORDS:
        text(content.get(key, ""), place.at(key))
    for key, limits in _NUMBERS.items():
        if key in content:
            _number(content[key], limits, place.at(key))
    if "plant" in content:
        text(content["plant"], place.at("plant"), PLANTS)
    if ("job" in content) == ("moves" in content):
        raise place.at("job").wrong(
            "there are moves, too; allowed: one of the two"
            if "job" in content
            else "missing; allowed: a file of commands, or moves = [[X, Y, Z], ...] in mm"
        )
    perturbed = content.get("perturbed", False)
    if not isinstance(perturbed, bool):
        raise place.at("perturbed").wrong(f"{perturbed!r}; allowed: true, false")
    may_strike = content.get("may_strike", [])
    if not isinstance(may_strike, list) or not all(isinstance(name, str) for name in may_strike):
        raise place.at("may_strike").wrong(f'{may_strike!r}; allowed: a list of end switches, or ["all"]')
    named = content.get("machine", "4030")
    called = str((folder / named).resolve()) if (folder / named).is_dir() else named
    machine = load_machine(called)
    start_mm = _triple(content["start_mm"], place.at("start_mm")) if "start_mm" in content else None
    scenario = folder / content["scenario"] if "scenario" in content else None
    call = TwinSpec(
        machine=called,
        controller=content.get("controller", TwinSpec.controller),
        plant=content.get("plant", "mujoco"),
        scenario=scenario,
        start_mm=start_mm,
    )
    bounds: dict[str, Any] = {
        key: float(content[key]) for key in ("margin", "deviation_mm", "cycle_s", "timeout_s") if key in content
    }
    moves = content.get("moves", [])
    if not isinstance(moves, list) or ("moves" in content and not moves):
        raise place.at("moves").wrong(f"{moves!r}; allowed: a list of targets [X, Y, Z] in mm")
    return call, Work(
        version=VERSION,
        job_name=content.get("job", "moves"),
        job=_job(folder / content["job"], call.controller) if "job" in content else "",
        moves=tuple(_triple(target, place.at("moves")) for target in moves),
        spec=call.with_(scenario=None),
        machine_digest=machine.digest,
        events=() if scenario is None else tuple(_events(scenario)),
        perturbed=perturbed,
        bounds=Bounds(may_strike=tuple(may_strike), **bounds),
    )


def _job(file: Path, controller: str) -> str:
    data = file.read_bytes()
    try:
        job = decode_job(data)
        check_controller(job, create_language(controller), controller)
        return job
    except JobError as error:
        raise JobError(f"{file}: {error}") from None


def _events(file: Path) -> list[dict[str, Any]]:
    """The tables of a scenario as they stand in its file; they are checked when a twin reads them."""
    place = Place(file, PlanError)
    tables = read_toml(place).get("event", [])
    return [dict(entry) for entry in tables if isinstance(entry, dict)] if isinstance(tables, list) else []


def _number(value: Any, limits: Limits, place: Place) -> float:
    """A number within limits; a whole one stays one."""
    held = plain(value, limits, place)
    if limits.whole and not isinstance(value, int):
        raise place.wrong(f"{value}; allowed: a whole number")
    return int(value) if limits.whole else held


def _triple(value: Any, place: Place) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != len(CARRIAGES):
        raise place.wrong(f"{value!r}; allowed: three numbers, X, Y and Z in mm")
    x, y, z = (plain(number, Limits("mm", -1e4, 1e4), place) for number in value)
    return x, y, z


def _seeds(value: Any, place: Place) -> tuple[int, ...]:
    if not isinstance(value, list):
        return tuple(range(int(_number(value, _SEEDS, place))))
    seeds = tuple(int(_number(seed, _SEED, place)) for seed in value)
    if not seeds or len(set(seeds)) < len(seeds):
        raise place.wrong(f"{value!r}; allowed: how many, or a list of different ones")
    return seeds


# ---- parameters ------------------------------------------------------------------------------------------------------


def _flat(content: Mapping[str, Any], place: Place, prefix: str = "") -> list[tuple[str, Any]]:
    """Keys with dots and what stands there: `a.b = [1]` and `"a.b" = [1]` are the same. A form has a key of _FORM."""
    found: list[tuple[str, Any]] = []
    for key, value in content.items():
        if isinstance(value, dict) and not any(name in value for name in ("values", "low", "high")):
            if not value or all(not isinstance(inner, dict | list) for inner in value.values()):
                raise place.at(prefix + key).wrong(
                    f"{value!r}; allowed: values = [...], or low and high, with steps or without"
                )
            found += _flat(value, place, f"{prefix}{key}.")
        else:
            found.append((prefix + key, value))
    return found


def _parameter(section: str, key: str, form: Any, place: Place, work: Work, machine: Machine) -> Parameter:
    content = {"values": form} if isinstance(form, list) else form
    if not isinstance(content, dict):
        raise place.wrong(f"{form!r}; allowed: a list of values, or a table such as {{ low = 1, high = 2 }}")
    known(content, _FORM, place)
    unit = text(content.get("unit", ""), place.at("unit"))
    check = {"machine": _machine_key, "settings": _settings_key, "job": _job_key, "scenario": _scenario_key}[section]
    is_number = check(key, unit, place, work, machine)
    name = text(content.get("name", re.sub(r"\W", "_", key)), place.at("name"))
    if not _COLUMN.fullmatch(name):
        raise place.at("name").wrong(f"{name!r}; allowed: a word of letters, digits and _, for the column")
    flags = {}
    for switch in ("log", "whole"):
        flags[switch] = content.get(switch, False)
        if not isinstance(flags[switch], bool):
            raise place.at(switch).wrong(f"{flags[switch]!r}; allowed: true, false")
    if "values" in content:
        for other in ("low", "high", "steps", "log", "whole"):
            if other in content:
                raise place.at(other).wrong("there are values; allowed: either values, or low and high")
        values = _values(content["values"], is_number, place.at("values"))
        return Parameter(section, key, name, unit, values)
    for end in ("low", "high"):
        if end not in content:
            raise place.at(end).wrong("missing; allowed: low and high, or values = [...]")
        if is_number is False:
            raise place.wrong("is no number; allowed: values = [...]")
    low, high = (plain(content[end], _ANY, place.at(end)) for end in ("low", "high"))
    whole = bool(flags["whole"] or section == "settings")
    if not low < high:
        raise place.at("high").wrong(f"{high:g}; allowed: more than low, {low:g}")
    if flags["log"] and low <= 0.0:
        raise place.at("low").wrong(f"{low:g}; allowed with log = true: more than 0")
    if whole and (low != int(low) or high != int(high)):
        raise place.wrong(f"{low:g} .. {high:g}; allowed: whole numbers")
    ranged = Parameter(section, key, name, unit, (), low, high, bool(flags["log"]), whole)
    if "steps" not in content:
        return ranged
    steps = int(_number(content["steps"], _STEPS, place.at("steps")))
    spread = dict.fromkeys(between(ranged, n / (steps - 1)) for n in range(steps))
    return replace(ranged, values=tuple(spread))


def between(parameter: Parameter, part: float) -> float:
    """The value so far from low (0) to high (1) of a range; a whole one each number as often as another."""
    low, high = parameter.low, parameter.high
    value = low * (high / low) ** part if parameter.log else low + part * (high - low)
    value = min(max(value, low), high)
    return round(value) if parameter.whole else value


def _values(value: Any, is_number: bool | None, place: Place) -> tuple[Any, ...]:
    if not isinstance(value, list) or not value:
        raise place.wrong(f"{value!r}; allowed: a list of values")
    kinds = {"numbers": (int, float), "texts": (str,), "switches": (bool,)}
    kind = next(
        (
            name
            for name, types in kinds.items()
            if all(isinstance(one, types) and (isinstance(one, bool) == (name == "switches")) for one in value)
        ),
        None,
    )
    if kind is None or (is_number is not None and is_number != (kind == "numbers")):
        wanted = "numbers" if is_number else "texts or switches" if is_number is False else "all of one kind"
        raise place.wrong(f"{value!r}; allowed: {wanted}")
    for number, one in enumerate(value):
        if one in value[:number]:
            raise place.wrong(f"{one!r} stands twice; allowed: different ones")
    return tuple(value)


def _machine_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    """Check key and unit; whether it takes numbers (None: whatever the values are)."""
    if key == "imperfections":
        _no_unit(unit, place, f"nothing; the values are levels: {', '.join(LEVELS)}")
        return False
    listed = {row.parameter: row for row in rows(machine.tree)}
    for name in [name for name in listed if name.startswith(f"axes.{CARRIAGES[0]}.")]:
        common = name.replace(f"axes.{CARRIAGES[0]}.", "axes.all.", 1)
        if all(name.replace(f"axes.{CARRIAGES[0]}.", f"axes.{axis}.", 1) in listed for axis in CARRIAGES):
            listed[common] = listed[name]
    if key not in listed:
        raise place.wrong(f"unknown parameter of {machine.name}; {hint(key, listed, 'isel-twin describe lists them')}")
    row = listed[key]
    if isinstance(row.value, str | bool):
        _no_unit(unit, place, "none")
        return False
    needed = row.unit not in ("", "1")
    allowed = [f"{row.unit!r}"] if needed else []
    if unit == "" and needed:
        raise place.at("unit").wrong(f'missing; allowed: unit = "{row.unit}", or unit = "{TIMES}" for multiples')
    if unit not in ("", row.unit, TIMES):
        raise place.at("unit").wrong(f"{unit!r}; allowed: {', '.join([*allowed, repr(TIMES)])}")
    return True


def _settings_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    if key not in SETTINGS_RANGES:
        raise place.wrong(f"unknown setting; {hint(key, SETTINGS_RANGES)}")
    if not work.moves:
        raise place.wrong(
            f"a job file says its settings itself; allowed: write {{{key}}} in the job and {key} in [job], or moves"
        )
    _no_unit(unit, place, "none; the key tells it")
    return True


def _job_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    if work.moves:
        raise place.wrong("moves have no text; allowed: parameters of [settings], or job in place of moves")
    _no_unit(unit, place, "none; the command tells it")
    if key.startswith("line "):
        count = len(work.job_lines)
        number = key.removeprefix("line ")
        if not number.isdigit() or not 1 <= int(number) <= count:
            raise place.wrong(f"{work.job_name} has no such line; allowed: line 1 .. line {count}")
        return None
    if not _PLACEHOLDER.fullmatch(key) or f"{{{key}}}" not in work.job:
        there = dict.fromkeys(re.findall(r"\{([A-Za-z_]\w*)\}", work.job))
        raise place.wrong(
            f"{{{key}}} does not stand in {work.job_name}; " + (hint(key, there) if there else 'allowed: "line N"')
        )
    return None


def _scenario_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    if not work.events:
        raise place.wrong("there is no scenario; allowed: beside scenario = FILE in [sweep]")
    if unit not in ("", TIMES):
        raise place.at("unit").wrong(f"{unit!r}; allowed: {TIMES!r}, or none: keys of a scenario tell their unit")
    if key == EVENTS:
        return False
    name, _, rest = key.partition(".")
    names = [str(event["name"]) for event in work.events if "name" in event]
    numbers = [str(number) for number in range(1, len(work.events) + 1)]
    if name not in (*names, *numbers):
        raise place.wrong(f"there is no event {name!r}; {hint(name, [*names, *numbers, EVENTS])}")
    first = rest.partition(".")[0]
    if first not in (*TIME_KEYS, *EVENT_KEYS):
        raise place.wrong(f"unknown key of an event; {hint(first, (*TIME_KEYS, *EVENT_KEYS))}")
    return True if unit == TIMES else None


def _no_unit(unit: str, place: Place, allowed: str) -> None:
    if unit:
        raise place.at("unit").wrong(f"{unit!r}; allowed: {allowed}")


def _check_names(parameters: Sequence[Parameter], place: Place) -> None:
    names: list[str] = []
    for parameter in parameters:
        where = place.at(parameter.section).at(parameter.key)
        if parameter.name in (*names, *_OWN):
            whose = "another parameter" if parameter.name in names else "an outcome"
            raise where.wrong(
                f'the column {parameter.name!r} is that of {whose}; allowed: name = "..." gives it another one'
            )
        names.append(parameter.name)


def _check_placeholders(parameters: Sequence[Parameter], work: Work, place: Place) -> None:
    """Every event that `events` names must be there."""
    names = [str(event["name"]) for event in work.events if "name" in event]
    for parameter in parameters:
        if (parameter.section, parameter.key) != ("scenario", EVENTS):
            continue
        where = place.at("scenario").at(EVENTS)
        if not names:
            raise where.wrong("no event of the scenario has a name; allowed: beside events with name = '...'")
        for value in parameter.values:
            for name in str(value).split():
                if name not in names:
                    raise where.wrong(f"there is no event {name!r}; {hint(name, names)}")
