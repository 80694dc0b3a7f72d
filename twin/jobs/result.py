"""What becomes of a line of a job."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """In a line that runs a program of the controller's (jobs/5): a step of it, or a remark of the controller."""

    time_ns: int  # when the step began, or when it was said
    text: str
    position_mm: tuple[float, ...] = ()  # [3], counted by the end of the step; () for a remark
    plane: tuple[int, int] = (0, 1)  # axes of the plane in which the step cuts
    tool_mm: float = 0.0  # radius of its tool, 0 if it cuts nothing or nobody knows
    at: tuple[int, int] | None = None  # line and column of the file where it, or what is remarked, stands


@dataclass(frozen=True)
class Result:
    """What became of a line: sent at time_ns, over at end_ns; counters [axes] and true positions [3] mm at its end."""

    number: int
    command: str
    reply: str
    ok: bool
    time_ns: int
    end_ns: int
    counts: tuple[int, ...]
    position_mm: tuple[float, ...]
    margin: tuple[float | None, ...] = ()  # least pull-out margin of each axis meanwhile; None without a motor
    complete: bool = True  # all was sent, the controller has answered and stands still; if not, the job ends here
    expected: str | None = None  # what the line expects; `ok` says whether it was so
    why: str = ""  # why not; of a program of which nothing is expected: what the controller says is wrong
    event: str = ""  # of a line that is not ok: the last event during it, or before it
    condition: bool = False  # it is no command: the reply is what was found
    lost_known: tuple[float | None, ...] = ()  # steps lost of each axis that a condition on them has found well
    unpowered_known: int | None = None  # the same of steps made without power
    restarts: int = 0  # how often the controller started anew since the line before, or since the job began
    restarts_known: int | None = None  # as many, since power-on, a condition has found well
    fault_known: bool = False  # the same of the controller's fault
    drive_faults_known: tuple[int | None, ...] = ()  # the same of the faults of each drive: how many
    parts: tuple[Part, ...] = ()  # of a line that loads or runs a program; the last ones, if there are very many

    @property
    def blame(self) -> str:
        """Of a line that is not ok: what its reply means or what went wrong, and the last event; "" if unknown."""
        return "; ".join(filter(None, (self.why, self.event)))

    @property
    def shown_reply(self) -> str:
        """The reply, and if it should have been another one, which; of a refusal what it means, and the last event."""
        if not self.ok and self.expected is None:
            return ": ".join(filter(None, (self.reply, self.blame)))
        if self.ok or self.expected is None or self.condition:
            return self.reply
        return f"{self.reply or 'none'} (not {self.expected}: {self.why})"
