"""Readers of job files, and what all of them share: recognition, cautions, plausibility, text from bytes."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, takewhile
from typing import BinaryIO, Protocol

from isel_twin.cam.feeds import Feeds
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import (
    Arc,
    CamError,
    Caution,
    Element,
    End,
    Line,
    Place,
    Rapid,
    Reference,
    Spindle,
    Toolpath,
)

HEAD_LINES = 200  # that say something, by which a file is recognised
HEAD_BYTES = 1 << 20  # at its beginning, in which they are looked for
LONGEST = 65_536  # characters of a line that are read at once; a longer line comes in pieces of this length
SHALLOW_MM = 0.02  # no cut of these machines is meant to be less deep
MOST = 1e6  # mm, mm/s, s, turns a minute: no number of a job for these machines is larger
_COMMAND = re.compile(r"\s*(@\d|<\d)")
_REMARK = re.compile(r"\s*([;#(].*)?$")
_MARK = "\xef\xbb\xbf"  # of UTF-8 at the beginning of a file, read as Latin-1
_END = "\x1a"  # of a text, where programs of old systems write one
_NO_TEXT: Mapping[str, str] = {
    "\x1f\x8b": "is packed by gzip; unpack it",
    "PK\x03\x04": "is a zip archive; unpack it",
    "%PDF": "is a PDF; save the text of the program",
    "\x89PNG": "is a picture; make toolpaths of it with a CAM program",
    "\xff\xd8\xff": "is a picture; make toolpaths of it with a CAM program",
    "\xff\xfe": "is UTF-16; save it as UTF-8",
    "\xfe\xff": "is UTF-16; save it as UTF-8",
}
_DRAWN = "it has shapes, no way of a tool; make toolpaths of it with a CAM program"
_PAL = r"#(axis|steps|elev|units|ref_speed)\b|reference\s+[xyza]+\s*;|move(to|rel)?\s+-?[\d.]+\(\d"
_NO_JOB = {  # by the first lines of a text
    rf"\s*+{pattern}": f"is {what}"
    for pattern, what in {
        r"(999\s[^\n]*\n\s*)*0\s+SECTION\b": f"a DXF drawing: {_DRAWN}",
        r"(<\?xml[^>]*>\s*)?(<!--[^>]*>\s*|<!DOCTYPE[^>]*>\s*)*<svg\b": f"an SVG drawing: {_DRAWN}",
        r"<[?!]?[a-z]": "XML or HTML, no job of a machine",
        r"\{\s*[\"}]|\[\s*([\[{\"]|[-\d.]+\s*[,\]])": "JSON, no job of a machine",
        r"\[+[\w.]+\]+\s*$": "a table of settings, no job of a machine",
        r"solid\b[^\n]*\n\s*facet\b": f"an STL body: {_DRAWN}",
        r"ISO-10303-21;": f"a STEP body: {_DRAWN}",
        r"%!PS": f"PostScript: {_DRAWN}, or with pstoedit",
        r"(G04[^\n]*\*\s*)*%(FS[LT][AI]|MO(MM|IN)\*|TF\.)": "a Gerber drawing; pcb2gcode makes toolpaths of it",
        rf"(.*\n){{0,20}}?\s*+({_PAL})": "a source of PAL-PC; what that sends can be recorded and run",
        r"P\d+\s*\n\s*[GMXYZ]": (
            "a program of the BWO 900 without numbers of blocks (N10 ...); for G-code leave that line out"
        ),
    }.items()
}
_DRILL_HEADER = re.compile(r"\s*(INCH\b|METRIC\b|FMAT,|ICI\b|T\d+[^;M]*C\.?\d)", re.I)
_DRILL_BEGIN = re.compile(r"\s*(%|G90|M7[12]|(INCH|METRIC)\b.*)\s*$", re.I)
_DRILL_POINT = re.compile(r"\s*(T\d+)?([XY][-+]?[\d.]+|G85)+\s*$", re.I)
_DRILL_TOOL = re.compile(r"\s*T\d+([CFS][\d.]+)*\s*$", re.I)
_DRILL_REST = re.compile(r"\s*(%|M(00|30|7[12]|95)|G(05|9[01]|93.*)|R\d+[XY].*|(INCH|METRIC)\b.*)\s*$", re.I)
_BINARY = 4  # control characters that texts have not, in the first _BEGIN bytes
_BEGIN = 512
_CONTROLS = bytes({*range(32)} - {3, 9, 10, 11, 12, 13, 26, 27})  # ETX and ESC are in HPGL, 26 ends a text


class Reader(Protocol):
    """A format of job files; made by an entry point of the group `isel_twin.job_files`."""

    name: str  # of the entry point
    title: str  # for people
    suffixes: tuple[str, ...]  # of file names, as ".ncp": they decide where the content does not

    def claims(self, head: str) -> bool:
        """Is a file that begins like this in this format?"""

    def read(self, lines: Iterable[str], settings: CamSettings) -> Toolpath:
        """The toolpath, made while it is read. lines: with or without their ends, a longer one in pieces of LONGEST.
        Raises CamError, when it gets there."""


def statements(head: str) -> list[str]:
    """The first lines of a file that say something. None of a job of commands (jobs/3): one in which a line is a
    command of a controller, or that begins with a remark (# ...)."""
    lines = list(islice((line for line in head.splitlines() if not _REMARK.match(line)), HEAD_LINES))
    if head.lstrip().startswith("#") or any(_COMMAND.match(line) for line in lines):
        return []
    return lines


def head_of(data: bytes) -> str:
    """The lines by which a file is recognised: its first one, and the first ones that say something, behind remarks of
    any number. Raises CamError for what is no text, and for drawings and bodies that CAM programs begin with."""
    begin = data[:_BEGIN]
    lines = (line for line in text_lines(io.BytesIO(data[:HEAD_BYTES])) if not line.isspace())
    first = next(lines, "")
    head = "".join([first, *islice((line for line in lines if not _REMARK.match(line)), HEAD_LINES)])
    for pattern, why in _NO_JOB.items():
        if re.match(pattern, head, re.IGNORECASE | re.MULTILINE):
            raise CamError(f"the file {why}")
    if len(begin) - len(begin.translate(None, _CONTROLS)) > _BINARY:
        raise CamError("the file is no text")
    return head


def mostly(head: str, pattern: re.Pattern[str]) -> bool:
    """Do more than a quarter of the statements begin like this?"""
    lines = statements(head)
    return sum(bool(pattern.match(line)) for line in lines) > len(lines) // 4


def drills(head: str) -> bool:
    """Is it a drill file? One begins with M48, as G-code may, and has a header of its own words up to % or M95; or has
    nothing but tools and points (cam/12)."""
    lines = statements(head)
    begin = next((at for at, line in enumerate(lines) if not _DRILL_BEGIN.match(line)), len(lines))
    if lines[begin:] and re.match(r"\s*M48\s*$", lines[begin], re.I):
        header = list(takewhile(lambda line: line.strip().upper() not in ("%", "M95"), lines[begin + 1 :]))
        ends = len(header) < len(lines) - begin - 1
        return any(map(_DRILL_HEADER.match, header)) or (ends and not any("G" in line.upper() for line in header))
    points, tools = ([bool(each.match(line)) for line in lines] for each in (_DRILL_POINT, _DRILL_TOOL))
    known = (point or tool or _DRILL_REST.match(line) for point, tool, line in zip(points, tools, lines, strict=True))
    return any(points) and any(tools) and all(known)


def text_lines(file: BinaryIO) -> Iterator[str]:
    """Lines of a file of any size, with "\\n" at their ends: UTF-8, a line that is not is Latin-1 (cam/11). CR LF, LF
    and CR alone end a line, and Ctrl-Z the text. Raises CamError for what is no text."""
    text = io.TextIOWrapper(file, encoding="latin-1", newline=None)
    try:
        line = text.readline(LONGEST)
        for begins, why in _NO_TEXT.items():
            if line.startswith(begins):
                raise CamError(f"the file {why}", Place(1))
        if line.count("\0", 0, 64) > 1 or line.startswith("\0"):
            raise CamError("the file is no text, or UTF-16; save it as UTF-8", Place(1))
        line = line.removeprefix(_MARK) or text.readline(LONGEST)
        while line:
            if _END in line:
                if rest := line[: line.index(_END)]:
                    yield rest
                return
            yield line if line.isascii() else _decoded(line)
            line = text.readline(LONGEST)
    finally:
        if not file.closed:
            text.detach()


def whole_lines(lines: Iterable[str]) -> Iterator[str]:
    """The same lines, for formats in which none is long. Raises CamError for one that came in pieces."""
    for number, line in enumerate(lines, 1):
        if len(line) >= LONGEST:
            raise CamError(f"the line is longer than {LONGEST} characters; write one statement a line", Place(number))
        yield line


def _decoded(line: str) -> str:
    try:
        return line.encode("latin-1").decode("utf-8")
    except UnicodeDecodeError:
        return line


def unusual(number: str) -> str:
    """Say why a number with a decimal comma or an exponent is not read, and how it is written; "" for any other."""
    if "," not in number and "e" not in number.lower():
        return ""
    what = "a comma" if "," in number else "an exponent"
    try:
        plain = f"{float(number.replace(',', '.')):.9f}".rstrip("0").rstrip(".")
    except ValueError:
        return f"{number[:30]} has {what}"
    return f"{number[:30]} has {what}; write {plain}"


class Once:
    """Cautions of a file: the first of each kind."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def __call__(self, kind: str, place: Place, text: str) -> tuple[Caution, ...]:
        if kind in self._said:
            return ()
        self._said.add(kind)
        return (Caution(place, text),)


def plausible(path: Toolpath, settings: CamSettings, feeds: Feeds) -> Toolpath:
    """The same toolpath; before its end a caution if its highest point is cut and its lowest is travelled (cam/14), if
    it cuts less deep than it can be meant (cam/34), or at feeds out of proportion (cam/39)."""
    travel, cut = [math.inf, -math.inf], [math.inf, -math.inf]  # lowest and highest Z
    zero = settings.machine_point(settings.zero)[2]
    at = settings.machine_point(settings.start)
    element: Element
    for element in path:
        kind = type(element)
        if kind is Line or kind is Arc or kind is Rapid:
            if kind is Rapid:
                heights = travel
            else:
                heights = cut
                if element.feed_mm_s > feeds.across_mm_s:  # type: ignore[union-attr]
                    feeds.cut(element, at)  # type: ignore[arg-type]
            at = element.to  # type: ignore[union-attr]
            z = at[2]
            if z < heights[0]:
                heights[0] = z
            if z > heights[1]:
                heights[1] = z
        elif kind is Spindle:
            feeds.spindle(element)  # type: ignore[arg-type]
        elif kind is Reference:
            at = element.ends(at)  # type: ignore[union-attr]
        elif kind is End:
            yield from feeds.caution()
            if travel[0] <= cut[0] and cut[1] > travel[1] + 1e-9:
                why = "it cuts above its rapid moves; if so, set file_z_up = false"
                yield Caution(element.place, f"Z of this file seems to count downwards: {why}")
            if 1e-9 < (depth := zero - cut[0]) < SHALLOW_MM:
                told = f"the deepest cut is {1000.0 * depth:.3g} um below the zero of the work"
                yield Caution(element.place, f"{told}; is the file in another unit?")
        yield element
