"""One of many twins says nothing: what becomes of it is in its row, its repetition or its trial."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quietly() -> Iterator[None]:
    """Suppress the warnings of twins meanwhile."""
    log = logging.getLogger("isel_twin")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)
