"""Random parts as CAM programs write them, each from a seed: RS274 in mm or inch, within 30 mm of the work's zero."""

from __future__ import annotations

import math
import random

INCH_MM = 25.4
PLANES = {"G17": ("XY", "IJ", "Z"), "G18": ("ZX", "KI", "Y"), "G19": ("YZ", "JK", "X")}
CYCLES = {"G81": "", "G82": " P0.2", "G83": " Q1.5", "G73": " Q1.5", "G85": ""}


def part(seed: int, most: int = 7) -> str:
    """Lines, arcs and helices in three planes, and rows of holes, up to so many; the tool begins above the work."""
    return "\n".join(_Part(random.Random(seed), most).lines)


class _Part:
    def __init__(self, draw: random.Random, most: int) -> None:
        self._draw, self._inch = draw, draw.random() < 0.4
        self._at = {"X": 0.0, "Y": 0.0, "Z": 20.0}  # mm
        self.lines = [f"{'G20' if self._inch else 'G21'} G90 G91.1 G94 G17 G40 G49 G80", f"F{self._feed()}"]
        self.lines += [f"S{draw.randint(5, 24)}000 M3", f"G0 {self._words(X=self._near(), Y=self._near(), Z=20.0)}"]
        for _ in range(draw.randint(most // 2, most)):
            draw.choices((self._line, self._arc, self._holes), (4, 4, 1))[0]()
        self.lines += [f"G0 {self._words(Z=25.0)}", "M5", "M2", ""]

    def _near(self) -> float:
        return self._draw.uniform(-20.0, 20.0)

    def _shown(self, mm: float) -> str:
        """rs274 tells four decimals, in the unit of the file."""
        return f"{mm / INCH_MM:.4f}" if self._inch else f"{mm:.3f}"

    def _words(self, **to: float) -> str:
        """The tool stands where the words say, not where it was meant to."""
        for axis, mm in to.items():
            self._at[axis] = float(self._shown(mm)) * (INCH_MM if self._inch else 1.0)
        return " ".join(f"{axis}{self._shown(mm)}" for axis, mm in to.items())

    def _feed(self) -> str:
        return f"{self._draw.choice((300, 600, 900)) / (INCH_MM if self._inch else 1.0):.1f}"

    def _line(self) -> None:
        axes = [axis for axis in "XYZ" if self._draw.random() < 0.6] or ["X"]
        code = self._draw.choice(("G1", "G1", "G0"))
        feed = f" F{self._feed()}" if self._draw.random() < 0.3 else ""
        self.lines.append(f"{code} {self._words(**{axis: self._near() for axis in axes})}{feed}")

    def _arc(self) -> None:
        """About a centre 2 to 9 mm away; the end lies on the circle, or on the start, or on a helix."""
        plane = self._draw.choice(("G17", "G17", *PLANES))
        (a, b), (i, j), third = PLANES[plane]
        angle, radius = self._draw.uniform(0.0, 2.0 * math.pi), self._draw.uniform(2.0, 9.0)
        centre = self._at[a] + radius * math.cos(angle), self._at[b] + radius * math.sin(angle)
        ways = f"{i}{self._shown(centre[0] - self._at[a])} {j}{self._shown(centre[1] - self._at[b])}"
        turn = self._draw.choice((0.0, self._draw.uniform(0.3, 6.0)))
        to = {a: self._at[a], b: self._at[b]}
        if turn:
            end = angle + math.pi + turn
            to = {a: centre[0] + radius * math.cos(end), b: centre[1] + radius * math.sin(end)}
        if self._draw.random() < 0.3:
            to[third] = self._at[third] + self._draw.uniform(-3.0, 3.0)
        times = f" P{self._draw.randint(2, 3)}" if self._draw.random() < 0.2 else ""
        self.lines.append(f"{plane} {self._draw.choice(('G2', 'G3'))} {self._words(**to)} {ways}{times}")

    def _holes(self) -> None:
        code = self._draw.choice(tuple(CYCLES))
        back = self._draw.choice(("G98", "G99"))
        first = self._words(X=self._near(), Y=self._near())
        height = self._draw.uniform(-5.0, 5.0)
        depth, retract = self._shown(height - self._draw.uniform(1.0, 6.0)), self._shown(height)
        self.lines += [f"G17 G0 {self._words(Z=20.0)}", f"{back} {code} {first} Z{depth} R{retract}{CYCLES[code]}"]
        if self._inch:  # Q is a length
            self.lines[-1] = self.lines[-1].replace("Q1.5", "Q0.06")
        for _ in range(self._draw.randint(0, 2)):
            self.lines.append(self._words(**{self._draw.choice("XY"): self._near()}))
        self._at["Z"] = 20.0 if back == "G98" else height
        self.lines += ["G80", f"G0 {self._words(Z=20.0)}"]
