"""`isel-twin learn`: what a recorded session tells of the machine at the other end of the line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options, sessions
from isel_twin.cli.outputs import say, say_json

if TYPE_CHECKING:
    from isel_twin.many.learning.explain import Explained
    from isel_twin.many.learning.learn import Told
    from isel_twin.recordings.judging import Limits


def learn(
    recording: Annotated[Path, Parameter(help="File that `tap`, or --record NAME.mcap, has made.")],
    /,
    *,
    twin: options.SessionTwin = options.DEFAULT_SESSION_TWIN,
    out: Annotated[Path | None, options.written("A flash memory with what was found.", name=("--out", "-o"))] = None,
    time_tolerance: sessions.TimeTolerance = None,
    step_tolerance: sessions.StepTolerance = 1,
    json: options.Json = False,
) -> int:
    """Tell what a session says of controller and machine, and what makes the twin answer as it does.

    Axes, speeds and line come from the bytes alone. Ramps, start-stop frequency, reference speed, play, switches and
    firmware are found by changing the twin of this call until its replies come as recorded; each is told with how sure
    it is. Exit code 0 if the twin then does what the recording does, 1 if something is left.
    """
    from isel_twin.many.learning.explain import explained
    from isel_twin.many.learning.learn import told_alone
    from isel_twin.recordings.reading import read

    limits: Limits = sessions.limits_of(time_tolerance, step_tolerance)
    options.check_writable(out, kept=(recording, *twin.files))
    with call_errors(recording):
        recorded = read(recording)
    spec = sessions.spec_for(recorded, twin, "")
    session = sessions.session_of(recorded, spec.controller, limits)
    told = told_alone(session)
    with call_errors():
        result = explained(session, spec)
    image = result.spec.flash
    if out is not None:
        if not isinstance(image, bytes):
            raise CallError(f"{out}: nothing was found that a flash memory holds; nothing is written")
        from isel_twin.base.files import atomic_write

        with call_errors(out):
            atomic_write(out, image)
    if json:
        say_json(_as_json(told, result))
    else:
        if not recorded.whole:
            say(f"{recording}: the recording has no end, it was cut off; it is used as far as it goes")
        _print(told, result)
    return 0 if result.same else 1


def _print(told: list[Told], result: Explained) -> None:
    for one in told:
        print(f"{one.what}: {one.value} ({one.sure})")
    start = ", ".join(f"{mm:.1f}" for mm in result.spec.start_mm or ())
    print(f"place at power-on: {start} mm from the motor-end switches (by the first reference run)")
    for line in sessions.words(result.before, result if result.causes else None):
        print(line)
    if result.same and not result.causes:
        print("the twin already answers as recorded")
    elif result.same:
        print("with these settings the twin answers as recorded")
    else:
        print(sessions.verdict(result.before, result))


def _as_json(told: list[Told], result: Explained) -> dict[str, Any]:
    return {
        "told": [{"what": one.what, "value": one.value, "sure": one.sure} for one in told],
        "start_mm": [round(mm, 3) for mm in result.spec.start_mm or ()],
        "causes": sessions.causes_as_json(result),
        "unexplained": sessions.differences_as_json(result.unexplained),
        "same": result.same,
    }
