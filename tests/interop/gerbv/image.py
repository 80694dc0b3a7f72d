"""What gerbv reads in a drill file, as it writes it again as a Gerber image: inches with six decimals.

%ADD10C,0.0315*%    the tools        X0393701Y0787402D03*   a hole
G54D10*             change of tool   .. D02* .. D01*        a slot
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

from isel_twin.cam.excellon import Excellon
from isel_twin.cam.ncp import Ncp
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Caution, Line, Tool
from tests.forked import PATIENCE_S
from tests.interop.gerbv.files import INCH, Mark

LOOSE_MM = 1e-4  # six decimals of an inch are 25 nm
LOOSE_TOOL_MM = 2e-3  # four
LOOSE_NCP_MM = 1e-3  # whole um
SETTINGS = CamSettings(z_sign=1, feed_mm_s=10.0, depth_mm=1.8)
_APERTURE = re.compile(r"%ADD(\d+)C,([\d.]+)\*%")
_POINT = re.compile(r"(?:G01)?X(-?\d+)Y(-?\d+)D0([123])\*")


def command() -> str | None:
    return shutil.which("gerbv")


def seen(gerbv: str, text: str, folder: Path) -> list[Mark]:
    """The marks of a file."""
    (folder / "file.drl").write_bytes(text.encode())
    subprocess.run(
        [gerbv, "-x", "rs274x", "-o", "file.gbr", "file.drl"],
        cwd=folder, capture_output=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    image = (folder / "file.gbr").read_text()
    diameters = {code: INCH * float(inches) for code, inches in _APERTURE.findall(image)}
    marks: list[Mark] = []
    diameter, start = 0.0, (0.0, 0.0)
    for line in image.splitlines():
        if line.startswith("G54D"):
            diameter = diameters[line[4:-1]]
        elif match := _POINT.fullmatch(line):
            to = INCH * int(match[1]) / 1e6, INCH * int(match[2]) / 1e6
            if match[3] == "3":
                marks.append((*to, diameter))
            elif match[3] == "1":
                marks.append((*start, *to, diameter))
            start = to
    return marks


def ncp(gerbv: str, folder: Path) -> str:
    """The holes of that file as NCP, without remarks; gerbv leaves slots out, and puts tools in order."""
    subprocess.run(
        [gerbv, "-x", "idrill", "-o", "file.ncp", "file.drl"],
        cwd=folder, capture_output=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    lines = (folder / "file.ncp").read_text().splitlines()
    return "\n".join(line for line in lines if line and not line.startswith(";"))


def ncp_differs(text: str, theirs: Iterable[Mark]) -> str:
    """A hole that only one of both has, the NCP as it is read here or the marks; "" for none."""
    downwards = [element for element in Ncp().read(text.splitlines(), SETTINGS) if isinstance(element, Line)]
    ours, holes = [line.to[:2] for line in downwards], [mark[:2] for mark in theirs if len(mark) == 3]
    if len(ours) != len(holes):
        return f"NCP: {len(ours)} holes, {len(holes)} in the image"
    lost = [hole for hole in holes if min(math.dist(hole, own) for own in ours) > LOOSE_NCP_MM]
    return f"NCP: {lost[0]} is lost" if lost else ""


def read(lines: Iterable[str], settings: CamSettings = SETTINGS) -> tuple[list[Mark], list[str]]:
    """The marks that the reader here makes, and its cautions; an error is the last of them."""
    marks: list[Mark] = []
    said: list[str] = []
    diameter, at, down = 0.0, (0.0, 0.0), False
    try:
        for element in Excellon().read(lines, settings):
            if isinstance(element, Tool):
                diameter = float(element.name.split()[0])
            elif isinstance(element, Line) and down:
                marks[-1] = (*at, *element.to[:2], diameter)
            elif isinstance(element, Line):
                marks.append((*element.to[:2], diameter))
                at = element.to[:2]
            elif isinstance(element, Caution):
                said.append(str(element))
                continue
            down = isinstance(element, Line)
    except CamError as error:
        said.append(str(error))
    return marks, said


def differ(ours: list[Mark], theirs: list[Mark], tool_mm: float = LOOSE_TOOL_MM) -> str:
    """The first difference; "" for none."""
    for number, (own, other) in enumerate(zip(ours, theirs, strict=False)):
        same = len(own) == len(other) and math.dist(own[:-1], other[:-1]) <= LOOSE_MM
        if not same or abs(own[-1] - other[-1]) > tool_mm:
            return f"mark {number}: {own} here, {other} there"
    return "" if len(ours) == len(theirs) else f"{len(ours)} marks here, {len(theirs)} there"
