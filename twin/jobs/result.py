"""What becomes of a line of a job."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """On the way through a line that runs a program of the controller's: a step of it, or what the controller remarks.

    time_ns: when the step began, or when it was said; position_mm [3]: what the controller has counted by the
    end of the step, () for a remark.
    """

    time_ns: int
    text: str
    position_mm: tuple[float, ...] = ()
    plane: tuple[int, int] = (0, 1)
    """Axes of the plane in which the step cuts, and the radius of its tool, 0 if it cuts nothing or nobody knows."""
    tool_mm: float = 0.0
    at: tuple[int, int] | None = None
    """Line and column of the file where it stands, or where to look for what is remarked; None: nowhere in it."""


@dataclass(frozen=True)
class Result:
    """What became of a line: sent at time_ns, over at end_ns; counters [axes] and true positions [3] mm at its end.

    complete: all of it was sent, and the controller has answered and stands still. If not, the job ends with it.
    """

    number: int
    command: str
    reply: str
    ok: bool
    time_ns: int
    end_ns: int
    counts: tuple[int, ...]
    position_mm: tuple[float, ...]
    margin: tuple[float | None, ...] = ()
    """Least pull-out margin of each axis meanwhile, `Twin.margin`; None for an axis without a motor."""
    complete: bool = True
    expected: str | None = None
    """What the line expects; None if it expects nothing. `ok` then says whether it was so, and `why` why not.
    Of a line that loads or runs a program and expects nothing: what the controller says is wrong."""
    why: str = ""
    condition: bool = False
    lost_known: tuple[float | None, ...] = ()  # steps lost of each axis that a condition on them has found well
    fault_known: bool = False  # the same of the controller's fault
    drive_faults_known: tuple[int | None, ...] = ()  # the same of the faults of each drive: how many

    parts: tuple[Part, ...] = ()  # of a line that loads or runs a program; the last ones, if there are very many

    @property
    def shown_reply(self) -> str:
        """The reply, and if it should have been another one, which."""
        if not self.ok and self.expected is None and self.why:
            return self.why
        if self.ok or self.expected is None or self.condition:
            return self.reply
        return f"{self.reply or 'none'} (not {self.expected}: {self.why})"
