"""Parts that the drilling cycles of all formats share."""

from __future__ import annotations

MOST_PECKS = 10_000  # in a hole

# "rapid" or "feed" to a height, mm; "dwell" for seconds
Step = tuple[str, float]
