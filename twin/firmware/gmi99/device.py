"""The card: its state (board.py) and the parts that work on it."""

from __future__ import annotations

from collections.abc import Mapping

from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.commands import parse
from isel_twin.firmware.gmi99.drives import DriveBank
from isel_twin.firmware.gmi99.images import DIGITAL, STATIC_BYTES
from isel_twin.firmware.gmi99.logic import CardPlc
from isel_twin.firmware.gmi99.path import Path
from isel_twin.firmware.gmi99.queue import Queue

OUTPUT_NAMES = tuple(f"a{byte}.{bit}" for byte in range(DIGITAL) for bit in range(8))
"""Outputs of the drives, two bytes a slot."""


class Card(Board):
    """See the module."""

    drives: DriveBank
    path: Path
    queue: Queue

    def __init__(self, flash: bytes | None, override_pot_percent: int, turn: int, plc: bytes) -> None:
        """`flash`: None for a new card, which then has the PLC program `plc`."""
        super().__init__(flash, override_pot_percent, plc)
        self.drives = DriveBank(self, turn)
        self.path = Path(self)
        self.queue = Queue(self)
        self.plc = CardPlc(self)
        self.store.restore(parse)

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        """Mains on."""
        self.now_ns = self.power_on_ns = t_ns
        self.images.data[:STATIC_BYTES] = bytes.fromhex(self.stored.data).ljust(STATIC_BYTES, b"\0")
        self.parameters_changed()
        self.output("flash_fault", int(self.flash_fault))
        self.output("stages", 0)
        self.output("brake", 0)
        self.output("spindle", 0)
        self.output("hood_release", 1)
        for terminal in ("slot0.estop", "slot0.power"):  # not wired: nothing speaks against it
            self.drives.set_input(terminal, True)
        for terminal in sorted(levels):
            self.drives.set_input(terminal, levels[terminal])
        self.fault = False
        self.refresh_flags()
        self.plc.power_on(t_ns, bytes.fromhex(self.stored.plc))
