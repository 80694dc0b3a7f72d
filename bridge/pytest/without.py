"""At a real controller (--isel-port): what stands in for the twin, and skips whoever needs it."""

from __future__ import annotations

from typing import NoReturn

import pytest


def no_twin(what: str) -> NoReturn:
    """Skip a test that needs the twin."""
    pytest.skip(f"{what}: needs the twin, and with --isel-port the machine is a real one")


class NoTwin:
    """In the place of a twin: whoever looks at it is skipped."""

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("_"):
            raise AttributeError(name)
        no_twin(f"twin.{name}")
