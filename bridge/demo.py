"""`isel-twin demo`: a host program drives the twin through a pseudo-terminal, as it would drive the machine.

The host part (`_Host`) has only a port name and the controller's language; the twin serves that port in its own thread.
Beside each reply the true positions are shown, which the host cannot see.
"""

from __future__ import annotations

import os
import sys
import threading
import time

import serial
from rich import box
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.server import Server
from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed

CONTROLLER = "imc-s8"
REPLY_TIMEOUT_S = 120.0

# A session as real hosts run it, and what each command is for.
SESSION = (
    ("@07", "initialise X, Y, Z"),
    ("@0M16000,10000,8000,10000,0,10000,0,30", "refused: no reference run yet"),
    ("@0d5000,5000,5000", "reference speed 15.6 mm/s"),
    ("@0R7", "reference run: Z, Y, X onto their switches"),
    ("@0P", "where do you think you are?"),
    ("@0M16000,10000,8000,10000,0,10000,0,30", "to X 50 mm, Y 25 mm"),
    ("@0P", "and now?"),
    ("@0z1", "interpolate in space"),
    ("@0M48000,10000,24000,10000,9600,10000,0,30", "to 150, 75, 30 mm at 31 mm/s"),
    ("@0M0,10000,0,10000,0,10000,0,30", "and back to zero"),
)

# The same job with a ramp and a speed that the motors cannot follow.
OVERLOAD = (
    ("@0J4000", "ramp: 4000 Hz/ms instead of 100"),
    ("@0M48000,20000,24000,20000,9600,20000,0,30", "the same way at twice the speed"),
    ("@0P", "the controller is sure"),
)


class _Host:
    def __init__(self, port: str, baud: int) -> None:
        self.serial = serial.Serial(port, baud, timeout=REPLY_TIMEOUT_S)
        self._language = needed(create_language(CONTROLLER), CONTROLLER)

    def ask(self, command: str) -> str:
        """Send a command, read until its reply is complete. Raises TimeoutError."""
        data = self._language.frame(command)
        self.serial.write(data)
        self._language.messages(data, sent=True)
        while byte := self.serial.read(1):
            for message in self._language.messages(byte, sent=False):
                return message.text
        raise TimeoutError(f"no complete reply to {command!r} within {REPLY_TIMEOUT_S:g} s")


def _session(console: Console, host: _Host, twin: Twin, title: str, commands: tuple[tuple[str, str], ...]) -> None:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 1, 0))
    table.add_column("virtual s", justify="right", no_wrap=True)
    table.add_column("host sends", overflow="fold")
    table.add_column("reply", overflow="fold")
    table.add_column("", no_wrap=True)
    for heading in ("counter mm", "true mm", "difference um"):
        table.add_column(heading, justify="right", no_wrap=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("")
        for command, purpose in commands:
            progress.update(task, description=f"{command}   {purpose}")
            reply = host.ask(command)
            axes, true_mm = twin.machine.axes, twin.position_mm
            counter_mm = [count / axis.steps_per_mm for count, axis in zip(twin.counts, axes, strict=False)]
            table.add_row(
                f"{twin.time_ns / 1e9:.3f}",
                f"{command}\n[dim]{purpose}[/dim]",
                reply,
                "X\nY\nZ",
                "\n".join(f"{value:.3f}" for value in counter_mm),
                "\n".join(f"{value:.3f}" for value in true_mm),
                "\n".join(f"{1e3 * (true - counter):.1f}" for true, counter in zip(true_mm, counter_mm, strict=True)),
            )
    console.print(table)


def main() -> None:
    console = Console() if sys.stdout.isatty() else Console(width=100)
    with console.status("building the machine"):
        twin = Twin(machine="4030", controller=CONTROLLER, seed=int(os.environ.get("SEED", "0")), line_speed=True)
    pty = PtyEndpoint()
    server = Server(twin, Pacer(None), [pty])
    thread = threading.Thread(target=server.run, name="isel-twin", daemon=True)
    began = time.monotonic()
    thread.start()
    console.print(
        f"The twin of a 4030 with its iMC-S8 listens on [bold]{pty.address}[/bold], a host program opens it.\n"
    )
    host = _Host(pty.address, twin.serial_format.baud)
    _session(console, host, twin, "A session", SESSION)
    console.print("Differences of some um are load, friction and backlash; no step is lost.\n")
    _session(console, host, twin, "The same way, too fast", OVERLOAD)
    host.serial.close()
    wall_s = time.monotonic() - began
    server.stop()
    thread.join()
    twin.run(1.0)
    lost = ", ".join(
        f"{axis.name.upper()} {steps} ({steps / axis.steps_per_mm:.1f} mm)"
        for axis, steps in zip(twin.machine.axes, twin.lost_steps.round().astype(int), strict=False)
    )
    console.print("Every reply was 0: an open-loop controller cannot know. The twin does.")
    console.print(f"[bold]Steps lost[/bold]: {lost}\n")
    virtual_s = twin.time_ns / 1e9
    console.print(f"{virtual_s:.1f} s of machine time took {wall_s:.1f} s: {virtual_s / wall_s:.0f} times real time.")
    console.print(
        "\nNext: [bold]isel-twin serve --pty /tmp/imc[/bold] and point your own host program at /tmp/imc;\n"
        "[bold]isel-twin init shop[/bold] begins a project. In a checkout the command is .venv/bin/isel-twin."
    )


if __name__ == "__main__":
    main()
