"""Ideal drives: every axis is at its counter, and has current while the stages are on."""

from __future__ import annotations

from typing import Protocol


class _Desk(Protocol):
    outputs: dict[str, int]

    @property
    def counts(self) -> tuple[int, ...]: ...


class IdealDrives:
    """Implements `isel_twin.controller.Drives`."""

    def __init__(self, desk: _Desk) -> None:
        self._desk = desk
        self._axes = len(desk.counts)

    @property
    def encoder(self) -> tuple[int, ...]:
        return self._desk.counts

    @property
    def lag(self) -> tuple[float, ...]:
        return (0.0,) * self._axes

    speed = lag

    spindle_rev_min: float | None = None  # a test may set it

    @property
    def past_zero_pulse(self) -> tuple[int, ...]:
        return (0,) * self._axes

    @property
    def on(self) -> tuple[bool, ...]:
        return (bool(self._desk.outputs.get("stages")),) * self._axes

    @property
    def fault(self) -> tuple[bool, ...]:
        return (False,) * self._axes

    overloaded = fault

    @property
    def in_position(self) -> tuple[bool, ...]:
        return (True,) * self._axes
