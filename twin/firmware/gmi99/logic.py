"""The card's PLC: programs run by twin/firmware/plc on the card's images and flags, with the block FB 254.

    images.py   E A M D   <---- pass by pass ---->   isel_twin.firmware.plc.Plc
                                                         |
    card: positions, status, corrections, speeds  <---  FB 254: accumulator 1 is the function, 2 its argument

A pass works on copies. It takes 45 us an instruction, rounded up to the 4 ms grid (gmi99/31); its effects come at its
end, when the card reads the flags. FB 254 acts when called; functions that the manual names but does not describe have
no effect (gmi99/32).
"""

from __future__ import annotations

from functools import cache
from importlib import resources

from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.drives import DriveBank
from isel_twin.firmware.gmi99.images import ANALOG, FIRMWARE_OWNS, PLC_MAY_NOT_RESET, PLC_MAY_NOT_SET, Images
from isel_twin.firmware.gmi99.interpolator import Interpolator
from isel_twin.firmware.gmi99.offsets import PLC_ZERO_LIMIT
from isel_twin.firmware.gmi99.planner import PERIOD_NS
from isel_twin.firmware.gmi99.queue import Queue
from isel_twin.firmware.gmi99.settings import FINE, SLOTS, Stored
from isel_twin.firmware.gmi99.uncoupled import Uncoupled
from isel_twin.firmware.plc import ImageError, Plc, PlcMemory, PlcProgram, Rights
from isel_twin.firmware.plc.assembler import assemble

SAFETY = "safety.awl"  # program text that a new card may have, in this folder
HIGHEST_SPEED = 40  # its data word
LONGEST_IMAGE = 0xFFFF
DEVICE = 0x5B
READ = 0x8000
ALL = 0xFFFF
INVALID_STATUS = 0x0100
EXTENDED = 254
FUNCTIONS = 2, 3, 4, 5, 6, 8, 10, 12, 30, 33


@cache
def new_card(spindle_rev_min: int) -> Stored:
    """Memories of a card with the safety program (gmi99/33). spindle_rev_min: at 10 V of the analog output, 0: none."""
    program = assemble(resources.files(__package__).joinpath(SAFETY).read_text(encoding="utf-8"))
    words = bytes(2 * HIGHEST_SPEED) + spindle_rev_min.to_bytes(2, "little")
    return Stored(plc=program.image.hex(), data=words.rstrip(b"\0").hex())


def _rights() -> Rights:
    """Rights of a program to the flags (6.1.1)."""
    free = [0xFF & ~FIRMWARE_OWNS.get(byte, 0) for byte in range(256)]
    return Rights(
        bytes(mask & ~PLC_MAY_NOT_SET.get(byte, 0) for byte, mask in enumerate(free)),
        bytes(mask & ~PLC_MAY_NOT_RESET.get(byte, 0) for byte, mask in enumerate(free)),
    )


class CardPlc:
    def __init__(
        self, board: Board, interpolator: Interpolator, uncoupled: Uncoupled, drives: DriveBank, queue: Queue
    ) -> None:
        self.board, self.interpolator, self.drives, self.queue = board, interpolator, drives, queue
        self.uncoupled = uncoupled
        images = board.images
        self._outputs = bytearray(images.outputs)
        self._memory = PlcMemory(images.inputs, self._outputs, images.flags, images.data)
        self._plc = Plc(_rights(), {EXTENDED: self._extended}, PERIOD_NS)
        self._download = bytearray()
        self._seen = b""
        self.load_error = False
        """The last download was no program (bit 0 of the memory status)."""

    @property
    def running(self) -> bool:
        """True while a program runs."""
        return self._plc.running

    @property
    def next_ns(self) -> int | None:
        """End of the next pass that may differ from the one before; None if it does not run or nothing changes."""
        return self._plc.next_ns

    @property
    def inputs(self) -> bytes | bytearray:
        """The image of the inputs: of the present pass; while no program runs, as they are (gmi99/31)."""
        return self._plc.inputs or self.board.images.inputs

    def power_on(self, t_ns: int, image: bytes) -> None:
        """Mains on; a stored program starts by itself. `image`: from `end_load`, empty for none."""
        if not image:
            return
        try:
            self._plc.load(image)
        except ImageError as error:
            self._failed(str(error))
            return
        self._begin(t_ns, power_on=True)

    def start(self, t_ns: int) -> None:
        """p1;1."""
        if not self._plc.running:
            self._begin(t_ns, power_on=False)

    def stop(self, t_ns: int) -> None:
        """p1;2: at the end of the pass, outputs to 0."""
        if self._plc.running:
            self._plc.stop_at_end(t_ns)

    def look(self, t_ns: int) -> None:
        """Take changes of inputs, flags or data."""
        seen = _bytes(self.board.images)
        if self._plc.running and seen != self._seen:
            self._plc.touch(t_ns)
        self._seen = seen

    def advance(self, t_ns: int) -> None:
        """Let time pass to t_ns, never beyond `next_ns`."""
        images = self.board.images
        self._outputs[:] = images.outputs
        self._plc.end_pass(t_ns, self._memory)
        for byte, value in enumerate(self._outputs):
            images.set_output_byte(byte, value)
        if self._plc.running:
            self._outputs[:] = images.outputs
            self._plc.begin_pass(t_ns, self._memory)
        else:
            images.clear_outputs()
            if self._plc.stopped_by:
                self.board.refuse(f"the PLC has stopped: {self._plc.stopped_by}")
        if self.board.analog_drives or images.flag(ANALOG):
            self.board.put_analog_outputs()
        self._seen = _bytes(images)
        self.board.keep_data()

    def begin_load(self) -> None:
        """p1;100."""
        self._plc.clear()
        self.board.images.clear_outputs()
        self._download.clear()

    def load(self, offset: int, data: bytes) -> None:
        """`a`: a part of the image."""
        if offset + len(data) > LONGEST_IMAGE:
            self._failed(f"an image of more than {LONGEST_IMAGE} bytes")
            return
        self._download.extend(bytes(max(0, offset + len(data) - len(self._download))))
        self._download[offset : offset + len(data)] = data

    def end_load(self) -> bytes | None:
        """p1;101: the image to be kept, None if it is no program."""
        try:
            self._plc.load(bytes(self._download))
        except ImageError as error:
            self._failed(str(error))
            return None
        self.load_error = False
        return self._plc.image

    def entry(self, block: int) -> int | None:
        """Where block OB `block` begins in the image; None if there is none."""
        program: PlcProgram | None = self._plc.program
        return None if program is None else program.entries.get(("OB", block))

    def code(self, offset: int, count: int) -> bytes:
        """Bytes of the image from there on, empty beyond its end."""
        part = self._plc.image[offset : offset + count]
        return part.ljust(count, b"\0") if part else b""

    def _begin(self, t_ns: int, *, power_on: bool) -> None:
        self._outputs[:] = self.board.images.outputs
        self._plc.start(t_ns, self._memory, power_on)
        self._seen = _bytes(self.board.images)

    def _failed(self, why: str) -> None:
        self.load_error = True
        self.board.refuse(f"no PLC program: {why}")

    def _extended(self, number: int, argument: int, memory: PlcMemory) -> tuple[int, int]:
        """FB 254: accumulators 1 and 2 afterwards (6.1.3)."""
        axis = number - 0x110
        if 0 <= axis < SLOTS:
            return self._plc_zero(axis, argument), argument
        if number not in FUNCTIONS:
            return number, argument
        result = self._function(number, argument)
        memory.e[:] = self.board.images.inputs  # function 2 may have moved them
        return result

    def _function(self, number: int, argument: int) -> tuple[int, int]:
        board = self.board
        match number:
            case 2:
                if argument in (0, 1):
                    board.image_mode = argument
                    board.arrange_images()
                    self.interpolator.speeds_changed()
            case 3:
                return self.drives.searching, argument
            case 4:
                return DEVICE, board.settings.sgx & ALL
            case 5:
                if argument < FINE:
                    board.offsets.preselected = argument
                return board.offsets.preselected, argument
            case 6:
                return self._state(argument & 0xFF, argument >> 8, argument)
            case 8:
                board.analog_drives = argument >> 4 & 0x0F
            case 10:
                return self.drives.status(argument) if argument < SLOTS else INVALID_STATUS, argument
            case 12:
                if argument >= SLOTS:
                    return 0, argument
                low, high = board.settings.home_from[argument], board.settings.home_to[argument]
                return int(low <= board.position[argument] <= high), argument
            case 30:
                if argument in (0, 1):
                    self.uncoupled.follow_feed(on=argument == 1)
            case 33:
                if argument in (0, 1, 2):
                    board.reduced_mode = argument
        return number, argument

    def _state(self, what: int, axis: int, argument: int) -> tuple[int, int]:
        if what == 3 and axis < SLOTS:
            position = self.board.position[axis]
            return position & ALL, position >> 16 & ALL
        if what == 5:
            return self.board.uncoupled, argument
        return self.queue.block_number & ALL if what == 15 else 6, argument

    def _plc_zero(self, axis: int, argument: int) -> int:
        zeros = self.board.offsets.plc_zero
        value = argument - 0x10000 if argument & 0x8000 else argument
        if argument != READ and abs(value) <= PLC_ZERO_LIMIT:
            zeros[axis] = value
        return zeros[axis] & ALL


def _bytes(images: Images) -> bytes:
    return b"".join((images.inputs, images.outputs, images.flags, images.data))
