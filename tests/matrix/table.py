"""docs/faults.md: written by `python -m tests.matrix`, read by the test."""

from __future__ import annotations

from pathlib import Path

from tests.matrix.cells import CONTROLLERS, FAULTS, PLANTS, TOOLS, Outcome, cells

DOCUMENT = Path(__file__).parents[2] / "docs" / "faults.md"
HEAD = """# What becomes of faults

What each tool says of a job in whose midst something happens, by controller and plant (`k` kinematic, `m` MuJoCo).
Written by `python -m tests.matrix`, and held by tests/matrix/test_matrix.py.

- **well**, **not well**: the exit code is 0 or 1. `golden`, `replay` and `compare` ask whether it is the same once
  more, and `serve` whether it goes on, so for them a fault is well.
- A number: the call is refused in one line, which stands below.
- `obstacle` and `drive` need physics: the kinematic plant says that they had no effect. The iSMIF looks
  at its switches in reference runs only. The GMI99 and the BWO 900 have answered before they move, so a line cut then
  hurts nobody.
- `exec` runs a host that sends the job and takes no notice of replies: its verdict is the machine's alone.
"""
WORDS = {"well": "well", "not well": "**not**"}


def shown(made: Outcome) -> str:
    return made.words


def write_table(found: dict[tuple[str, str, str, str], str]) -> None:
    """found: words of each cell."""
    refusals = list(dict.fromkeys(text for text in found.values() if text not in WORDS))
    lines = [HEAD]
    for tool in TOOLS:
        plants = [plant for plant in PLANTS if any(cell[0] == tool and cell[3] == plant for cell in found)]
        faults = [fault for fault in FAULTS if any(cell[0] == tool and cell[2] == fault for cell in found)]
        columns = [(controller, plant) for controller in CONTROLLERS for plant in plants]
        lines += [f"## {tool}", ""]
        lines.append("| | " + " | ".join(f"{controller} {plant[0]}" for controller, plant in columns) + " |")
        lines.append("|---" * (len(columns) + 1) + "|")
        for fault in faults:
            texts = [found[tool, controller, fault, plant] for controller, plant in columns]
            row = [WORDS.get(text) or str(refusals.index(text) + 1) for text in texts]
            lines.append(f"| {fault} | " + " | ".join(row) + " |")
        lines.append("")
    lines += ["## Refusals", "", *(f"{n}. {text}" for n, text in enumerate(refusals, 1)), ""]
    DOCUMENT.write_text("\n".join(lines), encoding="utf-8")


def read_table() -> dict[tuple[str, str, str, str], str]:
    """Words of each cell, as the document has them."""
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines()
    refusals = dict(line.split(". ", 1) for line in lines if line[:1].isdigit())
    words = {shown: word for word, shown in WORDS.items()}
    found, tool, columns = {}, "", []
    plants = {plant[0]: plant for plant in PLANTS}
    for line in lines:
        if line.startswith("## "):
            tool = line[3:]
        elif line.startswith("| | "):
            columns = [column.strip().split() for column in line.strip("|").split("|")[1:]]
        elif line.startswith("| "):
            fault, *texts = [text.strip() for text in line.strip("|").split("|")]
            for (controller, plant), text in zip(columns, texts, strict=True):
                found[tool, controller, fault, plants[plant]] = words.get(text) or refusals[text]
    assert len(found) <= len(list(cells()))
    return found
