"""Commands of a host, as a toolpath again: a twin without physics carries it out, and its motions are told.

    bytes ---> twin, each message to its end ---> motions ---> lines, arcs, spindle ---> a file (isel_twin.cam.files)

Points are those of the machine, 0 where a reference run ends; reference runs are left out, and so is where the
carriages stood before the first. Every motion is a cut at the speed it had, as nothing tells rapids from feeds.
Circles in X and Y stay arcs, each turn of its own; helices, other planes and the paths of controllers that join moves
become chords within CHORD_MM, or a step of all axes where that is more. Each message is carried out to its end before
the next: what stopped a motion half-way is not told.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Element, Line, Place, Spindle
from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import Twin
from isel_twin.language import Language, create_language, needed
from isel_twin.motion import Motion
from isel_twin.motion.circle import Circle
from isel_twin.motion.path import StepLine
from isel_twin.motion.step_run import StepRun
from isel_twin.motion.time_law import Trapezoid

CHORD_MM = 0.002  # chords leave a path that is no line and no arc by at most this
MOST_S = 86_400.0  # virtual time that a message may take

Floats = NDArray[np.float64]


def recovered(sent: Iterable[bytes], spec: TwinSpec, settings: CamSettings | None = None) -> Iterator[Element]:
    """The toolpath of what was sent, made while it is taken; places are numbers of its messages. Raises MachineError,
    LanguageError, CallError."""
    twin = spec.with_(plant="kinematic").build()
    language = needed(create_language(spec.controller), spec.controller)
    return _carried_out(_messages(sent, language), twin, settings or CamSettings())


def _carried_out(messages: Iterable[bytes], twin: Twin, settings: CamSettings) -> Iterator[Element]:
    step_mm = np.asarray(twin.step_mm[: len(CARRIAGES)], dtype=np.float64)
    at = np.zeros(len(CARRIAGES))  # mm from the end of the reference run
    counters: list[Any] = []
    twin.listen(lambda _, kind, what: counters.append(what) if kind == "counter" else None)
    told, spindle = 0, Spindle(Place(1), 0)
    for number, data in enumerate(messages, 1):
        counters.clear()
        twin.write(data)
        twin.run_until_idle(MOST_S)
        twin.read()
        motions = twin.steps.motions[told:]
        told += len(motions)
        if counters and motions:  # a reference run
            at[[what.axis for what in counters if what.axis < len(at)]] = 0.0
            continue
        if (now := _spindle(twin))[1:] != spindle[1:]:
            spindle = now
            yield now._replace(place=Place(number))
        for motion in motions:
            for element in _elements(motion, at, step_mm, settings, Place(number)):
                yield element
                at = np.array(_back(element.to, settings))


def _spindle(twin: Twin) -> Spindle:
    """Spindle as the controller asks for it now; its speed as far as it is known."""
    outputs, machine = twin.outputs, twin.machine.spindle
    if not outputs.get("spindle"):
        return Spindle(Place(1), 0)
    rev_min = float(outputs.get("spindle_speed") or 0)
    if not rev_min and machine is not None:
        rev_min = machine.wanted_rev_min(outputs.get("analog", 0), None)
    return Spindle(Place(1), -1 if rev_min < 0 else 1, abs(rev_min) or None)


def _messages(sent: Iterable[bytes], language: Language) -> Iterator[bytes]:
    """One after the other; bytes that are no whole message come last."""
    for data in sent:
        yield from (message.data for message in language.messages(data, True))
    if rest := language.rest(True):
        yield rest


def _elements(motion: Motion, at: Floats, step_mm: Floats, settings: CamSettings, place: Place) -> Iterator[Line | Arc]:
    if isinstance(motion, StepRun) and isinstance(motion.law, Trapezoid):
        steps = np.array(motion.displacement(motion.end_ns)[: len(CARRIAGES)], dtype=np.float64)
        ticks = motion.last - motion.first
        if isinstance(motion.path, StepLine):
            if steps.any():
                way_mm = float(np.linalg.norm(steps * step_mm))
                feed = float(motion.law.speed_hz) * way_mm / ticks
                yield Line(place, settings.machine_point(_point(at + steps * step_mm)), feed)
            return
        if isinstance(motion.path, Circle) and (arc := _arc(motion, motion.path, at, step_mm)) is not None:
            centre, radius_mm, sense, angle = arc
            feed = float(motion.law.speed_hz) * radius_mm * angle / ticks
            turns = math.ceil(angle / (2.0 * math.pi) - 1e-9)
            for to in [at] * (turns - 1) + [at + steps * step_mm]:
                to_mm, centre_mm = (settings.machine_point(_point(values)) for values in (to, centre))
                yield Arc(place, to_mm, centre_mm, 2, sense, feed)
            return
    yield from _chords(motion, at, step_mm, settings, place)


def _arc(motion: StepRun, path: Circle, at: Floats, step_mm: Floats) -> tuple[Floats, float, int, float] | None:
    """Centre, radius, sense and angle of a whole circle or arc in X and Y; None for any other."""
    if set(path.plane) != {0, 1} or path.third_axis is not None or step_mm[0] != step_mm[1]:
        return None
    if motion.first or motion.last < path.ticks or not path.squared_radius:
        return None
    if (angle := _angle(path, path.ticks)) <= 0.0:  # a single step towards the centre
        return None
    centre = at.copy()
    centre[path.plane[0]] -= path.xs * step_mm[0]
    centre[path.plane[1]] -= path.ys * step_mm[0]
    return centre, math.sqrt(path.squared_radius) * float(step_mm[0]), 1 if path.plane == (0, 1) else -1, angle


def _angle(path: Circle, ticks: int) -> float:
    """Angle of the first ticks, with its full turns; a quarter of a circle has 2 R of them."""
    x, y = path.displacement(ticks)[path.plane[0]] + path.xs, path.displacement(ticks)[path.plane[1]] + path.ys
    part = math.atan2(y, x) - math.atan2(path.ys, path.xs)
    about = ticks / (8.0 * math.sqrt(path.squared_radius))
    return part + 2.0 * math.pi * round(about - part / (2.0 * math.pi))


def _chords(motion: Motion, at: Floats, step_mm: Floats, settings: CamSettings, place: Place) -> Iterator[Line]:
    t_ns, delta = motion.window(motion.first, motion.last)
    if not len(t_ns):
        return
    places = at + np.cumsum(delta[:, : len(CARRIAGES)], axis=0, dtype=np.int64) * step_mm
    places = np.vstack([at, places])
    times = np.concatenate([[motion.start_ns], t_ns]).astype(np.float64) / SECOND_NS
    for first, last in itertools.pairwise(_corners(places, max(CHORD_MM, float(np.linalg.norm(step_mm))))):
        way_mm = float(np.linalg.norm(places[last] - places[first]))
        took_s = times[last] - times[first]
        if way_mm and took_s:
            yield Line(place, settings.machine_point(_point(places[last])), way_mm / took_s)


def _corners(places: Floats, within_mm: float) -> Sequence[int]:
    """Indices of the points [n, 3] whose chords keep all others so near (Douglas and Peucker)."""
    kept, open_ = {0, len(places) - 1}, [(0, len(places) - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        chord = places[last] - places[first]
        beside = places[first + 1 : last] - places[first]
        length = float(np.dot(chord, chord))
        share = np.clip(beside @ chord / length, 0.0, 1.0) if length else np.zeros(len(beside))
        off = np.linalg.norm(beside - share[:, None] * chord, axis=1)
        worst = int(off.argmax())
        if off[worst] > within_mm:
            middle = first + 1 + worst
            kept.add(middle)
            open_ += [(first, middle), (middle, last)]
    return sorted(kept)


def _point(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _back(point: tuple[float, float, float], settings: CamSettings) -> tuple[float, float, float]:
    """In the sense of the counters: the sign of Z is its own inverse."""
    return settings.machine_point(point)
