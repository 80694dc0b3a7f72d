"""What becomes of a line of a job."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Result"]


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
    """What the line expects; None if it expects nothing. `ok` then says whether it was so, and `why` why not."""
    why: str = ""
    condition: bool = False
    """It is no command: the reply is what was found."""
    lost_known: tuple[float | None, ...] = ()
    """Steps lost of each axis that a condition on them has found well."""
    fault_known: bool = False
    """The same of the controller's fault."""
    drive_faults_known: tuple[int | None, ...] = ()
    """The same of the faults of each drive: how many."""

    @property
    def shown_reply(self) -> str:
        """The reply, and if it should have been another one, which."""
        if self.ok or self.expected is None or self.condition:
            return self.reply
        return f"{self.reply or 'none'} (not {self.expected}: {self.why})"
