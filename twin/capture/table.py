"""Text tables that logic analysers export as CSV.

    Saleae Logic          sigrok, PulseView                   any other
    Time [s],Channel 0    ; Channels (2/8): D0, D1            t_us;D0;D1
    0.000000000,0         ; Samplerate: 1 MHz                 0;0;1
    0.000012500,1         logic,logic                         12,5;1;1
                          0,1

Separated by comma, semicolon, tab or, without any of these, blanks; lines that begin with ; or # are comments, empty
ones are skipped. Times are decimal numbers in the unit of the column's name, converted exactly to whole nanoseconds; or
there are none, and each row is one sample at a known rate. Cells are 0 or 1.

LinuxCNC's `halsampler -t` writes the number of each sample before its values, and "overrun" where some are missing: a
gap from the number before to the one after.
"""

from __future__ import annotations

import codecs
import csv
import itertools
import mmap
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from isel_twin.base.units import SECOND_NS
from isel_twin.capture.vcd import ALL, EARLIER, NO_TIME, SCAN, gaps_of, scanned, waves_of
from isel_twin.capture.wave import LONGEST_NS, Capture, CaptureError, WrongCallError
from isel_twin.native import core

UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0, "ps": -3}  # powers of ten from a unit of time to nanoseconds
OVERRUN = "overrun"
HEADER_LINES = 200  # lines within which the first row must be found
LONGEST_LINE = 1 << 16  # bytes of a line beyond which a file is not a table
FASTEST_HZ = 4 * SECOND_NS
IS_TIME = -2  # in the place of a signal: the column of times

_SPELT = {
    **{name: name for name in UNITS},
    **{"sec": "s", "second": "s", "seconds": "s", "millisecond": "ms", "milliseconds": "ms", "µs": "us", "μs": "us"},
    **{"microsecond": "us", "microseconds": "us", "nanosecond": "ns", "nanoseconds": "ns"},
    **{"picosecond": "ps", "picoseconds": "ps"},
}
_TIME_NAME = re.compile(
    r"(?:(?:time|timestamp|t)(?:[\s_\[(/,-]*([a-zµμ]+)[\])]?)?|((?:milli|micro|nano|pico)?seconds?))"
)
_RATE = re.compile(r"samplerate:\s*([0-9]+(?:\.[0-9]+)?)\s*([kMG]?)Hz", re.IGNORECASE)
_CHANNELS = re.compile(r"channels\s*(?:\([^)]*\))?:\s*(.+)", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]*)?(?:[eE][+-]?[0-9]+)?")
NO_BIT, SHORT_ROW, TOO_LATE, NO_COUNT = range(6, 10)
IN_C = ("IS_TIME", "NO_BIT", "SHORT_ROW", "TOO_LATE", "NO_COUNT")  # records.h has them, too
_PROBLEMS = {
    NO_TIME: "the time is no decimal number; export times in seconds",
    EARLIER: "the time is less than the one before; sort the rows by time",
    NO_BIT: "is neither 0 nor 1; export digital channels",
    SHORT_ROW: "the row has fewer columns than the first one; export the capture again",
    TOO_LATE: "the time is beyond 31 years; give the unit by --time-unit",
    NO_COUNT: "samples are missing, and their numbers, too, which would tell how many; take them by halsampler -t",
}


class Table:
    """A table; only its beginning is read at first."""

    def __init__(self, path: Path, time_unit: str | None = None, sample_rate_hz: float | None = None) -> None:
        """time_unit: one of UNITS, for a time column without a unit in its name. sample_rate_hz: of a table without
        times.

        Raises CaptureError, OSError.
        """
        self.path = path
        with path.open("rb") as file:
            if not file.seek(0, 2):
                raise CaptureError(f"{path}: is empty")
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        comments, rows, places = self._beginning()
        if not any(mark in rows[-1][1] for mark in "\t;,") and len(rows[-1][1].split()) > 1:
            text = b"\n".join(b",".join(line.split()) for line in self._data[:].splitlines())
            self._data = mmap.mmap(-1, len(text))
            self._data.write(text)
            _, rows, places = self._beginning()
        first = rows[0][1]
        self._delimiter = next((mark for mark in "\t;" if mark in rows[-1][1]), ",")
        try:
            cells = [
                cell.strip() for cell in next(csv.reader([first], delimiter=self._delimiter, skipinitialspace=True))
            ]
        except csv.Error as error:
            raise CaptureError(f"{path}: line {rows[0][0]}: {error}") from None
        headed = not all(_NUMBER.fullmatch(cell) for cell in cells if cell)
        numbered = not headed and _count_up([row.partition(self._delimiter)[0] for _, row in rows])
        said = _names_in(comments)
        rate_hz = sample_rate_hz if sample_rate_hz is not None else _rate_in(comments)
        if headed and len(rows) < 2:
            raise CaptureError(f"{path}: has no row below its header")
        self._begin, self._line = places[int(headed)], rows[int(headed)][0]
        self._time, self._unit = self._time_column(cells, headed, time_unit, rate_hz, numbered)
        columns = [column for column in range(len(cells)) if column != self._time]
        names = [cells[column] for column in columns] if headed else [str(column + 1) for column in columns]
        if len(said) == len(columns) and (not headed or len(set(names)) < len(names) or set(names) == {"logic"}):
            names = said
        self._columns = dict(zip(names, columns, strict=True))
        if not all(names) or len(self._columns) < len(names):
            raise CaptureError(f"{path}: line {rows[0][0]}: columns need names of their own: {', '.join(names)[:80]}")
        self._width = len(cells)
        self._rate_hz = None if self._unit else rate_hz

    @property
    def names(self) -> list[str]:
        """Names of all columns but the time."""
        return list(self._columns)

    def read(self, names: Sequence[str]) -> Capture:
        """Levels of the named columns. Times that begin before 0 are shifted to begin at 0.

        Raises CaptureError for a name that is not there and for a row that is damaged.
        """
        found = [self._find(name) for name in names]
        order = list(dict.fromkeys(found))
        columns = np.full(self._width, -1, dtype=np.int16)
        columns[order] = np.arange(len(order))
        if self._time is not None:
            columns[self._time] = IS_TIME
        data = np.frombuffer(self._data, dtype=np.uint8)
        scan = np.zeros(1, SCAN)
        scan["place"], scan["line"] = self._begin, self._line
        levels, first = np.full(len(order), -1, dtype=np.int8), np.zeros(len(order), dtype=np.int8)
        power = UNITS[self._unit or "ns"]
        numbered = self._time is not None and self._rate_hz is not None
        how = data, ord(self._delimiter), columns, numbered, power, scan, levels, first
        pieces = scanned(lambda *room: core.scan_table(*how, *room), data.size, scan)
        place, line, last, begin, problem, column, *_ = scan[0].tolist()
        if problem:
            self._tell(line, problem, column, bytes(data[place : place + 40]))
        if self._rate_hz is not None:
            rate = round(self._rate_hz)
            last = last * SECOND_NS // rate
            if last > LONGEST_NS:
                wrong = f"{self.path}: the last sample is beyond 31 years at {rate} samples a second"
                raise CaptureError(f"{wrong}; give the right --sample-rate")
            for times, _ in pieces:
                whole, rest = np.divmod(times, rate)
                times[:] = whole * SECOND_NS + (2 * rest * SECOND_NS + rate) // (2 * rate)
        shift = max(0, -begin)
        for times, _ in pieces:
            times += shift
        end_ns = max(last + shift, 0)
        made = waves_of(pieces, first, end_ns)
        waves = {name: made[order.index(column)] for name, column in zip(names, found, strict=True)}
        resolution = SECOND_NS / self._rate_hz if self._rate_hz is not None else 0.0
        return Capture(waves, end_ns, resolution, shift, gaps_of(pieces, ALL, end_ns)[1])

    def _tell(self, line: int, problem: int, column: int, data: bytes) -> NoReturn:
        where = next((name for name, place in self._columns.items() if place == column), "")
        cell = [*data.decode("latin-1").splitlines(), ""][0].split(self._delimiter)[0]
        shown = ascii(cell[:24].strip())
        about = f"column {where}: {shown} " if problem == NO_BIT else "" if problem == SHORT_ROW else f"{shown}: "
        raise CaptureError(f"{self.path}: line {line}: {about}{_PROBLEMS[problem]}")

    def _beginning(self) -> tuple[list[str], list[tuple[int, str]], list[int]]:
        """Comments, and line numbers, texts and places of the first three rows."""
        comments: list[str] = []
        rows: list[tuple[int, str]] = []
        places: list[int] = []
        place = 3 if self._data[:3] == codecs.BOM_UTF8 else 0
        if self._data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) or b"\0" in self._data[: 1 << 12]:
            raise CaptureError(f"{self.path}: is UTF-16 or no text at all; save it as UTF-8 text")
        self._data.seek(place)
        for number in range(1, HEADER_LINES + 1):
            place = self._data.tell()
            line = self._data.readline()
            if len(line) > LONGEST_LINE:
                raise CaptureError(f"{self.path}: line {number}: is too long for a table; export the capture as CSV")
            if not line or len(rows) == 3:
                break
            text = line.decode("utf-8", "replace").strip("\r\n")
            if text[:1] in (";", "#"):
                comments.append(text[1:].strip())
            elif text.strip() and text.strip() != OVERRUN:
                rows.append((number, text))
                places.append(place)
        if not rows:
            raise CaptureError(f"{self.path}: has no row in it")
        return comments, rows, places

    def _time_column(
        self, cells: list[str], headed: bool, unit: str | None, rate_hz: float | None, numbered: bool
    ) -> tuple[int | None, str]:
        """The column of times and its unit; none for the numbers of samples, which take a rate."""
        if unit is not None and unit not in UNITS:
            raise WrongCallError(f"time-unit {unit}: must be one of {', '.join(UNITS)}")
        if rate_hz is not None and not (1.0 <= rate_hz <= FASTEST_HZ and rate_hz == round(rate_hz)):
            raise WrongCallError(f"sample-rate {rate_hz:g}: must be a whole number from 1 to {FASTEST_HZ} Hz")
        for column, cell in enumerate(cells if headed else []):
            match = _TIME_NAME.fullmatch(cell.lower())
            if match is None:
                continue
            word = match[1] or match[2]
            found = unit or _SPELT.get(word or "")
            if found is None and (word is None or column == 0):
                remedy = f"give --time-unit, one of {', '.join(UNITS)}"
                raise CaptureError(f"{self.path}: column {cell!r} does not say its unit; {remedy}")
            if found is not None:
                return column, found
        if rate_hz is not None and (headed or unit is None):
            return 0 if numbered else None, ""
        if unit is not None:
            return 0, unit
        wrong = f"{self.path}: neither a column of times nor a sample rate: {', '.join(cells)[:80]}"
        raise CaptureError(f"{wrong}; give --time-unit for the first column, or --sample-rate")

    def _find(self, name: str) -> int:
        if name in self._columns:
            return self._columns[name]
        alike = [column for other, column in self._columns.items() if other.lower() == name.lower()]
        if len(alike) == 1:
            return alike[0]
        raise CaptureError(f"{self.path}: has no column {name}; it has {', '.join(self.names[:24])}")


def _rate_in(comments: Sequence[str]) -> float | None:
    for comment in comments:
        if match := _RATE.search(comment):
            return float(round(float(match[1]) * {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}[match[2].lower()]))
    return None


def _count_up(cells: Sequence[str]) -> bool:
    """True for numbers of samples, by ones but for an overrun; levels are 0 or 1, and times go by larger steps."""
    numbers = [int(cell) for cell in cells if cell.strip().isdecimal()]
    steps = [after - before for before, after in itertools.pairwise(numbers)]
    return len(numbers) == 3 and min(steps) == 1


def _names_in(comments: Sequence[str]) -> list[str]:
    for comment in comments:
        if match := _CHANNELS.search(comment):
            return [name.strip() for name in match[1].split(",")]
    return []
