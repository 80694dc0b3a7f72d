"""The command `isel-twin`: one file a command, each with one function that returns the exit code.

    begin     init, demo, doctor
    operate   serve, ctl, tap, ports, exec, mtconnect, opcua, linuxcnc  a machine behind a port, and hosts that drive it
    test      run, check, golden, drive, replay, compare, lsp
    tune      tune, sweep, identify, experiment, learn
    look      machines, motors, controllers, describe, motor, decode, convert, export, panel,
              fmu, plc

What they share:

    options.py       options that several commands have, and checks of their values
    jobs.py          job files as arguments of commands
    sessions.py      recordings as arguments of commands, and the verdict on two of them
    outputs.py       output as a table or JSON; files.py: files that are written
    interruption.py  Ctrl-C

Exit codes: 0 success; 1 a job in which a command was refused or steps were lost; 2 a call that cannot be carried out,
with the reason in one line on stderr; those of `exec` are its host's. Heavy imports are in the commands that need them.
"""

from __future__ import annotations

import gc
import logging
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack

from cyclopts import App, CycloptsError, Group, Parameter, UnusedCliTokensError, ValidationError

from isel_twin.base.errors import CallError, one_line
from isel_twin.base.printable import ShownStream, shown, shown_line
from isel_twin.cli.interruption import until_told
from isel_twin.cli.options import STANDARD_INPUT
from isel_twin.version import VERSION

__all__ = ["app", "main"]

app = App(
    name="isel-twin",
    help="Digital twin of a 3-axis isel gantry: controller, motors, mechanics and switches on one virtual clock.",
    version=VERSION,
    version_flags=["--version"],
    version_format="plaintext",
    default_parameter=Parameter(negative=()),
)
# the commands by purpose, as file:function; only the one that is called is imported
GROUPS = {
    "Begin": ("init:init", "demo:demo", "doctor:doctor"),
    "Operate": ("serve:serve", "ctl:ctl", "tap:tap", "ports:ports", "exec:exec_", "mtconnect:mtconnect", "opcua:opcua",
                "linuxcnc:linuxcnc"),
    "Test": ("run:run", "check:check", "golden:golden", "drive:drive", "replay:replay", "compare:compare", "lsp:lsp"),
    "Tune": ("tune:tune", "sweep:sweep", "identify:identify", "experiment:experiment", "learn:learn"),
    "Look": (
        "names:machines", "names:motors", "names:controllers", "describe:describe", "motor:motor", "decode:decode",
        "convert:convert", "export:export", "panel:panel", "fmu:fmu", "plc:plc",
    ),
}  # fmt: skip
for place, (title, commands) in enumerate(GROUPS.items()):
    group = Group(title, sort_key=place)
    for command in commands:
        app.command(f"isel_twin.cli.{command}", group=group)
app.register_install_completion_command()

YOUNG = 10_000  # threshold of the garbage collector; Python's 700 costs a tenth of a second during imports


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line, then exit."""
    tokens = list(_plain_tokens(sys.argv[1:] if argv is None else argv))
    ours = argv is None and tokens[:1] != ["exec"]  # not a host program's process
    if ours:
        _open_standard_files()
        sys.stdout, sys.stderr = ShownStream(sys.stdout), ShownStream(sys.stderr)
        gc.set_threshold(YOUNG)
        os.environ.setdefault("MUJOCO_GL", "disable")  # no command draws, and looking for OpenGL starts a process
    if logging.lastResort is not None:  # warnings, unless the command configures logging
        logging.lastResort.setFormatter(logging.Formatter("isel-twin: %(message)s"))
    if set(tokens[:1]) <= {"--help", "-h"}:
        app.resolved_commands()  # imports all: the list tells what each is for
    with ExitStack() as stack:
        if ours and set(tokens[:1]) & _UNTIL_TOLD:
            stack.enter_context(until_told())
        code = _run(tokens)
    if ours:
        gc.freeze()  # else the interpreter searches all objects for garbage as it ends
    sys.exit(code)


def _open_standard_files() -> None:
    """In place of closed ones: else the next file that is opened gets their number, and what is said goes into it."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115  (for the life of the process)


def _run(tokens: Sequence[str]) -> int:
    """The exit code of a command line; what is wrong with it is said in one line."""
    try:
        code = app(tokens, print_error=False, exit_on_error=False, result_action="return_value")
        sys.stdout.flush()
    except UnusedCliTokensError as error:
        name = " ".join(error.command_chain or ())
        words = ", ".join(map(repr, error.unused_tokens or ()))
        code = _say(2, f"{words}: {name or 'isel-twin'} takes no such word; isel-twin {name} --help says what it takes")
    except ValidationError as error:
        option = error.argument.name if error.argument is not None else ""
        code = _say(2, f"{option} {error.exception_message}" if option.startswith("-") else error.exception_message)
    except (CallError, CycloptsError) as error:
        dashes = "--" if isinstance(error, CallError) and error.option else ""
        code = _say(2, f"{dashes}{error}")
        for line in getattr(error, "excerpt", "").splitlines():
            print(f"    {shown(line)}", file=sys.stderr)
    except KeyboardInterrupt:
        code = 130
    except BrokenPipeError:  # the reader of the output is gone, for example `| head`
        sys.stderr.close()
        code = 1
    except OSError as error:  # standard output cannot be written, for example a full disk
        code = _say(2, f"{error.filename2 or error.filename or 'standard output'}: {error.strerror or error}")
        sys.stdout = None  # else the interpreter tries to flush it again
    except RuntimeError as error:
        from isel_twin.native import CoreError  # only now: most commands that fail have not needed them
        from isel_twin.plant import PlantError

        if not isinstance(error, CoreError | PlantError):
            raise
        code = _say(2, str(error))
    return code


def _say(code: int, text: str) -> int:
    print(f"isel-twin: {shown_line(one_line(text))}", file=sys.stderr)
    return code


_UNTIL_TOLD = {"serve", "tap", "panel"}  # commands that run until they are told to stop
_MAY_STAND_ALONE = ("--pty", "--panel")  # options with an optional value


def _plain_tokens(tokens: Iterable[str]) -> Iterator[str]:
    """Add an empty value to an option that has none, and replace `-` by its file name; unchanged after `--`."""
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
