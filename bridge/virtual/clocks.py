"""Clocks, sleeps and dates in virtual time."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable
from typing import Any

from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import EPOCH_NS, UPTIME_NS, Turns, here


def _clock(real: Callable[[], Any], zero_ns: int, whole: bool) -> StandIn:
    def virtual(active: Turns) -> float | int:
        active.look()
        now_ns = zero_ns + active.now_ns
        return now_ns if whole else now_ns / SECOND_NS

    return StandIn(real, virtual)


_ZERO_NS = {"time": EPOCH_NS, "monotonic": UPTIME_NS, "perf_counter": UPTIME_NS, "process_time": 0, "thread_time": 0}


def _epoch_s(active: Turns) -> float:
    active.look()
    return (EPOCH_NS + active.now_ns) / SECOND_NS


def _sleep(active: Turns, seconds: float, /) -> None:
    if seconds != seconds:
        raise ValueError("Invalid value NaN (not a number)")
    if seconds < 0:
        raise ValueError("sleep length must be non-negative")
    if seconds == 0:
        active.look()
    else:
        active.wait(None, active.deadline(seconds), "sleep")


def _now_or(position: int, real: Callable[..., Any]) -> StandIn:
    """Functions of `time` with an argument whose default is the present time."""

    def virtual(active: Turns, *args: Any) -> Any:
        if len(args) <= position or args[position] is None:
            present: Any = _epoch_s(active)
            if real.__name__ in ("strftime", "asctime"):
                present = time.localtime(present)
            args = (*args[:position], present)
        return real(*args)

    return StandIn(real, virtual)


def _gettime_ns(active: Turns, clock: int) -> int:
    active.look()
    return active.now_ns + (EPOCH_NS if clock == time.CLOCK_REALTIME else UPTIME_NS)


class _DateMeta(type):
    """Makes real dates instances of the stand-in of their class; a host's own subclasses are unchanged."""

    def __instancecheck__(cls, value: object) -> bool:
        return isinstance(value, _REAL_DATES[cls]) if cls in _REAL_DATES else type.__instancecheck__(cls, value)

    def __subclasscheck__(cls, other: type) -> bool:
        return issubclass(other, _REAL_DATES[cls]) if cls in _REAL_DATES else type.__subclasscheck__(cls, other)


class VirtualDate(datetime.date, metaclass=_DateMeta):
    @classmethod
    def today(cls) -> Any:
        active = here()
        return super().today() if active is None else cls.fromtimestamp(_epoch_s(active))

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}" if type(self) is VirtualDate else super().__repr__()


class VirtualDatetime(datetime.datetime, metaclass=_DateMeta):
    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        active = here()
        return super().now(tz) if active is None else cls.fromtimestamp(_epoch_s(active), tz)

    @classmethod
    def utcnow(cls) -> Any:
        return cls.now(datetime.UTC).replace(tzinfo=None)

    @classmethod
    def today(cls) -> Any:
        return cls.now()

    def date(self) -> Any:
        return VirtualDate(self.year, self.month, self.day)

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}" if type(self) is VirtualDatetime else super().__repr__()


_REAL_DATES: dict[type, type] = {VirtualDate: datetime.date, VirtualDatetime: datetime.datetime}
for _stand, _name in ((VirtualDate, "date"), (VirtualDatetime, "datetime")):
    _stand.__name__ = _stand.__qualname__ = _name
    _stand.__module__ = "datetime"


def stand_ins() -> list[tuple[Any, Any]]:
    pairs: list[tuple[Any, Any]] = [(time.sleep, StandIn(time.sleep, _sleep))]
    for name, zero_ns in _ZERO_NS.items():
        for suffix in ("", "_ns"):
            if (real := getattr(time, name + suffix, None)) is not None:
                pairs.append((real, _clock(real, zero_ns, bool(suffix))))
    pairs += [(real, _now_or(0, real)) for real in (time.localtime, time.gmtime, time.ctime, time.asctime)]
    pairs.append((time.strftime, _now_or(1, time.strftime)))
    if hasattr(time, "clock_gettime"):
        in_s = StandIn(time.clock_gettime, lambda active, clock: _gettime_ns(active, clock) / SECOND_NS)
        pairs += [(time.clock_gettime, in_s), (time.clock_gettime_ns, StandIn(time.clock_gettime_ns, _gettime_ns))]
    return pairs
