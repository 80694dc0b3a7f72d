"""A program far longer than the memory of the control: it is fed while it is carried out, and nothing grows.

Blocks of a tenth of a millimetre, one path without a stop, so many megabytes of them; memory is looked at when a
megabyte has been taken and at the end, and the rate of blocks against real time is told.
"""

from __future__ import annotations

import gc
import math
import os
import time
from collections.abc import Iterator

from isel_twin import Twin
from tests.reliability.figures import Figure, main, resident_mb

NUMBER = 100
LIMIT_MB = 20.0
PIECE_MM, RADIUS_MM = 0.1, 50.0
REFERENCE = b"D\r\nP8683: 1\r\nP12530: 1\r\nP12330: 1\r\nP12130: 1\r\n#\r\n"
FEED = b"D\r\nP8811: 1\r\nP8800: 1\r\nP8683: 2\r\nP8684: 1\r\n#\r\n"


def rows(megabytes: float) -> Iterator[str]:
    """The lines of the program: round and round."""
    yield from ("P1", "N1 G90 G1 F6000 X110 Y60")
    number, size = 1, 0
    while size < megabytes * 1e6:
        number += 1
        angle = number * PIECE_MM / RADIUS_MM
        row = f"N{number} X{60 + RADIUS_MM * math.cos(angle):.3f} Y{60 + RADIUS_MM * math.sin(angle):.3f}"
        size += len(row) + 2
        yield row
    yield from (f"N{number + 1} M30", "#")


def measure(number: float) -> list[Figure]:
    """number: of megabytes."""
    twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(5.0, 5.0, 5.0), keep_motions=1)
    twin.write(REFERENCE)
    twin.run_until_idle()
    twin.write(FEED)
    begin, sent, blocks, waiting, early_mb = time.perf_counter(), 0, 0, bytearray(), None
    for row in rows(number):
        waiting += row.encode() + b"\r\n"
        blocks += 1
        if len(waiting) >= 16_384:
            twin.write(bytes(waiting))
            sent += len(waiting)
            waiting.clear()
            while twin.commands_due:
                twin.run(1.0)
        if early_mb is None and sent > 500_000 * min(number, 1):
            gc.collect()
            early_mb = resident_mb(os.getpid())
    twin.write(bytes(waiting))
    ended = twin.run_until_idle()
    taken_s = time.perf_counter() - begin
    gc.collect()
    grown_mb = resident_mb(os.getpid()) - (early_mb or 0.0)
    failed = int(not ended or twin.fault or twin.commands_due > 0)
    return [
        Figure(f"program of {number} MB, {blocks} blocks, that was fed: not carried out to its end", failed, "", 0.0),
        Figure("growth from its first megabyte on", grown_mb, "MB", LIMIT_MB),
        Figure("blocks a second, whole twin (kinematic plant)", blocks / taken_s, ""),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
