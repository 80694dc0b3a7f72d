"""Tables of text: what logic analysers export as CSV.

    Saleae Logic          sigrok, PulseView                   any other
    Time [s],Channel 0    ; Channels (2/8): D0, D1            t_us;D0;D1
    0.000000000,0         ; Samplerate: 1 MHz                 0;0;1
    0.000012500,1         logic,logic                         12,5;1;1
                          0,1

Separated by comma, semicolon or tab; lines that begin with ; or # are comments, empty ones are skipped. Times are
decimal numbers in the unit that the column's name says, converted to whole nanoseconds in whole numbers; or there are
none, and each row is one sample at a known rate. Cells are 0 or 1.
"""

from __future__ import annotations

import codecs
import csv
import mmap
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from isel_twin.base.compiling import njit
from isel_twin.base.units import SECOND_NS
from isel_twin.capture.vcd import PIECE, waves_of
from isel_twin.capture.wave import LONGEST_NS, Capture, CaptureError, WrongCallError

UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0, "ps": -3}
"""Powers of ten from a unit of time to nanoseconds."""
HEADER_LINES = 200
"""Lines among which the first row must be found."""
LONGEST_LINE = 1 << 16
"""Bytes of a line beyond which a file is taken for no table."""
FASTEST_HZ = 4 * SECOND_NS

_SPELT = {
    **{name: name for name in UNITS},
    **{"sec": "s", "second": "s", "seconds": "s", "millisecond": "ms", "milliseconds": "ms", "µs": "us", "μs": "us"},
    **{"microsecond": "us", "microseconds": "us", "nanosecond": "ns", "nanoseconds": "ns"},
    **{"picosecond": "ps", "picoseconds": "ps"},
}
_TIME = re.compile(r"(?:(?:time|timestamp|t)(?:[\s_\[(/,-]*([a-zµμ]+)[\])]?)?|((?:milli|micro|nano|pico)?seconds?))")
_RATE = re.compile(r"samplerate:\s*([0-9]+(?:\.[0-9]+)?)\s*([kMG]?)Hz", re.IGNORECASE)
_CHANNELS = re.compile(r"channels\s*(?:\([^)]*\))?:\s*(.+)", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]*)?(?:[eE][+-]?[0-9]+)?")
_PROBLEMS = {
    1: "the time is no decimal number; export times in seconds",
    2: "the time is less than the one before; sort the rows by time",
    3: "is neither 0 nor 1; export digital channels",
    4: "the row has fewer columns than the first one; export the capture again",
    5: "the time is beyond 31 years; give the unit by --time-unit",
}


class Table:
    """A table whose beginning has been read."""

    def __init__(self, path: Path, time_unit: str | None = None, sample_rate_hz: float | None = None) -> None:
        """time_unit: one of UNITS, of a time column whose name says none. sample_rate_hz: of a table without times.

        Raises CaptureError for a file that is no such table, OSError for one that cannot be read.
        """
        self.path = path
        with path.open("rb") as file:
            if not file.seek(0, 2):
                raise CaptureError(f"{path}: is empty")
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        comments, rows, places = self._beginning()
        first = rows[0][1]
        self._delimiter = next((mark for mark in "\t;" if mark in rows[-1][1]), ",")
        cells = [cell.strip() for cell in next(csv.reader([first], delimiter=self._delimiter, skipinitialspace=True))]
        headed = not all(_NUMBER.fullmatch(cell) for cell in cells if cell)
        said = _names_in(comments)
        rate_hz = sample_rate_hz if sample_rate_hz is not None else _rate_in(comments)
        if headed and len(rows) < 2:
            raise CaptureError(f"{path}: has no row below its header")
        self._begin, self._line = places[int(headed)], rows[int(headed)][0]
        self._time, self._unit = self._time_column(cells, headed, time_unit, rate_hz, said)
        columns = [column for column in range(len(cells)) if column != self._time]
        names = [cells[column] for column in columns] if headed else [str(column + 1) for column in columns]
        if len(said) == len(columns) and (not headed or len(set(names)) < len(names) or set(names) == {"logic"}):
            names = said
        self._columns = dict(zip(names, columns, strict=True))
        if not all(names) or len(self._columns) < len(names):
            raise CaptureError(f"{path}: line {rows[0][0]}: columns need names of their own: {', '.join(names)[:80]}")
        self._width = len(cells)
        self._rate_hz = rate_hz if self._time is None else None

    @property
    def names(self) -> list[str]:
        """Names of all columns but that of the time."""
        return list(self._columns)

    def read(self, names: Sequence[str]) -> Capture:
        """Levels of some columns, by the names they are asked for; large and small letters count only if they must.

        Raises CaptureError for a name that is not there and for a row that is damaged. Times that begin before 0 are
        shifted so that they begin at 0.
        """
        found = [self._find(name) for name in names]
        order = list(dict.fromkeys(found))
        columns = np.full(self._width, -1, dtype=np.int16)
        columns[order] = np.arange(len(order))
        if self._time is not None:
            columns[self._time] = -2
        data = np.frombuffer(self._data, dtype=np.uint8)
        # place, line, time or number of the next row, problem, its column, time of the first row
        state = np.array([self._begin, self._line, 0 if self._time is None else -(1 << 62), 0, 0, 0], dtype=np.int64)
        levels, first = np.full(len(order), -1, dtype=np.int8), np.zeros(len(order), dtype=np.int8)
        pieces = []
        power = 0 if self._time is None else UNITS[self._unit]
        while state[0] < len(data) and not state[3]:
            times, which = np.empty(PIECE, dtype=np.int64), np.empty(PIECE, dtype=np.uint8)
            timed = self._time is not None
            count = _scan(data, ord(self._delimiter), columns, timed, power, state, levels, first, times, which)
            pieces.append((times[:count].copy(), which[:count].copy()))
        if state[3]:
            self._tell(int(state[1]), int(state[3]), int(state[4]), bytes(data[state[0] : state[0] + 40]))
        last = int(state[2])
        if self._rate_hz is not None:
            rate = round(self._rate_hz)
            for times, _ in pieces:
                whole, rest = np.divmod(times, rate)
                times[:] = whole * SECOND_NS + (2 * rest * SECOND_NS + rate) // (2 * rate)
            last = max(last - 1, 0) * SECOND_NS // rate
        shift = max(0, -int(state[5])) if self._time is not None else 0
        for times, _ in pieces:
            times += shift
        waves = dict(zip(names, (waves_of(pieces, first)[order.index(column)] for column in found), strict=True))
        resolution = SECOND_NS / self._rate_hz if self._rate_hz is not None else 0.0
        return Capture(waves, max(last + shift, 0), resolution, shift)

    def _tell(self, line: int, problem: int, column: int, data: bytes) -> None:
        where = next((name for name, place in self._columns.items() if place == column), "")
        cell = [*data.decode("latin-1").splitlines(), ""][0].split(self._delimiter)[0]
        shown = ascii(cell[:24].strip())
        about = f"column {where}: {shown} " if problem == 3 else "" if problem == 4 else f"{shown}: "
        raise CaptureError(f"{self.path}: line {line}: {about}{_PROBLEMS[problem]}")

    def _beginning(self) -> tuple[list[str], list[tuple[int, str]], list[int]]:
        """Comments, and line numbers, texts and places of the first two rows."""
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
            if not line or len(rows) == 2:
                break
            text = line.decode("utf-8", "replace").strip("\r\n")
            if text[:1] in (";", "#"):
                comments.append(text[1:].strip())
            elif text.strip():
                rows.append((number, text))
                places.append(place)
        if not rows:
            raise CaptureError(f"{self.path}: has no row in it")
        return comments, rows, places

    def _time_column(
        self, cells: list[str], headed: bool, unit: str | None, rate_hz: float | None, said: list[str]
    ) -> tuple[int | None, str]:
        if unit is not None and unit not in UNITS:
            raise WrongCallError(f"time-unit {unit}: must be one of {', '.join(UNITS)}")
        if rate_hz is not None and not (1.0 <= rate_hz <= FASTEST_HZ and rate_hz == round(rate_hz)):
            raise WrongCallError(f"sample-rate {rate_hz:g}: must be a whole number from 1 to {FASTEST_HZ} Hz")
        for column, cell in enumerate(cells if headed else []):
            match = _TIME.fullmatch(cell.lower())
            if match is None:
                continue
            word = match[1] or match[2]
            found = unit or _SPELT.get(word or "")
            if found is None and (word is None or column == 0):
                raise CaptureError(
                    f"{self.path}: column {cell!r} does not say its unit; give --time-unit, one of {', '.join(UNITS)}"
                )
            if found is not None:
                return column, found
        if rate_hz is not None and (headed or unit is None):
            return None, ""
        if unit is not None:
            return 0, unit
        raise CaptureError(
            f"{self.path}: neither a column of times nor a sample rate: {', '.join(cells)[:80]}; "
            "give --time-unit for the first column, or --sample-rate"
        )

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


def _names_in(comments: Sequence[str]) -> list[str]:
    for comment in comments:
        if match := _CHANNELS.search(comment):
            return [name.strip() for name in match[1].split(",")]
    return []


@njit(nogil=True)
def _scan(data, delimiter, columns, timed, power, state, levels, first, times, which):
    """Changes of wanted columns, row by row, from state[0] on, as long as there is room for a row; their number.

    columns int16 [width]: -2 the time, -1 of no interest, else the signal. power: of ten, from its unit to ns.
    """
    size, room, count = data.size, times.size - levels.size, 0
    i, line, before = state[0], state[1], state[2]
    while i < size and count <= room:
        c = data[i]
        if c == 10 or c == 13 or c == 32:
            line += c == 10
            i += 1
            continue
        if c == 59 or c == 35:  # a comment
            while i < size and data[i] != 10:
                i += 1
            continue
        time = before
        seen = 0
        row = i
        begun = count
        for column in range(columns.size):
            wanted = columns[column]
            start = i
            while i < size and (data[i] == 32 or data[i] == 34):
                i += 1
            if wanted == -2:
                negative = i < size and data[i] == 45
                if i < size and (data[i] == 45 or data[i] == 43):
                    i += 1
                mantissa, shift, digits, point = 0, power, 0, False
                while i < size:
                    c = data[i]
                    if 48 <= c <= 57:
                        digits += 1
                        if mantissa < 10**17:
                            mantissa = 10 * mantissa + (c - 48)
                            shift -= point
                        else:
                            shift += not point
                    elif (c == 46 or (c == 44 and delimiter != 44)) and not point:
                        point = True
                    else:
                        break
                    i += 1
                if digits and i < size and (data[i] == 101 or data[i] == 69):
                    i += 1
                    down = i < size and data[i] == 45
                    if i < size and (data[i] == 45 or data[i] == 43):
                        i += 1
                    exponent, powers = 0, 0
                    while i < size and 48 <= data[i] <= 57:
                        exponent = min(10 * exponent + (data[i] - 48), 10_000)
                        powers += 1
                        i += 1
                    if powers == 0:
                        digits = 0
                    shift += -exponent if down else exponent
                while i < size and (data[i] == 32 or data[i] == 34):
                    i += 1
                if digits == 0 or (i < size and data[i] != delimiter and data[i] != 10 and data[i] != 13):
                    state[0], state[1], state[3], state[4] = start, line, 1, column
                    return count
                while shift > 0 and 0 < mantissa < 10**17:
                    mantissa *= 10
                    shift -= 1
                if mantissa > 0 and (shift > 0 or (shift == 0 and mantissa > LONGEST_NS)):
                    state[0], state[1], state[3], state[4] = start, line, 5, column
                    return count
                divisor = 1
                while shift < 0 and divisor < 10**18:
                    divisor *= 10
                    shift += 1
                time = (mantissa + divisor // 2) // divisor if shift == 0 or mantissa == 0 else 0
                if negative:
                    time = -time
                if time < before:
                    state[0], state[1], state[3], state[4] = start, line, 2, column
                    return count
                if before == -(1 << 62):
                    state[5] = time
            elif wanted >= 0:
                level = data[i] - 48 if i < size else 2
                if i < size:
                    i += 1
                if i < size and data[i] == 46:
                    i += 1
                    while i < size and data[i] == 48:
                        i += 1
                while i < size and (data[i] == 32 or data[i] == 34):
                    i += 1
                if (level != 0 and level != 1) or (
                    i < size and data[i] != delimiter and data[i] != 10 and data[i] != 13
                ):
                    state[0], state[1], state[3], state[4] = start, line, 3, column
                    return count
                if levels[wanted] < 0:
                    first[wanted] = level
                elif levels[wanted] != level:
                    which[count] = wanted
                    count += 1
                levels[wanted] = level
            else:
                while i < size and data[i] != delimiter and data[i] != 10 and data[i] != 13:
                    i += 1
            seen += 1
            if i < size and data[i] == delimiter:
                i += 1
            else:
                break
        if seen < columns.size:
            state[0], state[1], state[3] = row, line, 4
            return count
        for k in range(begun, count):
            times[k] = time
        before = time if timed else before + 1
        while i < size and data[i] != 10:
            i += 1
    state[0], state[1], state[2] = i, line, before
    return count
