"""The end of serving: recordings are kept, whatever the reason of the end.

stopped (a signal) ------------------.
the loop breaks (a full disk, an     +--> endpoints closed ---> recording written --> exit code
error in a part of the twin) --------'                                |
                                              disk full: write to the temporary folder and report it
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable
from pathlib import Path

from isel_twin.bridge.serve.server import Server

log = logging.getLogger("isel_twin")


def serve_and_keep(server: Server, record: Path | None = None, write: Callable[[Path], object] | None = None) -> int:
    """Serve until the server is stopped or breaks; then `write(record)`, if there is one.

    Returns an exit code: 0, or 1 if the loop broke or the recording is not in its place; the log says why.
    """
    code = 1
    try:
        server.run()
        code = 0
    except OSError as error:
        log.error("the server stops: %s", _reason(error))
    except Exception:
        log.error("the server stops, because the twin has broken; what happened until then is kept", exc_info=True)
    finally:  # also at sys.exit
        if record is not None and write is not None and not keep(record, write):
            code = 1
    return code


def keep(path: Path, write: Callable[[Path], object]) -> bool:
    """Write a file by `write(path)`, else under the same name in the temporary folder; True: in its place."""
    try:
        write(path)
    except OSError as error:
        try:
            elsewhere = Path(tempfile.mkdtemp(prefix="isel-twin-")) / path.name
            write(elsewhere)
        except OSError as another:
            log.error("%s: could not be written, and is lost: %s; nor elsewhere: %s", path, _reason(error), another)
        else:
            log.error("%s: could not be written: %s; it is kept as %s", path, _reason(error), elsewhere)
        return False
    return True


def _reason(error: OSError) -> str:
    reason = error.strerror or str(error)
    return f"{error.filename}: {reason}" if error.filename is not None else reason
