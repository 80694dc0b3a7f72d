"""The outcome of a line of a job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

Ends: TypeAlias = tuple[float, float]  # the least and the most of a number


@dataclass(frozen=True)
class Part:
    """Part of a line that runs a program of the controller (jobs/5): a step of it, or a remark of the controller."""

    time_ns: int  # when the step began or the remark was made
    text: str
    position_mm: tuple[float, ...] = ()  # [3], by the counters at the end of the step; () for a remark
    plane: tuple[int, int] = (0, 1)  # axes of the plane in which the step cuts
    tool_mm: float = 0.0  # radius of its tool, 0 if it does not cut or the radius is unknown
    at: tuple[int, int] | None = None  # its line and column in the file


@dataclass(frozen=True)
class Result:
    """The outcome of a line: sent at time_ns, over at end_ns; counters [axes] and true positions [3] mm at its end."""

    number: int
    command: str
    reply: str
    ok: bool
    time_ns: int
    end_ns: int
    counts: tuple[int, ...]
    position_mm: tuple[float, ...]
    margin: tuple[float | None, ...] = ()  # least pull-out margin of each axis meanwhile; None without a motor
    margin_band: tuple[Ends | None, ...] = ()
    """Where each margin lies as far as torque is known (drives/bands.py); None without a stepper motor."""
    edge: tuple[float | None, ...] = ()
    """How many times the largest speed of each axis meanwhile its motor may turn until a swing grows (drives/
    stability.py); None without a stepper motor, or at rest."""
    complete: bool = True  # all was sent, the controller has answered and is idle; if not, the job ends here
    expected: str | None = None  # what the line expects; `ok` says whether it was met
    why: str = ""  # why it was not met; of a program without expectation: the error that the controller reports
    event: str = ""  # of a line that is not ok: the last event during it, or before it
    condition: bool = False  # it is a condition: the reply is the value found
    lost_known: tuple[float | None, ...] = ()  # lost steps of each axis that a condition expects
    unpowered_known: int | None = None  # number of steps without power that a condition expects
    disturbed: str = ""  # bytes of it that have not arrived as they were sent, in words
    astray: str = ""  # axes that it has referenced though no end switch of theirs was struck, in words
    line_known: tuple[int | None, ...] = ()  # those since power-on that a condition expects, as in LineFaults
    bytes_ns: int = 0  # time that its bytes and those of its reply take on the line, one after the other
    restarts: int = 0  # restarts of the controller since the line before, or since the beginning of the job
    restarts_known: int | None = None  # number of restarts since power-on that a condition expects
    fault_known: str | None = None
    """The fault in which the controller stands at the end of a line that expects it; None: it is not expected."""
    drive_faults_known: tuple[int | None, ...] = ()  # number of faults of each drive that a condition expects
    parts: tuple[Part, ...] = ()  # parts of a line that loads or runs a program; only the last of very many

    @property
    def blame(self) -> str:
        """Of a line that is not ok: what its reply means or what went wrong, and the last event; "" if unknown."""
        return "; ".join(filter(None, (self.why, self.event)))

    @property
    def margin_told(self) -> str:
        """The least margin and its band in per cent; "" without physics."""
        return in_percent(self.margin, self.margin_band)

    @property
    def shown_reply(self) -> str:
        """The reply, and if it should have been another one, which; of a refusal what it means, and the last event."""
        if not self.ok and self.expected is None:
            return ": ".join(filter(None, (self.reply, self.blame)))
        if self.ok or self.expected is None or self.condition:
            return self.reply
        return f"{self.reply or 'none'} (not {self.expected}: {self.why})"


def least_band(bands: Sequence[Ends | None]) -> Ends | None:
    """That of the least of several margins."""
    known = [ends for ends in bands if ends is not None]
    return (min(low for low, _ in known), min(high for _, high in known)) if known else None


def in_percent(margins: Sequence[float | None], bands: Sequence[Ends | None]) -> str:
    """The least of the margins and its band, `71 % (66 to 75 %)`; "" without physics."""
    least = min((margin for margin in margins if margin is not None), default=None)
    if least is None:
        return ""
    low, high = (f"{100.0 * end:.0f}" for end in least_band(bands) or (least, least))
    return f"{100.0 * least:.0f} %{'' if low == high else f' ({low} to {high} %)'}"
