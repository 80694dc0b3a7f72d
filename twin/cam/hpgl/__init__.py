"""HPGL: plots, as drawing and engraving programs write them (docs/jobfiles.md).

    IN;SP1;PU400,400;PD1200,400;PU;     1 unit is 0.025 mm; the pen is the tool

scan.py     instructions of a file, a pair of numbers at a time
plot.py     what they do
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from isel_twin.cam.hpgl.plot import Plot
from isel_twin.cam.reader import mostly
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath

_CLAIM = re.compile(r"\s*(\x1b%-?\d*B|\x1bE|\x1b\.|IN;|SP\d|P[UDAR]\s*-?[\d.]+[,\s]\s*-?[\d.]|P[UD];)")


class Hpgl:
    """The reader."""

    name = "hpgl"
    title = "HPGL"
    suffixes = (".plt", ".hpgl", ".hpg")

    def claims(self, head: str) -> bool:
        return mostly(head, _CLAIM)

    def read(self, lines: Iterable[str], settings: CamSettings) -> Toolpath:
        return Plot(settings).run(lines)


def create(name: str) -> Hpgl:
    return Hpgl()
