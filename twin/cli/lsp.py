"""`isel-twin lsp`: a language server for job files."""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError


def lsp(
    *,
    settings: Annotated[
        Path | None, Parameter(help="File of bounds; without it isel-twin.toml beside each job, or above.")
    ] = None,
    machine: Annotated[str | None, Parameter(help="Name of a machine, or path of a machine folder.")] = None,
    controller: Annotated[str | None, Parameter(help="Name of a controller.")] = None,
    plant: Annotated[str | None, Parameter(help="mujoco or kinematic.")] = None,
) -> int:
    """Serve an editor: findings of `check` while a job is typed, figures of each line, what a command means.

    Speaks the Language Server Protocol on standard input and output; the editor starts it (docs/editors.md). Machine,
    controller and bounds come from isel-twin.toml, or from the options.
    """
    try:
        from isel_twin.bridge.editor.server import JobServer
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        raise CallError("lsp needs pygls: pip install 'isel-twin[lsp]'") from None
    server = JobServer(settings, {"machine": machine, "controller": controller, "plant": plant})
    given, out = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")  # the server closes them
    try:
        with redirect_stdout(sys.stderr):  # nothing else may be said there
            server.start_io(given, out)
    finally:
        server.end()
    return 0
