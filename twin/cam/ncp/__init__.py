"""NCP, isel's intermediate format of flat commands (".ncp"), as seven programs write it (docs/jobfiles.md).

    IMF_PBL_V1.0                    one statement a line, words divided by blanks, N and digits before it, ; remarks
    N10 VEL 10000                   lengths um, angles degrees, speeds um/s, times ms
    N20 FASTABS X10000 Y20000
    N30 CCWABS I20000 J10000        centres absolute; without an end a full circle
    N40 PROGEND

statement.py    a line in words and numbers
program.py      what they do
drill.py        the drilling cycle
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from isel_twin.cam.feeds import Feeds
from isel_twin.cam.ncp.program import Program
from isel_twin.cam.reader import mostly, plausible, whole_lines
from isel_twin.cam.settings import FEED_UNITS, CamSettings
from isel_twin.cam.toolpath import Toolpath

_CLAIM = re.compile(
    r"\s*(N\d+\s+)?(IMF_PBL\b|(FAST|MOVE|CW|CCW|CWHLX|CCWHLX)(ABS|REL)\b|(FAST)?VEL\s*\d|WPCLEAR\b|PROG(BEGIN|END)\b|GETTOOL\b"
    r"|DRILL(DEF)?\b)",
    re.I,
)


class Ncp:
    """The reader."""

    name = "ncp"
    title = "NCP"
    suffixes = (".ncp",)

    def claims(self, head: str) -> bool:
        return mostly(head, _CLAIM)

    def read(self, lines: Iterable[str], settings: CamSettings) -> Toolpath:
        program = Program(settings)
        feeds = Feeds(settings, program.per_mm_s, tuple(FEED_UNITS))
        return plausible(program.run(whole_lines(lines)), settings, feeds)


def create(name: str) -> Ncp:
    return Ncp()
