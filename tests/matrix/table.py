"""docs/faults.md: the specification (expected.py) as a page. Only the refusals of `tune` are copied from it."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill

from tests.matrix.cells import PLANTS
from tests.matrix.expected import CONTROLLERS, FAULTS, JUDGES, SAME, Fault

DOCUMENT = Path(__file__).parents[2] / "docs" / "faults.md"
HEAD = f"""# What becomes of faults

What the tools must say of a job in whose last motion something happens (*at the start*: before it), by controller and
plant (`k` kinematic, `m` MuJoCo). A verdict that is well although the fault has changed anything of what was made or of
what was answered would be a wrong green. The page is the specification (tests/matrix/expected.py), not a record;
tests/matrix/test_matrix.py holds cells of it, `python -m tests.matrix` every one.

- {", ".join(f"`{tool}`" for tool in JUDGES)} say the same (`pytest`: `assert_accepted`, `assert_no_step_lost` and
  `assert_no_collision` together): `not` well, exit code 1, or `well`, because nothing has been changed.
- `exec --check` says it of a host that takes no notice of replies.
- `well` in a row of physics on the kinematic plant: it has no effect there, and the verdict says so.
- {", ".join(f"`{tool}`" for tool in SAME)} ask whether it is the same once more: every fault is well there.
- `serve` goes on, and its state says what is wrong as long as it is.
- `tune` says in one line that a job has to run before it can be tuned, and what has happened, where the job itself is
  not over; else it finds no settings that are well.
- `identify` and `experiment` take no faults.

| fault | scenario | {" | ".join(f"{name} {plant[0]}" for name in CONTROLLERS for plant in PLANTS)} |
|---|---|{"---|" * (len(CONTROLLERS) * len(PLANTS))}
"""


def row(name: str, fault: Fault) -> str:
    acts = fault.acts.replace("\n", ", ") or "a vise in the way"
    words = [("not" if fault.bites(c, plant) else "well") for c in CONTROLLERS for plant in PLANTS]
    return f"| {name} | `{acts}`{' at the start' if fault.at_start else ''} | {' | '.join(words)} |\n"


def reasons(name: str, fault: Fault) -> str:
    spares = "" if not fault.spares else fault.spared
    if 0 < len(fault.spares) < len(CONTROLLERS):
        spares = f"not with {', '.join(fault.spares)}: {spares}"
    text = f"- {name}: {'; '.join(filter(None, (fault.because, spares)))}."
    return fill(text, 118, subsequent_indent="  ", break_on_hyphens=False) + "\n"


def page() -> str:
    rows = "".join(row(*each) for each in FAULTS.items())
    why = "".join(reasons(*each) for each in FAULTS.items())
    return f"{HEAD}{rows}\n## Why\n\n{why}"
