"""Which causes make the twin answer as the recording does (recordings/6): one at a time, the one that explains most
first."""

from __future__ import annotations

from dataclasses import dataclass

from isel_twin.core.spec import TwinSpec
from isel_twin.many.learning.causes import TIME_COST, Cause, best, candidates, cost
from isel_twin.many.learning.session import Session
from isel_twin.recordings.judging import Comparison, Difference, Kind

MOST_CAUSES = 3
LEAST_SHARE = 0.5  # of what differs, a cause explains at least so much
ALIKE, NEAR = 1.5, 0.3  # causes that leave nothing marked, at such a multiple of the cost and so much, are alike


@dataclass(frozen=True)
class Explained:
    causes: tuple[Cause, ...]
    alternatives: tuple[tuple[str, ...], ...]  # of each cause, others that explain it as well
    before: Comparison  # with the twin as it was
    rest: Comparison  # with all causes in the twin
    spec: TwinSpec  # this twin

    @property
    def unexplained(self) -> tuple[Difference, ...]:
        """What differs that no cause explains, the weightiest first."""
        return tuple(one for one in self.rest.weighed if one.kind is not Kind.START)

    @property
    def same(self) -> bool:
        """True if nothing differs that the causes do not explain."""
        return not (self.unexplained or self.rest.only_a or self.rest.only_b)


def explained(session: Session, spec: TwinSpec, *, unknown_start: bool = True, most: int | None = None) -> Explained:
    """Explain what differs between a recording and this twin. unknown_start: nobody knows where the real machine stood
    at power-on, so that is no difference. most: causes that are looked for; None: MOST_CAUSES."""
    most = MOST_CAUSES if most is None else most
    spec = spec.with_(line_speed=True)
    if unknown_start:
        spec = session.placed(spec)
    before = found = session.judged(spec)
    causes: list[Cause] = []
    others: list[tuple[str, ...]] = []
    if most and any(one.kind is Kind.START for one in found.differences):
        placed = session.placed(spec)
        where = ", ".join(f"{mm:.0f}" for mm in placed.start_mm or ())
        told = f"the place at power-on, {where} mm from the motor-end switches"
        setting = "--start " + ",".join(f"{mm:.2f}" for mm in placed.start_mm or ())
        causes.append(Cause("power-on position", told, setting, placed, evidence="the first reference run"))
        others.append(())
        spec, found = placed, session.judged(placed)
    while cost(found) >= TIME_COST and len(causes) < most:
        judged = best(session, candidates(session, spec, found), spec.plant)
        if not judged or judged[0][0] > LEAST_SHARE * cost(found):
            break
        _, cause, _ = judged[0]
        most_cost = min(ALIKE * judged[0][0] + NEAR, TIME_COST)
        alike = [other.told for price, other, _ in judged[1:] if price <= most_cost]
        causes.append(cause)
        others.append(tuple(alike))
        spec = cause.spec
        found = session.judged(spec)
        if unknown_start and any(one.kind is Kind.START for one in found.differences):
            spec = session.placed(spec)
            found = session.judged(spec)
    return Explained(tuple(causes), tuple(others), before, found, spec)
