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
from numpy.typing import NDArray

from isel_twin.base.compiling import contains, njit
from isel_twin.base.units import SECOND_NS
from isel_twin.capture import vcd, wave
from isel_twin.capture.vcd import ALL, FOUND, LOST, gaps_of, scanned, waves_of
from isel_twin.capture.wave import LONGEST_NS, Capture, CaptureError, WrongCallError

UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0, "ps": -3}  # powers of ten from a unit of time to nanoseconds
OVERRUN = "overrun"
HEADER_LINES = 200  # lines within which the first row must be found
LONGEST_LINE = 1 << 16  # bytes of a line beyond which a file is not a table
FASTEST_HZ = 4 * SECOND_NS
_PLACE, _LINE, _TIME, _PROBLEM, _COLUMN, _FIRST = range(6)  # fields of the scanner's state; _TIME: or row number
_LF, _CR, _SPACE, _QUOTE, _HASH, _PLUS, _COMMA, _MINUS, _POINT, _SEMICOLON = b'\n\r "#+,-.;'
_IS_TIME = -2
_NEVER = -(1 << 62)

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
_PROBLEMS = {
    1: "the time is no decimal number; export times in seconds",
    2: "the time is less than the one before; sort the rows by time",
    3: "is neither 0 nor 1; export digital channels",
    4: "the row has fewer columns than the first one; export the capture again",
    5: "the time is beyond 31 years; give the unit by --time-unit",
    6: "samples are missing, and their numbers, too, which would tell how many; take them by halsampler -t",
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
            columns[self._time] = _IS_TIME
        data = np.frombuffer(self._data, dtype=np.uint8)
        state = np.array([self._begin, self._line, 0 if self._time is None else _NEVER, 0, 0, 0], dtype=np.int64)
        levels, first = np.full(len(order), -1, dtype=np.int8), np.zeros(len(order), dtype=np.int8)
        power = UNITS[self._unit or "ns"]
        numbered = self._time is not None and self._rate_hz is not None
        how = data, ord(self._delimiter), columns, self._time is not None, numbered, power, state, levels, first
        pieces = scanned(lambda times, which: _scan(*how, times, which), data.size, state)
        if state[_PROBLEM]:
            self._tell(state, bytes(data[state[_PLACE] : state[_PLACE] + 40]))
        last = int(state[_TIME])
        if self._rate_hz is not None:
            rate = round(self._rate_hz)
            for times, _ in pieces:
                whole, rest = np.divmod(times, rate)
                times[:] = whole * SECOND_NS + (2 * rest * SECOND_NS + rate) // (2 * rate)
            last = (last if numbered else max(last - 1, 0)) * SECOND_NS // rate
        shift = max(0, -int(state[_FIRST])) if self._time is not None else 0
        for times, _ in pieces:
            times += shift
        end_ns = max(last + shift, 0)
        made = waves_of(pieces, first, end_ns)
        waves = {name: made[order.index(column)] for name, column in zip(names, found, strict=True)}
        resolution = SECOND_NS / self._rate_hz if self._rate_hz is not None else 0.0
        return Capture(waves, end_ns, resolution, shift, gaps_of(pieces, ALL, end_ns)[1])

    def _tell(self, state: NDArray[np.int64], data: bytes) -> NoReturn:
        line, problem, column = state[[_LINE, _PROBLEM, _COLUMN]].tolist()
        where = next((name for name, place in self._columns.items() if place == column), "")
        cell = [*data.decode("latin-1").splitlines(), ""][0].split(self._delimiter)[0]
        shown = ascii(cell[:24].strip())
        about = f"column {where}: {shown} " if problem == 3 else "" if problem == 4 else f"{shown}: "
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


# The scanner. pyarrow.csv takes half as long again for exact decimals and has neither line numbers nor comments. The
# work for each cell is written in the loop: a call would take as long as the work.


@njit(nogil=True)
def _scan(data, delimiter, columns, timed, numbered, power, state, levels, first, times, which):
    """Write the changes of wanted columns from state[_PLACE] on, while there is room for a row; return their number.

    columns int16 [width]: _IS_TIME, -1 ignored, else the signal. numbered: times are the numbers of samples. power: of
    ten, from the unit of time to ns. levels, first int8 [signals]: present and first level (-1: none yet); times,
    which: output.
    """
    size, room, count = data.size, times.size - levels.size - 2, 0
    i, line, before = state[_PLACE], state[_LINE], state[_TIME]
    while i < size and count <= room:
        c = data[i]
        if c in (_LF, _CR, _SPACE):
            line += c == _LF
            i += 1
            continue
        if c in (_SEMICOLON, _HASH):  # a comment
            i = _line_end(data, i)
            continue
        if i + 7 <= size and c == 111 and data[i + 1] == 118 and data[i + 6] == 110:  # ov....n, see OVERRUN
            if not numbered:
                state[_PLACE], state[_LINE], state[_PROBLEM] = i, line, 6
                return count
            i = _line_end(data, i)
            continue
        row, begun, time, seen = i, count, before, 0
        for column in range(columns.size):
            wanted, start, problem = columns[column], i, 0
            if wanted == _IS_TIME:
                i = _past_quotes(data, i)
                negative = i < size and data[i] == _MINUS
                i += i < size and (data[i] == _MINUS or data[i] == _PLUS)
                mantissa, shift, good, point = 0, power, False, False
                while i < size:
                    c = data[i]
                    if 48 <= c <= 57:
                        good = True
                        if mantissa < 10**17:
                            mantissa = 10 * mantissa + (c - 48)
                            shift -= point
                        else:
                            shift += not point
                    elif (c == _POINT or (c == _COMMA and delimiter != _COMMA)) and not point:
                        point = True
                    else:
                        break
                    i += 1
                if good and i < size and (data[i] == 69 or data[i] == 101):  # E, e
                    i, exponent, good = _exponent_at(data, i + 1)
                    shift += exponent
                i = _past_quotes(data, i)
                time = _scaled(mantissa, shift)
                if not (good and _ends(data, i, delimiter)):
                    problem = 1
                elif time < 0:
                    problem = 5
                else:
                    time = -time if negative else time
                    problem = 2 if time < before else 0
                if before == _NEVER:
                    state[_FIRST] = time
            elif wanted >= 0:
                i = _past_quotes(data, i)
                level = data[i] - 48 if i < size else 2
                i += i < size
                if i < size and data[i] == _POINT:
                    i += 1
                    while i < size and data[i] == 48:
                        i += 1
                i = _past_quotes(data, i)
                if (level != 0 and level != 1) or not _ends(data, i, delimiter):
                    problem = 3
                elif levels[wanted] < 0:
                    first[wanted] = level
                elif levels[wanted] != level:
                    which[count] = wanted
                    count += 1
                levels[wanted] = level
            else:
                i = _cell_end(data, i, delimiter)
            if problem:
                state[_PLACE], state[_LINE], state[_PROBLEM], state[_COLUMN] = start, line, problem, column
                return count
            seen += 1
            if i == size or data[i] != delimiter:
                break
            i += 1
        if seen < columns.size:
            state[_PLACE], state[_LINE], state[_PROBLEM] = row, line, 4
            return count
        for k in range(begun, count):
            times[k] = time
        if numbered and before != _NEVER and time > before + 1:
            times[count], which[count] = before, LOST + ALL
            times[count + 1], which[count + 1] = time, FOUND + ALL
            count += 2
        before = time if timed else before + 1
        i = _line_end(data, i)
    state[_PLACE], state[_LINE], state[_TIME] = i, line, before
    return count


@njit(nogil=True)
def _line_end(data, i):
    while i < data.size and data[i] != _LF:
        i += 1
    return i


@njit(nogil=True)
def _ends(data, i, delimiter):
    """True if a cell ends before this place."""
    return i == data.size or data[i] == delimiter or data[i] == _LF or data[i] == _CR


@njit(nogil=True)
def _cell_end(data, i, delimiter):
    """The end of an ignored cell; a delimiter in quotes is text."""
    quoted = False
    while i < data.size and data[i] != _LF and data[i] != _CR and (quoted or data[i] != delimiter):
        quoted ^= data[i] == _QUOTE
        i += 1
    return i


@njit(nogil=True)
def _past_quotes(data, i):
    while i < data.size and (data[i] == _SPACE or data[i] == _QUOTE):
        i += 1
    return i


@njit(nogil=True)
def _exponent_at(data, i):
    """The place after an exponent, its value within 10 000, and whether it has a digit."""
    down = i < data.size and data[i] == _MINUS
    if i < data.size and (data[i] == _MINUS or data[i] == _PLUS):
        i += 1
    exponent, good = 0, False
    while i < data.size and 48 <= data[i] <= 57:
        exponent = min(10 * exponent + (data[i] - 48), 10_000)
        good = True
        i += 1
    return i, -exponent if down else exponent, good


@njit(nogil=True)
def _scaled(mantissa, shift):
    """The nearest whole number to mantissa times 10 to the power of shift, halves up; -1 if it is beyond LONGEST_NS."""
    while shift > 0 and 0 < mantissa < 10**17:
        mantissa *= 10
        shift -= 1
    if mantissa > 0 and (shift > 0 or (shift == 0 and mantissa > LONGEST_NS)):
        return -1
    divisor = 1
    while shift < 0 and divisor < 10**18:
        divisor *= 10
        shift += 1
    return (mantissa + divisor // 2) // divisor if shift == 0 or mantissa == 0 else 0


contains(__name__, vcd.__file__, wave.__file__)
