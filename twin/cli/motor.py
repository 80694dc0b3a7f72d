"""`isel-twin motor`: the torque curve of a motor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli.options import PICTURE, Json, Overrides, check_writable, parse_overrides, written

if TYPE_CHECKING:
    from isel_twin.drives.stage import Stage
    from isel_twin.machine import Machine


def motor(
    name: Annotated[
        str, Parameter(help="Type name of a motor, such as 23HS32-4004S, or with a machine one of its axes: x, y, z.")
    ],
    *,
    machine: Annotated[
        str | None, Parameter(help="Machine (name or folder) whose own motors and stages are to be taken.")
    ] = None,
    set: Overrides = (),
    picture: Annotated[
        Path | None, written("Draw torque and growth of a swing into a file (.png, .svg, .pdf).", *PICTURE)
    ] = None,
    json: Json = False,
) -> int:
    """Show a motor's torque curve with two closed forms, a prediction and a bound, and from which speed on a swing of
    its rotor grows. * marks speeds compared with a maker's curve, ~ those beyond that limit.

    At 48 V with the rated current and 1600 microsteps a revolution, or on the stage of a machine. For a servo axis:
    peak and continuous torque.
    """
    from tempfile import TemporaryDirectory

    if set and machine is None:
        raise CallError("set: changes a machine; name it with --machine", option=True)
    check_writable(picture)
    with call_errors(), TemporaryDirectory() as folder:
        from isel_twin.base.axes import CARRIAGES
        from isel_twin.drives.library import MOTORS
        from isel_twin.drives.report import show_motor
        from isel_twin.machine import load_machine, with_overrides

        drawn = Path(folder) / picture.name if picture is not None else None
        if machine is None:
            show_motor(name, picture=drawn, json=json)
        else:
            owner = with_overrides(load_machine(machine), parse_overrides(set))
            if name in CARRIAGES and _show_servo(owner, name, drawn, json):
                return _keep(drawn, picture)
            if name in CARRIAGES:
                name = str(owner.tree["axes"][name]["motor"])
            show_motor(name, _stage(owner, name), drawn, {**MOTORS, **owner.motors}, json=json)
        return _keep(drawn, picture)


def _keep(drawn: Path | None, picture: Path | None) -> int:
    from isel_twin.base.files import atomic_write

    if picture is not None and drawn is not None:
        atomic_write(picture, drawn.read_bytes())
    return 0


def _show_servo(machine: Machine, name: str, picture: Path | None, json: bool) -> bool:
    """Show the motor of a servo axis; False for another axis."""
    from isel_twin.base.axes import CARRIAGES
    from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
    from isel_twin.drives.servo_report import show_servo

    axis = machine.axes[CARRIAGES.index(name)]
    if not (isinstance(axis.motor, ServoMotor) and isinstance(axis.stage, ServoDrive)):
        return False
    show_servo(f"{machine.name}, axis {name}", axis.motor, axis.stage, axis.screw.lead_mm, picture, json=json)
    return True


def _stage(machine: Machine, motor: str) -> Stage | None:
    """The stage of the first axis with that motor."""
    from isel_twin.drives.stage import Stage

    stages = (a.stage for a in machine.axes if machine.tree["axes"][a.name].get("motor") == motor)
    return next((stage for stage in stages if isinstance(stage, Stage)), None)
