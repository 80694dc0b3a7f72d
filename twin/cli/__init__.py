"""The command `isel-twin`.

    serve        a twin behind a serial port that host programs connect to
    ctl          operate a machine that is served
    run          a file of commands in virtual time
    drive        captured step and direction signals of a real controller
    exec         a host program in Python in virtual time
    decode       bytes of a line explained
    replay       a recorded session once more, and what is different
    compare      two recordings laid over each other, command by command
    export       a recording as a file for other tools
    check        jobs against their bounds
    tune         the fastest settings of a job that lose no step
    golden       jobs that have to do what they did
    sweep        a job under many conditions, as a table
    identify     a machine's numbers from recordings and measurements
    experiment   the moves that would tell most about a machine
    tap          between a real host and a real controller, recording both
    ports        serial ports that are served here, and real ones
    plc          programs of a controller's PLC
    machines, describe, controllers, motor      what there is, and its numbers

One file a command, each with one function that returns the exit code; what they share:

    options.py   parameters that several commands have, and checks of their values
    jobs.py      job files as they are given to a command
    outputs.py   where results go: table, JSON, recorder

Exit codes: 0 all well; 1 a job in which a command was refused or steps were lost; 2 a call that cannot be carried out,
with one line on stderr that says why; those of `exec` are its host's. Everything heavy is imported by the command that
needs it.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator, Sequence

from cyclopts import App, CycloptsError, Parameter, UnusedCliTokensError

from isel_twin.base.errors import CallError, one_line
from isel_twin.cli import (
    check,
    compare,
    controllers,
    ctl,
    decode,
    describe,
    drive,
    experiment,
    export,
    golden,
    identify,
    machines,
    motor,
    plc,
    ports,
    replay,
    run,
    serve,
    sweep,
    tap,
    tune,
)
from isel_twin.cli.exec import exec_
from isel_twin.cli.options import STANDARD_INPUT
from isel_twin.version import VERSION

__all__ = ["app", "main"]

app = App(
    name="isel-twin",
    help="Digital twin of a 3-axis isel gantry: controller, motors, mechanics and switches on one virtual clock.",
    version=VERSION,
    version_flags=["--version"],
    default_parameter=Parameter(negative=()),
)
for command in (
    identify.identify,
    experiment.experiment,
    serve.serve,
    ctl.ctl,
    run.run,
    drive.drive,
    exec_,
    check.check,
    tune.tune,
    decode.decode,
    export.export,
    replay.replay,
    compare.compare,
    sweep.sweep,
    tap.tap,
    ports.ports,
    machines.machines,
    controllers.controllers,
    describe.describe,
    motor.motor,
):
    app.command(command)
app.command(golden.golden)
app.command(plc.plc)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line, then exit."""
    tokens = list(_plain_tokens(sys.argv[1:] if argv is None else argv))
    if logging.lastResort is not None:  # warnings, unless the command has something else in mind for its log
        logging.lastResort.setFormatter(logging.Formatter("isel-twin: %(message)s"))
    try:
        code = app(tokens, print_error=False, exit_on_error=False, result_action="return_value")
        sys.stdout.flush()
    except UnusedCliTokensError as error:
        name = " ".join(error.command_chain or ())
        words = ", ".join(map(repr, error.unused_tokens or ()))
        code = _say(2, f"{words}: {name or 'isel-twin'} takes no such word; isel-twin {name} --help says what it takes")
    except (CallError, CycloptsError) as error:
        dashes = "--" if isinstance(error, CallError) and error.option else ""
        code = _say(2, f"{dashes}{error}")
        for line in getattr(error, "excerpt", "").splitlines():
            print(f"    {line}", file=sys.stderr)
    except KeyboardInterrupt:
        code = 130
    except BrokenPipeError:  # nobody reads our output any more, for example `| head`
        sys.stderr.close()
        code = 1
    except OSError as error:  # standard output cannot be written, for example a full disk
        code = _say(2, f"{error.filename or 'standard output'}: {error.strerror or error}")
        sys.stdout = None  # or the interpreter tries to flush it once more
    sys.exit(code)


def _say(code: int, text: str) -> int:
    print(f"isel-twin: {one_line(text)}", file=sys.stderr)
    return code


_MAY_STAND_ALONE = ("--pty", "--panel")
"""Options whose value may be left out."""


def _plain_tokens(tokens: Iterable[str]) -> Iterator[str]:
    """Give an option that may stand alone and does an empty value, and `-` its name; nothing after `--`."""
    pending, verbatim = "", False
    for token in tokens:
        if verbatim:
            yield token
            continue
        if pending:
            yield f"{pending}=" if token.startswith("-") else f"{pending}={token}"
            pending = ""
            if not token.startswith("-"):
                continue
        verbatim = token == "--"
        if token in _MAY_STAND_ALONE:
            pending = token
        else:
            yield STANDARD_INPUT if token == "-" else token
    if pending:
        yield f"{pending}="
