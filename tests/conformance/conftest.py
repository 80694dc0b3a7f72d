"""Hooks the conformance record into every test session that touches this folder, and its desks into the golden file."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from conformance.record import Record, covers_folder
from golden.conformance import Golden

RECORD = pytest.StashKey[Record]()
GOLDEN = pytest.StashKey[Golden]()


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "verdict_on_table: judges the conformance tables; runs after everything else")
    records = [plugin for plugin in config.pluginmanager.get_plugins() if isinstance(plugin, Record)]
    if not records:
        records = [Record()]
        config.pluginmanager.register(records[0])
    config.stash[RECORD] = records[0]
    config.stash[GOLDEN] = Golden(bool(config.getoption("--update-golden")))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    with item.config.stash[GOLDEN].watching(item):
        return (yield)


def pytest_sessionfinish(session: pytest.Session) -> None:
    golden = session.config.stash[GOLDEN]
    if golden.update and golden.seen:
        golden.write(whole=covers_folder(session.config, session.items) and not session.testsfailed)


@pytest.fixture
def record(pytestconfig: pytest.Config) -> Record:
    """The session's record of rows and outcomes."""
    return pytestconfig.stash[RECORD]


@pytest.fixture
def golden(pytestconfig: pytest.Config) -> Golden:
    """The digests of the desks of this folder."""
    return pytestconfig.stash[GOLDEN]
