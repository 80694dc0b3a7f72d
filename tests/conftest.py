"""What all tests share: the option that writes golden files anew."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write the digests in tests/golden anew")


@pytest.fixture
def update_golden(pytestconfig: pytest.Config) -> bool:
    """Are golden files to be written instead of compared?"""
    return bool(pytestconfig.getoption("--update-golden"))
