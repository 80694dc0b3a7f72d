"""A small library of its own in a folder, in the place of the core: built, changed and broken by tests."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from isel_twin.native import Core, compiling, library

CORE_C = """#include "core.h"
#define WIDE 3
#include "exports.h"
TEXT layout_SMALL = "a i8 0; b f8 8; 16";
typedef struct { int64_t a; double b; } SMALL;
typedef struct { int64_t a; } UNKNOWN;
#include "sums.c"
"""
SUMS_C = """/* Sums of what a call hands over. */
API double sum(A1(const double, x), A2(const int32_t, k), R(SMALL, s), int64_t n,
               double y) {
    double found = y + (double)n;
    for (int64_t i = 0; i < x_n; i++) found += x[i];
    for (int64_t i = 0; i < k_rows * k_columns; i++) found += k[i];
    s->a += 1;
    return found + s->b;
}
API void twice(A1(double, x, n), A1(double, y, n)) {
    for (int64_t i = 0; i < x_n; i++) y[i] = 2.0 * x[i];
}
API int64_t joined(A1(const double, x, n), A1(const double, ends, n + 1), A2(const double, table, 2 * n, WIDE)) {
    return x_n;
}
API int64_t first(const int64_t *x) { return x[0]; }
API int64_t foreign(R(UNKNOWN, u)) { return u->a; }
"""
SMALL = np.dtype([("a", np.int64), ("b", np.float64)])


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of its C sources, of which core.c includes all others."""
    shutil.copy(compiling.HERE / "core.h", tmp_path)
    (tmp_path / "core.c").write_text(CORE_C)
    (tmp_path / "sums.c").write_text(SUMS_C)
    monkeypatch.setitem(library.RECORDS, "SMALL", SMALL)
    return tmp_path


@pytest.fixture
def small(sources: Path) -> Core:
    return Core(sources / "core.c")
