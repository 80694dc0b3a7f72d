"""Tells code of the host from that of Python, packages and the twin."""

from __future__ import annotations

import os
import sys
from types import FrameType

import isel_twin

# Folders of Python, of packages and of the twin; other files belong to the host.
LIBRARIES = tuple(
    folder.rstrip(os.sep) + os.sep
    for folder in (
        os.path.dirname(os.__file__),
        os.path.dirname(os.path.abspath(__file__)),
        os.path.dirname(os.path.abspath(isel_twin.__file__)),
        *(folder for folder in sys.path if folder.endswith(("site-packages", "dist-packages"))),
    )
)


def host_line(frame: FrameType | None) -> str:
    """File and line of the innermost call in a stack that is in no library; empty if there is none."""
    while frame is not None:
        name = frame.f_code.co_filename
        if not name.startswith((*LIBRARIES, "<frozen")):
            return f"{os.path.basename(name)}:{frame.f_lineno}"
        frame = frame.f_back
    return ""
