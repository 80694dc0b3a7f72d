"""What is sent: the motions that are under way at once, as one run of set points.

One motion is its own run. Of several the sum is sent, from the last time of the grid on, and a new one whenever one of
them begins or ends: so a sum never has more parts than there are motions.
"""

from __future__ import annotations

from isel_twin.motion import SetPointRun
from isel_twin.motion.together import Part, Together


class UnderWay:
    def __init__(self) -> None:
        self._motions: tuple[SetPointRun, ...] = ()
        self.run: SetPointRun | None = None
        self._serial = 0

    def take(self, motions: tuple[SetPointRun, ...], now_ns: int, origin_ns: int) -> None:
        """Take the motions as they are now. origin_ns: a time of the grid, which they have in common."""
        before, self._motions = self._motions, motions
        if len(before) == len(motions) and all(a is b for a, b in zip(before, motions, strict=True)):
            return
        same = len(before) == len(motions) and all(a.continues(b) for a, b in zip(motions, before, strict=True))
        shown = self.run
        summed = shown is not None and isinstance(shown.plan, Together)
        if not motions:
            self.run = None
        elif len(motions) == 1 and not (summed and (same or motions[0].start_ns < now_ns)):
            self.run = motions[0]
        else:
            if not (same and summed):
                self._serial += 1
                period_ns = motions[0].period_ns
                start_ns = now_ns - (now_ns - origin_ns) % period_ns
                shown = SetPointRun(_sum(motions, start_ns, self._serial), period_ns, start_ns)
            assert shown is not None
            self.run = shown.with_plan(_sum(motions, shown.start_ns, self._serial))


def _sum(motions: tuple[SetPointRun, ...], start_ns: int, serial: int) -> Together:
    return Together(
        tuple(Part(motion.plan, (motion.start_ns - start_ns) // motion.period_ns) for motion in motions),
        ("together", serial),
    )
