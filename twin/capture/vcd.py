"""Value change dumps (IEEE 1364), as logic analysers, simulators and this package write them.

    $timescale 1 us $end                                header: names and codes of signals, in Python
    $scope module libsigrok $end  $var wire 1 ! D0 $end
    $enddefinitions $end
    #0 0! #25 1! #30 0!                                 body: #time, value and code, in a compiled scanner

A level is the value of a wire, or whether a vector is not 0. `x` and `z` are no level: the wire keeps its last one,
which is a gap in the capture, and so is the time from $dumpoff to $dumpon. A signal that is first named at a change,
not at the beginning, had the other level before (capture/4). The scanner takes the whole file as bytes and returns the
changes of wanted signals in pieces, so that memory is needed for edges, not for text.
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.compiling import njit
from isel_twin.capture.wave import LONGEST_NS, Capture, CaptureError, Wave

MOST_CHANGES = 1 << 20  # most changes from one call of a scanner
Piece = tuple[NDArray[np.int64], NDArray[np.uint8]]  # times and signals of changes
_PLACE, _LINE, _TIME, _PROBLEM, _BEGIN, _PART = range(6)  # fields of a scanner's state; _BEGIN: the first time
_CHANGES, _LEVELS, _OFF = range(3)  # parts: changes; levels in $dumpvars and its like; $dumpoff, in which all are x
LOST, FOUND, ALL = 64, 128, 63  # added to a signal that loses its level or has one again; ALL: all signals
_LF, _SPACE, _HASH, _DOLLAR = b"\n #$"
_NO_LEVEL, _NO_CHANGE, _OTHER = -1, -2, -3  # x and z; no change at all; a number or a text
_SECTION = re.compile(r"\$(\w+)\s(.*?)\$end(?=\s|$)", re.DOTALL)
_UNITS_FS = {"s": 10**15, "ms": 10**12, "us": 10**9, "ns": 10**6, "ps": 10**3, "fs": 1}
_PROBLEMS = {
    1: "the time is no whole number, or too large",
    2: "the time is less than the one before",
    3: "no change of a value begins like this",
    4: "a change of a value has no signal",
    5: "a $comment has no $end",
}


class Dump:
    """A dump; only its header is read at first."""

    def __init__(self, path: Path) -> None:
        """Raises CaptureError for a file that is no dump, OSError for one that cannot be read."""
        self.path = path
        with path.open("rb") as file:
            if not file.seek(0, 2):
                raise CaptureError(f"{path}: is empty")
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        keyword = self._data.find(b"$enddefinitions")
        self._begin = self._data.find(b"$end", keyword + 1) + len(b"$end")
        if keyword < 0 or self._begin < len(b"$end"):
            raise CaptureError(f"{path}: is no value change dump: it has no $enddefinitions; export it as VCD again")
        header = self._data[:keyword].decode("latin-1")
        self._unit_fs = 0
        self._variables: list[tuple[str, str]] = []  # name and code of each
        self._read_header(header)
        self._line = header.count("\n") + self._data[keyword : self._begin].count(b"\n") + 1

    @property
    def names(self) -> list[str]:
        """Names of all signals, scopes before them: `step.step_x`."""
        return [name for name, _ in self._variables]

    def read(self, names: Sequence[str]) -> Capture:
        """Levels of the named signals: full names, or the last part if it is unique.

        Raises CaptureError for a name that is not there and for a body that is damaged.
        """
        codes = [self._find(name) for name in names]
        keys = np.array([_key(code) for code in dict.fromkeys(codes)], dtype=np.int64)
        data = np.frombuffer(self._data, dtype=np.uint8)
        state = np.array([self._begin, self._line, 0, 0, -1, _CHANGES], dtype=np.int64)
        levels = np.full(len(keys), -1, dtype=np.int8)
        first = np.zeros(len(keys), dtype=np.int8)
        lost = np.zeros(len(keys) + 1, dtype=np.int8)
        how = data, keys, state, levels, first, lost
        pieces = scanned(lambda times, which: _scan(*how, times, which), data.size, state)
        if state[_PROBLEM]:
            place = int(state[_PLACE])
            token = bytes(data[place : place + 40]).split(None, 1)[:1] or [b""]
            shown = ascii(token[0][:24].decode("latin-1"))
            problem = _PROBLEMS[int(state[_PROBLEM])]
            raise CaptureError(f"{self.path}: line {state[_LINE]}: {shown}: {problem}; export the capture again")
        if int(state[_TIME]) * self._unit_fs >= LONGEST_NS * 10**6:
            where = f"{self.path}: line {state[_LINE]}"
            raise CaptureError(f"{where}: the time {state[_TIME]} is beyond 31 years; export it again")
        for times, _ in pieces:
            _to_ns(times, self._unit_fs)
        order = list(dict.fromkeys(codes))
        end_ns = int(state[_TIME]) * self._unit_fs // 10**6
        found = waves_of(pieces, first, end_ns)
        waves = {name: found[order.index(code)] for name, code in zip(names, codes, strict=True)}
        return Capture(waves, end_ns, self._unit_fs / 1e6, gaps=gaps_of(pieces, ALL, end_ns)[1])

    def _read_header(self, header: str) -> None:
        scopes: list[str] = []
        for section in _SECTION.finditer(header):
            keyword, words = section[1], section[2].split()
            wrong = f"{self.path}: line {header.count(chr(10), 0, section.start()) + 1}: ${keyword}"
            if keyword == "timescale":
                match = re.fullmatch(r"(1|10|100)\s*(s|ms|us|ns|ps|fs)", " ".join(words))
                if match is None:
                    said = " ".join(words)[:24]
                    raise CaptureError(f"{wrong} {said}: must be 1, 10 or 100 and s, ms, us, ns, ps, fs")
                self._unit_fs = int(match[1]) * _UNITS_FS[match[2]]
            elif keyword == "scope":
                scopes.append(words[-1] if words else "")
            elif keyword == "upscope":
                if not scopes:
                    raise CaptureError(f"{wrong}: no $scope is open; export the capture again")
                scopes.pop()
            elif keyword == "var":
                if len(words) < 4:
                    raise CaptureError(f"{wrong}: needs type, size, code and name; export the capture again")
                name = " ".join(words[3:])
                if words[1] != "1":
                    name = re.sub(r"\s*\[[^\]]*\]$", "", name)
                self._variables.append((".".join([*scopes, name]), words[2]))
        if not self._unit_fs:
            raise CaptureError(f"{self.path}: has no $timescale; add one, for example $timescale 1 ns $end")
        if not self._variables:
            raise CaptureError(f"{self.path}: has no signal ($var) in it")

    def _find(self, name: str) -> str:
        for same in (str, str.lower):
            whole = [v for v in self._variables if same(v[0]) == same(name)]
            found = whole or [v for v in self._variables if same(v[0]).endswith("." + same(name))]
            if len({code for _, code in found}) == 1:
                return found[0][1]
            if found:
                raise CaptureError(f"{self.path}: {name} may be {' or '.join(v for v, _ in found[:6])}; say which")
        raise CaptureError(f"{self.path}: has no signal {name}; it has {', '.join(self.names[:24])}")


def scanned(scan: Callable[..., int], size: int, state: NDArray[np.int64]) -> list[Piece]:
    """Changes up to the end of the file or the first problem. scan(times, which) fills both, advances `state` and
    returns the number."""
    pieces = []
    while state[_PLACE] < size and not state[_PROBLEM]:
        times, which = np.empty(MOST_CHANGES, dtype=np.int64), np.empty(MOST_CHANGES, dtype=np.uint8)
        count = scan(times, which)
        pieces.append((times[:count].copy(), which[:count].copy()))
    return pieces


def _to_ns(times: NDArray[np.int64], unit_fs: int) -> None:
    """Convert times in place from units to the nearest nanosecond."""
    if unit_fs >= 10**6:
        times *= unit_fs // 10**6
    else:
        per_ns = 10**6 // unit_fs
        times += per_ns // 2
        times //= per_ns


def waves_of(pieces: Sequence[Piece], first: NDArray[np.int8], end_ns: int) -> list[Wave]:
    """The waves of scanned pieces: times int64 [n], signal uint8 [n]; first: int8 [signals]."""
    none = np.empty(0, dtype=np.int64)
    return [
        Wave(
            level > 0,
            np.concatenate([*(times[which == k] for times, which in pieces), none]),
            *gaps_of(pieces, k, end_ns),
        )
        for k, level in enumerate(first.tolist())
    ]


def gaps_of(pieces: Sequence[Piece], signal: int, end_ns: int) -> tuple[int, tuple[tuple[int, int], ...]]:
    """The time at which a signal has its first level, 0 if it always has, and the gaps after that."""
    codes = LOST + signal, FOUND + signal
    seen = [(times[k], which[k]) for times, which in pieces for k in np.flatnonzero(np.isin(which, codes)).tolist()]
    known_ns = 0
    if seen and seen[0][1] == codes[1]:
        known_ns = int(seen.pop(0)[0])
    ends = [*(int(time) for time, _ in seen), end_ns]
    return known_ns, tuple((begin, end) for begin, end in zip(ends[:-1:2], ends[1::2], strict=False) if end > begin)


def _key(code: str) -> int:
    """The number that the scanner computes for a code."""
    key = 0
    for byte in code.encode("latin-1", "replace"):
        key = (key * 257 + byte) % (1 << 53)
    return key


@njit(nogil=True)
def _scan(data, keys, state, levels, first, lost, times, which):
    """Write the changes of wanted signals from state[_PLACE] on; return their number. state then says where and why it
    ended.

    keys int64 [signals]; levels, first int8 [signals]: present and first level (-1: none yet); lost int8 [signals + 1]:
    1 while it is x or z, the last one in $dumpoff; times, which: output.
    """
    size, room, count = data.size, times.size - 1, 0  # a signal may be found and change at once
    i, line, time, begin, part = state[_PLACE], state[_LINE], state[_TIME], state[_BEGIN], state[_PART]
    while i < size and count < room:
        c = data[i]
        if c <= _SPACE:
            line += c == _LF
            i += 1
            continue
        start, problem = i, 0
        if c == _HASH:
            i += 1
            value = 0
            while i < size and 48 <= data[i] <= 57 and i - start < 19:
                value = 10 * value + (data[i] - 48)
                i += 1
            if i == start + 1 or (i < size and data[i] > _SPACE):
                problem = 1
            elif value < time:
                problem = 2
            time = value
            begin = value if begin < 0 else begin
        elif c == _DOLLAR:  # a comment goes on to its $end; others are ignored
            i = _word_end(data, i)
            if i - start == 4:  # $end
                part = _CHANGES
            elif i - start > 6 and data[start + 1] == 100 and data[start + 2] == 117:  # $du(mp...)
                off = data[start + 5] == 111 and data[start + 6] == 102  # $dumpof(f)
                part = _OFF if off else _LEVELS
                if lost[-1] != off:
                    times[count], which[count] = time, ALL + (LOST if off else FOUND)
                    count += 1
                    lost[-1] = off
            elif i - start == 8 and data[start + 1] == 99 and data[start + 2] == 111:  # $co(mment)
                i, line = _comment_end(data, i, line)
                problem = 5 if i < 0 else 0
        else:
            if c == 48 or c == 49:
                level = c - 48
                i += 1
            else:
                i, level = _level_at(data, i)
            named = i
            i, key = _code_at(data, i)
            if level == _NO_CHANGE or i == named:
                problem = 3 if level == _NO_CHANGE else 4
            elif level >= _NO_LEVEL:
                for k in range(keys.size):
                    if keys[k] == key:
                        known, late = levels[k] >= 0, 0 <= begin < time
                        if level == _NO_LEVEL:
                            if known and not lost[k] and part != _OFF:
                                times[count], which[count] = time, LOST + k
                                count += 1
                            lost[k] |= part != _OFF
                            break
                        if lost[k] and (known or late):
                            times[count], which[count] = time, FOUND + k
                            count += 1
                        if not known:
                            changed = late and not lost[k] and part == _CHANGES
                            first[k] = 1 - level if changed else level
                        else:
                            changed = levels[k] != level
                        if changed:
                            times[count], which[count] = time, k
                            count += 1
                        levels[k], lost[k] = level, 0
                        break
        if problem:
            state[_PLACE], state[_LINE], state[_PROBLEM] = start, line, problem
            return count
    state[_PLACE], state[_LINE], state[_TIME], state[_BEGIN], state[_PART] = i, line, time, begin, part
    return count


@njit(nogil=True)
def _word_end(data, i):
    while i < data.size and data[i] > _SPACE:
        i += 1
    return i


@njit(nogil=True)
def _comment_end(data, i, line):
    """The place after the $end of a comment, and the line there; -1 and the line here without one."""
    lines = line
    while i + 3 < data.size:
        if data[i] == _DOLLAR and data[i + 1] == 101 and data[i + 2] == 110 and data[i + 3] == 100:
            return i + 4, lines
        lines += data[i] == _LF
        i += 1
    return -1, line


@njit(nogil=True)
def _level_at(data, i):
    """The place of the code after a value, and its level, or _NO_LEVEL and its like."""
    c = data[i] | 32  # small letters
    if c == 98 or c == 114 or c == 115:  # b, r, s: a vector, a real number, a text; then blanks
        i += 1
        level = 0 if c == 98 else _OTHER
        while i < data.size and data[i] > _SPACE:
            if c == 98 and data[i] == 49:
                level = 1
            elif data[i] != 48 and level == 0:
                level = _NO_LEVEL
            i += 1
        while i < data.size and data[i] <= _SPACE and data[i] != _LF:
            i += 1
        return i, level
    known = c == 120 or c == 122 or c == 117 or c == 119 or data[i] == 45  # x, z, u, w, -
    return i + 1, _NO_LEVEL if known else _NO_CHANGE


@njit(nogil=True)
def _code_at(data, i):
    """The place after the code of a signal, and its `_key`."""
    key = 0
    while i < data.size and data[i] > _SPACE:
        key = (key * 257 + data[i]) % (1 << 53)
        i += 1
    return i, key
