"""Excellon: drill files of circuit boards, as board programs write them (docs/jobfiles.md).

    M48                 the header: units, how numbers are written, tools
    METRIC,TZ,000.000
    T1C0.8
    %                   its end
    T1
    X12500Y7000         a hole at (12.5, 7)
    X15000              one beside it
    M30

numbers.py    digits without a point as mm: what the file says of them, and what can be concluded
words.py      a line as words
program.py    what they do
"""

from __future__ import annotations

from collections.abc import Iterable

from isel_twin.cam.excellon.program import Program
from isel_twin.cam.reader import drills, whole_lines
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath


class Excellon:
    """The reader."""

    name = "excellon"
    title = "Excellon"
    suffixes = (".drl", ".drd", ".xln", ".exc")

    def claims(self, head: str) -> bool:
        return drills(head)

    def read(self, lines: Iterable[str], settings: CamSettings) -> Toolpath:
        return Program(settings).run(whole_lines(lines))


def create(name: str) -> Excellon:
    return Excellon()
