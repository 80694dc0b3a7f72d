"""Judges two sessions laid over each other: what differs beyond what two equal machines would.

    replies      by their meaning; counters in them within --step-tolerance
    durations    within what this session's own quick replies scatter by, and moves that are made again: `Jitter`
                 (recordings/5). A busy computer is late now and then, and seldom twice: one duration alone has to
                 differ by more than several; and many that differ by little count if they rank behind the quick replies
                 beyond chance (Mann and Whitney's test). Delays only add: a real move that is shorter than that of a
                 twin in virtual time differs, whatever the load
    a stop       comes when the host sends it, which is not the same twice: what it broke off is timed from it, and the
                 counters may differ by what was travelled meanwhile, until a reference run or a counter says more
    reference    the first run of a session begins at an unknown place: set aside as a difference of its own kind

A difference does not end the comparison, and none is told twice: counters that are off by the same number of steps as
before are not off again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from statistics import median

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.controller.roles import offers
from isel_twin.language import Act, Language, TellsActs, TellsCounters, readable
from isel_twin.recordings.compare import Exchange, Matched, Pair, exchanges, matched
from isel_twin.recordings.reading import Recorded

QUICK_NS = 250 * MILLISECOND_NS  # longer replies are not those of the controller and its line alone
FEW = 5  # quick replies that say nothing yet about their scatter
FEW_TOLERANCE_NS = 10 * MILLISECOND_NS  # with so few
FLOOR_NS = 3 * MILLISECOND_NS  # least tolerance; of two recordings without any scatter EXACT_NS
EXACT_NS = MILLISECOND_NS
# tolerance: so many spreads of the quick replies, so many times their largest deviation; of one duration alone ALONE
SPREADS, LARGEST, ALONE = 6.0, 3.0, 10.0
UNSURE = 16.0  # replies; so many of them double these tolerances
# A switch trips where it trips within some 10 um, and is left at about 1 mm/s: two runs over three axes differ by 26 ms
# (one standard deviation); nearly four of them.
REFERENCE_NS = 100 * MILLISECOND_NS
SURE = 1e-3  # chance that moves without a difference rank so far behind the quick replies, or before them
CRYSTAL = 2e-4  # by which the clocks of two controllers may differ
MOST_EXACT = 2000  # product of the numbers up to which the test is exact
MOST_TOLD = 3  # axes of a controller that tells one counter at a time
MEDIANS = 3.0  # and their median differs by so many spreads


class Kind(StrEnum):
    """What differs at a command, the weightiest first."""

    REPLY = "reply"
    POSITION = "position"
    DURATION = "duration"
    START = "start"
    COUNTERS = "counters"


@dataclass(frozen=True)
class Jitter:
    """How much longer quick replies took on side B than on side A, and their scatter."""

    median_ns: float
    spread_ns: float  # standard deviation, from the median of the deviations
    largest_ns: float  # deviation from the median
    replies: int  # quick ones, and moves made once more

    @property
    def tolerance_ns(self) -> float:
        """Of durations of which several differ."""
        return self._tolerance_ns(LARGEST)

    @property
    def alone_ns(self) -> float:
        """Of a duration that differs alone."""
        return self._tolerance_ns(ALONE)

    def _tolerance_ns(self, largest: float) -> float:
        least = EXACT_NS if self.largest_ns == 0.0 else FLOOR_NS
        least = FEW_TOLERANCE_NS if self.replies < FEW else least
        unsure = 1.0 + UNSURE / max(self.replies, 1)  # few replies have not shown the largest deviation yet
        return max(least, unsure * SPREADS * self.spread_ns, unsure * largest * self.largest_ns)

    def __str__(self) -> str:
        known = self.median_ns, self.spread_ns, self.largest_ns, self.tolerance_ns, self.alone_ns
        later, spread, largest, several, alone = (f"{ns / 1e6:.2f}" for ns in known)
        return (
            f"{self.replies} quick replies: B later by {later} ms, spread {spread} ms, largest deviation {largest} ms: "
            f"durations count beyond {several} ms, one alone beyond {alone} ms"
        )


@dataclass(frozen=True)
class Difference:
    """Something that two equal machines would not have had, at one command."""

    kind: Kind
    pair: Pair
    text: str  # what, in words
    weight: float  # of differences of a kind: steps, or ns


@dataclass(frozen=True)
class Limits:
    """What is tolerated. tolerance_ns: None: from the quick replies."""

    tolerance_ns: float | None = None
    steps: int = 1
    exact_a: bool = False  # times of this side are of virtual time, without delays
    exact_b: bool = False


USUAL = Limits()


@dataclass(frozen=True)
class Comparison(Matched):
    jitter: Jitter
    tolerance_ns: float
    differences: tuple[Difference, ...]  # in the order of the commands
    late_ns: tuple[float, ...]  # of each pair, how much later B is than the model has it; nan: not timed
    quick_ns: tuple[float, ...]  # how much later each quick reply was on B than the median of them
    by_pair: dict[int, tuple[Difference, ...]] = field(init=False)  # by number of the command
    different: tuple[Pair, ...] = field(init=False)  # the pairs that differ

    def __post_init__(self) -> None:
        found: dict[int, tuple[Difference, ...]] = {}
        for one in self.differences:
            found[one.pair.number] = (*found.get(one.pair.number, ()), one)
        object.__setattr__(self, "by_pair", found)
        object.__setattr__(self, "different", tuple(pair for pair in self.pairs if pair.number in found))

    @property
    def same(self) -> bool:
        """True if nothing differs beyond what is tolerated and no command is on one side only."""
        return not (self.differences or self.only_a or self.only_b)

    def differs(self, pair: Pair) -> tuple[str, ...]:
        """The kinds of what differs at this pair."""
        return tuple(one.kind.value for one in self.by_pair.get(pair.number, ()))

    @property
    def weighed(self) -> list[Difference]:
        """The differences, the weightiest first."""
        order = list(Kind)
        return sorted(self.differences, key=lambda one: (order.index(one.kind), -one.weight, one.pair.number))


def compare(a: Recorded, b: Recorded, language_a: Language, language_b: Language, limits: Limits = USUAL) -> Comparison:
    """Compare two recordings, each with a fresh language. Raises RecordingError."""
    limits = replace(limits, exact_a=a.of_twin, exact_b=b.of_twin)
    return judge(matched(exchanges(a, language_a), exchanges(b, language_b)), language_a, limits)


def judge(sessions: Matched, language: Language, limits: Limits = USUAL) -> Comparison:
    """Judge matched sessions. language: of side A; its own state is not used."""
    return _Judge(sessions, language, limits).judged()


def act_of(language: Language, sent: bytes) -> Act:
    """What a command does, as far as the language tells."""
    if offers(language, TellsActs):
        return language.act(sent)
    return Act((), references=-1) if sent in language.reference()[-1:] else Act(stops=sent == language.break_off())


def stopped(side: Sequence[Exchange], stops: Sequence[Exchange]) -> dict[int, int]:
    """When the first stop was sent into each command, by when that command was sent."""
    found: dict[int, int] = {}
    for stop in stops:
        for one in side:
            if one.replied_ns is not None and one.sent_ns < stop.sent_ns < one.replied_ns:
                found.setdefault(one.sent_ns, stop.sent_ns)
    return found


class _Judge:
    def __init__(self, sessions: Matched, language: Language, limits: Limits) -> None:
        self._sessions, self._language, self._limits = sessions, language, limits
        self._acts = {pair.number: act_of(language, pair.a.command) for pair in sessions.pairs}
        self._stops_a, self._stops_b = (
            stopped(
                [getattr(pair, side) for pair in sessions.pairs],
                [getattr(pair, side) for pair in sessions.pairs if self._acts[pair.number].stops],
            )
            for side in "ab"
        )
        self.jitter = self._jitter()
        self.tolerance_ns = self.jitter.tolerance_ns if limits.tolerance_ns is None else limits.tolerance_ns
        self._found: list[Difference] = []
        self._slack_steps = 0.0  # that counters may differ by since the last stop
        self._off: dict[int, int] = {}  # B less A when the counter of an axis was last told
        self._told: set[int] = set()  # axes whose counters were told since the last stop
        self._referenced = 0  # axes with a reference run before, a mask
        self._nowhere = False  # the last reference run has failed, on both sides alike
        self._timed: list[_Timed] = []

    def _quick(self, pair: Pair) -> bool:
        act = self._acts[pair.number]
        took = pair.a.duration_ns, pair.b.duration_ns
        return act.speeds_hz is None and not act.stops and all(ns is not None and ns < QUICK_NS for ns in took)

    def _jitter(self) -> Jitter:
        pairs = [pair for pair in self._sessions.pairs if pair.a.reply == pair.b.reply]
        later = [pair.later_ns for pair in pairs if self._quick(pair)]
        known = [ns for ns in later if ns is not None]
        if not known:
            return Jitter(0.0, 0.0, 0.0, 0)
        middle = median(known)
        deviations = [abs(ns - middle) for ns in known]
        repeats = self._repeats(pairs)
        return Jitter(middle, 1.4826 * median(deviations), max((*deviations, *repeats)), len(known) + len(repeats))

    def _repeats(self, pairs: Sequence[Pair]) -> list[int]:
        """How much later moves made once more were than the earliest of their kind, in ns."""
        kinds: dict[bytes, list[int]] = {}
        for pair in pairs:
            act = self._acts[pair.number]
            whole = pair.a.sent_ns not in self._stops_a and pair.b.sent_ns not in self._stops_b
            if act.speeds_hz is not None and not act.references and whole and pair.later_ns is not None:
                kinds.setdefault(pair.a.command, []).append(pair.later_ns)
        return [ns - min(all_ns) for all_ns in kinds.values() for ns in sorted(all_ns)[1:]]

    def judged(self) -> Comparison:
        late: list[float] = []
        for pair in self._sessions.pairs:
            late.append(self._time(pair))
            self._reply(pair)
        self._durations()
        self._found.sort(key=lambda one: one.pair.number)
        found = tuple(self._found)
        sessions = self._sessions
        return Comparison(
            sessions.pairs,
            sessions.only_a,
            sessions.only_b,
            self.jitter,
            self.tolerance_ns,
            found,
            tuple(late),
            tuple(self._quick_ns()),
        )

    def _differ(self, kind: Kind, pair: Pair, text: str, weight: float) -> None:
        self._found.append(Difference(kind, pair, text, weight))

    def _reply(self, pair: Pair) -> None:
        a, b = pair.a, pair.b
        if self._acts[pair.number].references and a.reply == b.reply:
            self._slack_steps, self._off = 0.0, {}
            self._nowhere = not self._language.accepted(a.command, a.reply)
        places = (
            [self._language.counters(side.command, side.reply) for side in (a, b)]
            if offers(self._language, TellsCounters)
            else [None, None]
        )
        there, other = places
        if there is not None and other is not None and there[0].keys() == other[0].keys() and there[1] == other[1]:
            self._place(pair, there[0], other[0])
        elif a.reply != b.reply and (a.meaning != b.meaning or not a.meaning):
            told = [side.meaning or "no reply" for side in (a, b)]
            if there is not None and other is not None:  # which may be a file of thousands of lines
                lines = itertools.zip_longest(there[1].splitlines(), other[1].splitlines(), fillvalue=b"no line")
                told = next(([readable(x), readable(y)] for x, y in lines if x != y), told)
            self._differ(Kind.REPLY, pair, f"{told[0]} / {told[1]}", 1.0)
        if None not in (a.counts, b.counts) and a.counts != b.counts and self._slack_steps == 0.0:
            self._differ(Kind.COUNTERS, pair, f"counters {list(a.counts or ())} / {list(b.counts or ())}", 1.0)

    def _place(self, pair: Pair, a: Mapping[int, int], b: Mapping[int, int]) -> None:
        off = {axis: b[axis] - a[axis] for axis in a}
        allowed = self._limits.steps + self._slack_steps
        both = [(steps, self._off.get(axis, 0)) for axis, steps in off.items()]
        beyond = [abs(steps) for steps, before in both if min(abs(steps), abs(steps - before)) > allowed]
        if beyond:
            # after a reference run that failed counters tell where the machine stood at power-on
            unlike = not self._nowhere or any((not a[axis]) != (not b[axis]) for axis in a)
            kind = Kind.POSITION if unlike else Kind.START
            self._differ(kind, pair, f"counters {list(a.values())} / {list(b.values())}", max(beyond))
        self._off |= off
        self._told |= off.keys()
        known = float(max(map(abs, self._off.values()), default=0))
        # what may have been travelled since a stop is known when every axis has been told again
        self._slack_steps = known if len(off) > 1 or len(self._told) >= MOST_TOLD else max(known, self._slack_steps)

    def _time(self, pair: Pair) -> float:
        """How much later B is than the model has it, in ns; nan if that says nothing."""
        a, b, act = pair.a, pair.b, self._acts[pair.number]
        if pair.later_ns is None or act.stops or self._quick(pair):
            return math.nan
        later = float(pair.later_ns) - self.jitter.median_ns
        extra = 0.0
        stop_a, stop_b = self._stops_a.get(a.sent_ns), self._stops_b.get(b.sent_ns)
        if stop_a is not None or stop_b is not None:
            if stop_a is None or stop_b is None or a.reply != b.reply:
                return math.nan
            apart_ns = (stop_b - b.sent_ns) - (stop_a - a.sent_ns)
            later -= apart_ns
            fastest_hz = max(act.speeds_hz or (0,), default=0)
            self._told = set()
            self._slack_steps += math.ceil((abs(apart_ns) + self.tolerance_ns) * fastest_hz / SECOND_NS)
        elif act.references:
            extra = REFERENCE_NS if self._limits.tolerance_ns is None else 0.0
            if act.references & ~self._referenced and a.meaning == b.meaning:
                self._referenced |= act.references
                if abs(later) > extra + self.tolerance_ns:
                    self._differ(Kind.START, pair, f"first reference run {_later(later)}", abs(later))
                return math.nan
        elif self._slack_steps:
            extra = self._slack_steps / max(min(act.speeds_hz or (1,)), 1) * SECOND_NS
        if a.meaning == b.meaning:
            self._timed.append(_Timed(pair, later, extra, references=bool(act.references)))
        return later

    def _durations(self) -> None:
        asked_ns = self._limits.tolerance_ns
        for references, sign in itertools.product((False, True), (1.0, -1.0)):
            timed = [one for one in self._timed if one.references == references]
            beyond = [one for one in timed if sign * one.late_ns - one.extra_ns > self.tolerance_ns]
            if asked_ns is None and len(beyond) == 1:
                beyond = [one for one in beyond if abs(one.late_ns) - one.extra_ns > self.jitter.alone_ns]
            if asked_ns is None:
                more = self._references(timed, sign) if references else self._moves(timed, sign)
                beyond += [one for one in (*more, *self._too_short(timed, sign)) if one not in beyond]
            for one in beyond:
                self._differ(Kind.DURATION, one.pair, _later(one.late_ns), abs(one.late_ns))

    def _quick_ns(self) -> list[float]:
        """How much later each quick reply was on B than the median of them."""
        quick = (pair for pair in self._sessions.pairs if self._quick(pair) and pair.a.reply == pair.b.reply)
        return [(pair.later_ns or 0) - self.jitter.median_ns for pair in quick]

    def _moves(self, timed: Sequence[_Timed], sign: float) -> list[_Timed]:
        """Moves that are later by little (sign: or earlier), if they are so beyond chance.

        Delays only add, and add more to moves than to quick replies where a computer is overloaded. So of moves that
        are made again the least late counts, and no more than one kind may be as early as half the quick replies. A
        busy server is late with quick replies and catches up while a move lasts: a move that is shorter on the side
        with delays may lack the usual delay, by as much as delays scatter.
        """
        exact = self._limits.exact_b if sign > 0 else self._limits.exact_a
        lacking_ns = min(abs(self.jitter.median_ns), self.jitter.largest_ns) if exact else 0.0
        plain = [(one, sign * one.late_ns - lacking_ns) for one in timed if one.extra_ns == 0.0]
        kinds: dict[bytes, float] = {}
        for one, ns in plain:
            kinds[one.pair.a.command] = min(ns, kinds.get(one.pair.a.command, math.inf))
        late, quick = [kinds[one.pair.a.command] for one, _ in plain], [sign * ns for ns in self._quick_ns()]
        least = max(0.5 * EXACT_NS, MEDIANS * self.jitter.spread_ns)
        if not late or median(late) < least or sorted(kinds.values())[:2][-1] <= median(quick or [0.0]):
            return []
        return [one for one, ns in plain if ns > least] if _chance(late, quick) <= SURE else []

    def _too_short(self, timed: Sequence[_Timed], sign: float) -> list[_Timed]:
        """Commands that are shorter on the side with delays than its shortest delays let expect."""
        exact = self._limits.exact_b if sign > 0 else self._limits.exact_a
        quick = self._quick_ns()
        if not exact or len(quick) < FEW or (self._limits.exact_a and self._limits.exact_b):
            return []
        most = max(sign * ns for ns in quick)
        lacking_ns = min(max(abs(self.jitter.median_ns) - most, 0.0), self.jitter.largest_ns)  # as in `_moves`
        least = most + lacking_ns + FLOOR_NS
        return [
            one
            for one in timed
            if sign * one.late_ns - one.extra_ns
            > least + CRYSTAL * max(one.pair.a.duration_ns or 0, one.pair.b.duration_ns or 0)
        ]

    def _references(self, timed: Sequence[_Timed], sign: float) -> list[_Timed]:
        """Reference runs after the first, if several differ by what no quick reply did."""
        least = REFERENCE_NS + SPREADS * self.jitter.spread_ns
        beyond = [one for one in timed if sign * one.late_ns > least]
        unusual = all(sign * ns < REFERENCE_NS for ns in self._quick_ns())
        return beyond if len(beyond) > 1 and unusual else []


@dataclass(frozen=True)
class _Timed:
    """A command whose duration says something."""

    pair: Pair
    late_ns: float  # how much later B is
    extra_ns: float  # tolerated beside the jitter
    references: bool


def _chance(these: Sequence[float], those: Sequence[float]) -> float:
    """The probability that the first rank so far above the second if both are alike: Mann and Whitney's test, exact
    for small numbers. Ties count half."""
    n, m = len(these), len(those)
    if not n or not m:
        return 1.0
    above = sum((a > b) + 0.5 * (a == b) for a in these for b in those)
    if n * m > MOST_EXACT:
        spread = math.sqrt(n * m * (n + m + 1) / 12.0)
        return 0.5 * math.erfc((above - 0.5 * n * m - 0.5) / spread / math.sqrt(2.0))
    ways = [[1] + [0] * (n * m) for _ in range(m + 1)]  # of j of those and the first i of these, by their sum
    for _ in range(n):
        new = [[1] + [0] * (n * m)]
        for j in range(1, m + 1):
            # the highest of all is one of these, above j of those, or one of those
            new.append([ways[j][u - j] * (u >= j) + new[j - 1][u] for u in range(n * m + 1)])
        ways = new
    return sum(ways[m][math.floor(above) :]) / math.comb(n + m, n)


def _later(ns: float) -> str:
    return f"{abs(ns) / 1e6:.1f} ms {'later' if ns > 0 else 'earlier'} on B"
