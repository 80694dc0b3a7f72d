"""Units of virtual time, in integer nanoseconds."""

from __future__ import annotations

from typing import Final

MICROSECOND_NS: Final = 1_000
MILLISECOND_NS: Final = 1_000_000
SECOND_NS: Final = 1_000_000_000
IN_C = ("SECOND_NS",)  # records.h has them, too
