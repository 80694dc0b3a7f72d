"""Pytest plugin: remembers which test shows which row, and how it ended."""

from __future__ import annotations

import pytest
from conformance.rows import FOLDER


class Record:
    """`tests`: row -> names of the tests that show it; `outcomes`: row -> how each of those that were run ended."""

    def __init__(self) -> None:
        self.tests: dict[str, list[str]] = {}
        self.outcomes: dict[str, list[str]] = {}
        self._rows: dict[str, tuple[str, ...]] = {}

    def pytest_configure(self, config: pytest.Config) -> None:
        config.addinivalue_line("markers", "shows(*rows): the test shows that these rows of a conformance table hold")

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Note the rows of every test, and let the verdict on the table come after all of them."""
        for item in items:
            rows = tuple(str(row) for mark in item.iter_markers("shows") for row in mark.args)
            self._rows[item.nodeid] = rows
            for row in rows:
                name = item.name if f"[{row}]" in item.name else getattr(item, "originalname", item.name)
                names = self.tests.setdefault(row, [])
                if name not in names:
                    names.append(name)
        items.sort(key=lambda item: item.get_closest_marker("verdict_on_table") is not None)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" or report.outcome != "passed":
            ended = "xfailed" if hasattr(report, "wasxfail") else report.outcome
            for row in self._rows.get(report.nodeid, ()):
                self.outcomes.setdefault(row, []).append(ended)

    def holds(self, row: str) -> bool:
        """Was the row shown by at least one test, and did all of those that were run pass?"""
        outcomes = self.outcomes.get(row, [])
        return bool(outcomes) and all(outcome == "passed" for outcome in outcomes)


def covers_folder(config: pytest.Config, items: list[pytest.Item]) -> bool:
    """Has this session collected every test of this folder?"""
    whole = {path.name for path in FOLDER.glob("test_*.py")} <= {item.path.name for item in items}
    narrowed = config.getoption("keyword") or config.getoption("markexpr") or any("::" in arg for arg in config.args)
    return whole and not narrowed
