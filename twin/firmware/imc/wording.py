"""The parameters of the iMC's commands in words: a row for each command of commands.py with parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from isel_twin.firmware.imc import commands, moves
from isel_twin.firmware.imc.query import AXIS_NAMES
from isel_twin.firmware.imc.reading import END_OF_FIELD, ReadingState, numbers, plain, stored

# `@0i` (2.2.13) and `@0S` (2.2.23), which control the flow of commands and are in no table
FLOW: Mapping[str, str] = {"i": "store a program: the lines that follow", "S": "go on, or start the stored program"}

# (parameters, axes set) -> the parameters in words, after the command's purpose; None: wrong number of them
Details = Callable[[Sequence[int], int], str | None]


def line_words(line: bytes, mode: ReadingState) -> str:
    if mode.storing and not line.lstrip().startswith(b"@"):
        code, text = stored(line)
        if code == END_OF_FIELD:
            return "end of the program"
        command = commands.CNC.get(code)
        if command is None:
            return "cannot be stored"
        return f"to store: {command.purpose}{_parameters(CNC_DETAILS.get(code), text, mode.axes)}"
    parts = mode.split(line)
    if parts is None:
        return "for another device"
    code, text = parts
    if code in FLOW:
        return FLOW[code]
    command = commands.DNC.get(code) or commands.INITIALISATION.get(code)
    if command is None:
        return "no such command"
    if command.parameters is None:
        return f"{command.purpose}: {plain(text) or 'nothing'}"
    return f"{command.purpose}{_parameters(DNC_DETAILS.get(code), text, mode.axes)}"


def _parameters(details: Details | None, text: str, axes: int) -> str:
    """The parameters in words, or unchanged if their number is wrong."""
    values = numbers(text)
    if values == []:
        return ""
    words = details(values, axes) if details is not None and values is not None else None
    return words if words is not None else f": {plain(text)}"


def _one(words: Callable[[int], str]) -> Details:
    return lambda values, axes: f": {words(values[0])}" if len(values) == 1 else None


def _choice(*names: str, first: int = 0) -> Details:
    """One of so many names, the first for the number `first`."""
    return _one(lambda value: names[value - first] if 0 <= value - first < len(names) else str(value))


def _letters(mask: int) -> str:
    return " ".join(name for axis, name in enumerate(AXIS_NAMES) if mask >> axis & 1) or "none"


def _names(axes: int, count: int) -> list[str]:
    """Names of the axes of `count` numbers: those set, or the first ones if unknown."""
    return _letters(axes).split() if axes else list(AXIS_NAMES[:count])


def _each(unit: str) -> Details:
    """A number for each axis that is set."""

    def words(values: Sequence[int], axes: int) -> str | None:
        names = _names(axes, len(values))
        if len(values) != len(names):
            return None
        return ": " + ", ".join(f"{name} {value}{unit}" for name, value in zip(names, values, strict=True))

    return words


def _four(unit: str) -> Details:
    """A number for each of the four axes, set or not."""
    return lambda values, axes: _each(unit)(values, 15)


def _ways(preposition: str, fourth: str | None) -> Details:
    """Pairs of steps and speed. With X, Y, Z there are four: the fourth is the second Z move, or unused (2.2.2)."""

    def words(values: Sequence[int], axes: int) -> str | None:
        pairs = list(zip(values[0::2], values[1::2], strict=False))
        names = _names(axes, len(pairs))
        if len(pairs) == 4 and axes in (0, moves.XYZ):
            names = [*AXIS_NAMES[:3], *([fourth] if fourth else [])]
            pairs = pairs[: len(names)]
        if len(pairs) != len(names) or len(values) % 2:
            return None
        ways = (f"{name} {steps} at {speed} Hz" for name, (steps, speed) in zip(names, pairs, strict=True))
        return f" {preposition} {', '.join(ways)}"

    return words


def _arc(values: Sequence[int], axes: int) -> str | None:
    if len(values) not in (7, 8):
        return None
    length, speed, d, xs, ys, rx, ry = values[:7]
    third = f", {values[7]} steps of the third axis" if len(values) == 8 else ""
    return f" of {length} steps at {speed} Hz, D {d}, start {xs} {ys}, directions {rx} {ry}{third}"


def _until_port(values: Sequence[int], axes: int) -> str | None:
    if len(values) < 5:
        return None
    port, mask, value, speed, *steps = values
    ways = _each("")(steps, axes)
    return ways and f", port {port} with mask {mask} at {value}, at {speed} Hz{ways}"


def _watch(values: Sequence[int], axes: int) -> str | None:
    return ": port {}, mask {}, value {}".format(*values) if len(values) == 3 else None


def _bit(values: Sequence[int], axes: int) -> str | None:
    """Port, bit or 128 for all of them, value, and for a branch where to."""
    if len(values) not in (3, 4):
        return None
    port, bit, value = values[:3]
    where = f", then {values[3]:+d} commands" if len(values) == 4 else ""
    return f": port {port}, {'all bits' if bit == 128 else f'bit {bit}'} at {value}{where}"


def _loop(values: Sequence[int], axes: int) -> str | None:
    if len(values) != 2:
        return None
    count, offset = values
    return f": {offset:+d} commands, {count} times" if count else f": {offset:+d} commands"


def _await(values: Sequence[int], axes: int) -> str | None:
    return f": {_character(values[0])}, then {values[1]:+d} commands" if len(values) == 2 else None


def _character(code: int) -> str:
    return repr(chr(code)) if 32 <= code < 127 else str(code)


_axes, _number = _one(_letters), _one(str)
_hz, _ramp = _one(lambda value: f"{value} Hz"), _one(lambda value: f"{value} Hz/ms")
_switch, _plane = _choice("off", "on"), _choice("XY", "XZ", "YZ")
_turn = _choice("counter-clockwise", "clockwise", first=-1)

# parameters of DNC and initialisation commands in words; those that have none are left out
DNC_DETAILS: Mapping[str, Details] = {
    commands.AXES_CODE: _axes,
    "A": _ways("by", "then Z"),
    "b": _number,
    "B": lambda values, axes: ": port {}, value {}".format(*values) if len(values) == 2 else None,
    "d": _each(" Hz"),
    "e": _plane,
    "f": _turn,
    "j": _hz,
    "J": _ramp,
    "M": _ways("to", None),
    "w": _arc,
    "y": _arc,
    "Z": _until_port,
    "Id": _four(" Hz"),
    "IF": _four(""),
    "IJ": _ramp,
    "Ij": _hz,
    **dict.fromkeys(("F", "n", "N", "R", "Ie", "ID", "IR", "IT"), _axes),
    **dict.fromkeys(("g", "T", "z", "IO", "IC"), _switch),
    **dict.fromkeys(("G", "IE"), _number),
    **dict.fromkeys(("IA", "Ia", "IH", "IN"), _watch),
}

# parameters of storable commands in words
CNC_DETAILS: Mapping[str, Details] = {
    **{code: DNC_DETAILS[code] for code in "efgjJnNTwyz"},
    "0": _ways("by", "then Z"),
    "1": _one(_character),
    "2": _await,
    "3": _loop,
    "5": _one(lambda tenths: f"{tenths / 10:g} s"),
    "6": _bit,
    "7": _axes,
    "d": _four(" Hz"),
    "m": _ways("to", None),
    "o": _bit,
    "p": _bit,
}
