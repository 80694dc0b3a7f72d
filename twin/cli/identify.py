"""`isel-twin identify`: machine parameters from recordings and measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options
from isel_twin.cli.outputs import counted, say, say_json
from isel_twin.core.spec import MACHINE

if TYPE_CHECKING:
    from isel_twin.machine import Machine
    from isel_twin.many.identification.fit import Fit, Prospect
    from isel_twin.many.identification.measured import Measured
    from isel_twin.many.identification.sealed import Day
    from isel_twin.many.identification.session import Session
    from isel_twin.many.identification.unknowns import Unknown

Names = Annotated[
    list[str] | None,
    Parameter(
        help="Parameters, with commas: friction.x, backlash.x, stiffness.x, supply, mass, or keys of `describe`."
    ),
]
Priors = Annotated[list[str] | None, Parameter(help="NAME=LOW..HIGH, 95 % of what is believed. May be repeated.")]
MeasuredFiles = Annotated[list[Path] | None, Parameter(help="What was measured (TOML, CSV). May be repeated.")]


def identify(
    *recordings: Annotated[Path, Parameter(help="Recordings of the machine: of `tap`, or of --record NAME.mcap.")],
    measured: MeasuredFiles = None,
    machine: options.MachineName = MACHINE,
    set: options.Overrides = (),
    controller: Annotated[str, Parameter(help="Which one it has, if a recording does not say.")] = "",
    fit: Names = None,
    prior: Priors = None,
    hold_out: Annotated[
        list[str] | None,
        Parameter(
            help="NAME of a recording, or how many of the last, not fitted but predicted. Default: the last one."
        ),
    ] = None,
    patch: Annotated[Path | None, options.written("Folder for a machine.toml with what was found.")] = None,
    report: Annotated[Path | None, options.written("A page about it (HTML).", *options.PAGE, bare=True)] = None,
    score: Annotated[
        Path | None,
        Parameter(help="A filled form of a measuring day: predicted, measured, E_n. Needs no recordings."),
    ] = None,
    journal: Annotated[
        Path | None, options.written("Keeps each replay, so that the same call goes on after it was ended.")
    ] = None,
    workers: options.Workers = 1,
    json: Annotated[bool, Parameter(help="One JSON object.")] = False,
) -> int:
    """Fit parameters of a machine to recordings and measurements.

    Shows before the fit which parameters the data cannot identify. Recordings that are held out are only predicted: if
    the fit predicts them worse than the machine file, nothing is written and the exit code is 1. With --score a
    measuring day (`isel-twin experiment --protocol`) is compared with what was predicted of it, and the exit code is 1
    if it differs. See docs/identification.md.
    """
    with call_errors():
        need_scipy()
    options.check_workers(workers)
    target = None if patch is None else patch / "machine.toml"
    if patch is not None and patch.exists() and not patch.is_dir():
        raise CallError(f"{patch}: is a file; name a folder for the machine")
    options.check_writable(report, journal, kept=(*recordings, *(measured or ()), *([score] if score else [])))
    from isel_twin.base.files import atomic_write
    from isel_twin.machine import load_machine, with_overrides
    from isel_twin.many.identification.fit import fit as fit_sessions
    from isel_twin.many.identification.patch import as_json, based_on
    from isel_twin.many.identification.patch import patch as as_patch

    day = None if score is None else _scored(score)
    if day is not None and not recordings:
        if measured or patch or report:
            raise CallError("score: without recordings nothing is fitted; name them, or leave --measured, --patch away")
        return _say_day(day, json)
    with call_errors():
        known = with_overrides(load_machine(machine), options.parse_overrides(set))
    base = "" if patch is None else based_on(machine, known, patch.resolve())
    told = read_all([*(measured or ()), *([score] if score and score not in (measured or ()) else [])])
    sessions = _sessions(recordings, told, controller, known)
    unknowns = unknowns_of(known, fit, prior, told.axes)
    fitted, held = _split(sessions, hold_out)
    names, held_names = [one.name for one in fitted], [one.name for one in held]

    with call_errors(journal), options.crew_of(workers) as crew, counted("replays") as tell:
        result = fit_sessions(
            known,
            unknowns,
            fitted,
            held,
            crew=crew,
            told=None if json else _say_prospect,
            progress=tell,
            journal=journal,
            gate=patch is not None,
        )
    if report is not None:
        from isel_twin.many.identification.page import page

        with call_errors(report):
            atomic_write(report, page(f"{known.name} identified", result, names, held_names, day).encode())
    if json:
        say_json({**as_json(result, names, held_names), **_day_json(day)})
    else:
        _print(result)
    for line in result.doubts:
        say(line)
    code = 0 if day is None else _say_day(day, json, alone=False)
    if result.worse:
        what = f"{result.after['all']:.2f} instead of {result.before['all']:.2f} standard deviations"
        say(f"refused: the fit predicts {', '.join(held_names)} worse than before, {what}")
        return 1
    if patch is not None and target is not None:
        name = sessions[0].controller
        with call_errors(target):
            patch.mkdir(parents=True, exist_ok=True)
            content = as_patch(result, known, base, patch.resolve().name, name, names, held_names)
            atomic_write(target, content.encode())
            load_machine(patch)
    return code


def _say_prospect(prospect: Prospect) -> None:
    print("before the fit:", *prospect.lines, sep="\n  ", flush=True)


def _scored(file: Path) -> Day:
    from isel_twin.many.identification.sealed import score

    with call_errors(file):
        return score(file)


def _day_json(day: Day | None) -> dict[str, Any]:
    from isel_twin.many.identification.sealed import as_json

    return {} if day is None else {"score": as_json(day)}


def _say_day(day: Day, json: bool, alone: bool = True) -> int:
    """The table of a measuring day; exit code 1 if it does not hold."""
    if not json:
        print(f"\n{'':<44} {'predicted':>10}  {'band':<22} {'measured':>10} {'E_n':>6}  verdict")
        for one in day.scores:
            said, there = one.predicted, f"{one.measured:.4g}" if one.verdict != "not measured" else ""
            e_n = f"{one.e_n:+.2f}" if there else ""
            name, band = f"{said.what}, {said.unit}", f"{said.low:.4g} .. {said.high:.4g}"
            print(f"{name:<44} {said.value:>10.4g}  {band:<22} {there:>10} {e_n:>6}  {one.verdict}")
        print(day.in_words())
        print(f"sealed: {day.seal}")
    elif alone:
        say_json(_day_json(day))
    return 0 if day.holds else 1


def need_scipy() -> None:
    """Raise ValueError, of one line, without SciPy."""
    from importlib.util import find_spec

    if find_spec("scipy") is None:
        raise ValueError("identification needs SciPy: pip install 'isel-twin[tune]'")


def read_all(files: Sequence[Path] | None) -> Measured:
    """The measurements of all files. Raises CallError."""
    from isel_twin.many.identification.measured import read_measured

    total: Measured | None = None
    for file in files or ():
        with call_errors(file):
            one = read_measured(file)
        total = one if total is None else total + one
    if total is None:
        why = "name at least one file of measurements; `isel-twin experiment` makes one"
        raise CallError(f"measured: {why}", option=True)
    if total.unread:
        say(f"{'1 entry is' if total.unread == 1 else f'{total.unread} entries are'} not filled in (nan) and left out")
    return total


def unknowns_of(
    machine: Machine, fit: Sequence[str] | None, prior: Sequence[str] | None, axes: Sequence[str]
) -> list[Unknown]:
    """The parameters that a call names, or the default ones. Raises CallError."""
    from isel_twin.many.identification.unknowns import default_names, parse_prior, unknown

    with call_errors():
        spans = {name: (low, high) for name, low, high in map(parse_prior, prior or ())}
        wanted = [name.strip() for names in fit or () for name in names.split(",") if name.strip()]
        names = list(dict.fromkeys(wanted or [*default_names(axes, machine), *spans]))
        if missing := [name for name in spans if name not in names]:
            raise CallError(f"prior {missing[0]}: is not fitted; add it to --fit", option=True)
        found = [unknown(machine, name, spans.get(name)) for name in names]
        for item in found:
            low, high = spans.get(item.name, (item.prior, item.prior))
            if low < item.least or high > item.most:
                allowed = f"{item.least:g} .. {item.most:g} {item.unit}".removesuffix(" 1")
                raise ValueError(f"prior {item.name}: {low:g} .. {high:g}; allowed: within {allowed}")
        return found


def _sessions(recordings: Sequence[Path], told: Measured, controller: str, machine: Machine) -> list[Session]:
    from isel_twin.many.identification.session import session_of, stand_alone
    from isel_twin.many.identification.trajectory import with_trajectories
    from isel_twin.recordings.reading import read

    if not recordings:
        raise CallError("name the recordings: isel-twin identify RECORDING... --measured FILE")
    found = []
    for path in recordings:
        with call_errors(path):
            recorded = read(path)
            found.append(with_trajectories(session_of(recorded, told, controller, machine), recorded))
    names = [session.name for session in found]
    if twice := [name for name in names if names.count(name) > 1]:
        raise CallError(f"{twice[0]}: two recordings have this name; measurements could belong to either")
    alone = [stand_alone(name, told, found[0].controller) for name in told.names if name not in names]
    if lost := [one.name for one in alone if one.measured.readings or one.measured.acts]:
        raise CallError(f"{lost[0]}: something was measured in this recording, and it is not among those named")
    return [*found, *(one for one in alone if one.data)]


def _split(sessions: Sequence[Session], hold_out: Sequence[str] | None) -> tuple[list[Session], list[Session]]:
    """The sessions to fit and those only to predict. Raises CallError."""
    names = [session.name for session in sessions]
    wanted = list(hold_out) if hold_out else ["1" if len(sessions) > 1 else "0"]
    if wanted == ["1"] and len(sessions) == 1:
        why = "there is one recording, and it has to be fitted; --hold-out 0 goes without"
        raise CallError(f"hold-out 1: {why}", option=True)
    held: set[str] = set()
    for name in wanted:
        stem = Path(name).stem if name.endswith(".mcap") else name
        if stem in names:
            held.add(stem)
        elif name.isdigit() and int(name) < len(sessions):
            held |= set(names[len(names) - int(name) :])
        else:
            known = f"{', '.join(names)}, or a number below {len(names)}"
            raise CallError(f"hold-out {name!r}: no such recording; allowed: {known}", option=True)
    if held == set(names):
        raise CallError("hold-out: nothing is left to be fitted", option=True)
    return [one for one in sessions if one.name not in held], [one for one in sessions if one.name in held]


def _print(result: Fit) -> None:
    print()
    told = [(one.unknown.name, one) for one in result.estimates] + [
        (f"+ {one.unknown.name}", one) for one in result.beside
    ]
    width = max(18, *(len(name) for name, _ in told))
    print(
        f"{'parameter':<{width}} {'value':>10}  {'95 % interval':<24} {'unit':<5} {'prior range':<20} {'of prior':>8}"
    )
    for name, one in told:
        item = one.unknown
        span, before = f"{one.low:.4g} .. {one.high:.4g}", f"{item.low:.4g} .. {item.high:.4g}"
        line = f"{name:<{width}} {one.value:>10.4g}  {span:<24} {item.unit:<5} {before:<20} {one.remaining:>8.0%}"
        note = "measured" if result.before and result.measured(one) else one.note or "fitted"
        print(f"{line}  {note}")
    if result.beside:
        print("+: not asked for, fitted beside the others within what is known of it")
    names = [one.unknown.name for one in result.estimates]
    for noise in result.noise:
        print(f"noise: {noise.line}")
    pairs = [
        f"{names[i]} and {names[j]} {result.correlation[i, j]:+.2f}"
        for i in range(len(names))
        for j in range(i)
        if abs(result.correlation[i, j]) >= 0.5
    ]
    if pairs:
        print(f"correlated: {', '.join(pairs)}")
    print(f"\nfitted:   {_told(result.fitted_before, result.fitted_after)}")
    if result.before:
        times = f"{result.times:.1f} times better" if not result.worse else "worse"
        print(f"held out: {_told(result.before, result.after)}: {times}")
    else:
        print("held out: nothing, so no number is measured")
    print(f"chi-square per degree of freedom, {', '.join(one.short for one in result.kinds)}")


def _told(before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """Root mean squares in standard deviations of the data, for all and by kind."""
    kinds = ", ".join(f"{kind} {before[kind]:.2f} -> {after[kind]:.2f}" for kind in before if kind != "all")
    return f"rms {before['all']:.2f} -> {after['all']:.2f} standard deviations ({kinds})"
