"""Twins that are many say nothing, and no thread takes another's voice."""

from __future__ import annotations

import logging
from threading import Barrier, Thread

import pytest

from isel_twin.base.quiet import quietly
from tests.forked import PATIENCE_S

LOG = logging.getLogger("isel_twin")


def test_nothing_below_the_level_is_said_meanwhile(caplog: pytest.LogCaptureFixture) -> None:
    with quietly(logging.ERROR):
        LOG.warning("warned inside")
        with quietly():
            LOG.error("erred inside")
        LOG.error("erred")
    LOG.warning("warned after")
    assert caplog.messages == ["erred", "warned after"]


def test_two_threads_at_once_leave_the_log_as_it_was(caplog: pytest.LogCaptureFixture) -> None:
    """One begins before the other ends, and ends after it."""
    steps = [Barrier(2, timeout=PATIENCE_S) for _ in range(2)]

    def first() -> None:
        with quietly():
            steps[0].wait()
        steps[1].wait()

    def second() -> None:
        LOG.warning("the other is silent")
        steps[0].wait()
        with quietly():
            steps[1].wait()
        LOG.warning("after both")

    threads = [Thread(target=first), Thread(target=second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    LOG.warning("here")
    assert caplog.messages == ["the other is silent", "after both", "here"]
