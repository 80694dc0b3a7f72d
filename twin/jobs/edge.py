"""How far a job is from losing steps: it is made again with ever more of what brings motors out of step.

    speed        all speeds of its straight moves, of controllers whose language retimes jobs; of a servo axis the edge
                 at which its drive switches itself off
    supply       voltage of the stage of one axis, downwards
    inductance   of the motor of one axis
    load         friction of guide and screw of one axis

                 1.00   1.06   1.12   1.19         upwards until the first loss, by steps of 6 %,
    holds         x      x      x      LOST        then halved to 1 %, each on several seeds: the edge is where the
                               |--|                first of them loses

What is known without that is the speed from which on a motor swings (`Result.edge`): it lies below the edge of speed,
steps are lost from 1.03 to 1.26 of it on.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.crew import Crew, Stop, in_order
from isel_twin.base.errors import CallError
from isel_twin.base.quiet import quietly
from isel_twin.controller import offers
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import Line, parse_job
from isel_twin.jobs.playing import played
from isel_twin.jobs.verdict import Verdict
from isel_twin.language import RetimesJobs, create_language

STEP = 1.06  # from factor to factor upwards
PRECISION = 1.01
SEEDS = 3  # machines of the same numbers: other places, rotor angles and scatter
FARTHEST: Mapping[str, float] = {"speed": 3.0, "supply": 0.3, "inductance": 5.0, "load": 10.0}
_LOAD_KEYS = ("guide_friction", "shaft_coulomb", "shaft_viscous")


@dataclass(frozen=True)
class Edge:
    """The least factor on a quantity at which an axis loses steps, or its servo drive switches itself off."""

    quantity: str
    axis: str
    factor: float | None  # None: not up to FARTHEST
    closed_loop: bool = False


@dataclass(frozen=True)
class _Search:
    quantity: str
    axis: str  # "" for the speed, which is that of all


def check(call: TwinSpec) -> None:
    """Raise CallError if nothing can be lost."""
    if call.plant == "kinematic":
        raise CallError("edge: the kinematic plant loses no step whatever one changes; take mujoco", option=True)


def edges(
    call: TwinSpec,
    lines: Sequence[Line],
    verdict: Verdict,
    *,
    timeout_s: float,
    flash: bytes | None = None,
    crew: Crew | None = None,
    stop: Stop | None = None,
) -> Iterator[Edge]:
    """The edges of a job, whose verdict is well, for the axes that have moved; in a fixed order, with any crew. Those
    of what the controller's language cannot change are left out, and of servo axes all but that of speed."""
    moved = [name for name, edge in zip(AXIS_NAMES, verdict.edge, strict=False) if edge and name in CARRIAGES]
    searches = [_Search(quantity, axis) for axis in moved for quantity in ("supply", "inductance", "load")]
    if offers(create_language(call.controller), RetimesJobs):
        searches.insert(0, _Search("speed", ""))
    find = functools.partial(_found, call, lines, timeout_s, flash)
    for found in in_order(find, searches, crew, stop):
        yield from found


def told(found: Sequence[Edge]) -> dict[str, dict[str, float | None]]:
    """In JSON's types: factors by axis and quantity; null: not up to FARTHEST."""
    axes: dict[str, dict[str, float | None]] = {}
    for edge in found:
        axes.setdefault(edge.axis, {})[edge.quantity] = edge.factor
    return axes


def _found(
    call: TwinSpec, lines: Sequence[Line], timeout_s: float, flash: bytes | None, search: _Search
) -> tuple[Edge, ...]:
    """Depends only on its arguments, so that it can run in another process."""
    farthest = FARTHEST[search.quantity]

    @functools.cache
    def losers(factor: float, seeds: int) -> tuple[str, ...]:
        """Axes that lose steps on any of so many seeds."""
        spec, changed = _changed(call, lines, search, factor)
        lost: set[str] = set()
        for seed in range(call.seed, call.seed + seeds):
            with quietly():
                verdict = played(spec.with_(seed=seed, flash=flash).build(), changed, timeout_s=timeout_s).verdict
            lost |= {name for name, gone in zip(AXIS_NAMES, _out_of_step(verdict), strict=False) if gone}
        return tuple(sorted(lost))

    factor = _least(lambda factor: bool(losers(factor, 1)), lambda factor: bool(losers(factor, SEEDS)), farthest)
    told = None if factor is None else round(factor, 4)
    if search.axis:
        return (Edge(search.quantity, search.axis, told),)
    servos = {axis.name for axis in call.fitted().axes if axis.closed_loop}
    found = () if factor is None else losers(factor, SEEDS)
    return tuple(Edge(search.quantity, axis, told, axis in servos) for axis in found)


def _least(quick: Callable[[float], bool], sure: Callable[[float], bool], farthest: float) -> float | None:
    """The least factor for which `sure` is true, looked for from 1 to `farthest` by `quick`; None if there is none."""
    up = farthest > 1.0
    low, high = 1.0, STEP if up else 1.0 / STEP
    while not quick(high):
        if high == farthest:
            return None
        low, high = high, min(high * STEP, farthest) if up else max(high / STEP, farthest)
    low = low / STEP if up else low * STEP  # other seeds may lose earlier
    while max(high / low, low / high) > PRECISION:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if sure(middle) else (middle, high)
    return high


def _out_of_step(verdict: Verdict) -> list[bool]:
    """Axes that have lost steps, or whose servo drive has switched itself off."""
    return [any(each) for each in zip(verdict.lost, verdict.halfway, verdict.switched_off, strict=False)]


def _changed(call: TwinSpec, lines: Sequence[Line], search: _Search, factor: float) -> tuple[TwinSpec, Sequence[Line]]:
    """The call and the job with one quantity changed."""
    if search.quantity == "speed":
        return call, _faster(call.controller, lines, factor)
    tree = call.fitted().tree
    axis: Any = tree["axes"][search.axis]
    keys: Mapping[str, tuple[str, ...]] = {
        "supply": ("stage.supply",),
        "inductance": ("specimen.inductance",),
        "load": _LOAD_KEYS,
    }
    overrides = {}
    for key in keys[search.quantity]:
        entry = axis
        for name in key.split("."):
            entry = entry[name]
        overrides[f"axes.{search.axis}.{key}"] = entry["value"] * factor
    return call.with_(overrides={**call.overrides, **overrides}), lines


def _faster(controller: str, lines: Sequence[Line], factor: float) -> Sequence[Line]:
    """The job with all speeds of its straight moves times a factor."""
    language = create_language(controller)
    assert offers(language, RetimesJobs)
    if lines[-1].program:
        text = "\n".join(language.faster(lines[-1].source.splitlines(), factor))
        return parse_job(text, create_language(controller), controller)
    texts = language.faster([line.command for line in lines], factor)
    return [
        line if text == line.command else _retold(line, text, controller)
        for line, text in zip(lines, texts, strict=True)
    ]


def _retold(line: Line, text: str, controller: str) -> Line:
    (parsed,) = parse_job(text, create_language(controller), controller)
    return replace(parsed, number=line.number, expected=line.expected)
