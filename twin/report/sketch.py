"""A picture of a run for a failed test: path from above and from the front, error and lost steps. The path begins where
a counter was last set, mostly by a reference run, as it needs a constant zero.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.files import atomic_write
from isel_twin.base.pictures import picture_bytes
from isel_twin.base.thinning import extremes
from isel_twin.base.units import SECOND_NS
from isel_twin.core.position import position_error_mm

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.recorder import Recorder

POINTS = 4000  # most samples of a curve that are drawn


def write_sketch(path: str | os.PathLike[str], twin: Twin, recorder: Recorder, zero_ns: int = 0) -> None:
    """Write a PNG of what the recorder saw. zero_ns: when a counter was last set. Raises OSError."""
    samples = np.concatenate(list(recorder.samples()))
    time_s = samples["time_ns"] / SECOND_NS
    path_mm = samples["position_mm"][samples["time_ns"] >= zero_ns]
    x, y, z = path_mm[extremes(path_mm, POINTS)].T
    figure = Figure(figsize=(11, 8), dpi=100)  # fixed margins; computing them would draw all twice
    figure.subplots_adjust(0.09, 0.07, 0.98, 0.95, wspace=0.2, hspace=0.3)
    (plan, front), (error, lost) = figure.subplots(2, 2)
    plan.plot(x, y, linewidth=1)
    plan.plot(x[-1:], y[-1:], "o")
    plan.set(xlabel="X / mm", ylabel="Y / mm", title="path from above, since a counter was set")
    front.plot(x, z, linewidth=1)
    front.plot(x[-1:], z[-1:], "o")
    front.set(xlabel="X / mm", ylabel="Z / mm", title="and from the front")
    for curve in (plan, front):  # do not magnify rounding errors, here and below
        for limits, limit in ((curve.get_xlim(), curve.set_xlim), (curve.get_ylim(), curve.set_ylim)):
            middle = sum(limits) / 2.0
            limit(min(limits[0], middle - 0.5), max(limits[1], middle + 0.5))
    error_um = position_error_mm(samples["position_mm"], samples["counts"], twin.step_mm) * 1e3
    for plot, values, names in ((error, error_um, CARRIAGES), (lost, samples["lost_steps"], AXIS_NAMES)):
        kept = extremes(values, POINTS)
        for axis, column in zip(names, values[kept].T, strict=False):
            plot.plot(time_s[kept], column, label=axis, linewidth=1)
    error.set(xlabel="virtual time / s", ylabel="position error / um", title="true position minus counter")
    lost.set(xlabel="virtual time / s", ylabel="lost steps", title="counter minus rotor")
    for curve in (error, lost):
        low, high = curve.get_ylim()
        curve.set_ylim(min(low, -1.0), max(high, 1.0))
        curve.legend(loc="upper left")
    atomic_write(path, picture_bytes(figure))
