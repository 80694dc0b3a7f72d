"""How far a job is from losing steps: it is made again with ever more of what brings motors out of step.

    speed        all speeds of its straight moves, of controllers whose language retimes jobs; of a servo axis the edge
                 at which its drive switches itself off
    supply       voltage of the stage of one axis, downwards
    inductance   of the motor of one axis
    load         friction of guide and screw of one axis

                 1.00   1.06   1.12   1.19         upwards until the first loss, by steps of 6 % (the load, which has
    holds         x      x      x      LOST        no resonances on its way, by 26 % before), then halved to 1 %, each
                               |--|                on several seeds: the edge is where the first of them loses. A seed
                                                   whose power-on place leads the job into a switch is none of them

    told                    1.09                   and moved by 5 % at most, so that 5 % nearer all of them hold and 5 %
                                                   farther all of them lose: a band of losses may be narrower than that

A factor at which the job is not made to its end, as the controller refuses a speed, says nothing of losses: it ends the
search, and the edge is told as none up to the farthest factor at which every seed has made the whole job (jobs/18).
So does a speed beyond which no move becomes any faster, as the controller has a highest one.

What is known without that is the speed from which on a motor swings (`Result.edge`): it lies below the edge of speed,
or within 5 % of it, and there is none where it could not be confirmed. `python -m tests.edges` holds edges against
fresh seeds (docs/fidelity.md).
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.crew import Crew, Stop, here, in_order
from isel_twin.base.errors import CallError
from isel_twin.base.quiet import quietly
from isel_twin.controller import offers
from isel_twin.core.seen import SLOW_RAD_S
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import Line, parse_job
from isel_twin.jobs.playing import TIMEOUT_S, out_of_step, played
from isel_twin.jobs.verdict import Verdict
from isel_twin.language import RetimesJobs, create_language

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.result import Result

STEP = 1.06  # from factor to factor upwards
STRIDE = STEP**4  # of the load
PRECISION = 1.01
NEARER, FARTHER = 0.95, 1.05  # of an edge: where every seed holds, and where every seed loses
SEEDS = 3  # machines of the same numbers: other places, rotor angles and scatter
ASKED = 4 * SEEDS  # most seeds that are looked at for those
FARTHEST: Mapping[str, float] = {"speed": 3.0, "supply": 0.3, "inductance": 5.0, "load": 10.0}
BEYOND = "the range of the machine file ends"
NO_FASTER = "no move is any faster"
_LOAD_KEYS = ("guide_friction", "shaft_coulomb", "shaft_viscous")


@dataclass(frozen=True)
class Edge:
    """The least factor on a quantity at which an axis loses steps, or its servo drive switches itself off."""

    quantity: str
    axis: str
    factor: float | None  # None: not up to `tried`
    tried: float  # without a factor: the farthest at which every seed has made the whole job and this axis has held
    line: int | None = None  # the first after which steps are lost there
    closed_loop: bool = False
    seeds: int = 1  # how many were tried
    ends: str = ""  # why nothing is known beyond `tried`, in words; "": no more is looked for


@dataclass(frozen=True)
class Trial:
    """The outcome of a job with one quantity times a factor, on one seed."""

    lost: Mapping[str, int]  # axes that have lost steps, and the line in which each did
    ends: str = ""  # why the job was not made to its end, which says nothing of the other axes
    moving_ns: int = 0  # time in which the controller moved


@dataclass(frozen=True)
class _Search:
    quantity: str
    axes: tuple[str, ...]  # whose edge is sought; the speed is that of all


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
    call = call.with_(flash=flash)
    moved = _moved(call, lines, verdict, timeout_s)
    searches = [_Search(quantity, (axis,)) for axis in moved for quantity in ("supply", "inductance", "load")]
    if offers(create_language(call.controller), RetimesJobs):
        every = [axis.name for axis in call.fitted().axes if axis.name in moved or axis.closed_loop]
        searches.insert(0, _Search("speed", tuple(every)))
    if not searches:
        return
    with crew or here() as workers:
        others = alike(call, lines, range(call.seed + 1, call.seed + ASKED), SEEDS - 1, timeout_s, workers, stop)
        find = functools.partial(_found, call, lines, timeout_s, (call.seed, *others))
        for found in in_order(find, searches, workers, stop):
            yield from found


def _moved(call: TwinSpec, lines: Sequence[Line], verdict: Verdict, timeout_s: float) -> list[str]:
    """Carriages whose stepper motors have turned. Those without a limit of the swing have no edge that says so: if
    there are any, the job is made again."""
    turned = {name for name, edge in zip(AXIS_NAMES, verdict.edge, strict=False) if edge}
    axes = [axis for axis in call.fitted().axes if not axis.closed_loop]
    if verdict.physics and any(axis.name not in turned and math.isinf(axis.swing_limit_rad_s) for axis in axes):
        twin = call.build()

        def take(_: Result) -> None:
            turned.update(itertools.compress(AXIS_NAMES, twin.fastest_rad_s >= SLOW_RAD_S))

        with quietly():
            played(twin, lines, [take], timeout_s, edges=False)
    return [axis.name for axis in axes if axis.name in turned and axis.name in CARRIAGES]


def alike(
    call: TwinSpec,
    lines: Sequence[Line],
    seeds: Sequence[int],
    wanted: int,
    timeout_s: float = TIMEOUT_S,
    crew: Crew | None = None,
    stop: Stop | None = None,
) -> tuple[int, ...]:
    """The first of these seeds, at most `wanted`, on which the job as it stands is answered as it should be. On others
    it meets a switch, from where the carriages stand at power-on, and stops there at once: what that loses says nothing
    of speed, supply or load."""
    answered = functools.partial(_answered, call, lines, timeout_s)
    found: list[int] = []
    with closing(in_order(answered, seeds, crew, stop)) as told:
        for seed, good in zip(seeds, told, strict=False):
            if good:
                found.append(seed)
            if len(found) == wanted:
                break
    return tuple(found)


def _answered(call: TwinSpec, lines: Sequence[Line], timeout_s: float, seed: int) -> bool:
    with quietly():
        verdict = played(call.with_(seed=seed).build(), lines, timeout_s=timeout_s).verdict
    return not (verdict.refused or verdict.unmet or verdict.unsent or verdict.unfinished)


def told(found: Sequence[Edge]) -> dict[str, Any]:
    """In JSON's types: factors by axis and quantity, null where there is none; the lines that lose there; and where
    there is none, up to which factor the job was made, and what ends it beyond."""
    axes: dict[str, dict[str, float | None]] = {}
    lines: dict[str, dict[str, int]] = {}
    tested: dict[str, dict[str, dict[str, Any]]] = {}
    for edge in found:
        axes.setdefault(edge.axis, {})[edge.quantity] = edge.factor
        if edge.line is not None:
            lines.setdefault(edge.axis, {})[edge.quantity] = edge.line
        if edge.factor is None:
            over = {"to": round(edge.tried, 4), "ends": edge.ends}
            tested.setdefault(edge.axis, {})[edge.quantity] = over
    seeds = max((edge.seeds for edge in found), default=0)
    return {"edge": axes, "edge_lines": lines, "edge_tested": tested, "edge_seeds": seeds}


class _Losses:
    """A watcher that notes the first line after which each axis has lost steps, or its servo drive is off, and the
    first that is refused, or not over, before all have."""

    def __init__(self, twin: Twin, wanted: Iterable[str]) -> None:
        self.lines: dict[str, int] = {}
        self.ends = ""
        self._twin, self._wanted = twin, set(wanted)

    def take(self, result: Result) -> None:
        for axis in out_of_step(self._twin):
            self.lines.setdefault(AXIS_NAMES[axis], result.number)
        if not result.complete:
            self.ends = f"line {result.number} is not over in time"
        elif not result.ok and not result.condition:
            self.ends = f"line {result.number} is refused ({result.shown_reply or 'no reply'})"

    def stop(self) -> bool:
        """True once nothing is left to be found; the rest of such a job has no meaning."""
        return bool(self.ends) or self._wanted <= self.lines.keys()


def tried(
    call: TwinSpec,
    lines: Sequence[Line],
    quantity: str,
    axes: tuple[str, ...],
    factor: float,
    seed: int,
    timeout_s: float = TIMEOUT_S,
) -> Trial:
    """Make a job on a seed with a quantity (of `axes`; the speed is that of all) times a factor. The job ends when all
    of `axes` have lost steps, or when a line of it is not made."""
    spec, changed = _changed(call, lines, _Search(quantity, axes), factor)
    try:
        twin = spec.with_(seed=seed).build()
    except ValueError:
        return Trial({}, BEYOND)
    seen = _Losses(twin, axes)
    with quietly():
        verdict = played(twin, changed, [seen.take], timeout_s, seen.stop, edges=False).verdict
    for name, halfway in zip(AXIS_NAMES, verdict.halfway, strict=False):
        if halfway:
            seen.lines.setdefault(name, lines[-1].number)
    if not seen.lines and not seen.ends:
        seen.ends = next(iter(replace(verdict, unmet=()).problems()), "")
    moving_ns = sum(motion.end_ns - motion.start_ns for motion in twin.steps.motions)
    return Trial(seen.lines, seen.ends, moving_ns)


def _found(
    call: TwinSpec, lines: Sequence[Line], timeout_s: float, seeds: Sequence[int], search: _Search
) -> tuple[Edge, ...]:
    """Depends only on its arguments, so that it can run in another process."""
    farthest, sign = _farthest(call, lines, search), 1 if FARTHEST[search.quantity] > 1.0 else -1
    asked = {1.0}  # factors

    @functools.cache
    def made(factor: float, seed: int) -> Trial:
        asked.add(factor)
        return tried(call, lines, search.quantity, search.axes, factor, seed, timeout_s)

    def edge(axis: str) -> Edge:
        def over(factor: float, seed: int) -> bool:
            return axis in made(factor, seed).lost or bool(made(factor, seed).ends)

        def quick(factor: float) -> bool:
            return over(factor, call.seed) or (factor == farthest and some(factor))

        def some(factor: float) -> bool:
            return any(over(factor, seed) for seed in seeds)

        def every(factor: float) -> bool:
            return all(axis in made(factor, seed).lost for seed in seeds)

        first = _least(quick, some, farthest, STRIDE if search.quantity == "load" else STEP)
        ends = "" if farthest == FARTHEST[search.quantity] else BEYOND
        if first is not None:
            first = _before_bands(some, first, sign)
            if lines_lost := [made(first, seed).lost[axis] for seed in seeds if axis in made(first, seed).lost]:
                factor = _between_sure(some, every, first, sign)
                return Edge(search.quantity, axis, factor, factor, min(lines_lost), axis in servos, len(seeds))
            ends = next(made(first, seed).ends for seed in seeds if made(first, seed).ends)
        before = (factor for factor in asked if first is None or (first - factor) * sign > 0.0)
        nearer = sorted(before, key=lambda factor: -factor * sign)
        held = next((factor for factor in nearer if factor == 1.0 or not some(factor)), 1.0)
        if search.quantity == "speed":
            moving_ns = {factor: made(factor, call.seed).moving_ns for factor in sorted(asked) if factor <= held}
            alike = [factor for factor in moving_ns if moving_ns[factor] == moving_ns[held]]
            if len(alike) > 1:
                held, ends = max((factor for factor in moving_ns if factor < alike[0]), default=1.0), NO_FASTER
        return Edge(search.quantity, axis, None, held, None, axis in servos, len(seeds), ends)

    servos = {axis.name for axis in call.fitted().axes if axis.closed_loop}
    found = [edge(axis) for axis in search.axes]
    return tuple(each for each in found if each.factor is not None or each.ends or not each.closed_loop)


def _least(
    quick: Callable[[float], bool], sure: Callable[[float], bool], farthest: float, stride: float = STEP
) -> float | None:
    """The least factor for which `sure` is true, looked for from 1 to `farthest` by `quick`; None if there is none.
    stride: from factor to factor until the first, before which STEP is gone."""
    sign = 1 if farthest > 1.0 else -1

    def scanned(low: float, end: float, step: float) -> tuple[float, float] | None:
        """The last factor that holds and the first that loses."""
        while low != end:
            high = low * step**sign
            high = end if (high - end) * sign > -1e-9 else high
            if quick(high):
                return low, high
            low = high
        return None

    there = scanned(1.0, farthest, stride)
    if there is not None and stride != STEP:
        there = scanned(*there, STEP)
    if there is None:
        return None
    low, high = there
    return _halved(sure, low / STEP**sign, high)  # other seeds may lose earlier


def _halved(lost: Callable[[float], bool], low: float, high: float) -> float:
    while max(high / low, low / high) > PRECISION:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if lost(middle) else (middle, high)
    return high


def _before_bands(some: Callable[[float], bool], first: float, sign: int) -> float:
    """The first loss, if a band of losses that STEP has passed over lies just before it."""
    while (first - 1.0) * sign > 0.0 and some(nearer := first * NEARER**sign):
        first = _halved(some, nearer / STEP**sign, nearer)
    return first


def _between_sure(some: Callable[[float], bool], every: Callable[[float], bool], first: float, sign: int) -> float:
    """The factor nearest to that of the first loss that lies between what holds and what loses for sure; that of the
    first loss if there is none."""
    for halves in sorted(range(-10, 11), key=abs):
        factor = round(first * (1.0 + halves / 200.0) ** sign, 4)
        if every(factor * FARTHER**sign) and not some(factor * NEARER**sign):
            return factor
    return round(first, 4)


def _farthest(call: TwinSpec, lines: Sequence[Line], search: _Search) -> float:
    """FARTHEST, or less: the machine file's range of a quantity goes FARTHER than that. 1 if it ends at once."""
    farthest = FARTHEST[search.quantity]
    if search.quantity == "speed":
        return farthest
    sign = 1 if farthest > 1.0 else -1
    while (farthest - 1.0) * sign > 0.0:
        try:
            _changed(call, lines, search, farthest * FARTHER**sign)[0].fitted()
        except ValueError:
            farthest /= STEP**sign
        else:
            return farthest
    return 1.0


def _changed(call: TwinSpec, lines: Sequence[Line], search: _Search, factor: float) -> tuple[TwinSpec, Sequence[Line]]:
    """The call and the job with one quantity changed."""
    if search.quantity == "speed":
        return call, _faster(call.controller, lines, factor)
    tree = call.fitted().tree
    (name,) = search.axes
    axis: Any = tree["axes"][name]
    keys: Mapping[str, tuple[str, ...]] = {
        "supply": ("stage.supply",),
        "inductance": ("specimen.inductance",),
        "load": _LOAD_KEYS,
    }
    overrides = {}
    for key in keys[search.quantity]:
        entry = axis
        for part in key.split("."):
            entry = entry[part]
        overrides[f"axes.{name}.{key}"] = entry["value"] * factor
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
