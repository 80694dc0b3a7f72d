"""Splines: points joined by tangential cubics (manual 4.18, G50, G51).

    lead-in                 leaving P_0: along the end of the block before, as long as P_0 P_1 times 2 c
    at P_i                  T_i = c (P_i+1 - P_i-1),  c = P8847, 0.5 unless set
    lead-out                arriving at the last point: along the beginning of the block after

A block of a spline waits for the next path, whose end its own tangent needs: one block of look-ahead, as a corner has.
Without a path before or after it M1235.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.curves import Bent, through
from isel_twin.firmware.bwo900.geometry.elements import Element, Point
from isel_twin.firmware.bwo900.messages import Code, ProgramError

STANDARD: Final = 0.5
PARTS: Final = 8  # pieces of a block with G51, each with a speed of its own


class Spline:
    """Takes blocks and returns those of splines as cubics."""

    def __init__(self, bulge: float) -> None:
        """bulge: P8847, 0 the standard."""
        self._bulge = bulge if bulge > 0.0 else STANDARD
        self._last: Element | Bent | None = None  # of the last path; None: there has been none
        self._leaving: Point | None = None  # derivative at the beginning of the block that waits
        self._waiting: PathBlock | None = None
        self._between: list[PathBlock] = []

    @property
    def idle(self) -> bool:
        return self._waiting is None

    def push(self, block: PathBlock) -> list[PathBlock]:
        """Returns the blocks that are complete. Raises ProgramError M1235."""
        if not block.elements:
            if self._waiting is None:
                return [block]
            self._between.append(block)
            return []
        done: list[PathBlock] = []
        if (before := self._waiting) is not None:
            a, b = before.start, before.finish
            if block.spline:
                arriving = tuple(self._bulge * (z - x) for x, z in zip(a, block.finish, strict=True))
            else:
                size = 2.0 * self._bulge * math.dist(a, b)
                arriving = tuple(size * d for d in block.elements[0].tangent(0.0))
            assert self._leaving is not None
            cubic = through(a, b, self._leaving, arriving)
            elements = cubic.parts(PARTS) if before.contour_feed else (cubic,)
            done = [replace(before, elements=elements), *self._between]
            self._waiting, self._between, self._leaving = None, [], arriving
        elif block.spline:
            if self._last is None:
                raise _missing(block, "the path before it")
            size = 2.0 * self._bulge * block.length_mm
            self._leaving = tuple(size * d for d in self._last.tangent(1.0))
        if block.spline:
            self._waiting = block
            return done
        self._last = block.elements[-1]
        return [*done, block]

    def flush(self) -> list[PathBlock]:
        """End: no block follows. Raises ProgramError M1235 if a spline waits for the next path."""
        if self._waiting is not None:
            block, self._waiting, self._between = self._waiting, None, []
            raise _missing(block, "the path after it")
        return []


def _missing(block: PathBlock, what: str) -> ProgramError:
    return ProgramError(Code.SPLINE, f"{what} is missing").at(block.program, block.number, block.column)
