"""G-code: RS274 as LinuxCNC's interpreter defines it, as far as CAM programs write it (docs/jobfiles.md).

words.py     a line as words, remarks left out
codes.py     modal groups; what is refused
program.py   the blocks, in the order of their lines
motion.py    modes and motions
arcs.py      centres and tolerances
cycles.py    G73 G81 G82 G83 G85 G89
offsets.py   G54 .. G59.3, G92, G52, lengths of tools
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from isel_twin.cam.feeds import Feeds
from isel_twin.cam.gcode.program import Program
from isel_twin.cam.reader import drills, mostly, plausible, whole_lines
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath

_CLAIM = re.compile(
    r"\s*+%\s*\w*\s*$|\s*+/?\s*+(N\d+\s*)?("
    r"G0?[0-3](?!\d)[^,;<]*[XYZ]\s*[-+]?[\d.]|G(17|2[018]|4[0349]|5[4-9]|64|7[13]|8[0-359]|9[0-9])(?!\d)"
    r"|[XYZ]\s*[-+]?[\d.]|T\d+\s*M0?6(?!\d)|M(0?\d|30)\s*$)",
    re.I,
)


class GCode:
    """The reader."""

    name = "gcode"
    title = "G-code"
    suffixes = (".nc", ".ngc", ".tap", ".cnc", ".gcode", ".din", ".iso")

    def claims(self, head: str) -> bool:
        return mostly(head, _CLAIM) and not drills(head)

    def read(self, lines: Iterable[str], settings: CamSettings) -> Toolpath:
        program = Program(settings)
        feeds = Feeds(settings, program.per_mm_s, ("mm/min", "mm/s"))
        return plausible(program.run(whole_lines(lines)), settings, feeds)


def create(name: str) -> GCode:
    return GCode()
