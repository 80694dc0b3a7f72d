"""`isel-twin replay`: plays a recorded session again and shows differences."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli import options
from isel_twin.cli.files import RecordPath, begin, check_record, keep
from isel_twin.cli.options import Overrides
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.reading import Recorded
    from isel_twin.recordings.replay import Pace


def replay(
    recording: Annotated[Path, Parameter(help="File that --record NAME.mcap, or `tap`, has made.")],
    /,
    *,
    speed: Annotated[str, Parameter(help="Times real time, or max: as fast as possible.")] = "max",
    record: RecordPath = None,
    interval: Annotated[float, Parameter(help="Of a real controller: time between two samples of --record.")] = 0.01,
    controller: Annotated[str, Parameter(help="Of a real controller: which one the twin has.")] = "",
    machine: Annotated[options.MachineName, Parameter(help="Of a real controller: the twin's machine.")] = MACHINE,
    plant: Annotated[options.PlantName, Parameter(help="Of a real controller: the twin's plant.")] = TwinSpec.plant,
    seed: Annotated[options.Seed, Parameter(help="Of a real controller: the twin's seed.")] = TwinSpec.seed,
    set: Annotated[Overrides, Parameter(help="Of a real controller: KEY=VALUE, a parameter of the machine.")] = (),
    json: Annotated[bool, Parameter(help="One JSON object.")] = False,
) -> int:
    """Play the host's bytes and all operations, at the same virtual times, to a twin built from the recording.

    Prints the first difference in replies, times, stream or positions. Exit code 0 if there is none, 1 if there is.
    With the same versions there is none, to the bit; other versions are reported.

    A recording of a real controller (`tap`) is played to a twin of --controller, --machine, --plant and --seed: the
    replies are compared as bytes. For times, use `compare` with the file of --record.
    """
    import time
    from contextlib import ExitStack
    from tempfile import TemporaryDirectory

    from isel_twin.bridge.serve.pacing import Pacer, parse_speed
    from isel_twin.cli.outputs import say, say_json
    from isel_twin.recordings import replay as replaying
    from isel_twin.recordings.reading import read

    options.check_seconds("interval", interval, 1e-9)
    with call_errors():
        factor = parse_speed(speed)
    check_record(record)
    options.check_writable(record, kept=(recording,))
    with call_errors(recording):
        recorded = read(recording)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="isel-twin-")))
        call = TwinSpec(machine, plant=plant, seed=seed, overrides=options.parse_overrides(set))
        twin = _twin(recorded, folder, controller, call)
        if recorded.of_twin:  # its samples are compared, so they are taken at the same times
            interval = recorded.interval_ns / SECOND_NS
        recorder = None if record is None else begin(record, twin, interval, {"replay_of": recording.name}, stack)
        pacer = Pacer(factor, 0)
        pace: Pace | None = None if factor is None else lambda time_ns: time.sleep(pacer.until_s(time_ns))
        with call_errors(recording):
            difference = (replaying.replay if recorded.of_twin else replaying.play_host)(recorded, twin, pace)
        if record is not None and recorder is not None:
            with call_errors(record):
                keep(recorder, record)
    told = replaying.versions(recorded) if recorded.of_twin else []
    if not recorded.whole:
        told.append("the recording has no end, it was cut off; it is played as far as it goes")
    if json:
        first = None if difference is None else dataclasses.asdict(difference)
        say_json({"same": difference is None, "difference": first, "time_ns": twin.time_ns, "told": told})
        return 0 if difference is None else 1
    for line in told:
        say(f"{recording}: {line}")
    compared = "replies, times, stream and positions" if recorded.of_twin else "replies"
    if difference is None:
        print(f"no difference in {compared}, {twin.time_ns / 1e9:.3f} s of machine time")
        return 0
    print(f"first difference: {difference}")
    return 1


def _twin(recorded: Recorded, folder: Path, controller: str, call: TwinSpec) -> Twin:
    """The twin for the replay. Raises CallError."""
    from isel_twin.recordings.replay import rebuilt

    if recorded.of_twin:
        if controller:
            raise CallError("controller: the recording of a twin says it itself; leave it out", option=True)
        with call_errors(recorded.path):
            return rebuilt(recorded, folder)
    name = controller or recorded.controller
    if not name:
        raise CallError(f"{recorded.path}: does not say which controller it is of; --controller NAME does")
    return call.with_(controller=name, line_speed=True).build(keep_motions=1)
