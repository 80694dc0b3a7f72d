"""Digests of the conformance sessions: what every desk of a test saw, for the hooks of tests/conformance/conftest.py.

`Desk.built` holds the desks of the test that is running. A test that draws its stimuli (Hypothesis) has no digest: its
examples are not the same from run to run. A test that makes no desk has none either.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from golden.digest import FOLDER, LENGTH, REMEDY, digest, load, save, switches_full_steps

from isel_twin.testing import Desk

FILE = FOLDER / "conformance.txt"


class Golden:
    """Digests on file, and those of the tests that have passed in this session."""

    def __init__(self, update: bool) -> None:
        self.update = update
        self.kept = load(FILE)
        self.seen: dict[str, str] = {}

    @contextmanager
    def watching(self, item: pytest.Item) -> Iterator[None]:
        """Collect the desks that are built meanwhile; in the end compare with the file. Raises AssertionError."""
        if item.get_closest_marker("hypothesis") is not None:
            yield
            return
        Desk.built = desks = []
        try:
            yield
        finally:
            Desk.built = None
        name = f"{item.path.name}::{item.name}"
        if not desks:
            assert self.update or name not in self.kept, f"golden: {name} makes no desk any more; {REMEDY}"
            return
        full_steps = item.path.name.startswith("test_ismif")
        self.seen[name] = together(digest_of(desk, full_steps and switches_full_steps(desk.sent)) for desk in desks)
        if not self.update:
            assert name in self.kept, f"golden: {name} is a new session: run make golden"
            assert self.seen[name] == self.kept[name], (
                f"golden: replies, steps or positions at the desks of {name} are not those on file; {REMEDY}"
            )

    def missing(self, present: set[str]) -> list[str]:
        """Sessions on file that no test of the folder makes."""
        return sorted(set(self.kept) - present)

    def write(self, whole: bool) -> None:
        """Write the file anew; if not the whole folder was run, with the other sessions as they were."""
        save(FILE, self.seen if whole else self.kept | self.seen)


def digest_of(desk: Desk, coarse: bool) -> str:
    """What this desk has seen so far."""
    return digest(desk.replies, desk.steps, desk.counts, desk.carriage, coarse)


def together(digests: Iterator[str]) -> str:
    """One digest of several, in their order."""
    return hashlib.sha256(" ".join(digests).encode()).hexdigest()[:LENGTH]
