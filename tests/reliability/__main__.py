"""All measurements, one table: `make reliability`."""

from __future__ import annotations

import sys

from tests.reliability import (
    alike,
    connects,
    differences,
    echo,
    feed,
    flood,
    heard,
    kills,
    memory,
    punctual,
    queries,
    strings,
    tap,
    vanished,
    week,
)
from tests.reliability.figures import table

PROGRAMS = (
    queries,
    echo,
    punctual,
    heard,
    connects,
    flood,
    kills,
    vanished,
    memory,
    feed,
    strings,
    tap,
    differences,
    alike,
    week,
)


def main() -> None:
    good = True
    for program in PROGRAMS:
        name = program.__name__.rpartition(".")[2]
        figures = program.measure(program.NUMBER)
        print(f"\n`python -m tests.reliability.{name} {program.NUMBER}`\n\n{table(figures)}", flush=True)
        good = good and all(figure.holds for figure in figures)
    sys.exit(not good)


if __name__ == "__main__":
    main()
