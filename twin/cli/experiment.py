"""`isel-twin experiment`: the most informative moves for identification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.parameters import parse_json
from isel_twin.cli import options
from isel_twin.cli.identify import Names, Priors, need_scipy, unknowns_of
from isel_twin.cli.options import Whole
from isel_twin.cli.outputs import counted, say_json
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from isel_twin.base.crew import Crew
    from isel_twin.machine import Machine
    from isel_twin.many.identification.choice import Choice
    from isel_twin.many.identification.experiment import Experiment
    from isel_twin.many.identification.measured import Measured
    from isel_twin.many.identification.sealed import Predicted
    from isel_twin.many.identification.unknowns import Unknown

CLOCK_NOISE_S = 0.0005  # standard deviation of what a host's clock adds to an arrival


@Parameter(name="*")
@dataclass(frozen=True)
class StandIn:
    """A twin that carries the experiment out in place of the real machine."""

    carry_out: Annotated[
        str, Parameter(help="A machine whose twin stands in for the real one: writes NAME.mcap and fills in NAME.toml.")
    ] = ""
    carry_out_seed: Annotated[
        Whole, Parameter(help="A number: seed of that twin and of the errors of gauge and clock.")
    ] = 1
    gauge_noise_mm: Annotated[float, Parameter(help="Standard deviation of its gauge, mm.")] = 0.005

    def measured(self, made: Experiment, machine: Machine, controller: str, recording: Path) -> Measured:
        """What this machine's twin has shown; its recording is written."""
        from isel_twin.many.identification.stand_in import carry_out, write_recording

        noise = {"noise_mm": self.gauge_noise_mm, "time_noise_s": CLOCK_NOISE_S}
        recorded, found = carry_out(made, machine, controller, seed=self.carry_out_seed, **noise)
        write_recording(recording, recorded)
        return found


NOBODY = StandIn()


def experiment(
    name: Annotated[Path, Parameter(help="NAME.txt will be the job, NAME.toml the file to fill in.")],
    /,
    *,
    machine: options.MachineName = MACHINE,
    controller: options.ControllerName = TwinSpec.controller,
    set: options.Overrides = (),
    axes: Annotated[str, Parameter(help="Axes to be measured, with commas.")] = "x",
    fit: Names = None,
    prior: Priors = None,
    known: Annotated[Path | None, Parameter(help="JSON of `identify`: what is known already.")] = None,
    blocks: Annotated[Whole, Parameter(help="Number of pieces that the experiment has.")] = 8,
    criterion: Annotated[
        Literal["D", "E"], Parameter(help="D: all parameters together. E: the one least known.")
    ] = "D",
    supply: Annotated[
        list[float] | None, Parameter(help="V of the stages for the stall series, if it can be set. May be repeated.")
    ] = None,
    seed: Annotated[
        Whole, Parameter(help="A number: seed of places, speeds and forces; another one is another experiment.")
    ] = 0,
    stand_in: StandIn = NOBODY,
    protocol: Annotated[
        bool, Parameter(help="A measuring day by ISO 230 with predictions, in place of chosen blocks.")
    ] = False,
    uncertain: Annotated[
        Whole, Parameter(help="Number of machines that this one may be, for the bands of --protocol.")
    ] = 20,
    workers: options.Workers = 1,
    json: options.Json = False,
) -> int:
    """Choose the moves and measurements that tell most about uncertain parameters, and write them as a job.

    NAME.txt is a job for `isel-twin run` or any host; what to measure stands in it as comments. NAME.toml has an entry
    for each measurement, nan until it is filled in. NAME-stall.txt, if there is one, is the series of speeds for stall
    speeds. With --protocol it is a measuring day, and the twin's predictions stand sealed in NAME.toml, for
    `isel-twin identify --score NAME.toml`.
    """
    _check(name, blocks, uncertain)
    if protocol and (fit or prior or known or supply):
        raise CallError("protocol: a measuring day is the same for all; leave --fit, --prior, --known, --supply away")
    options.check_workers(workers)
    job, form = name.with_suffix(".txt"), name.with_suffix(".toml")
    series, recording = name.with_name(f"{name.name}-stall.txt"), name.with_suffix(".mcap")
    options.check_writable(job, form, series, *([recording] if stand_in.carry_out else []))
    from isel_twin.base.axes import CARRIAGES
    from isel_twin.base.files import atomic_write
    from isel_twin.language import create_language, needed
    from isel_twin.machine import load_machine, with_overrides
    from isel_twin.many.identification import experiment as experiments
    from isel_twin.many.identification.choice import choose
    from isel_twin.many.identification.measured import written
    from isel_twin.many.identification.protocol import day

    wanted = [axis.strip() for axis in axes.split(",") if axis.strip()]
    if not wanted or any(axis not in CARRIAGES for axis in wanted):
        raise CallError(f"axes {axes!r}: must be some of {', '.join(CARRIAGES)}, with commas", option=True)
    with call_errors():
        believed = with_overrides(load_machine(machine), options.parse_overrides(set))
        language = needed(create_language(controller), controller)
        real = load_machine(stand_in.carry_out) if stand_in.carry_out else None
    choice = None
    with call_errors(), options.crew_of(workers) as crew:
        if protocol:
            chosen = day(believed, controller, wanted, seed)
        else:
            unknowns = unknowns_of(believed, fit, prior, wanted)
            covariance = None if known is None else _known(known, unknowns)
            candidates = experiments.blocks(believed, controller, wanted, unknowns, seed, supply or ())
            choice = choose(
                believed, controller, candidates, unknowns, blocks, known=covariance, criterion=criterion, crew=crew
            )
            chosen = list(choice.blocks)
        made = experiments.assemble(name.name, chosen, language)
        predicted = _predicted(made, believed, controller, uncertain, seed, crew) if protocol else []
    with call_errors():
        text = experiments.job_text(made, language)
        if series_text := experiments.series_text(made, believed, language):
            atomic_write(series, series_text.encode())
        filled = made.template() if real is None else stand_in.measured(made, real, controller, recording)
        told, seal = written(filled, made.comments()), ""
        if protocol:
            head = {"machine": believed.name, "digest": believed.digest, "controller": controller}
            told, text, seal = _sealed(told, text, {**head, "seed": seed, "uncertain": uncertain}, predicted)
        atomic_write(job, text.encode())
        atomic_write(form, told.encode())
    if choice is None:
        _say_day(job, form, predicted, seal, json)
    else:
        _say_choice(job, form, choice, [item.name for item in unknowns], json)
    return 0


def _check(name: Path, blocks: int, uncertain: int) -> None:
    if name.suffix:
        files = f"{name.stem}.txt and {name.stem}.toml"
        raise CallError(f"{name}: the name of an experiment has no ending; {files} will be made")
    if not 1 <= blocks <= 100:
        raise CallError(f"blocks {blocks}: must be from 1 to 100", option=True)
    if not 2 <= uncertain <= 1000:
        raise CallError(f"uncertain {uncertain}: must be from 2 to 1000", option=True)
    with call_errors():
        need_scipy()


def _predicted(
    made: Experiment, machine: Machine, controller: str, number: int, seed: int, crew: Crew | None
) -> list[Predicted]:
    from isel_twin.many.identification.sealed import predict_day

    with counted("machines", number) as tell:
        return predict_day(made, machine, controller, number=number, seed=seed, crew=crew, progress=tell)


def _sealed(form: str, job: str, head: Mapping[str, Any], predicted: Sequence[Predicted]) -> tuple[str, str, str]:
    from isel_twin.many.identification.sealed import sealed
    from isel_twin.version import VERSION

    return sealed(form, job, {**head, "version": VERSION}, predicted)


def _say_day(job: Path, form: Path, predicted: Sequence[Predicted], seal: str, json: bool) -> None:
    from isel_twin.many.identification.protocol import COLD

    if json:
        told = [
            {"what": one.what, "unit": one.unit, "value": one.value, "band": [one.low, one.high]} for one in predicted
        ]
        say_json({"job": str(job), "measure": str(form), "seal": seal, "predicted": told})
        return
    print(f"{'predicted':<44} {'value':>10}  {'band':<22} unit")
    for one in predicted:
        band = f"{one.low:.4g} .. {one.high:.4g}"
        print(f"{one.what:<44} {one.value:>10.4g}  {band:<22} {one.unit}".rstrip())
    print(f"measure it {COLD}")
    print(f"sealed: {seal}")


def _say_choice(job: Path, form: Path, choice: Choice, names: Sequence[str], json: bool) -> None:
    if json:
        rest = [dict(zip(names, map(float, row), strict=True)) for row in choice.left]
        blocks_told = [{"block": block.name, "left": row} for block, row in zip(choice.blocks, rest, strict=True)]
        say_json({"job": str(job), "measure": str(form), "blocks": blocks_told})
        return
    print(f"{'':34}what will be left of the prior's uncertainty")
    print(f"{'block':<34}{''.join(f'{name:>14}' for name in names)}")
    for block, left in zip(choice.blocks, choice.left, strict=True):
        print(f"{block.name:<34}{''.join(f'{part:>14.0%}' for part in left)}")


def _known(file: Path, unknowns: list[Unknown]) -> NDArray[np.float64]:
    """Covariance of the parameters from an identification. Raises CallError."""

    import numpy as np

    with call_errors(file):
        content = parse_json(file.read_text(encoding="utf-8"))
        try:
            names = [item["name"] for item in content["parameters"]]
            covariance = np.array(content["covariance"], dtype=np.float64)
            there = [k for k, item in enumerate(unknowns) if item.name in names]
            which = [names.index(unknowns[k].name) for k in there]
            found = np.eye(len(unknowns))
            found[np.ix_(there, there)] = covariance[np.ix_(which, which)]
        except (KeyError, TypeError, ValueError, IndexError):
            raise CallError(f"{file}: is no result of `isel-twin identify --json`") from None
    return found
