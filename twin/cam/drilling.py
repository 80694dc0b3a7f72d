"""What the drilling cycles of all formats have in common."""

from __future__ import annotations

MOST_PECKS = 10_000  # in a hole

# "rapid" or "feed" to a height, mm; "dwell" for seconds
Step = tuple[str, float]
