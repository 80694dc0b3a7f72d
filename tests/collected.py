"""`python3-dbg -m pytest -n0 -p tests.collected tests/...`: looks for garbage after each test (docs/reliability.md).

An object with fewer references than things that have it is freed while it is in use, and a usual Python dies of it
later, if at all. One that was built for debugging says at the next look which object it is.
"""

from __future__ import annotations

import gc
from itertools import count

import pytest

_tests = count(1)


@pytest.hookimpl(trylast=True)
def pytest_runtest_logfinish() -> None:
    """Every fortieth time also at what was there before the tests."""
    if next(_tests) % 40 == 0:
        gc.unfreeze()
        gc.collect()
        gc.freeze()
    gc.collect()
