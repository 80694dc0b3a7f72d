"""Plays a captured stream in a twin, motion by motion, and records the switches that the carriages strike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.capture.player import Player
from isel_twin.core.snapshot import snapshot
from isel_twin.jobs.job import Line
from isel_twin.jobs.result import Result
from isel_twin.jobs.sending import margins

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.motion import StepRun


@dataclass(frozen=True)
class Strike:
    switch: str
    time_ns: int


class Strikes:
    """Watches the switches of a twin from now on."""

    def __init__(self, twin: Twin) -> None:
        self.seen: list[Strike] = []  # the first strike of each switch, in the order of time, also one at the beginning
        self._known: set[str] = set()
        twin.observe(self._look, 100 * MILLISECOND_NS)

    def _look(self, twin: Twin) -> None:
        for name, state in twin.inputs.items():
            if state == "struck" and name not in self._known:
                self._known.add(name)
                self.seen.append(Strike(name, twin.time_ns))


def lines_of(player: Player) -> list[Line]:
    """The motions as lines of a job, with the distance in steps in place of a command."""
    return [Line(number, _in_words(motion), ()) for number, motion in enumerate(player.motions, 1)]


def _in_words(motion: StepRun) -> str:
    steps = motion.displacement(motion.end_ns)
    moved = [f"{axis.upper()} {n:+d}" for axis, n in zip(AXIS_NAMES, steps, strict=False) if n]
    return " ".join(moved) or f"to and fro, {motion.last} ticks"


def play(
    twin: Twin,
    player: Player,
    over_ns: int,
    strikes: Strikes,
    allowed: Callable[[str], bool],
    stop: Callable[[], bool] | None = None,
) -> Iterator[Result]:
    """Let the twin make the motions of its player, with a result for each, then let time pass to over_ns. allowed:
    whether a switch may be struck; a motion that strikes another one is not ok, and its reply names it.
    """
    for line, motion in zip(lines_of(player), player.motions, strict=True):
        twin.run_until(motion.start_ns, stop)
        if stop is not None and stop():
            return
        before = len(strikes.seen)
        twin.watch_margin()
        twin.run_until(motion.end_ns, stop)
        ended_ns = twin.time_ns
        complete = ended_ns >= motion.end_ns
        if complete and line.number == len(player.motions):
            twin.run_until(over_ns, stop)
        struck = [strike.switch for strike in strikes.seen[before:]]
        seen = snapshot(twin)
        yield Result(
            number=line.number,
            command=line.command,
            reply=" ".join(struck),
            ok=all(map(allowed, struck)),
            time_ns=motion.start_ns,
            end_ns=ended_ns,
            counts=tuple(seen.counts.tolist()),
            position_mm=tuple(seen.position_mm.tolist()),
            **margins(twin),
            complete=complete,
        )
        if not complete:
            return
