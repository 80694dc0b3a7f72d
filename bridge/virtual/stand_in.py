"""A function that is virtual in the threads of a host and real everywhere else."""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any

from isel_twin.bridge.virtual.turns import here


class StandIn:
    """Calls `virtual(time, ...)` in a thread of the host, `real(...)` elsewhere.

    An object and no function, since a class may hold it: `clock = time.monotonic`, called as `self.clock()`.
    """

    def __init__(self, real: Any, virtual: Callable[..., Any], kind: type | None = None) -> None:
        """kind: class whose instances pass for those of what is real."""
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
