"""Position errors on a grid of time, sampled by the plant if possible.

    watch = Watch(twin, interval_ns)        from now on
    twin.run_until(...)
    watch.errors_mm()                       one row for each complete interval

A look takes as long as computing twenty milliseconds of motion, so the compiled loop takes the samples. They are equal
to looks to the bit: positions are of the exact nanosecond, and a counter is

    counter(t) = counter at the last whole sub-step + ticks from there to t

where the ticks, a pulse or two, are those of the twin's record. Without physics there are no sub-steps, and
counters are of the exact nanosecond, too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isel_twin.core.sampling import TwinSamples
from isel_twin.core.twin import Twin


def error_mm(twin: Twin, steps_per_mm: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """float64 [3], true carriage position minus counter, in mm, now."""
    return twin.position_mm - twin.counts[:3] / (_steps_per_mm(twin) if steps_per_mm is None else steps_per_mm)


class Watch:
    """Errors of a twin on a grid of time that begins now; `errors_mm` ends it."""

    def __init__(self, twin: Twin, interval_ns: int) -> None:
        """interval_ns: a multiple of the sub-step. `in_loop` says whether the plant takes the samples."""
        self._twin, self._interval_ns, self._begin_ns = twin, interval_ns, twin.time_ns
        self._steps_per_mm = _steps_per_mm(twin)
        self._samples: list[TwinSamples] = []
        self.in_loop = twin.sample(self._take, interval_ns, from_ns=twin.time_ns) is not None

    def _take(self, samples: TwinSamples) -> None:
        self._samples.append(samples)

    def error_mm(self) -> NDArray[np.float64]:
        """The errors now, for plants without sampling."""
        return error_mm(self._twin, self._steps_per_mm)

    def leave(self) -> None:
        if self.in_loop:
            self._twin.sample_no_more(self._take)
            self.in_loop = False

    def errors_mm(self) -> NDArray[np.float64]:
        """float64 [n, 3], errors at the ends of all complete intervals until now, in mm; ends the watch."""
        self.leave()
        twin, every = self._twin, self._interval_ns
        times_ns = np.arange(self._begin_ns + every, twin.time_ns + 1, every, dtype=np.int64)
        if not len(times_ns):
            return np.empty((0, 3))
        taken_ns = np.concatenate([part.time_ns for part in self._samples])
        row = np.searchsorted(taken_ns, times_ns, side="right") - 1  # while nothing moves there is only one sample
        position_mm = np.concatenate([part.position_mm for part in self._samples])[row]
        counts = np.concatenate([part.counts for part in self._samples])[row]
        since = self._ticks_since_substep(times_ns) if twin.physics else 0
        return position_mm - (counts[:, :3] + since) / self._steps_per_mm

    def _ticks_since_substep(self, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """int64 [n, 3], changes of the counters after the last whole sub-step before each time."""
        whole_ns = times_ns - times_ns % self._twin.machine.timing.substep_ns
        made = np.zeros((len(times_ns), 3), dtype=np.int64)
        for motion in reversed(self._twin.steps.motions):
            if motion.end_ns < whole_ns[0]:
                break
            t_ns, delta = motion.window(motion.first, motion.last)
            first, last = t_ns.searchsorted(whole_ns, side="right"), t_ns.searchsorted(times_ns, side="right")
            while (more := first < last).any():  # at most two rounds, unless a stage makes steps all the time
                made[more] += delta[first[more], :3]
                first += 1
        return made


def _steps_per_mm(twin: Twin) -> NDArray[np.float64]:
    return np.array([axis.steps_per_mm for axis in twin.machine.axes])
