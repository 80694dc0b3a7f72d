"""One of many twins says nothing: what becomes of it is in its row, its repetition or its trial."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_LEAST: ContextVar[int] = ContextVar("least level of the log that is told", default=logging.NOTSET)


def _is_told(record: logging.LogRecord) -> bool:
    return record.levelno >= _LEAST.get()


@contextmanager
def quietly(least: int = logging.CRITICAL) -> Iterator[None]:
    """Suppress what twins of this thread say below a level meanwhile; other threads keep their voice."""
    logging.getLogger("isel_twin").addFilter(_is_told)  # a second time is none
    before = _LEAST.set(least)
    try:
        yield
    finally:
        _LEAST.reset(before)
