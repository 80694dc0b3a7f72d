"""`isel-twin exec`: a host program in Python, unmodified, in virtual time."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli import options, outputs
from isel_twin.cli.files import RecordPath, StepsPath, begin, keep

if TYPE_CHECKING:
    import logging

    from isel_twin.bridge.serve.wire_log import WireLog
    from isel_twin.bridge.virtual.virtual_host import HostRun
    from isel_twin.bridge.virtual.virtual_time import VirtualTime


def exec_(
    *command: Annotated[str, Parameter(help="-- python host.py and its arguments.", allow_leading_hyphen=True)],
    twin: options.TwinOptions = options.DEFAULT_TWIN,
    port: Annotated[
        str | None, Parameter(help="Name of the twin's serial port; without it, every port that the host opens.")
    ] = None,
    steps: StepsPath = None,
    record: RecordPath = None,
    interval: options.Interval = 0.01,
    log: Annotated[Literal["wire"] | None, Parameter(help="wire: print every message on the line, in words.")] = None,
    timeout: Annotated[
        float | None, Parameter(help="Virtual seconds after which a host that has not ended is ended, with 1.")
    ] = None,
    check: Annotated[
        bool, Parameter(help="Exit code 1 if steps were lost or a fault is left, whatever the host says.")
    ] = False,
    json: Annotated[bool, Parameter(help="The verdict on the machine as one line of JSON on standard output.")] = False,
) -> int:
    """Run a Python host program, unmodified, in this process and in virtual time.

    isel-twin exec --port COM4 -- python host.py --job circle

    Its serial.Serial("COM4") is the twin, and sleeps, clocks, timeouts, locks and threads follow the virtual clock: ten
    minutes of waiting take seconds, and the program behaves the same to the nanosecond every time. The verdict on the
    machine follows on standard error.

    Exit code: the host's own; with --check 1 if that is 0 and the machine failed; 2 if the call cannot be carried
    out, or the host does what virtual time cannot do.
    """
    try:
        from isel_twin.bridge.virtual.virtual_host import parse_program, run_host
    except ImportError as error:  # a Python version without support for virtual threads
        raise CallError(str(error)) from error

    if timeout is not None:
        options.check_seconds("timeout", timeout, 0.0)
    program = parse_program(command)
    options.check_seconds("interval", interval, 1e-9)
    options.check_writable(steps, record, kept=(*twin.files, None if program.path is None else Path(program.path)))
    driven = twin.spec(line_speed=True).build()
    from isel_twin.recordings.write import write_trace

    with ExitStack() as stack:
        wire = _wire_log(twin.controller, stack) if log is not None else None
        recording = None if record is None else begin(record, driven, interval, {"host": " ".join(command)}, stack)
        done = run_host(driven, program, port, wire=wire, limit_s=timeout, give_up=_give_up, raise_interrupt=False)
        recorded = True
        if record is not None and recording is not None:
            with call_errors(record):
                recorded = keep(recording, record)
    for note in done.notes:
        outputs.say(note)
    if done.reason:
        outputs.say(done.reason)
    if steps is not None:
        with call_errors():
            write_trace(steps, driven.steps, None, ".npz")
    if json:
        called = {"controller": twin.controller, "plant": twin.plant, "seed": twin.seed}
        outputs.say_json(summary(done) | called)
    elif done.ending != "refused":
        outputs.say(told(done))
    code = done.code or (1 if not recorded or (check and not done.verdict.ok) else 0)
    if done.left:
        outputs.say(f"threads of the host that go on after its end are left: {', '.join(done.left)}")
        _leave(code)
    return code


def _wire_log(controller: str, stack: ExitStack) -> WireLog:
    """The traffic on standard error until the stack is unwound."""
    import logging

    from isel_twin.bridge.serve.wire_log import WireLog
    from isel_twin.language import create_language

    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("isel-twin: %(message)s"))
    logger = logging.getLogger("isel_twin.wire")
    before = logger.level, logger.propagate
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    logger.propagate = False
    wire = WireLog(create_language(controller))
    stack.callback(_as_before, logger, *before)
    stack.callback(logger.removeHandler, handler)
    stack.callback(wire.close)
    return wire


def _as_before(logger: logging.Logger, level: int, propagate: bool) -> None:
    logger.setLevel(level)
    logger.propagate = propagate


def _give_up(time: VirtualTime) -> None:
    """The host's main thread does not end: report why it must, and end the process without it."""
    reason = time.ending.reason if time.ending is not None else ""
    outputs.say(f"{reason}; its main thread will not end, and there is no verdict")
    _leave(2 if time.ending is not None and time.ending.kind == "refused" else 1)


def _leave(code: int) -> None:
    """End the process without waiting for remains of the host."""
    import os

    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def summary(done: HostRun) -> dict[str, Any]:
    """The outcome of a host and its machine, in JSON's types."""
    verdict = done.verdict.summary()
    for about_commands in ("commands", "refused", "unsent", "interrupted", "margin"):
        del verdict[about_commands]
    return {
        "summary": True,
        **verdict,
        "ok": done.ok, "machine_ok": done.verdict.ok, "code": done.code, "ending": done.ending, "reason": done.reason,
        "virtual_s": (done.ended_ns - done.began_ns) / SECOND_NS,
        "struck": list(done.struck), "was_struck": list(done.was_struck), "notes": list(done.notes),
    }  # fmt: skip


def _struck(done: HostRun) -> str:
    """The end switches that are struck at the end, and those that were meanwhile, in a reference run or not."""
    if not done.was_struck:
        return "no end switch struck"
    now = f"struck: {', '.join(done.struck)}" if done.struck else "no end switch struck at the end"
    return f"{now} (meanwhile: {', '.join(done.was_struck)})"


def told(done: HostRun) -> str:
    """The same in one line for people."""
    from isel_twin.jobs.verdict import NOT_SIMULATED

    verdict = done.verdict
    no_loss = "no steps lost" if verdict.physics else f"{NOT_SIMULATED}; use --plant mujoco"
    where = ", ".join(f"{name} {value:.3f}" for name, value in zip("XYZ", verdict.position_mm, strict=False))
    parts = [
        verdict.headline if verdict.ok else "the machine failed",
        *verdict.problems(),
        *([] if any(verdict.lost) else [no_loss]),
        _struck(done),
        f"at {where} mm",
        f"{(done.ended_ns - done.began_ns) / SECOND_NS:.3f} s of virtual time",
    ]
    return "; ".join(parts)
