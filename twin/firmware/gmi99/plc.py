"""The border between the card and its PLC, and the PLC of a card that has no program.

The card asks for this and no more; the flags both look at are in images.py. A PLC works on copies: at the beginning of
a pass it reads `Images.inputs`, `flags` and `data`, at its end it writes outputs (`set_output_byte`) and flags
(`write_flags`), so that all effects of a pass become visible at its end. The card looks at the flags after `advance`.
"""

from __future__ import annotations

from typing import Protocol

__all__ = ["NoPlc", "Plc"]


class Plc(Protocol):
    """What the card asks of its PLC."""

    @property
    def running(self) -> bool:
        """A program is being carried out."""

    @property
    def stored(self) -> bool:
        """There is a program that can be started."""

    @property
    def load_error(self) -> bool:
        """The last download was no program (bit 0 of the memory status)."""

    @property
    def next_ns(self) -> int | None:
        """End of the present pass; None while it does not run."""

    def power_on(self, t_ns: int, image: bytes) -> None:
        """Mains on; a program there is starts by itself. `image`: as `end_load` gave it, empty for none."""

    def start(self, t_ns: int) -> None:
        """p1;1."""

    def stop(self, t_ns: int) -> None:
        """p1;2: at the end of the pass, outputs to 0."""

    def advance(self, t_ns: int) -> None:
        """Let time pass to t_ns, never beyond `next_ns`."""

    def begin_load(self) -> None:
        """p1;100."""

    def load(self, offset: int, data: bytes) -> None:
        """`a`: a part of the image."""

    def end_load(self) -> bytes | None:
        """p1;101: the image to be kept, None if it is no program."""

    def entry(self, block: int) -> int | None:
        """Where block OB `block` begins in the image; None if there is none."""

    def code(self, offset: int, count: int) -> bytes:
        """Bytes of the image from there on, empty beyond its end."""


class NoPlc:
    """Implements `Plc` for a card whose PLC cannot run: it takes downloads and keeps none."""

    running = False
    stored = False
    next_ns: int | None = None

    def __init__(self) -> None:
        self.load_error = False

    def power_on(self, t_ns: int, image: bytes) -> None:
        """Nothing runs."""

    def start(self, t_ns: int) -> None:
        """There is nothing to start."""

    def stop(self, t_ns: int) -> None:
        """There is nothing to stop."""

    def advance(self, t_ns: int) -> None:
        """Nothing happens."""

    def begin_load(self) -> None:
        """What comes is not kept."""

    def load(self, offset: int, data: bytes) -> None:
        """It is not kept."""

    def end_load(self) -> bytes | None:
        """No program."""
        self.load_error = True
        return None

    def entry(self, block: int) -> int | None:
        """There is no block."""
        return None

    def code(self, offset: int, count: int) -> bytes:
        """There is no image."""
        return b""
