"""The card: its state (board.py), its parts, abort, and status."""

from __future__ import annotations

from collections.abc import Mapping

from isel_twin.firmware.gmi99 import images
from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.drives import DriveBank
from isel_twin.firmware.gmi99.images import DIGITAL, STATIC_BYTES
from isel_twin.firmware.gmi99.interpolator import Interpolator
from isel_twin.firmware.gmi99.logic import CardPlc
from isel_twin.firmware.gmi99.queue import Queue
from isel_twin.firmware.gmi99.settings import SLOTS, Stored
from isel_twin.firmware.gmi99.store import DEPTH
from isel_twin.firmware.gmi99.uncoupled import Uncoupled

# outputs of the drives, two bytes a slot
OUTPUT_NAMES = tuple(f"a{byte}.{bit}" for byte in range(DIGITAL) for bit in range(8))


class Card(Board):
    def __init__(self, flash: bytes | None, override_pot_percent: int, turn: int, new: Stored) -> None:
        """`flash`: None for a new card, in whose memories is `new`."""
        super().__init__(flash, override_pot_percent, new)
        self.queue = Queue(self)
        self.interpolator = Interpolator(self)
        self.off_path = Uncoupled(self, self.interpolator)
        self.drives = DriveBank(self, self.interpolator, self.off_path, self.queue, turn)
        self.plc = CardPlc(self, self.interpolator, self.off_path, self.drives, self.queue)
        self._moving_told = False

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self.now_ns = self.power_on_ns = t_ns
        self.images.data[:STATIC_BYTES] = bytes.fromhex(self.stored.data).ljust(STATIC_BYTES, b"\0")
        self.parameters_changed()
        self.output("flash_fault", int(self.flash_fault))
        self.output("stages", 0)
        self.output("brake", 0)
        self.output("spindle", 0)
        self.output("hood_release", 1)
        for terminal in ("slot0.estop", "slot0.power"):  # not wired: counts as good
            self.drives.set_input(terminal, True)
        for terminal in sorted(levels):
            self.drives.set_input(terminal, levels[terminal])
        self.refused = ""
        self.refresh_flags()
        self.plc.power_on(t_ns, bytes.fromhex(self.stored.plc))

    def parameters_changed(self) -> None:
        """Apply changed N parameters."""
        self.arrange_images()
        self.interpolator.speeds_changed()

    def abort(self) -> None:
        """#0, M0.1: brake and drop everything."""
        self.queue.drop()
        self.interpolator.break_off()
        self.off_path.break_off()
        self.drives.brake()

    def call(self, number: int) -> None:
        """p3;1: start a program, or go on with it as a subprogram."""
        commands, depth = self.store.program(number), self.queue.depth
        if not depth:
            self.images.flags[images.PROGRAM_NUMBER] = number
        if not commands:
            self.store.error = True
            self.refuse(f"program {number} is empty")
        elif depth > DEPTH:
            self.store.error = True
            self.refuse(f"program {number} is called {DEPTH + 1} deep")
            self.abort()
        else:
            self.queue.enter(commands)

    def flags_changed(self, *, program_ran: bool) -> None:
        """Take flags written by host or PLC; `program_ran`: M0.2 before."""
        flags = self.images
        if flags.flag(images.BREAK_OFF):
            flags.set_flag(images.BREAK_OFF, False)
            self.abort()
        if flags.flag(images.PROGRAM_RUNS) and not program_ran and not self.in_program:
            flags.set_flag(images.PROGRAM_RUNS, False)
            self.call(flags.flags[images.PROGRAM_NUMBER])
        flags.set_flag(images.PROGRAM_RUNS, self.in_program)
        if flags.flag(images.ANALOG):
            self.put_analog_outputs()
        self.interpolator.speeds_changed()

    @property
    def fault_cause(self) -> str:
        """The last failure, or what has taken readiness and still does; "" if there is neither."""
        return self.refused or ("E-stop" if self.drives.estop else self.drives.lost_by)

    @property
    def in_program(self) -> bool:
        return self.queue.depth > 0

    @property
    def busy(self) -> bool:
        """True while a command or program is in execution."""
        return self.queue.busy or not self.interpolator.at_rest or not self.drives.at_rest

    @property
    def information(self) -> int:
        """Information character without the message (3.2)."""
        return self.drives.estop << 3 | self.moving << 4 | (not self.drives.ready) << 6 | self.busy << 7

    @property
    def memory_status(self) -> int:
        """T3;4."""
        bad = self.flash_fault
        return (self.plc.load_error or bad) | (not self.plc.running) << 1 | (self.store.error or bad) << 4 | bad << 5

    @property
    def safety_status(self) -> int:
        """T3;8."""
        stop = self.images.flag(images.STOP)
        blocked = any(self.drives.blocked(slot) for slot in range(SLOTS) if self.settings.axis_mask >> slot & 1)
        return self.reduced | blocked << 1 | stop << 2 | self.enable_missing << 3

    def refresh_flags(self) -> None:
        """Update the flags of the firmware and the output `moving`."""
        if self.moving != self._moving_told:
            self._moving_told = self.moving
            self.output("moving", int(self.moving))
        set_flag = self.images.set_flag
        set_flag(images.INDEXER_RUNS, self.path_run is not None)
        set_flag(images.NO_ESTOP, not self.drives.estop)
        set_flag(images.NOT_READY, not self.drives.ready)
        set_flag(images.READY, not self.busy)
        set_flag(images.FROZEN, bool(self.settings.motion_off))

    def ask_drives(self) -> None:
        """Update the flag I2T from the drives, before it is read."""
        self.images.set_flag(images.I2T, any(map(self.drives.is_overloaded, range(SLOTS))))
