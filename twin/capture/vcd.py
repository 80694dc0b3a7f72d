"""Value change dumps (IEEE 1364), as logic analysers, simulators and this package write them.

    $timescale 1 us $end                                header: names and codes of signals, in Python
    $scope module libsigrok $end  $var wire 1 ! D0 $end
    $enddefinitions $end
    #0 0! #25 1! #30 0!                                 body: #time, value and code, in C (vcd.c)

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

from isel_twin.capture.wave import LONGEST_NS, Capture, CaptureError, Wave
from isel_twin.native import core, record

MOST_CHANGES = 1 << 20  # most changes from one call of a scanner
Piece = tuple[NDArray[np.int64], NDArray[np.uint8]]  # times and signals of changes
SCAN = record(
    "SCAN",
    [
        ("place", "i8"),  # where the scanner is, or what the problem is about begins
        ("line", "i8"),
        ("time", "i8"),  # the last one
        ("begin", "i8"),  # the first one
        ("problem", "i8"),
        ("column", "i8"),  # of a table, with the problem
        ("rows", "i8"),  # of a table so far
        ("part", "i8"),  # of a dump: changes or levels
    ],
)
LOST, FOUND, ALL = 64, 128, 63  # added to a signal that loses its level or has one again; ALL: all signals
_SECTION = re.compile(r"\$(\w+)\s(.*?)\$end(?=\s|$)", re.DOTALL)
_UNITS_FS = {"s": 10**15, "ms": 10**12, "us": 10**9, "ns": 10**6, "ps": 10**3, "fs": 1}
NO_TIME, EARLIER, NO_VALUE, NO_SIGNAL, NO_END = range(1, 6)
IN_C = ("ALL", "LOST", "FOUND", "NO_TIME", "EARLIER", "NO_VALUE", "NO_SIGNAL", "NO_END")  # records.h has them, too
_PROBLEMS = {
    NO_TIME: "the time is no whole number, or too large",
    EARLIER: "the time is less than the one before",
    NO_VALUE: "no change of a value begins like this",
    NO_SIGNAL: "a change of a value has no signal",
    NO_END: "a $comment has no $end",
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
        scan = np.zeros(1, SCAN)
        scan["place"], scan["line"], scan["begin"] = self._begin, self._line, -1
        levels = np.full(len(keys), -1, dtype=np.int8)
        first = np.zeros(len(keys), dtype=np.int8)
        lost = np.zeros(len(keys) + 1, dtype=np.int8)
        pieces = scanned(lambda *room: core.scan_dump(data, keys, scan, levels, first, lost, *room), data.size, scan)
        place, line, time, _, said, *_ = scan[0].tolist()
        if said:
            token = bytes(data[place : place + 40]).split(None, 1)[:1] or [b""]
            shown = ascii(token[0][:24].decode("latin-1"))
            raise CaptureError(f"{self.path}: line {line}: {shown}: {_PROBLEMS[said]}; export the capture again")
        if time * self._unit_fs >= LONGEST_NS * 10**6:
            raise CaptureError(f"{self.path}: line {line}: the time {time} is beyond 31 years; export it again")
        for times, _ in pieces:
            _to_ns(times, self._unit_fs)
        order = list(dict.fromkeys(codes))
        end_ns = time * self._unit_fs // 10**6
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


def scanned(scanner: Callable[..., int], size: int, scan: NDArray[np.void]) -> list[Piece]:
    """Changes up to the end of the file or the first problem. scanner(times, which) fills both, advances `scan` [1] and
    returns the number."""
    pieces = []
    while scan["place"][0] < size and not scan["problem"][0]:
        times, which = np.empty(MOST_CHANGES, dtype=np.int64), np.empty(MOST_CHANGES, dtype=np.uint8)
        count = scanner(times, which)
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
    """The number that the scanner computes for a code (vcd.c: code_at)."""
    key = 0
    for byte in code.encode("latin-1", "replace"):
        key = (key * 257 + byte) % (1 << 53)
    return key
