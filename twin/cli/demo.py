"""`isel-twin demo`: a session to look at."""

from __future__ import annotations


def demo() -> int:
    """Watch a host program drive the twin through a pseudo-terminal: replies, counters, true positions, lost steps."""
    from isel_twin.bridge.demo import main

    main()
    return 0
