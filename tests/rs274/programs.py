"""Random G-code programs, each from a seed: of the words that CAM programs write, some of them wrong."""

from __future__ import annotations

import random
from collections.abc import Callable


def program(seed: int) -> str:
    """Some ten to thirty lines that end with M2."""
    draw = random.Random(seed)
    lines = [
        draw.choice(("G21", "G20", "G21 G90 G94", "G90 G17 G21 G40 G49 G80")),
        "G98" if draw.random() < 0.7 else "",
    ]
    lines += [f"F{draw.choice((100, 250.5, 12))}", f"G0 {_axes(draw)}"]
    for _ in range(draw.randint(5, 25)):
        line = draw.choices(_KINDS, _WEIGHTS)[0](draw)
        lines.append(f"N{draw.randint(1, 9999)} {line}" if draw.random() < 0.2 else line)
    return "\n".join([line for line in lines if line] + ["M2", ""])


def _number(draw: random.Random, least: float = -40.0, most: float = 40.0) -> str:
    value = draw.choice((draw.uniform(least, most), draw.randint(int(least), int(most))))
    return draw.choice((f"{value:.3f}", f"{value:.1f}", f"{value:g}"[:7])).replace("e", "")


def _axes(draw: random.Random, letters: str = "XYZ") -> str:
    chosen = [letter for letter in letters if draw.random() < 0.6] or [draw.choice(letters)]
    return " ".join(f"{letter}{_number(draw)}" for letter in chosen)


def _line(draw: random.Random) -> str:
    code = draw.choice(("G0 ", "G1 ", "G1 ", "", "", "G01", "g 1 "))
    feed = f" F{draw.choice((60, 300, 7.5))}" if draw.random() < 0.3 else ""
    return f"{code}{_axes(draw)}{feed}"


def _arc(draw: random.Random) -> str:
    code = draw.choice(("G2", "G3"))
    if draw.random() < 0.7:
        code = f"G91.1 {code}"
    kind = draw.random()
    if kind < 0.4:  # full circle or helix
        turns = f" P{draw.randint(1, 4)}" if draw.random() < 0.3 else ""
        plane, third, centre = draw.choice(
            (
                ("G17", "Z", "I5"),
                ("G17", "Z", "I2 J1"),
                ("G18", "Y", "K4"),
                ("G18", "Y", "I3 K-2"),
                ("G19", "X", "J2 K7"),
            )
        )
        height = f" {third}{_number(draw)}" if draw.random() < 0.3 else ""
        return f"{plane} {code} {centre}{height}{turns}\nG1"
    if kind < 0.7:
        return f"{code} {_axes(draw)} R{draw.choice((150, 300, 2000, -1500, 2000, -4000, 5))}\nG0"
    x = draw.randint(1, 30)
    end = f"X{2 * x} I{x} J0" if kind < 0.85 else f"X{x} Y{x} I{x} J{draw.choice((0, 0, 0.01, 0.05))}"
    return f"G17 G91 {code} {end}\nG90 G1"


def _cycle(draw: random.Random) -> str:
    """A series with one R: what LinuxCNC does when R changes within it is not what it documents (cam/19)."""
    code = draw.choice(("G81", "G82", "G83", "G73", "G85", "G89"))
    words = {"G82": " P0.5", "G89": " P0.2", "G83": " Q3", "G73": " Q2.5"}.get(code, "")
    times = f" L{draw.randint(1, 3)}" if draw.random() < 0.2 else ""
    more = "".join(f"\n{_axes(draw, 'XY')}" for _ in range(draw.randint(0, 2)))
    return (
        f"G17 G80\nG0 Z{draw.randint(-10, 30)}\n"
        f"{code} {_axes(draw, 'XY')} Z{draw.randint(-20, -1)} R{draw.randint(0, 15)}{words}{times} F90{more}\nG80\nG0"
    )


def _mode(draw: random.Random) -> str:
    return draw.choice(
        (
            "G90",
            "G91",
            "G17",
            "G18",
            "G19",
            "G20",
            "G21",
            "G80",
            "G98",
            "G99",
            "G90.1",
            "G91.1",
            "G94 F200",
            "G40",
            "G49",
            "G43 H1",
            "G64 P0.1",
            "G61",
            "M8",
            "M9",
            "M7",
            "S500 M3",
            "M5",
            "T1 M6",
            "T2",
            "M0",
            "G54",
            "G55",
            "G59.3",
            "S100",
            "G17 G90 G91.1 F300",
            "(a remark)",
            "M3 S100 M8",
            "G91.1 G90 G80",
            "",
            "O100",
        ),
    )


def _offset(draw: random.Random) -> str:
    return draw.choice(
        (
            f"G92 {_axes(draw)}",
            "G92.1",
            "G92.2",
            "G92.3",
            f"G52 {_axes(draw)}",
            f"G10 L2 P{draw.randint(0, 9)} {_axes(draw)}",
            f"G10 L20 P{draw.randint(0, 9)} {_axes(draw)}",
            f"G53 G0 {_axes(draw)}",
            f"G53 G1 {_axes(draw)} F100",
            "G28.1",
            "G30.1",
            f"G28 {_axes(draw)}",
            "G28",
            "G30 Z1",
            "G91 G28 Z0",
        )
    )


def _inverse(draw: random.Random) -> str:
    return f"G93 G1 {_axes(draw)} F{draw.choice((2, 5.5))}\nG94 F200"


def _dwell(draw: random.Random) -> str:
    return f"G4 P{draw.choice((0, 0.5, 2))}"


def _wrong(draw: random.Random) -> str:
    return draw.choice(
        (
            "G0 G1 X1",
            "X1 X2",
            "G1 X1 I2",
            "G4",
            "G81 X1",
            "M3 M5",
            "G53 G2 X5 I2",
            "G2 X5",
            "P5",
            "X1e3",
            "G5.7 X1",
            "M7 M8",
            "G0 X1 K2",
            "G1 X1 F-3",
            "G1 X1,5",
            "N5 N6",
            "X",
            "G80 X4",
            "G28 G0 X4",
            "G83 X3 Z-4 R1 Q0",
            "G17 G18",
            "L2",
            "(a (b) c)",
            "(a",
            "G2 X1 I5 R5",
            "G92",
            "T-1",
            "S-5",
            "G10 L2 P11 X0",
            "G3 X4 R1",
            "% G1",
        )
    )


_WEIGHTED: tuple[tuple[Callable[[random.Random], str], int], ...] = (
    (_line, 40),
    (_arc, 15),
    (_cycle, 10),
    (_mode, 15),
    (_offset, 10),
    (_inverse, 1),
    (_dwell, 3),
    (_wrong, 1),
)
_KINDS = [kind for kind, _ in _WEIGHTED]
_WEIGHTS = [weight for _, weight in _WEIGHTED]
