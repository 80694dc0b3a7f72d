"""Compiled functions that are cached between processes where a folder can be written to.

    @njit(nogil=True, error_model="numpy")         numba's njit with cache=True
    def advance(...): ...

numba caches compiled code in `__pycache__` beside the source, else in the user's cache folder or in NUMBA_CACHE_DIR. It
raises if it cannot write there or the disk is full. Here the function works all the same: it is compiled again in each
process, and the log says once what that costs and what to do.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.runtime import rtsys

log = logging.getLogger("isel_twin")

_said = False


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba's njit with these options and, if possible, a cache on the disk."""

    def decorate(function: Callable[..., Any]) -> Any:
        compiled: Any = numba.njit(**options)(function)
        try:
            compiled._cache = _Cache(function)
        except RuntimeError as error:
            if "cannot cache function" not in str(error):
                raise
            _say("no folder to keep compiled code in, so each start compiles it anew; name one by NUMBA_CACHE_DIR")
        return compiled

    return decorate


class _Cache(FunctionCache):
    """numba's own cache, except that a full disk is no error, and loading is fast."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Cached code needs only memory management. numba would prepare for compiling first, which imports hundreds of
        modules, including scipy: 0.4 s of CPU time. It still does so before it compiles."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _say(
                f"compiled code cannot be kept ({error.strerror or error}), so each start compiles it anew; "
                "name a folder for it by NUMBA_CACHE_DIR"
            )


def _say(line: str) -> None:
    """Log a line once in a process, not once a function."""
    global _said
    if not _said:
        _said = True
        log.warning("%s", line)
