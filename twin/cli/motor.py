"""`isel-twin motor`: the torque curve of a motor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.call import call_errors
from isel_twin.cli.options import check_writable


def motor(
    name: Annotated[str, Parameter(help="Type name of a motor, such as 23HS32-4004S.")],
    *,
    picture: Annotated[Path | None, Parameter(help="Draw the curve into a file (.png, .svg, .pdf).")] = None,
) -> int:
    """Show a motor's torque curve with its closed-form envelope."""
    from tempfile import TemporaryDirectory

    check_writable(picture)
    with call_errors(), TemporaryDirectory() as folder:
        from isel_twin.drives.report import show_motor
        from isel_twin.files import atomic_write

        drawn = Path(folder) / picture.name if picture is not None else None
        show_motor(name, picture=drawn)
        if picture is not None and drawn is not None:
            atomic_write(picture, drawn.read_bytes())
    return 0
