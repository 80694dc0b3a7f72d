"""Compiled functions that are cached between processes where a folder can be written to.

    @njit(nogil=True, error_model="numpy")         numba's njit with cache=True, at the first call
    def advance(...): ...

    contains(__name__, other.__file__)             this module's compiled functions contain code of another file

Importing numba takes a third of a second: who calls no compiled function does without it. From its first call on a
function is numba's own in each module that has it under its name, so that later calls cost what they do with numba.
"""

from __future__ import annotations

import functools
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Tell = Callable[[str], None]

_CONTAINED: dict[str, tuple[str, ...]] = {}  # module: other files whose code its compiled functions contain
_WATCHES: list[_Watch] = []  # those who are told of compiling, the last first
_MAKING = threading.RLock()


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba's njit with these options and, if possible, a cache on the disk."""
    return lambda function: Compiled(function, options)


def contains(module: str, *files: str) -> None:
    """Code of other files is compiled into functions of this module: when they have changed, its cached code is stale.

    numba checks only the file of the function itself. Call it beside the functions."""
    _CONTAINED[module] = files


class Compiled:
    """A function that numba compiles, or loads from the cache, when it is first needed; then numba's dispatcher."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options

    @functools.cached_property
    def _dispatcher(self) -> Any:
        from isel_twin.base.compiled_code import dispatcher, drop_stale_code, tell_of_compiling

        with _MAKING:
            tell_of_compiling(compiling)
            if "_dispatcher" in self.__dict__:  # another thread was faster
                return self.__dict__["_dispatcher"]
            module, name = self.py_func.__module__, self.py_func.__name__
            made = dispatcher(self.py_func, self._options)
            if files := _CONTAINED.pop(module, ()):
                drop_stale_code(made, *files)
            for place in list(sys.modules.values()):
                if getattr(place, "__dict__", {}).get(name) is self:
                    setattr(place, name, made)
            return made

    def __call__(self, *arguments: Any) -> Any:
        return self._dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        """All else that a dispatcher has: numba asks for its type when a function that calls it is compiled."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._dispatcher, name)


def log_compiling(text: str) -> None:
    """A line on standard error."""
    print(f"isel-twin: {text}", file=sys.stderr, flush=True)


@contextmanager
def told_of_compiling(tell: Tell = log_compiling) -> Iterator[None]:
    """Report in a line of text when numba begins to compile in the block, and at the end how long it took; nothing if
    all is cached."""
    watch = _Watch(tell)
    _WATCHES.append(watch)
    try:
        yield
    finally:
        _WATCHES.remove(watch)
    if watch.spent_s > 0.0:
        tell(f"compiled in {watch.spent_s:.1f} s")


def compiling(begins: bool) -> None:
    """A compilation begins or ends: those who want to know are told."""
    for watch in _WATCHES:
        watch.take(begins)


class _Watch:
    """Times compilation (not loading); a compilation within another counts once."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._depth = 0
        self._began_s = 0.0
        self.spent_s = 0.0

    def take(self, begins: bool) -> None:
        if begins and self._depth == 0:
            if self.spent_s == 0.0:
                self._tell("compiling the physics (once per installation) ...")
            self._began_s = time.perf_counter()
        self._depth += 1 if begins else -1
        if not begins and self._depth == 0:
            self.spent_s += time.perf_counter() - self._began_s
