"""Drilling cycles G81, G83, G84, G85 (manual 5.3).

    P30 dwell at the depth, s      P34 approach plane      P37 first stroke (degressive)
    P32 feed; pitch of G84         P35 retract plane       P38 safety distance, 1 mm
    P33 depth                      P36 strokes; degression P39 degressive

                 G81                  G83                          G85
    P35 ...        . ^                     ^
    P34 ---------  | |       --.--.---.--. |          --|---^--
                   | |         |  ^ . | ^  |             |  ^
    P33            v '         v  | v v |  '             v  '     drawn: feed; dotted: rapid

Planes are absolute along the third axis of the plane, with G91, too. Without P35 the tool goes back to P34. A
depth is reached, by an exact stop, before the tool goes back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove, Kind
from isel_twin.firmware.bwo900.geometry.groups import CIRCLES
from isel_twin.firmware.bwo900.messages import Code, ProgramError, invalid
from isel_twin.firmware.bwo900.numbers import M, P

SAFETY_MM: Final = 1.0  # P38 where it is not programmed
MOST: Final = 10_000  # strokes of a hole; more is an error (M8036)


def drilling(call: Call) -> Iterator[CycleMove]:
    """G81: down with feed, dwell, back in rapid."""
    if not call.words:
        return
    depth, approach, feed = _planes(call)
    yield from _begin(call, approach)
    yield _to(call, Kind.LINE, depth, feed, dwell_s=call.given(P.HOLE_DWELL), exact_stop=True)
    yield from _end(call, approach)


def deep_hole(call: Call) -> Iterator[CycleMove]:
    """G83: P36 equal strokes, or degressive ones (P37, then P36 less each time)."""
    if not call.words:
        return
    depth, approach, feed = _planes(call)
    safety = SAFETY_MM if call.given(P.HOLE_SAFETY) is None else abs(call.needed(P.HOLE_SAFETY))
    back = safety if approach > depth else -safety
    depths = strokes(call, depth, approach)
    yield from _begin(call, approach)
    for number, reached in enumerate(depths):
        if number:
            yield _to(call, Kind.RAPID, approach)
            yield _to(call, Kind.RAPID, depths[number - 1] + back)
        last = number == len(depths) - 1
        yield _to(call, Kind.LINE, reached, feed, dwell_s=call.given(P.HOLE_DWELL) if last else None, exact_stop=True)
    if call.given(P.DEGRESSIVE) is not None:
        yield _to(call, Kind.RAPID, approach)
    yield from _end(call, approach)


def strokes(call: Call, depth: float, approach: float) -> list[float]:
    """Ends of the strokes of G83. Raises ProgramError: M8036, M8037."""
    whole = depth - approach
    if call.given(P.DEGRESSIVE) is None:
        count = int(abs(call.needed(P.STROKES)))
        if not 1 <= count <= MOST:
            raise ProgramError(invalid(P.STROKES), f"P36 is {call.get(P.STROKES):g}; allowed: 1 to {MOST}")
        return [approach + whole * number / count for number in range(1, count + 1)]
    less, stroke = abs(call.needed(P.STROKES)), abs(call.needed(P.FIRST_STROKE))
    if not less:
        raise ProgramError(invalid(P.STROKES), "P36 is 0: strokes would never end")
    if not stroke:
        raise ProgramError(invalid(P.FIRST_STROKE), "P37 is 0")
    if abs(whole) > MOST * less:
        raise ProgramError(invalid(P.STROKES), f"P36 is {less:g}: more than {MOST} strokes to {abs(whole):g} mm")
    sign = 1.0 if whole > 0 else -1.0
    left, at, ends = abs(whole), approach, list[float]()
    while left > 0.0:
        if stroke + less > left:  # two more do not fit: halve the rest
            ends += [at + sign * left / 2.0, depth]
            break
        at += sign * stroke
        left -= stroke
        ends.append(at)
        stroke = max(stroke - less, less)
    return ends


def tapping(call: Call) -> Iterator[CycleMove]:
    """G84: down with the spindle (feed = pitch times its measured speed, or S), it turns round, and back."""
    if not call.words:
        return
    depth, approach, pitch = _planes(call)
    left = int(call.get(P.THREAD) or 0) == M.SPINDLE_LEFT or (not call.get(P.THREAD) and call.turning < 0)
    feed = pitch if call.coupled else (call.speed_rpm or 0.0) * pitch
    yield from _begin(call, approach, M.SPINDLE_LEFT if left else M.SPINDLE_RIGHT)
    yield _to(call, Kind.TAP, depth, feed, exact_stop=True, m=(M.SPINDLE_RIGHT if left else M.SPINDLE_LEFT,))
    if (dwell := call.given(P.HOLE_DWELL)) is not None:
        yield CycleMove(Kind.LINE, dwell_s=dwell)
    yield _to(call, Kind.TAP, approach, feed, exact_stop=True)
    yield from _end(call, approach)


def boring(call: Call) -> Iterator[CycleMove]:
    """G85: down with feed, dwell, back with feed."""
    if not call.words:
        return
    depth, approach, feed = _planes(call)
    yield from _begin(call, approach)
    yield _to(call, Kind.LINE, depth, feed, dwell_s=call.given(P.HOLE_DWELL), exact_stop=True)
    yield _to(call, Kind.LINE, approach, feed)
    yield from _end(call, approach)


def _planes(call: Call) -> tuple[float, float, float]:
    """Depth, approach plane, and feed or pitch. Raises ProgramError: M8032 to M8034, M8300 to M8302."""
    depth, approach = call.needed(P.HOLE_DEPTH), call.needed(P.APPROACH_PLANE)
    feed = call.needed(P.HOLE_FEED)
    if feed <= 0.0:
        raise ProgramError(invalid(P.HOLE_FEED), f"P32 is {feed:g}; allowed: more than 0")
    if depth == approach:
        raise ProgramError(invalid(P.HOLE_DEPTH), "P33 and P34 are the same plane")
    if call.speed_rpm is None:
        raise ProgramError(Code.NO_SPINDLE_SPEED)
    if not call.speed_rpm:
        raise ProgramError(Code.SPINDLE_SPEED_ZERO, "S is 0")
    if not call.turning:
        raise ProgramError(Code.NO_SPINDLE_DIRECTION, "neither M03 nor M04 is in force")
    return depth, approach, feed


def _begin(call: Call, approach: float, spindle: int | None = None) -> Iterator[CycleMove]:
    """Spindle on; to the place in rapid, with polar coordinates on a circle with F; to the approach plane."""
    on = spindle or (M.SPINDLE_RIGHT if call.turning > 0 else M.SPINDLE_LEFT)
    yield CycleMove(Kind.RAPID, m=(on,))
    circle = call.polar and call.motion in CIRCLES
    yield CycleMove(Kind.PROGRAMMED if circle else Kind.RAPID, call.words)
    yield _to(call, Kind.RAPID, approach)


def _end(call: Call, approach: float) -> Iterator[CycleMove]:
    """To the retract plane in rapid, spindle off."""
    retract = call.get(P.RETRACT_PLANE)
    yield _to(call, Kind.RAPID, approach if retract is None else retract, m=(M.SPINDLE_OFF,))


def _to(
    call: Call,
    kind: Kind,
    height: float,
    feed: float | None = None,
    dwell_s: float | None = None,
    m: tuple[int, ...] = (),
    exact_stop: bool = False,
) -> CycleMove:
    return CycleMove(kind, {call.plane.third: height}, None, feed, dwell_s, m, exact_stop=exact_stop)
