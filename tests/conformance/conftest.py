"""Hooks the conformance record into every test session that touches this folder."""

from __future__ import annotations

import pytest
from conformance.record import Record

RECORD = pytest.StashKey[Record]()


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "verdict_on_table: judges the conformance tables; runs after everything else")
    records = [plugin for plugin in config.pluginmanager.get_plugins() if isinstance(plugin, Record)]
    if not records:
        records = [Record()]
        config.pluginmanager.register(records[0])
    config.stash[RECORD] = records[0]


@pytest.fixture
def record(pytestconfig: pytest.Config) -> Record:
    """The session's record of rows and outcomes."""
    return pytestconfig.stash[RECORD]
