"""What all tests share: the core from the start, failures told at once, the option to write golden files anew."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

import tests.assembled  # noqa: F401  (every call of the command line in this process is a third as long)
from isel_twin.native import core
from tests import forked
from tests.thorough import ALL, PART

for profile, examples in (("isel-twin", PART), ("thorough", ALL)):
    settings.register_profile(profile, deadline=None, max_examples=examples)  # as long as a busy computer needs
settings.load_profile("isel-twin")

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # begun in the background: what tests start would be deaf to it
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # what tests start by the hundred would compile all sources each time

gc.disable()  # nothing of what is imported and collected is thrown away


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write the digests in tests/golden anew")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Build the core before any worker starts, so that only one does; tell of failures from now on."""
    if terminal := session.config.pluginmanager.getplugin("terminalreporter"):  # workers have none
        session.config.pluginmanager.register(_AtOnce(terminal))
    if getattr(session.config.option, "numprocesses", None):
        if session.config.getoption("--update-golden"):
            raise pytest.UsageError("--update-golden writes whole files: not with --numprocesses")
        _rewrite(session.config.args)
        core.load()
        if sys.platform == "linux":
            forked.share()
        gc.enable()  # it collects nothing itself


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Workers get long files first (with --no-loadscope-reorder), so that none has one left when the others are
    through."""
    if hasattr(config, "workerinput"):
        size = Counter(item.path for item in items)
        takes_s = {item.path: mark.kwargs["seconds"] for item in items for mark in item.iter_markers("long")}
        items.sort(key=lambda item: (-takes_s.get(item.path, 0), -size[item.path]))


def pytest_collection_finish(session: pytest.Session) -> None:
    """What has been collected stays to the end: the garbage collector need not look at it again and again."""
    gc.freeze()
    gc.enable()


class _AtOnce:
    """Names each test that fails when it does, not a quarter of an hour later."""

    def __init__(self, terminal: pytest.TerminalReporter) -> None:
        self._terminal = terminal

    @pytest.hookimpl(trylast=True)  # behind the letter of the test
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            crash = getattr(report.longrepr, "reprcrash", None)
            reason, *_ = (crash.message if crash else report.longreprtext).splitlines() or [""]
            self._terminal.write_line(f"\nFAILED {report.nodeid} ({report.when}): {reason}", red=True)


def _rewrite(places: list[str]) -> None:
    """On a clean checkout each worker would rewrite all asserts, which takes longer than many a test: one does it."""
    here = Path(__file__).parent
    if not any(here.glob("__pycache__/test_*-pytest-*.pyc")):
        command = [sys.executable, "-m", "pytest", "--collect-only", "-qq", "-p", "no:cacheprovider", *places]
        subprocess.run(command, stdout=subprocess.DEVNULL, check=False)


@pytest.fixture
def update_golden(pytestconfig: pytest.Config) -> bool:
    """Are golden files to be written instead of compared?"""
    return bool(pytestconfig.getoption("--update-golden"))
