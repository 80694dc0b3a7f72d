"""Motions as JSON tables, and back, so that a recording has the exact stream in little space.

    StepRun(StepLine, Trapezoid)  <-->  {"steps": {"line": [800, -2000, 0, 0]}, "law": [...], "start_ns": t, "first": 0}

Motions of the package's controllers are stored by their parameters: lines, circles and helices with the trapezoidal
law; joined set points by phases and pieces. A motion that continues another has only its phases from the present one
on:

    {"joined": {"first": 17, "ticks": 550, "phases": "<base64>", ...}, "later": true, "period_ns": 4000000, ...}

A motion of a plug-in controller with its own path, law or plan is stored tick by tick: (recordings/3)

    {"ticks": {"t_ns": "<base64>", "delta": "<base64>", "dtype": "int32"}, "axes": 6, "lead_ns": 1000000, ...}

both compressed by zlib, t_ns as differences.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion import Listed, Motion, SetPointRun, StepRun, Steps, line
from isel_twin.motion.circle import Circle
from isel_twin.motion.joined import Joined
from isel_twin.motion.path import StepLine, StepPath
from isel_twin.motion.stretch import Stretch, since, written
from isel_twin.motion.time_law import Trapezoid, law_from_numbers, law_numbers

MOST_TICKS = 1 << 31  # most ticks of a listed motion that are read


def described(motion: Motion, before: Motion | None = None, time_ns: int = 0) -> dict[str, Any]:
    """The motion as a table. before: the motion that it continues at time_ns, if any, which is already stored."""
    if isinstance(motion, StepRun) and isinstance(motion.law, Trapezoid) and isinstance(motion.path, StepLine | Circle):
        table = {"steps": _path_table(motion.path), "law": law_numbers(motion.law)}
        return {**table, "start_ns": motion.start_ns, "first": motion.first}
    if isinstance(motion, SetPointRun) and isinstance(motion.plan, Joined):
        known = isinstance(before, SetPointRun) and isinstance(before.plan, Joined)
        stretch = since(motion.plan, motion.count(time_ns) if known else motion.first)
        if stretch is not None:
            return {
                "joined": {
                    "first": stretch.first,
                    "ticks": stretch.ticks,
                    "phases": _shrunk(stretch.phases),
                    "piece": _shrunk(stretch.piece),
                    "corner": _shrunk(stretch.corner),
                    "length": _shrunk(stretch.length),
                    "sine": motion.plan.sine,
                },
                "later": known,
                "axes": motion.axes,
                "period_ns": motion.period_ns,
                "start_ns": motion.start_ns,
                "first": motion.first,
                "end": motion.end,
            }
    t_ns, delta = motion.window(motion.first, motion.last)
    after_ns = np.diff(t_ns, prepend=np.int64(motion.start_ns))
    return {
        "ticks": {"t_ns": _shrunk(after_ns), "delta": _shrunk(delta), "dtype": delta.dtype.name},
        "axes": motion.axes,
        "lead_ns": motion.lead_ns,
        "start_ns": motion.start_ns,
        "first": motion.first,
    }


def motion_from(table: dict[str, Any], before: Motion | None = None) -> Motion:
    """The motion of a table; before: the one that it continues. Raises ValueError for a wrong table."""
    try:
        if "joined" in table:
            return _joined_from(table, before)
        if "steps" in table:
            law = law_from_numbers(table["law"])
            return StepRun(_path_from(table["steps"]), law, int(table["start_ns"]), int(table["first"]))
        ticks, axes = table["ticks"], int(table["axes"])
        if ticks["dtype"] not in ("int8", "int32"):
            raise ValueError(f"ticks of type {ticks['dtype']!r}")
        start_ns = int(table["start_ns"])
        t_ns = np.cumsum(_grown(ticks["t_ns"], "int64")) + start_ns
        delta = _grown(ticks["delta"], ticks["dtype"]).reshape(len(t_ns), axes)
        return Listed(t_ns, delta, start_ns, int(table["lead_ns"]), int(table["first"]))
    except (KeyError, TypeError, IndexError, AttributeError, OverflowError, zlib.error) as error:
        raise ValueError(f"no motion: {error!r}") from None


def add_run(steps: Steps, time_ns: int, content: dict[str, Any]) -> None:
    """Add the motion in a message of `/runs`, from time_ns on. Raises ValueError."""
    if content.get("run") is not None and content.get("continues"):
        if not steps.motions:
            raise ValueError("a motion continues none")
        steps.replace_last(motion_from(content["run"], steps.motions[-1]))
        return
    motion = None if content.get("run") is None else motion_from(content["run"])
    if steps.motions:
        steps.replace_last(steps.motions[-1].cut(time_ns))
    if motion is not None:
        steps.append(motion)


def _path_table(path: StepLine | Circle) -> dict[str, Any]:
    if isinstance(path, StepLine):
        return {"line": list(path.steps), "ticks": path.ticks}
    table = {item.name: getattr(path, item.name) for item in fields(path)}
    return {"circle": {"ticks": table.pop("arc_ticks"), **table}}


def _path_from(table: dict[str, Any]) -> StepPath:
    if "line" in table:
        return replace(line([int(n) for n in table["line"]]), ticks=int(table["ticks"]))
    numbers = dict(table["circle"])
    (first, second), third = map(int, numbers.pop("plane")), numbers.pop("third_axis")
    whole = {name: int(number) for name, number in numbers.items()}
    third_axis = None if third is None else int(third)
    return Circle(whole.pop("ticks"), plane=(first, second), third_axis=third_axis, **whole)


def _joined_from(table: dict[str, Any], before: Motion | None) -> SetPointRun:
    content, axes, period_ns = table["joined"], int(table["axes"]), int(table["period_ns"])
    known = None
    if table["later"]:
        if not isinstance(before, SetPointRun) or not isinstance(before.plan, Joined):
            raise ValueError("what comes later of a motion, without the beginning")
        known = before.plan
    stretch = Stretch(
        int(content["first"]),
        int(content["ticks"]),
        _grown(content["phases"], "float64").reshape(-1, 6),
        _grown(content["piece"], "int32"),
        _grown(content["corner"], "float64").reshape(-1, axes),
        _grown(content["length"], "float64"),
    )
    plan = written(stretch, period_ns, sine=bool(content["sine"]), before=known)
    end = None if table["end"] is None else int(table["end"])
    return SetPointRun(plan, period_ns, int(table["start_ns"]), int(table["first"]), end)


def _shrunk(values: NDArray[Any]) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values).tobytes(), 1)).decode()


def _grown(text: str, dtype: str) -> NDArray[Any]:
    inflater = zlib.decompressobj()
    data = inflater.decompress(base64.b64decode(text), MOST_TICKS)
    return np.frombuffer(data, dtype=dtype)
