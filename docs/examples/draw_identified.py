"""Pictures of an identification: `identify --json` as intervals, `identify --score FILE --json` as scores.

    isel-twin identify day1.mcap ... --json > fit.json        python docs/examples/draw_identified.py fit.json fit.png
    isel-twin identify --score day.toml --json > day.json     python docs/examples/draw_identified.py day.json day.png

Needs matplotlib: pip install 'isel-twin[report]'.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

BAD, FAIR, GOOD = "#b3261e", "#c77700", "#2f6f4f"
LONGEST = 4.0  # of a bar of E_n; what is more is written beside it


def intervals(told: dict[str, Any]) -> Figure:
    """Prior range, interval, and what of it other numbers make, in standard deviations of the prior."""
    figure = Figure(figsize=(7.5, 0.55 * len(told["parameters"]) + 1.2), layout="constrained")
    axes = figure.subplots()
    for row, (one, widened) in enumerate(zip(told["parameters"], told["widened"], strict=True)):
        low, prior, high = one["prior"]
        scale = math.log(high / low) / 4.0

        def at(value: float, prior: float = prior, scale: float = scale) -> float:
            return math.log(value / prior) / scale

        ends, middle = [at(value) for value in one["interval"]], at(one["value"])
        alone = [middle + (end - middle) / widened for end in ends]
        axes.barh(row, 4.0, left=-2.0, height=0.7, color="#e4e4e4")
        axes.barh(row, ends[1] - ends[0], left=ends[0], height=0.4, color="#8fb4d9")
        axes.barh(row, alone[1] - alone[0], left=alone[0], height=0.4, color="#1f5c99")
        axes.plot([middle], [row], "k|", markersize=14)
    axes.set_yticks(range(len(told["parameters"])), [one["name"] for one in told["parameters"]])
    axes.invert_yaxis()
    axes.set_xlabel("standard deviations of the prior; grey: its 95 %, light: what other numbers make of the interval")
    return figure


def scores(told: dict[str, Any]) -> Figure:
    """E_n of each characteristic."""
    rows = [one for one in told["score"]["scores"] if one["e_n"] is not None]
    figure = Figure(figsize=(7.5, 0.24 * len(rows) + 1.0), layout="constrained")
    axes = figure.subplots()
    for row, one in enumerate(rows):
        e_n, shown = one["e_n"], max(-LONGEST, min(LONGEST, one["e_n"]))
        axes.barh(row, shown, color={"holds": GOOD, "questionable": FAIR}.get(one["verdict"], BAD), height=0.7)
        if shown != e_n:
            axes.text(shown, row, f" {e_n:+.1f} ", va="center", ha="left" if e_n > 0 else "right", fontsize=8)
    axes.set_yticks(range(len(rows)), [one["what"] for one in rows], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(-LONGEST - 0.8, LONGEST + 0.8)
    for edge in (-1.0, 1.0):
        axes.axvline(edge, color="black", linewidth=0.8)
    axes.set_xlabel("E_n: difference over half of the band")
    return figure


def main() -> None:
    told = json.loads(Path(sys.argv[1]).read_text())
    (scores(told) if "parameters" not in told else intervals(told)).savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
