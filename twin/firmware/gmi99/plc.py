"""The border between the card and its PLC: what the card asks of it.

The flags both look at are in images.py. A PLC works on copies, from the beginning of a pass to its end, where all its
effects become visible. The card looks at the flags after `advance`.
"""

from __future__ import annotations

from typing import Protocol


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
        """End of the next pass that may differ from the one before; None while it does not run, or nothing changes."""

    def power_on(self, t_ns: int, image: bytes) -> None:
        """Mains on; a program there is starts by itself. `image`: as `end_load` gave it, empty for none."""

    def start(self, t_ns: int) -> None:
        """p1;1."""

    def stop(self, t_ns: int) -> None:
        """p1;2: at the end of the pass, outputs to 0."""

    def look(self, t_ns: int) -> None:
        """Something has happened: inputs, flags or data may have changed."""

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
