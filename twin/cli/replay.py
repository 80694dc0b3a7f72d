"""`isel-twin replay`: plays a recorded session again and shows differences."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli import options, sessions
from isel_twin.cli.files import RecordPath, begin, keep
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.judging import Limits
    from isel_twin.recordings.reading import Recorded
    from isel_twin.recordings.replay import Pace


def replay(
    recording: Annotated[Path, Parameter(help="File that --record NAME.mcap, or `tap`, has made.")],
    /,
    *,
    speed: Annotated[str, Parameter(help="Times real time, or max: as fast as possible.")] = "max",
    record: RecordPath = None,
    interval: Annotated[float, Parameter(help="Of a real controller: time between two samples of --record, s.")] = 0.01,
    twin: options.SessionTwin = options.DEFAULT_SESSION_TWIN,
    start: sessions.StartMm = "",
    time_tolerance: sessions.TimeTolerance = None,
    step_tolerance: sessions.StepTolerance = 1,
    report: sessions.ReportPath = None,
    json: Annotated[bool, Parameter(help="One JSON object.")] = False,
) -> int:
    """Play the host's bytes and all operations, at the same virtual times, to a twin built from the recording.

    Prints the first difference in replies, times, stream or positions. Exit code 0 if there is none, 1 if there is.
    With the same versions there is none, to the bit; other versions are reported.

    A recording of a real controller (`tap`) is played to a twin of the call, as its host would, and compared to its
    end as `compare` does; options of a twin, --start and --report are for those only. Without --start the twin is
    switched on where the first reference runs take as long as then.
    """
    import time
    from tempfile import TemporaryDirectory

    from isel_twin.bridge.serve.pacing import Pacer, parse_speed
    from isel_twin.recordings.reading import read

    options.check_seconds("interval", interval, 1e-9)
    limits = sessions.limits_of(time_tolerance, step_tolerance)
    with call_errors():
        factor = parse_speed(speed)
    options.check_writable(record, report, kept=(recording, *twin.files))
    with call_errors(recording):
        recorded = read(recording)
    pacer = Pacer(factor, 0)
    pace: Pace | None = None if factor is None else lambda time_ns: time.sleep(pacer.until_s(time_ns))
    with ExitStack() as stack:
        output = _Output(record, interval, recording, report, json, stack)
        if recorded.of_twin:
            asked = vars(twin) | {"start": start, "report": report}
            usual = vars(options.DEFAULT_SESSION_TWIN) | {"start": "", "report": None}
            for name, value in asked.items():
                if value != usual[name]:
                    raise CallError(f"{name}: the recording of a twin says it itself; leave it out", option=True)
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="isel-twin-")))
            return _twin_again(recorded, folder, pace, output)
        return _host_again(recorded, sessions.spec_for(recorded, twin, start), limits, pace, output)


@dataclasses.dataclass(frozen=True)
class _Output:
    record: Path | None
    interval_s: float
    recording: Path
    report: Path | None
    json: bool
    stack: ExitStack

    def begin(self, twin: Twin, interval_s: float) -> Callable[[], None]:
        """Record this twin from now on, if asked; the function returned ends it."""
        record = self.record
        if record is None:
            return lambda: None
        recorder = begin(record, twin, interval_s, {"replay_of": self.recording.name}, self.stack)

        def end() -> None:
            with call_errors(record):
                keep(recorder, record)

        return end


def _twin_again(recorded: Recorded, folder: Path, pace: Pace | None, output: _Output) -> int:
    """Replay the recording of a twin, to the bit."""
    from isel_twin.cli.outputs import say, say_json
    from isel_twin.recordings import replay as replaying

    with call_errors(recorded.path):
        twin = replaying.rebuilt(recorded, folder)
    # its samples are compared, so they are taken at the same times
    end = output.begin(twin, recorded.interval_ns / SECOND_NS)
    with call_errors(recorded.path):
        difference = replaying.replay(recorded, twin, pace)
    end()
    told = [*replaying.versions(recorded), *_cut_off(recorded)]
    if output.json:
        first = None if difference is None else dataclasses.asdict(difference)
        say_json({"same": difference is None, "difference": first, "time_ns": twin.time_ns, "told": told})
        return 0 if difference is None else 1
    for line in told:
        say(f"{recorded.path}: {line}")
    if difference is None:
        print(f"no difference in replies, times, stream and positions, {twin.time_ns / 1e9:.3f} s of machine time")
        return 0
    print(f"first difference: {difference}")
    return 1


def _host_again(recorded: Recorded, spec: TwinSpec, limits: Limits, pace: Pace | None, output: _Output) -> int:
    """Play the host of a real controller to a twin."""
    from isel_twin.cli.outputs import many, say, say_json
    from isel_twin.recordings.compare import matched
    from isel_twin.recordings.host import play_host
    from isel_twin.recordings.judging import judge

    session = sessions.session_of(recorded, spec.controller, limits)
    with call_errors():
        twin = (session.placed(spec) if spec.start_mm is None else spec).build(keep_motions=1)
    end = output.begin(twin, output.interval_s)
    with call_errors(recorded.path):
        played = play_host(session.pieces, twin, pace)
    end()
    exact = dataclasses.replace(session.limits, exact_b=True)
    found = judge(matched(session.exchanges, played), session.language, exact)
    verdict, lines = sessions.verdict(found, None), sessions.words(found, None)
    names = str(recorded.path), "the twin of this call"
    sessions.write_page(output.report, f"isel-twin replay: {recorded.path.name}", verdict, lines, names, found)
    told = _cut_off(recorded)
    if output.json:
        differences = sessions.differences_as_json(found.weighed)
        start = [round(mm, 3) for mm in twin.origin.start_mm or ()]
        summary = {"same": found.same, "differences": differences, "start_mm": start, "time_ns": twin.time_ns}
        say_json({**summary, "verdict": verdict, "told": told})
        return 0 if found.same else 1
    for line in told:
        say(f"{recorded.path}: {line}")
    if found.same:
        number, seconds = many(len(found.pairs), "command"), twin.time_ns / SECOND_NS
        print(f"no difference in replies, positions and durations of {number}, {seconds:.3f} s of machine time")
        return 0
    print(*lines, verdict, sep="\n")
    return 1


def _cut_off(recorded: Recorded) -> list[str]:
    return [] if recorded.whole else ["the recording has no end, it was cut off; it is played as far as it goes"]
