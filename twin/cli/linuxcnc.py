"""`isel-twin linuxcnc`: a twin and a LinuxCNC that moves it, by one call."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options

NOT_WELL = 4  # exit code: LinuxCNC has noticed nothing


def linuxcnc(
    *serve: Annotated[str, Parameter(help="-- options of serve: --machine, --record ...", allow_leading_hyphen=True)],
    ini: Annotated[Path | None, Parameter(help="INI of your machine; without it that of an isel 4030.")] = None,
    mdi: Annotated[list[str] | None, Parameter(help="A line to carry out after homing; may be repeated.")] = None,
    keep: Annotated[list[str] | None, Parameter(help="A HAL file of the INI to load behind the twin's.")] = None,
    timeout: Annotated[float, Parameter(help="Seconds of real time for the session.")] = 120.0,
    install: Annotated[bool, Parameter(help="Compile the realtime component into LinuxCNC, and end.")] = False,
) -> int:
    """Home and move a twin by LinuxCNC, unmodified and without a screen.

    isel-twin linuxcnc --ini my.ini --mdi 'G1 F600 X20' -- --machine 4030 --record live.mcap

    The INI's hardware is replaced by the twin, its display by a session that homes and carries the lines out. In
    lockstep where the component is installed (--install, once, with sudo), else by a sampler.

    Exit code: 0; 1 an error of LinuxCNC; 2 too late, or the call cannot be carried out; 3 an emergency stop; 4 the twin
    has lost steps or is not well otherwise.
    """
    from isel_twin.bridge.linuxcnc.session import CODES, INI, LinuxCncError, Session, lacking, lockstep, scale_of
    from isel_twin.bridge.linuxcnc.session import install as install_component
    from isel_twin.bridge.operate.client import Client, ClientError
    from isel_twin.bridge.operate.conditions import conditions
    from isel_twin.bridge.operate.started import Started
    from isel_twin.bridge.serve.loop import on_signals
    from isel_twin.cli.outputs import say
    from isel_twin.language import set_points_language

    options.check_seconds("timeout", timeout, 1.0)
    with call_errors():
        if install:
            print(install_component())
            return 0
        if lacking():
            raise LinuxCncError(lacking())
    controller, language = set_points_language()
    settings = [word for name, value in language.unwatched.items() for word in ("--set", f"{name}={value}")]
    with ExitStack() as stack:
        stack.enter_context(on_signals(_interrupt))  # whatever ends this process ends what it has started
        try:
            started = Started("--controller", controller, "--speed", "max", *settings, *serve)
            stack.callback(started.stop)
            with call_errors(ini), Client(started.info["control"]) as client:
                scale = scale_of(client.ask({"state": True}))
                say(f"{started.info['machine']}, {'in lockstep' if lockstep() else 'by a sampler'}")
                lines = "\n".join(mdi or [])
                with Session(started.info["tcp"], scale, ini or INI, lines, keep or (), timeout) as session:
                    done = session.wait()
                state = client.ask({"state": True})
        except ClientError as error:
            raise CallError(str(error)) from None
    for line in done.said if done.said else done.log.splitlines()[-20:]:
        print(line)
    for text in filter(None, conditions(state).values()):
        print(f"twin: {text}")
    print(f"twin: {' '.join(f'{mm:.4f}' for mm in state['machine_position_mm'])} mm, at {state['time_s']:.3f} s")
    if done.code:
        say(f"LinuxCNC ends with {done.code}: {CODES.get(done.code, 'it did not come to its session')}")
        return done.code if done.code in CODES else 1
    return NOT_WELL if any(conditions(state).values()) else 0


def _interrupt() -> None:
    raise KeyboardInterrupt
