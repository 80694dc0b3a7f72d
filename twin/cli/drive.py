"""`isel-twin drive`: a captured step and direction stream on simulated drives and machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import MICROSECOND_NS, SECOND_NS
from isel_twin.cli import options, outputs
from isel_twin.cli.files import MOST_SAMPLES, Files, RecordPath, ReportPath, StepsPath, TracePath, VcdPath
from isel_twin.cli.interruption import interruption
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.capture.play import Strikes
    from isel_twin.capture.ticks import Needs, Ticks
    from isel_twin.recordings.recorder import Recorder


def drive(
    capture: Annotated[Path, Parameter(help="The captured signals: .vcd, .csv, .npz, .dump or .out.")],
    /,
    *,
    map: Annotated[tuple[str, ...], Parameter(help="What is what: x.step=D0,x.dir=!D1,enable=D7. ! inverts.")] = (),
    machine: options.MachineName = MACHINE,
    plant: options.PlantName = TwinSpec.plant,
    seed: options.Seed = TwinSpec.seed,
    start: Annotated[str, Parameter(help="Where the machine stands: X,Y,Z in mm from the motor-end switches.")] = "",
    set: options.Overrides = (),
    scenario: options.ScenarioFile = None,
    edge: Annotated[Literal["rising", "falling", "both"], Parameter(help="Which edge of step is a step.")] = "rising",
    reverse: Annotated[str, Parameter(help="Axes whose direction is turned round: x,z.")] = "",
    time_unit: Annotated[
        Literal["s", "ms", "us", "ns", "ps"] | None, Parameter(help="Of a CSV column that does not say its own.")
    ] = None,
    sample_rate: Annotated[
        float | None, Parameter(help="Rows a second of a CSV without times; clock of a .dump in Hz.")
    ] = None,
    pulse_us: Annotated[float, Parameter(help="Shortest level of step that the drives take, us.")] = 1.9,
    setup_us: Annotated[float, Parameter(help="Shortest time from dir to step that they take, us.")] = 0.65,
    hold_us: Annotated[float, Parameter(help="Shortest time from step to dir that they take, us.")] = 0.65,
    may_strike: Annotated[str, Parameter(help="Switches that may be struck: limit_x1,limit_y1 or all.")] = "",
    gap: Annotated[float, Parameter(help="Pause in seconds that ends a motion.")] = 0.1,
    steps: StepsPath = None,
    vcd: VcdPath = None,
    trace: TracePath = None,
    report: ReportPath = None,
    record: RecordPath = None,
    interval: options.Interval = 0.01,
    json: Annotated[bool, Parameter(help="One line of JSON a motion, then one with the summary.")] = False,
) -> int:
    """Feed captured step and direction signals of a real controller into drives and machine.

    The signals of each axis are named by --map, repeated or separated by commas: x.step and x.dir (or x.plus and
    x.minus), y, z, a ... and a common enable; `step_x`, `Y_DIR` and other usual names need no map. Positive is dir
    high. Understood are CSV of Saleae Logic and sigrok, LinuxCNC's `halsampler -t`, other CSV with times, VCD, --steps
    and --vcd of `run`, and, without signals, text of Klipper's parsedump.py (.dump) and step.out of grblHAL's simulator
    (.out).

    Positions are relative to the beginning of the capture: --start, or random by --seed. The default limits of pulses
    and changes of direction are those of a DRV8825; 0 is no limit.

    Exit code 0 if no step was lost, the capture has no gap, no pulse is too short and no change of direction too late
    for the drives, and no switch struck that is not named by --may-strike, else 1.
    """
    options.check_seconds("interval", interval, 1e-9)
    options.check_seconds("gap", gap, 1e-6)
    limits_us = {"pulse_us": pulse_us, "setup_us": setup_us, "hold_us": hold_us}
    files = Files(steps, vcd, trace, report, record, interval)
    files.check(capture, scenario)
    overrides = options.parse_overrides(set)
    call = TwinSpec(machine, plant=plant, seed=seed, scenario=scenario, overrides=overrides, start_mm=_start(start))
    reading = {"edge": edge, "time_unit": time_unit, "sample_rate_hz": sample_rate, "reverse": reverse}
    needs = _needs(limits_us)
    ticks = _read(capture, map, needs, reading)
    if files.sampled and (samples := ticks.over_ns / SECOND_NS / interval) > MOST_SAMPLES:
        raise CallError(f"interval {interval:g}: makes {samples:.1e} samples of this capture; take more", option=True)
    with ExitStack() as stack:
        from isel_twin.capture.judging import of_signals, of_strikes
        from isel_twin.capture.play import Strikes, lines_of, play
        from isel_twin.capture.player import NAME, Player
        from isel_twin.jobs.checks.formats import content
        from isel_twin.jobs.playing import followed

        with call_errors():
            as_built = call.as_built
        allowed = _allowed(may_strike, [switch.name for switch in as_built.switches])
        player = Player(ticks, tuple(contact.name for contact in as_built.contacts), round(gap * SECOND_NS))
        twin = call.with_(controller=NAME, flash=None if record is None else player.image()).build(controller=player)
        strikes = Strikes(twin)
        writing = files.begin(twin, {"capture": str(capture)}, stack)
        lines = lines_of(player)
        show: outputs.JobOutput
        show = outputs.JsonOutput() if json else stack.enter_context(outputs.MotionsOutput(twin, lines))
        with interruption() as stopped:

            def stop() -> bool:
                return bool(stopped)

            motions = play(twin, player, ticks.over_ns, strikes, allowed, stop)
            made = followed(twin, lines, motions, [show.result], stop)
        found = [*of_signals(ticks, needs), *of_strikes(strikes.seen, allowed)]
        verdict = replace(made.verdict, found=tuple(one.message for one in found))
        told = {"plant": plant, "seed": seed, "capture": _summary(capture, ticks, strikes, allowed)}
        told["findings"] = [content(one) for one in found]
        told |= {"not_looked_at": unseen} if (unseen := _unseen(ticks, needs)) else {}

        def page(path: Path, recorder: Recorder) -> None:
            from isel_twin.jobs.checks.job import Report
            from isel_twin.jobs.golden import Golden
            from isel_twin.report.report import write_report

            summary, report = {**verdict.summary(), **told}, Report(str(capture), tuple(found), verdict, Golden())
            write_report(path, f"isel-twin: {capture}", twin, recorder, made.results, summary, report)

        unwritten = writing.write(page)
        verdict = replace(verdict, unwritten=tuple(unwritten.names))
        show.verdict(verdict, told)
        if not json:
            for text in _in_words(ticks, strikes, allowed, unseen):
                print(text, flush=True)
        if verdict.interrupted:
            outputs.say(f"{capture}: interrupted at {twin.time_ns / SECOND_NS:.3f} s; the capture ends there")
        outputs.tell(unwritten.failures)
    if verdict.interrupted:
        return 128 + stopped[0]
    return 0 if verdict.ok else 1


def _needs(limits_us: Mapping[str, float]) -> Needs:
    """Raises CallError."""
    from isel_twin.capture.ticks import Needs

    for name, value in limits_us.items():
        if not 0.0 <= value <= 1e6:
            raise CallError(f"{name.replace('_', '-')} {value:g}: must be from 0 to 1e6 us", option=True)
    return Needs(*(round(value * MICROSECOND_NS) for value in limits_us.values()))


def _read(capture: Path, map: Sequence[str], needs: Needs, how: Mapping[str, Any]) -> Ticks:
    from isel_twin.capture.load import load
    from isel_twin.capture.wave import WrongCallError

    with call_errors(capture):
        try:
            return load(capture, map, needs=needs, **how)
        except WrongCallError as error:
            raise CallError(str(error), option=True) from None


def _start(text: str) -> tuple[float, ...] | None:
    if not text:
        return None
    try:
        start_mm = tuple(float(part) for part in text.split(","))
    except ValueError:
        start_mm = ()
    if len(start_mm) != len(CARRIAGES):
        raise CallError(f"start {text!r}: must be three numbers in mm, for example 50,50,20", option=True)
    return start_mm


def _allowed(text: str, switches: Sequence[str]) -> Callable[[str], bool]:
    """A function that tells whether a switch may be struck. Raises CallError."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name != "all" and name not in switches:
            raise CallError(f"may-strike {name}: there are {', '.join(switches)}, and all", option=True)
    return lambda switch: "all" in names or switch in names


def _summary(path: Path, ticks: Ticks, strikes: Strikes, allowed: Callable[[str], bool]) -> dict[str, Any]:
    """The capture and its outcome, in JSON's types."""
    import dataclasses

    first_ns, last_ns = int(ticks.t_ns[0]), int(ticks.t_ns[-1])
    return {
        "file": str(path), "ticks": len(ticks.t_ns), "first_ns": first_ns, "cycle_ns": last_ns - first_ns,
        "end_ns": ticks.end_ns, "shift_ns": ticks.shift_ns, "resolution_ns": ticks.resolution_ns,
        "struck": [{**dataclasses.asdict(strike), "allowed": allowed(strike.switch)} for strike in strikes.seen],
        "gaps_ns": ticks.gaps, "remarks": ticks.remarks,
        "timing": {axis: dataclasses.asdict(timing) for axis, timing in ticks.timing.items()},
    }  # fmt: skip


def _unseen(ticks: Ticks, needs: Needs) -> list[str]:
    """Limits that are shorter than the capture can tell."""
    if not ticks.timing:
        return ["pulse_us", "setup_us", "hold_us"]
    told = vars(needs.told_by(ticks.resolution_ns))
    return [f"{name.removesuffix('_ns')}_us" for name, need in vars(needs).items() if need != told[name]]


def _in_words(ticks: Ticks, strikes: Strikes, allowed: Callable[[str], bool], unseen: Sequence[str]) -> Iterator[str]:
    begin, end = int(ticks.t_ns[0]), int(ticks.t_ns[-1])
    yield f"cycle time {(end - begin) / SECOND_NS:.6f} s, from the first step at {begin / SECOND_NS:.6f} s to the last"
    for strike in strikes.seen:
        may = " (allowed)" if allowed(strike.switch) else ""
        yield f"{strike.switch} struck at {strike.time_ns / SECOND_NS:.6f} s{may}"
    yield from ticks.remarks
    for axis, timing in ticks.timing.items():
        yield f"{axis.upper()}: {timing.steps} steps, at most {timing.fastest_hz:g} steps/s"
    if unseen:
        why = f"the capture resolves {ticks.resolution_ns:g} ns" if ticks.timing else "there are no signals in it"
        yield f"not looked at: {', '.join(unseen)}; {why}"
