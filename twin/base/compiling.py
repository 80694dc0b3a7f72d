"""Compiled functions that are cached between processes where a folder can be written to.

    @njit(nogil=True, error_model="numpy")         numba's njit with cache=True, at the first call
    def advance(...): ...

    @intrinsic
    def call(typingctx, ...): ...                  numba's intrinsic

    contains(__name__, other.__file__)             this module's compiled functions contain code of another file

Importing numba takes a third of a second: who calls no compiled function does without it, and so does who calls those
that are kept as object code (object_code.py), until one has been called OFTEN. From then on a function is numba's own
in each module that has it under its name, so that later calls cost what they do with numba.
"""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable
from typing import Any

OFTEN = 15_000  # calls of a function, by which its calls without numba have cost as much as numba

_CONTAINED: dict[str, tuple[str, ...]] = {}  # module: other files whose code its compiled functions contain
_MAKING = threading.RLock()


def njit(*, inner: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba's njit with these options and, if possible, a cache on the disk.

    inner: compiled functions call it, so that it needs no entry for Python, which is a part of the compiling. Python
    can call it all the same: then it is compiled for that anew in each process.
    """
    return lambda function: Compiled(function, options, inner)


def intrinsic(function: Callable[..., Any]) -> Any:
    """numba's intrinsic of a function, made when compiled code needs it."""
    return _Intrinsic(function)


class _Intrinsic:
    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @functools.cached_property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target
        from numba.extending import intrinsic

        context = cpu_target.typing_context
        made = intrinsic(self._function)
        context.refresh()
        return context.resolve_value_type(made)


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
        self._left = 0 if inner else OFTEN  # calls without numba

    @functools.cached_property
    def _kept_code(self) -> Any:
        """Object code; None if numba is there anyway."""
        with _MAKING:
            if "numba" in sys.modules:
                return None
            from isel_twin.base.object_code import Kept

            return Kept(self.py_func, _CONTAINED.get(self.py_func.__module__, ()))

    @functools.cached_property
    def _dispatcher(self) -> Any:
        from isel_twin.base.compiled_code import dispatcher, part

        with _MAKING:
            if "_dispatcher" in self.__dict__:  # another thread was faster
                return self.__dict__["_dispatcher"]
            if self._inner:
                return part(self.py_func, self._options)
            name = self.py_func.__name__
            made = dispatcher(self.py_func, self._options, _CONTAINED.get(self.py_func.__module__, ()))
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
        from isel_twin.base.compiled_code import part

        with _MAKING:
            return part(self.py_func, {**self._options, "no_cpython_wrapper": True})

    def __call__(self, *arguments: Any) -> Any:
        if self._left and self._kept_code is not None:
            self._left -= 1
            made, result = self._kept_code(arguments)
            if made:
                return result
        return self._dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        """All else that a dispatcher has."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._dispatcher, name)
