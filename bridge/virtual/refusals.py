"""Functions that virtual time cannot support: they would wait in real time, or leave the process. The host ends with
one line that names place, function and alternative.
"""

from __future__ import annotations

import ctypes.util
import importlib
import sys
import typing
import warnings
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from isel_twin.bridge.virtual.cpython import PRIVATE_FUNCTIONS, calling_frame
from isel_twin.bridge.virtual.host_code import host_line
from isel_twin.bridge.virtual.host_thread import HostEnded
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import Turns, here

SERVE = "use `isel-twin serve --pty`, in real time"


def refuse(what: str, remedy: str) -> typing.NoReturn:
    active = here()
    if active is not None:
        where = host_line(calling_frame(1))
        active.end("refused", f"{f'{where}: ' if where else ''}{what} cannot be had in virtual time: {remedy}")
    raise HostEnded(2)


def _called_by(*packages: str) -> str | None:
    """The innermost of these packages in the stack of calls."""
    frame: FrameType | None = calling_frame(1)
    while frame is not None:
        package = str(frame.f_globals.get("__name__", "")).split(".")[0]
        if package in packages:
            return package
        frame = frame.f_back
    return None


def _refused(what: str) -> Callable[..., Any]:
    def virtual(_: Turns, *args: Any, **kwargs: Any) -> Any:
        told = {
            "asyncio": "of asyncio, what leaves the process or is no loop of `new_event_loop`,",
            "multiprocessing": "multiprocessing",
            "concurrent": "a pool of processes",
            "subprocess": "subprocess",
        }
        if (by := _called_by(*told)) == "asyncio":
            warnings.filterwarnings("ignore", message="coroutine .* was never awaited")  # the host has ended
        refuse(told.get(by or "", what), SERVE)

    return virtual


_REFUSED: dict[str, tuple[str, ...]] = {
    "os": ("fork", "forkpty", "system", "posix_spawn", "posix_spawnp", "execv", "execve", "startfile"),
    "select": ("epoll", "kqueue", "devpoll"),
    "signal": ("setitimer", "alarm", "pause", "sigwait", "sigwaitinfo", "sigtimedwait"),
    **PRIVATE_FUNCTIONS,
}

_REFUSED_METHODS: dict[tuple[str, str], tuple[str, ...]] = {
    ("asyncio.base_events", "BaseEventLoop"): ("__new__",),
}


def _method(real: Callable[..., Any], what: str) -> Callable[..., Any]:
    virtual = _refused(what.removesuffix(".__init__"))

    def method(self: Any, *args: Any, **kwargs: Any) -> Any:
        active = here()
        if active is not None and not getattr(self, "in_virtual_time", False):
            virtual(active)
        return real(self) if real is object.__new__ else real(self, *args, **kwargs)

    return method


def stand_ins() -> list[tuple[Any, Any]]:
    find = ctypes.util.find_library  # asks ldconfig and compilers, which take no time of the machine
    return [
        (find, StandIn(find, lambda active, name: active.in_real_time(find, name))),
        *(
            (real, StandIn(real, _refused(f"{module.lstrip('_')}.{name}")))
            for module, names in _REFUSED.items()
            for name in names
            if (real := getattr(sys.modules.get(module), name, None)) is not None
        ),
    ]


def methods() -> Iterator[tuple[type, str, Callable[..., Any]]]:
    """Each refused method: class, name, and its replacement."""
    for (module, class_name), names in _REFUSED_METHODS.items():
        owner = getattr(importlib.import_module(module), class_name)
        for name in names:
            yield owner, name, _method(getattr(owner, name), f"{module}.{class_name}.{name}")
