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


def njit(*, inner: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba's njit with these options and, if possible, a cache on the disk.

    inner: compiled functions call it, so that it needs no entry for Python, which is a part of the compiling. Python
    can call it all the same: then it is compiled for that anew in each process.
    """
    return lambda function: Compiled(function, options, inner)


def contains(module: str, *files: str) -> None:
    """Code of other files is compiled into functions of this module: when they have changed, its cached code is stale.

    numba checks only the file of the function itself. Call it beside the functions."""
    _CONTAINED[module] = files


class Compiled:
    """A function that numba compiles, or loads from the cache, when it is first needed; then numba's dispatcher."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any], inner: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options, self._inner = options, inner

    @functools.cached_property
    def _dispatcher(self) -> Any:
        from isel_twin.base.compiled_code import dispatcher, tell_of_compiling

        with _MAKING:
            tell_of_compiling(compiling)
            if "_dispatcher" in self.__dict__:  # another thread was faster
                return self.__dict__["_dispatcher"]
            if self._inner:
                return dispatcher(self.py_func, self._options, kept=False)
            name, made = self.py_func.__name__, self._kept(self._options)
            for place in list(sys.modules.values()):
                if getattr(place, "__dict__", {}).get(name) is self:
                    setattr(place, name, made)
            return made

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for in a compiled function that calls it."""
        return (self._within if self._inner else self._dispatcher)._numba_type_

    @functools.cached_property
    def _within(self) -> Any:
        """The dispatcher without an entry for Python."""
        with _MAKING:
            return self._kept({**self._options, "no_cpython_wrapper": True})

    def _kept(self, options: dict[str, Any]) -> Any:
        from isel_twin.base.compiled_code import dispatcher, drop_stale_code

        made = dispatcher(self.py_func, options)
        if files := _CONTAINED.pop(self.py_func.__module__, ()):
            drop_stale_code(made, *files)
        return made

    def __call__(self, *arguments: Any) -> Any:
        return self._dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        """All else that a dispatcher has."""
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
