"""A function that is virtual in the threads of a host and real everywhere else."""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any

from isel_twin.bridge.virtual.turns import here


class StandIn:
    """Calls `virtual(time, ...)` in a thread of the host, `real(...)` elsewhere.

    It is an object instead of a function, as it may be a class attribute: `clock = time.monotonic`, called as
    `self.clock()`.
    """

    def __init__(self, real: Any, virtual: Callable[..., Any], kind: type | None = None) -> None:
        """kind: a class whose instances count as instances of the real one."""
        self._real = real
        self._kinds = tuple(each for each in (real, kind) if isinstance(each, type))
        self._virtual = virtual
        self.__name__ = getattr(real, "__name__", "?")
        self.__doc__ = getattr(real, "__doc__", None)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        active = here()
        return self._real(*args, **kwargs) if active is None else self._virtual(active, *args, **kwargs)

    def __repr__(self) -> str:
        return repr(self._real)

    def __instancecheck__(self, value: object) -> bool:
        return isinstance(value, self._kinds)

    def __or__(self, other: Any) -> Any:
        return typing.Any

    __ror__ = __or__
