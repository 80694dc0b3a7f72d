"""The scanners alone, on arrays that end where the file does: wherever it is cut, and however little room there is,
they stay within both (a sanitizer looks: `make sanitize`) and find the same."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.capture.table import IS_TIME
from isel_twin.capture.vcd import SCAN
from isel_twin.native import core
from tests.fuzz.mutate import mutated
from tests.thorough import drawn

DUMP = b"#0 $dumpvars 0! x# $end\n#5 1! b01 # $comment a # $end\n#9 $dumpoff x! x# $end #12 $dumpon 0! bx #\n"
DUMP += b'#20 r1.5 " sabc " z!\n#900000000000000000 1! 1#'
TABLE = b'0,0,a,1\n1e0,1,"b,c",0.00\n+2.5e-0,"0",,1\r\n# text\n 3.50000000000000000004 ,1,,0\n7,0,,1\noverrun\n9,1,,1'
FILES = 200


class Scanned:
    """One scanner over one file, a piece after the other."""

    def __init__(self, data: bytes, scan: Callable[[Scanned], int], room: int) -> None:
        self.data = np.frombuffer(data, np.uint8).copy()
        self.scan = np.zeros(1, SCAN)
        self.scan["begin"] = -1
        self.levels, self.first, self.lost = np.full(2, -1, np.int8), np.zeros(2, np.int8), np.zeros(3, np.int8)
        self.found: list[tuple[int, int]] = []
        while self.scan["place"][0] < len(data) and not self.scan["problem"][0]:
            self.times, self.which = np.empty(room, np.int64), np.empty(room, np.uint8)
            count = scan(self)
            self.found += zip(self.times[:count].tolist(), self.which[:count].tolist(), strict=True)

    def outcome(self) -> tuple[int, int, object]:
        """Place, problem, and what was found; with a problem its line and column."""
        place, line, time, begin, problem, column, *_ = self.scan[0].tolist()
        read = self.found, time, begin, self.levels.tobytes(), self.first.tobytes()
        return place, problem, (line, column) if problem else read


def dump(of: Scanned) -> int:
    keys = np.array([ord("!"), ord("#")], np.int64)
    found: int = core.scan_dump(of.data, keys, of.scan, of.levels, of.first, of.lost, of.times, of.which)
    return found


def table(of: Scanned) -> int:
    columns: NDArray[np.int16] = np.array([IS_TIME, 0, -1, 1], np.int16)
    found: int = core.scan_table(of.data, ord(","), columns, 1, 0, of.scan, of.levels, of.first, of.times, of.which)
    return found


@pytest.mark.parametrize(("scan", "text"), [(dump, DUMP), (table, TABLE)], ids=["dump", "table"])
def test_wherever_a_file_ends_small_pieces_are_the_whole(scan: Callable[[Scanned], int], text: bytes) -> None:
    files = [text[:end] for end in range(len(text) + 1)] + [mutated(text, seed) for seed in range(drawn(FILES))]
    pieces, whole = ([Scanned(data, scan, room).outcome() for data in files] for room in (6, 100_000))
    assert pieces == whole
    assert len({place for place, *_ in whole}) > 40
    assert sum(not problem for _, problem, _ in whole) > 20
