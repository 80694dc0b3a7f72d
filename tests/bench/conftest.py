"""Figures a benchmark finds beside its time: written into `benchmark.extra_info`, printed as lines at the end.

benchmark.extra_info["times real time"] = 1900.0
"""

from __future__ import annotations

from typing import Any


def pytest_terminal_summary(terminalreporter: Any, config: Any) -> None:
    session = getattr(config, "_benchmarksession", None)
    lines = [
        f"{bench.name:<46} {figure:<44} {value:>12,.4g}"
        for bench in (session.benchmarks if session is not None else ())
        for figure, value in sorted(bench.extra_info.items())
    ]
    if lines:
        terminalreporter.section("figures")
        for line in lines:
            terminalreporter.write_line(line)
