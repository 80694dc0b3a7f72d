"""Modes of operation (manual 7.5): HAND moves axes by keys, the others carry out programs."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """P8683, P8703. AUTO and POSITIONING can only be changed through HAND (M1009)."""

    HAND = 1
    AUTO = 2
    SINGLE = 4
    POSITIONING = 8
