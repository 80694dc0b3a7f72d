"""`isel-twin lsp`: a language server for job files."""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout

from isel_twin.base.errors import CallError
from isel_twin.cli.jobs import AS_THE_FILE_SAYS, JobTwin, SettingsFile


def lsp(
    *,
    settings: SettingsFile = None,
    twin: JobTwin = AS_THE_FILE_SAYS,
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
    server = JobServer(settings, vars(twin))
    given, out = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")  # the server closes them
    try:
        with redirect_stdout(sys.stderr):  # nothing else may be said there
            server.start_io(given, out)
    finally:
        server.end()
    return 0
