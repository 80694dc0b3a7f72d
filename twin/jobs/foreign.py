"""Files of CAM programs that are given to a controller as they are: said in one line, not in a refusal a line.

    IMF_PBL, FASTABS X1000, MOVEABS ...     NCP, isel's intermediate format
    G1 X10.5 F300, %, (a remark)            G-code
    IN;SP1;PU0,0;                           HPGL

A file is known by its content, not by its name. One with a command of the iMC, or that begins with a remark (# ...), is
a job whatever else is in it (jobs/3).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

LINES = 200  # at the beginning that are looked at
_NCP = re.compile(
    r"\s*(N\d+\s+)?(IMF_PBL\b|(FAST|MOVE|CW|CCW|CWHLX|CCWHLX)(ABS|REL)\b|(FAST)?VEL\s*\d|WPCLEAR\b|PROGEND\b|GETTOOL\b)",
    re.I,
)
_G_CODE = re.compile(
    r"\s*/?\s*(N\d+\s*)?G0?[0-3]\b[^,;<]*[XYZ]\s*[-+]?[\d.]|\s*%\s*$|\s*(N\d+\s*)?G(2[01]|9[01])\b", re.I
)
_HPGL = re.compile(r"\s*(\x1b%-?\d*B|IN;|SP\d|P[UDA]-?\d+,-?\d+|PU;)")
_COMMAND = re.compile(r"\s*(@\d|<\d)")
_REMARK = re.compile(r"\s*([;#(].*)?$")


def kind_of(text: str) -> str:
    """ "NCP", "G-code" or "HPGL"; "" for anything else, a job of commands among them."""
    lines = [line for line in text.splitlines()[:LINES] if not _REMARK.match(line)]
    if text.lstrip().startswith("#") or not lines or any(_COMMAND.match(line) for line in lines):
        return ""
    for kind, pattern in (("NCP", _NCP), ("HPGL", _HPGL), ("G-code", _G_CODE)):
        if sum(bool(pattern.match(line)) for line in lines) > len(lines) // 4:
            return kind
    return ""


def remedy(kind: str, controller: str, others: Sequence[str]) -> str:
    """What to do with such a file, in words. others: controllers that run programs."""
    programs = f"; programs by DIN 66025 run on {' and '.join(others)}" if kind == "G-code" and others else ""
    return (
        f"is {kind}, which {controller} does not understand: a job has the commands of the controller, as a host sends "
        f"them; have a post-processor write those{programs}"
    )
