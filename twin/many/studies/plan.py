"""Plans of sweeps: constants, parameters and repetitions, in a TOML file that is checked when it is read.

    [sweep]                          # constants
    job = "pocket.txt"               # or moves = [[60, 0, 0], [0, 0, 0]], targets in mm after a reference run
    format = "gcode"                 # of the job, whatever it looks like: ncp, gcode, hpgl, excellon
    zero = "fit"                     # of the work, as --zero has it: [100, 80, 60], or one that fits
    scenario = "stuck.toml"
    seeds = 20                       # 0 .. 19, or a list of them
    samples = 64                     # of the parameters with a range

    [machine]                        # parameters: keys of `isel-twin describe`, with their unit, or as multiples
    payload.mass = { values = [0, 4, 8], unit = "kg" }
    axes.all.guide_friction = { low = 0.8, high = 1.5, unit = "times" }

    [settings]                       # of a job of moves: speed_hz, acceleration_hz_per_ms, start_stop_hz
    speed_hz = { low = 5000, high = 20000, steps = 4 }

    [job]                            # of a job file: {speed} in it, or a whole line
    speed = [5000, 10000, 20000]
    "line 4" = ["@0J100", "@0J400"]

    [scenario]                       # of the scenario: EVENT.KEY, by name or number; and which events happen
    jam.friction_n.x = { low = 0, high = 400 }
    events = ["", "jam", "jam stick"]

A parameter is one of

    values = [...]                   each of them; short form: the list alone
    low, high, steps                 this many values, evenly spaced
    low, high                        sampled between the two

with `unit`, `name` (its column in the table), `log = true` (logarithmic) and `whole = true` (whole numbers). Values and
steps make a grid; each of its points has all samples, and each sample all seeds (points.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import FileError, Limits, Place, known, plain, read_toml, table, text
from isel_twin.base.toml_lines import read_lines
from isel_twin.cam.fitting import FIT
from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import PLANTS
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.checks.settings import switch_names
from isel_twin.jobs.job import JobError
from isel_twin.jobs.project import cam, find
from isel_twin.jobs.toolpaths import AS_IT_LOOKS, Reading, Source, own_text, source_of
from isel_twin.language import create_language
from isel_twin.machine import load_machine
from isel_twin.many.studies import parameters as varying
from isel_twin.many.studies.parameters import Parameter, checked_number
from isel_twin.many.studies.row import UNCERTAIN, Work
from isel_twin.version import VERSION

SECTIONS = ("machine", "settings", "job", "scenario")  # sections of parameters in a plan
MOST_POINTS = 1_000_000  # most rows of a table

_WORDS = ("machine", "controller", "plant", "scenario", "job", "format")
_NUMBERS: Mapping[str, Limits] = {
    "samples": Limits("samples", 1, 1 << 20, whole=True),
    "sample_seed": Limits("", 0, 2**63, whole=True),
    "timeout_s": Limits("s", 0.0, 1e9),
    "margin": Limits("", 0.0, 1.0),
    "deviation_mm": Limits("mm", 0.0, 1e5),
    "cycle_s": Limits("s", 0.0, 1e9),
}
_OTHERS = ("zero", "moves", "seeds", "start_mm", "may_strike", "perturbed", "sampling")
KEYS = (*_WORDS, *_NUMBERS, *_OTHERS)
SAMPLINGS = ("sobol", "saltelli")
_SEED = Limits("", 0, 2**63, whole=True)
_SEEDS = Limits("seeds", 1, 1_000_000, whole=True)


class PlanError(FileError):
    """A plan is wrong; the message is one line that names file, line, key and what is allowed."""


@dataclass(frozen=True)
class Plan:
    file: Path
    text: str
    call: TwinSpec  # the twin of all rows without the parameters; its scenario is the file itself
    work: Work
    parameters: tuple[Parameter, ...] = ()
    samples: int = 1
    sampling: str = "sobol"
    sample_seed: int = 0
    seeds: tuple[int, ...] = (0,)
    source: Source | None = None  # what the job's file was, if it is one of a CAM program


def load_plan(path: str | Path, reading: Reading = AS_IT_LOOKS) -> Plan:
    """Read a plan and its job, machine and scenario, with paths relative to the plan. reading: of the job, before what
    the plan says. Raises PlanError, JobError or MachineError for anything wrong in them, and OSError for a file that
    cannot be read."""
    file = Path(path)
    document, place = read_lines(file, PlanError)
    known(document, ("sweep", *SECTIONS), place)
    same = table(document.get("sweep", {}), place.at("sweep"))
    call, work, source = _same(same, place.at("sweep"), file.parent, reading)
    machine = call.as_built
    parameters = tuple(
        varying.read_parameter(section, key, form, place.at(section).at(key), work, machine)
        for section in SECTIONS
        for key, form in varying.flat(table(document.get(section, {}), place.at(section)), place.at(section))
    )
    varying.check_names(parameters, place)
    varying.check_events(parameters, work, place)
    samples, sampled = same.get("samples"), [parameter for parameter in parameters if parameter.sampled]
    sweep = place.at("sweep")
    where = sweep.at("samples")
    if samples is not None and not sampled:
        raise where.wrong("no parameter has a range; allowed: beside one with low and high, without steps")
    if "sampling" in same and not sampled:
        raise sweep.at("sampling").wrong("no parameter has a range; allowed: beside one without steps")
    if samples is None and sampled:
        one = sampled[0]
        at = place.at(one.section).at(one.key)
        raise at.wrong("a range is sampled; allowed: beside samples in [sweep], or with steps")
    if samples is not None and samples & (samples - 1):
        raise where.wrong(f"{samples}; allowed: a power of two, such as {1 << samples.bit_length()}")
    seeds = _seeds(same.get("seeds", 1), sweep.at("seeds"))
    number = len(seeds) * (samples or 1) * (len(sampled) + 2 if same.get("sampling") == "saltelli" else 1)
    number *= math.prod(len(parameter.values) or 1 for parameter in parameters)
    if number > MOST_POINTS:
        raise sweep.wrong(f"{number} points; allowed: up to {MOST_POINTS}")
    return Plan(
        file=file,
        text=place.text,
        call=call,
        work=replace(work, parameters=tuple((p.section, p.key, p.unit) for p in parameters)),
        parameters=parameters,
        samples=samples or 1,
        sampling=text(same.get("sampling", "sobol"), sweep.at("sampling"), SAMPLINGS),
        sample_seed=int(same.get("sample_seed", 0)),
        seeds=seeds,
        source=source,
    )


def _same(
    content: Mapping[str, Any], place: Place, folder: Path, reading: Reading
) -> tuple[TwinSpec, Work, Source | None]:
    known(content, KEYS, place)
    for key in _WORDS:
        text(content.get(key, ""), place.at(key))
    for key, limits in _NUMBERS.items():
        if key in content:
            checked_number(content[key], limits, place.at(key))
    if "plant" in content:
        text(content["plant"], place.at("plant"), PLANTS)
    if ("job" in content) == ("moves" in content):
        raise place.at("job").wrong(
            "there are moves, too; allowed: one of the two"
            if "job" in content
            else "missing; allowed: a file of commands, or moves = [[X, Y, Z], ...] in mm"
        )
    for key in ("job", "scenario"):
        if key in content and (folder / content[key]).is_fifo():
            raise place.at(key).wrong(f"{content[key]!r} is a pipe, which can be read only once; save it to a file")
    perturbed = content.get("perturbed", False)
    if perturbed != UNCERTAIN and not isinstance(perturbed, bool):
        raise place.at("perturbed").wrong(f"{perturbed!r}; allowed: true, false, {UNCERTAIN!r}")
    may_strike = switch_names(content.get("may_strike", []), place.at("may_strike"))
    called = content.get("machine", "4030")
    if (folder / called).is_dir():
        called = str((folder / called).resolve())
    machine = load_machine(called)
    start_mm = _triple(content["start_mm"], place.at("start_mm")) if "start_mm" in content else None
    scenario = folder / content["scenario"] if "scenario" in content else None
    named = {key: content[key] for key in ("controller", "plant") if key in content}
    call = TwinSpec(machine=called, scenario=scenario, start_mm=start_mm, **named)
    bounded = ("margin", "deviation_mm", "cycle_s", "timeout_s")
    bounds: dict[str, Any] = {key: float(content[key]) for key in bounded if key in content}
    moves = content.get("moves", [])
    if not isinstance(moves, list) or ("moves" in content and not moves):
        raise place.at("moves").wrong(f"{moves!r}; allowed: a list of targets [X, Y, Z] in mm")
    zero = content.get("zero")
    if zero is not None and zero != FIT:
        zero = _triple(zero, place.at("zero"))
    asked = Reading(reading.form or content.get("format"), zero if reading.zero is None else reading.zero)
    job, source = _job(folder / content["job"], call, asked) if "job" in content else ("", None)
    work = Work(
        version=VERSION,
        job_name=content.get("job", "moves"),
        job=job,
        moves=tuple(_triple(target, place.at("moves")) for target in moves),
        spec=call.with_(scenario=None),
        machine_digest=machine.digest,
        events=() if scenario is None else tuple(_events(scenario)),
        perturbed=perturbed,
        bounds=Bounds(may_strike=may_strike, **bounds),
    )
    return call, work, source


def _job(file: Path, call: TwinSpec, reading: Reading) -> tuple[str, Source | None]:
    """The text of a job, or what a file of a CAM program becomes for the controller."""
    try:
        data, language = file.read_bytes(), create_language(call.controller)
        settings = cam(find(file), call.as_built)
        source = source_of(data, file.suffix, language, call.controller, call.fitted, settings, reading)
        if source is None:
            return own_text(data, language, call.controller), None
        return source.text, source
    except JobError as error:
        raise JobError(f"{file}: {error}") from None


def _events(file: Path) -> list[dict[str, Any]]:
    """The tables of a scenario file, unchecked: a twin checks them."""
    place = Place(file, PlanError)
    tables = read_toml(place).get("event", [])
    return [dict(entry) for entry in tables if isinstance(entry, dict)] if isinstance(tables, list) else []


def _triple(value: Any, place: Place) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != len(CARRIAGES):
        raise place.wrong(f"{value!r}; allowed: three numbers, X, Y and Z in mm")
    x, y, z = (plain(number, Limits("mm", -1e4, 1e4), place) for number in value)
    return x, y, z


def _seeds(value: Any, place: Place) -> tuple[int, ...]:
    if not isinstance(value, list):
        return tuple(range(int(checked_number(value, _SEEDS, place))))
    seeds = tuple(int(checked_number(seed, _SEED, place)) for seed in value)
    if not seeds or len(set(seeds)) < len(seeds):
        raise place.wrong(f"{value!r}; allowed: how many, or a list of different ones")
    return seeds
