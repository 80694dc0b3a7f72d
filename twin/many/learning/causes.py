"""What may be other at the real machine than in the twin: candidates that answer as the recording does, if it is so.

    moves take longer or shorter              settings of the flash that shape ramps      a number, solved for
    reference runs after the first do         reference speed in the flash, play of an axis      a number, solved for
    a reply is another one                    firmware of the family, a stuck end switch         each in turn

A number is solved for by the secant method: durations are monotonic in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from statistics import fmean

from isel_twin.base.axes import CARRIAGES
from isel_twin.controller import controller_names
from isel_twin.controller.roles import offers
from isel_twin.core.spec import TwinSpec
from isel_twin.language import TellsActs, create_language
from isel_twin.machine.ranges import limits
from isel_twin.many.learning.session import Session
from isel_twin.recordings.judging import Comparison, Kind

FAULTS = ("stuck_closed", "stuck_open")  # a broken wire is an open contact
PLAY_MM = 0.1  # first step of the search for play
ROUNDS = 7  # most steps of a search
CLOSE_ENOUGH = 0.05  # of the spread of quick replies
LEAST_SPREAD_NS = 10_000.0  # of quick replies that do not scatter: their line has whole nanoseconds, the rest has not
VAGUE = 0.5  # doubt, as a share of what a number differs by, from which on it is called so
LEAST_LATE = 2  # durations that are least late
REPLY_COST, POSITION_COST, TIME_COST, MOST_LATE = 1000.0, 300.0, 10.0, 5.0


@dataclass(frozen=True)
class Cause:
    """One thing that is other at the real machine."""

    name: str
    told: str  # in words
    setting: str  # what makes the twin so
    spec: TwinSpec  # the twin that is so
    value: float | None = None
    sigma: float | None = None  # standard deviation, from the scatter of the session's quick replies
    evidence: str = ""  # what it was seen in


def cost(found: Comparison) -> float:
    """How unlike two sessions are, the place at power-on aside."""
    weights = {Kind.REPLY: REPLY_COST, Kind.POSITION: POSITION_COST, Kind.DURATION: TIME_COST}
    told = sum(weights.get(one.kind, 0.0) for one in found.differences)
    late = sum(min(abs(ns) / found.tolerance_ns, MOST_LATE) for ns in found.late_ns if not math.isnan(ns))
    return told + REPLY_COST * (len(found.only_a) + len(found.only_b)) + late


def candidates(session: Session, spec: TwinSpec, found: Comparison) -> Iterator[Cause]:
    """What may explain these differences. Each is a twin to be judged."""
    kinds = {one.kind for one in found.differences}
    if Kind.REPLY in kinds or Kind.POSITION in kinds:
        yield from _firmware(spec)
        yield from _switches(spec)
    late = [one for one in found.differences if one.kind is Kind.DURATION]
    references = [one for one in late if session.acts[one.pair.number - 1].references]
    if len(references) < len(late):
        yield from _flash(session, spec, found, of_references=False)
    if references:
        yield from _flash(session, spec, found, of_references=True)
        yield from _play(session, spec, found)


def _firmware(spec: TwinSpec) -> Iterator[Cause]:
    mine = create_language(spec.controller)
    for name in controller_names():
        if name != spec.controller and type(create_language(name)) is type(mine):
            told = f"its firmware: it answers as {name} does, not as {spec.controller}"
            yield Cause("firmware", told, f"--controller {name}", spec.with_(controller=name))


def _switches(spec: TwinSpec) -> Iterator[Cause]:
    if spec.scenario is not None or spec.events:
        return
    for contact in spec.fitted().contacts:
        name = contact.name
        for fault in FAULTS if contact.kind == "switch" else ():
            event = {"at": 0.0, "set": {name: fault}}
            words = "as if struck" if fault == "stuck_open" else "never struck"
            setting = f'--scenario with [[event]] at = 0, set = {{ {name} = "{fault}" }}'
            yield Cause("switch", f"end switch {name} is stuck, {words}", setting, spec.with_events([event]))


def _flash(session: Session, spec: TwinSpec, found: Comparison, *, of_references: bool) -> Iterator[Cause]:
    language = create_language(spec.controller)
    if not offers(language, TellsActs):
        return
    for name, setting in language.flash_settings.items():
        if setting.of_references != of_references:
            continue

        def with_value(value: float, name: str = name) -> TwinSpec:
            return with_flash(spec, {name: round(value)})

        invert = of_references or setting.unit == "Hz/ms"  # durations are linear in the reciprocal
        search = _Search(session, found, with_value, (setting.low, setting.high), invert, of_references)
        if (solved := search.solve(setting.usual, 0.7 * setting.usual)) is None:
            continue
        value, sigma = search.nearest(round(solved[0])), solved[1]
        has = str(setting.usual) if spec.flash is None else "what the twin has in its own"
        told = f"{name} {value} {setting.unit} in its flash ({sure(value, sigma, setting.usual)}), not {has}"
        line = setting.command.format(value)
        yield Cause(name, told, line, with_value(value), value, sigma, search.evidence)


def sure(value: float, sigma: float, usual: float) -> str:
    """How sure a number is, in words: where its doubt is as large as what it differs by, the delays forbid more."""
    vague = ", which is all that the delays of this session tell" if sigma > VAGUE * abs(value - usual) else ""
    return f"+- {sigma:.2g}{vague}"


def with_flash(spec: TwinSpec, values: dict[str, int]) -> TwinSpec:
    """The twin with these settings in its controller's flash, beside those that are there."""
    twin = spec.with_(plant="kinematic", scenario=None, events=(), line_speed=False, adapter_ms=0.0).build(
        keep_motions=1
    )
    language = create_language(spec.controller)
    assert offers(language, TellsActs)
    for line in language.flash_lines(values):
        twin.query(line)
    return spec.with_(flash=twin.flash)


def _play(session: Session, spec: TwinSpec, found: Comparison) -> Iterator[Cause]:
    axes = 0
    for act in session.acts:
        axes |= act.references
    for axis, name in enumerate(CARRIAGES):
        key = f"axes.{name}.backlash"
        if not axes >> axis & 1:
            continue
        has_mm = float(spec.fitted().tree["axes"][name].get("backlash", {}).get("value", 0.0))

        def with_value(value: float, key: str = key) -> TwinSpec:
            return spec.with_(overrides={**spec.overrides, key: value})

        allowed = limits(key)
        search = _Search(session, found, with_value, (allowed.low, allowed.high), invert=False, of_references=True)
        if (solved := search.solve(has_mm, has_mm + PLAY_MM)) is None:
            continue
        value, sigma = round(solved[0], 3), solved[1]
        told = f"backlash of {name.upper()} {value:g} mm (+- {sigma:.2g}), not {has_mm:g}"
        yield Cause("backlash", told, f"--set {key}={value:g}", with_value(value), value, sigma, search.evidence)


class _Search:
    """The value of one number with which durations are as recorded.

    Delays of a busy computer only make a recorded move longer, so of those that depend on the number the ones count
    that are least late, beside the quick replies that are least late. Reference runs are too few for that: their mean.
    """

    def __init__(
        self,
        session: Session,
        base: Comparison,
        with_value: Callable[[float], TwinSpec],
        limits: tuple[float, float],
        invert: bool,
        of_references: bool,
    ) -> None:
        self._session, self._with_value, self._limits, self._invert = session, with_value, limits, invert
        self._of_references, self._base = of_references, base
        self._spread_ns = max(base.jitter.spread_ns, LEAST_SPREAD_NS)
        self._numbers: frozenset[int] | None = None  # commands that depend on it
        what = "reference runs after the first" if of_references else "moves"
        self.evidence = f"{len(self._late(base))} {what}"

    def _late(self, found: Comparison) -> dict[int, float]:
        """How much later the twin is, by number of the command."""
        acts, wanted = self._session.acts, self._of_references
        return {
            pair.number: ns
            for pair, ns in zip(found.pairs, found.late_ns, strict=True)
            if not math.isnan(ns)
            and bool(acts[pair.number - 1].references) == wanted
            and acts[pair.number - 1].speeds_hz is not None
        }

    def _judged(self, value: float) -> Comparison | None:
        spec = self._with_value(value)
        return self._session.tried(spec if self._of_references else spec.with_(plant="kinematic"))

    def _score(self, found: Comparison) -> float:
        """How much later the twin is, in ns: 0 where the number is right."""
        late = sorted((ns for number, ns in self._late(found).items() if number in (self._numbers or ())), reverse=True)
        if not late:
            return math.nan
        if self._of_references or found.jitter.largest_ns == 0.0:
            return fmean(late)
        return fmean(late[:LEAST_LATE]) - fmean(sorted(found.quick_ns, reverse=True)[:LEAST_LATE] or [0.0])

    def _at(self, value: float) -> float:
        found = self._judged(value)
        return math.nan if found is None else self._score(found)

    def nearest(self, value: int) -> int:
        """The whole number beside this one, or this one, with which the durations are closest."""
        low, high = self._limits
        near = [each for each in (value, value - 1, value + 1) if low <= each <= high]
        return min(near, key=lambda each: (math.isnan(away := abs(self._at(each))), away))

    def solve(self, has: float, other: float) -> tuple[float, float] | None:
        """The value and its standard deviation; None if the durations do not depend on it, or none is as recorded.
        other: where the search begins, or as far on the other side of `has` if the range ends before."""
        bend: Callable[[float], float] = (lambda v: 1.0 / v) if self._invert else (lambda v: v)
        if not self._limits[0] <= other <= self._limits[1]:
            other = min(max(2.0 * has - other, self._limits[0]), self._limits[1])
        moved, before = self._judged(other), self._late(self._base)
        if moved is None:
            return None
        by = {number: abs(ns - before.get(number, ns)) for number, ns in self._late(moved).items()}
        most = max(by.values(), default=0.0)
        self._numbers = frozenset(number for number, ns in by.items() if ns > 0.5 * most)
        first = at = self._score(self._base)
        u, u2, at2 = bend(has), bend(other), self._score(moved)
        slope = 0.0
        for _ in range(ROUNDS):
            if u2 == u or at2 == at:
                break
            slope = (at2 - at) / (u2 - u)
            if math.isnan(slope) or abs(at2) <= CLOSE_ENOUGH * self._spread_ns:
                break
            low = max(self._limits[0], 1.0) if self._invert else self._limits[0]
            ends = sorted(map(bend, (low, self._limits[1])))
            new = min(max(u2 - at2 / slope, ends[0]), ends[1])
            if new == u2:
                break
            u, at, u2 = u2, at2, new
            at2 = self._at(bend(u2) if self._invert else u2)
        if slope == 0.0 or not abs(at2) < abs(first):
            return None
        value, sigma_u = bend(u2), self._spread_ns / abs(slope)
        return value, sigma_u * value * value if self._invert else sigma_u


def best(session: Session, causes: Iterable[Cause], plant: str) -> list[tuple[float, Cause, Comparison]]:
    """The candidates by their cost, least first. Those of switches and firmware are looked at without physics."""
    judged = []
    for cause in causes:
        quick = cause.name in ("switch", "firmware")
        found = session.tried(cause.spec.with_(plant="kinematic" if quick else plant))
        if found is not None:
            judged.append((cost(found), cause, found))
    return sorted(judged, key=lambda each: each[0])
