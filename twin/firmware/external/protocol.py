"""Lines of another control, and what is answered (external/2).

    row NS X Y Z [NAME=VALUE ...]   in NS nanoseconds the counters are X Y Z; outputs change at its beginning
    go HZ X Y Z                     the same, at HZ steps a second of the axis with the longest way
    out NAME=VALUE ...              outputs change; answered after 1 us, with what relays did about it
    set X Y Z                       the counters have these values, without a motion
    form steps | led                how rows become commands
    tell [encoder] [index]          what every answer has at its end, beside the rest
    state                           an answer, nothing else
    names                           terminals, in the order of the bits of LEVELS

    ok NS LEVELS FAULTS [...]       time in ns; levels and drive faults, hexadecimal, bit 0 the first name or axis;
                                    then the encoder of each axis, then its increments since the zero pulse
    names axes=3 estop_1 ...
    error WHY                       nothing has changed

A line ends with LF; CR is ignored. Numbers are whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from isel_twin.controller import OUTPUTS

END = b"\n"
LINE_BYTES = 1024  # longest line
FORMS = ("steps", "led")
TOLD = ("encoder", "index")

SHORTEST_NS, LONGEST_NS = 1_000, 60_000_000_000  # of a row
FASTEST_HZ = 5_000_000  # no step generator is faster; also bounds the ticks of a row
MOST_STEPS = 1 << 20  # of an axis in one row
COUNTER = 1 << 40  # counters stay below
HIGHEST = 1 << 20  # value of an output
SETTABLE = frozenset({*OUTPUTS, "spindle_speed"} - {"flash_fault"})

_SECOND_NS = 1_000_000_000


class LineError(ValueError):
    """A line cannot be carried out; one line that says why."""


@dataclass(frozen=True)
class Line:
    """A line that can be carried out."""

    word: str
    number: int = 0  # ns of a row, Hz of `go`
    counts: tuple[int, ...] = ()
    outputs: Mapping[str, int] = field(default_factory=dict)
    words: tuple[str, ...] = ()  # of `form` and `tell`


def parse(data: bytes, axes: int | None) -> Line:
    """A line without its end. axes: how many counters it must have, None: any. Raises LineError."""
    words = data.split()
    if not words:
        raise LineError("an empty line; allowed: row, go, out, set, form, tell, state, names")
    word, rest = words[0], words[1:]
    if word == b"row" or word == b"go":
        plain = next((at for at, text in enumerate(rest) if b"=" in text), len(rest))
        if plain < 2:
            raise LineError(f"{word.decode()}: needs {'NS' if word == b'row' else 'HZ'} and the counters")
        counts = _counts(rest[1:plain], axes)
        low, high = (SHORTEST_NS, LONGEST_NS) if word == b"row" else (1, FASTEST_HZ)
        number = _whole(rest[0], low, high, "ns" if word == b"row" else "steps/s")
        return Line(word.decode(), number, counts, _outputs(rest[plain:]) if plain < len(rest) else {})
    if word == b"set":
        return Line("set", counts=_counts(rest, axes))
    if word == b"out":
        if not rest:
            raise LineError("out: needs NAME=VALUE, for example stages=1")
        return Line("out", outputs=_outputs(rest))
    if word == b"form":
        return Line("form", words=_known(rest, FORMS, 1))
    if word == b"tell":
        return Line("tell", words=_known(rest, TOLD, len(TOLD)))
    if word in (b"state", b"names"):
        if rest:
            raise LineError(f"{word.decode()}: takes nothing behind it")
        return Line(word.decode())
    raise LineError(f"{_shown(word)}: unknown; allowed: row, go, out, set, form, tell, state, names")


def row_of(line: Line, from_counts: Sequence[int]) -> tuple[int, tuple[int, ...]]:
    """(ns, change of each counter) of a row or of `go` from these counters. Raises LineError."""
    changes = tuple(to - at for to, at in zip(line.counts, from_counts, strict=True))
    farthest = max(map(abs, changes))
    ns = line.number
    if line.word == "go":
        ns = max(SHORTEST_NS, -(-farthest * _SECOND_NS // line.number))
        if ns > LONGEST_NS:
            raise LineError(f"go: takes {ns} ns; allowed: up to {LONGEST_NS}")
    if farthest > MOST_STEPS or farthest * _SECOND_NS > FASTEST_HZ * ns:
        raise LineError(
            f"{line.word}: {farthest} steps in {ns} ns; allowed: {FASTEST_HZ} a second, {MOST_STEPS} in all"
        )
    return ns, changes


def _counts(words: Sequence[bytes], axes: int | None) -> tuple[int, ...]:
    if axes is not None and len(words) != axes:
        raise LineError(f"{len(words)} counters; allowed: {axes}, one of each axis")
    if not words:
        raise LineError("no counters; one of each axis is needed")
    return tuple([_whole(text, -COUNTER, COUNTER, "steps") for text in words])


def _whole(text: bytes, low: int, high: int, unit: str) -> int:
    try:
        value = int(text) if len(text) <= 20 and b"_" not in text else None
    except ValueError:
        value = None
    if value is None or not low <= value <= high:
        raise LineError(f"{_shown(text)}; allowed: a whole number from {low} to {high} {unit}")
    return value


def _outputs(words: Sequence[bytes]) -> dict[str, int]:
    outputs = {}
    for text in words:
        name, equals, value = text.partition(b"=")
        known = name.decode("latin-1")
        if not equals or known not in SETTABLE:
            raise LineError(f"{_shown(text)}; allowed: NAME=VALUE with one of {', '.join(sorted(SETTABLE))}")
        if known in outputs:
            raise LineError(f"{known}: stands twice; leave one out")
        outputs[known] = _whole(value, -HIGHEST, HIGHEST, "")
    return outputs


def _known(words: Sequence[bytes], allowed: Sequence[str], most: int) -> tuple[str, ...]:
    texts = tuple(text.decode("latin-1") for text in words)
    least = 1 if most == 1 else 0
    if not least <= len(texts) <= most or any(text not in allowed for text in texts) or len({*texts}) < len(texts):
        raise LineError(f"{_shown(b' '.join(words))}; allowed: {' or '.join(allowed)}")
    return texts


def _shown(data: bytes) -> str:
    """The beginning of what was sent, printable."""
    text = "".join(chr(byte) if 32 <= byte < 127 else "?" for byte in data[:40])
    return repr(text) if text else "nothing"
