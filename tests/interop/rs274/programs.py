"""Random G-code programs, each from a seed: of the words that CAM programs write, some of them wrong."""

from __future__ import annotations

import random
from collections.abc import Callable


def program(seed: int) -> str:
    """Some ten to sixty lines that end with M2, half of them in inch."""
    draw = random.Random(seed)
    lines = [
        draw.choice(("G21", "G20", "G21 G90 G94", "G90 G17 G20 G40 G49 G80")),
        "G98" if draw.random() < 0.7 else "",
    ]
    lines += [f"F{draw.choice((100, 250.5, 12))}", f"G0 {_axes(draw)}"]
    for _ in range(draw.randint(5, 25)):
        line = draw.choices(_KINDS, _WEIGHTS)[0](draw)
        lines.append(f"N{draw.randint(1, 9999)} {line}" if draw.random() < 0.2 else line)
    return "\n".join([line for line in lines if line] + ["M2", ""])


def _number(draw: random.Random, least: float = -40.0, most: float = 40.0) -> str:
    value = draw.choice((draw.uniform(least, most), draw.randint(int(least), int(most))))
    return draw.choice((f"{value:.4f}", f"{value:.3f}", f"{value:.1f}"))  # rs274 writes four decimals


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
        radius = draw.choice((150, 300, 2000, -1500, 2000, -4000, 5) if draw.random() < 0.2 else (2000, -4000, 800.5))
        return f"G17 {code} X{_number(draw)} {_axes(draw, 'YZ')} R{radius}\nG0"
    x = draw.randint(1, 30)
    end = f"X{2 * x} I{x} J0" if kind < 0.85 else f"X{x} Y{x} I{x} J{draw.choice((0, 0, 0.01, 0.05))}"
    return f"G17 G91 {code} {end}\nG90 G1"


_CYCLES = {"G81": "", "G82": " P0.5", "G83": " Q3", "G73": " Q2.5", "G85": "", "G89": " P0.2"}
_PLANES = {"G17": ("XY", "Z"), "G18": ("XZ", "Y"), "G19": ("YZ", "X")}  # axes of holes, and of their depth


def _series(draw: random.Random) -> str:
    """Holes in one of the planes; seldom R or the unit changes within them, or G98 follows G99 (cam/19)."""
    plane = draw.choice(("G17", "G17", *_PLANES))
    across, depth = _PLANES[plane]
    code = draw.choice(tuple(_CYCLES))
    times = f" L{draw.randint(1, 3)}" if draw.random() < 0.2 else ""
    lines = [
        f"{plane} {draw.choice(('G80', 'G80', 'G80 G99', 'G80 G98'))}",
        f"{draw.choice(('G0', 'G80 G0', 'G0 G80'))} {depth}{draw.randint(-10, 30)}",
        f"{draw.choice(('', '', 'G80 '))}{_hole(draw, code, across, depth)}{_CYCLES[code]}{times} F90",
    ]
    for _ in range(draw.randint(0, 4)):
        kind = draw.random()
        if kind < 0.5:
            lines.append(_axes(draw, across))
        elif kind < 0.6:
            lines.append(f"{_axes(draw, across)} {depth}{draw.randint(-20, -1)}")
        elif kind < 0.75:
            lines.append(f"{draw.choice(('G99', 'G99', 'G98'))} {_axes(draw, across)}")
        elif kind < 0.85:
            code = draw.choice(tuple(_CYCLES))
            lines.append(_hole(draw, code, across, depth) + _CYCLES[code])
        elif kind < 0.95:
            lines.append(f"{draw.choice(('G80 ' + code, code + ' G80'))} {_axes(draw, across)}")
        else:
            lines.append(draw.choice((f"R{draw.randint(0, 15)} {_axes(draw, across)}", "G20", "G21")))
    return "\n".join([*lines, "G80", "G0"])


def _hole(draw: random.Random, code: str, across: str, depth: str) -> str:
    return f"{code} {_axes(draw, across)} {depth}{draw.randint(-20, -1)} R{draw.randint(0, 15)}"


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
            "G80\nG1",
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
            "G91.1 G90 G80\nG0",
            "G80 G91.1 G0 G90",
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
            f"G10 L2 P{draw.randint(0, 9)} {_axes(draw)}{draw.choice(('', ' R0'))}",
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


_WEIGHTED: tuple[tuple[Callable[[random.Random], str], float], ...] = (
    (_line, 40),
    (_arc, 15),
    (_series, 12),
    (_mode, 15),
    (_offset, 10),
    (_inverse, 1),
    (_dwell, 3),
    (_wrong, 0.4),
)
_KINDS = [kind for kind, _ in _WEIGHTED]
_WEIGHTS = [weight for _, weight in _WEIGHTED]
