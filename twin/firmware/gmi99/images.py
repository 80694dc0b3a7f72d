"""Process images, flags, data words, registers of the card (6, 6.1.1, 6.2).

    E 48 bytes   inputs       M 256 bytes   flags; MB0..19 couple card and PLC, MB30.. are free
    A 48 bytes   outputs      D 256 bytes   data words DW0..127; DW0..39 are the registers R00..19, DW0..79 are kept

    no I/O cards                    E, A: drives 0..23
    I/O cards, mode 0 (default)     E, A: cards 0..23, drives 24..47
    I/O cards, mode 1 (FB 254.2)    E, A: drives 0..23, cards 24..47

In a group of 24 bytes the first 12 are digital, with bytes 2i and 2i + 1 for slot i, the others analog.

Words have their low byte first: MWn = MBn + 256 MB(n+1), in all areas (gmi99/9). Registers: 32 bits, at byte 4i of D.

Who may change a flag
---------------------
FIRMWARE_OWNS are the flag bits of the firmware; host (`p11`) and PLC may change the others, the PLC some of them only
in one direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

GROUP = 24
DIGITAL = 12
STATIC_BYTES = 160  # DW0..79 are non-volatile (3.1.1 d)
REGISTERS = 20

# Flags that couple card and PLC, as (byte, bit) (6.1.1).
STOP = 0, 0
BREAK_OFF = 0, 1
PROGRAM_RUNS = 0, 2
INDEXER_RUNS = 0, 3
NO_ESTOP = 0, 4
NOT_READY = 0, 7
PROGRAM_ENDED = 1, 0
I2T = 1, 1
READY = 1, 2
SYNCHRONISATION = 1, 3
PROGRAM_NUMBER = 2  # a byte number, like those below
REPORT_AGAIN = 3, 1
ANALOG = 3, 2
STOP_SUPPRESSED = 3, 3
FROZEN = 3, 4
WAITS_FOR_POSITION = 3, 5
REDUCED = 3, 6
MESSAGE = 4
FIRST_M = 6
M_EXTENSION = 11
KEY = 13  # of the host, written by `p11`
SPINDLE = 15
SPINDLE_SPEED = 16
TOOL = 18
TOOL_MEMORY = 19

# bits of a flag byte that neither host nor PLC changes: reserved ones, and those marked r in 6.1.1
FIRMWARE_OWNS: Mapping[int, int] = {0: 0b1111_1000, 1: 0b0001_0111, 3: 0b0011_0001, TOOL_MEMORY: 0xFF}
# bits that the PLC may only reset (marked 0 in 6.1.1), or only read while the host writes them
PLC_MAY_NOT_SET: Mapping[int, int] = {3: 0b0000_0010, KEY: 0xFF}
# bits that the PLC may only set (marked 1 in 6.1.1), or only read
PLC_MAY_NOT_RESET: Mapping[int, int] = {0: 0b0000_0010, KEY: 0xFF}


class Images:
    """The images. `changed(byte, bits)` is called for every output byte that changes: index in A, new value."""

    def __init__(self, changed: Callable[[int, int], None]) -> None:
        self.inputs = bytearray(2 * GROUP)
        self.outputs = bytearray(2 * GROUP)
        self.flags = bytearray(256)
        self.data = bytearray(256)
        self.drives_at = 0  # where the drives' bytes begin in E and A
        self._changed = changed

    def word(self, area: bytes | bytearray, byte: int) -> bytes:
        """Two bytes from there on, low byte first; 0 beyond the end."""
        return bytes(area[byte : byte + 2]).ljust(2, b"\0")

    def flag(self, place: tuple[int, int]) -> bool:
        byte, bit = place
        return bool(self.flags[byte] >> bit & 1)

    def set_flag(self, place: tuple[int, int], on: bool) -> None:
        byte, bit = place
        self.flags[byte] = self.flags[byte] & ~(1 << bit) | (on << bit)

    def arrange(self, *, cards: bool, mode: int) -> None:
        """Put the drives into the first or second group, with their inputs; outputs follow the image there."""
        at = GROUP if cards and mode == 0 else 0
        if at != self.drives_at:
            self.inputs[:] = self.inputs[GROUP:] + self.inputs[:GROUP]
            self.drives_at = at
            for byte in range(at, at + DIGITAL):
                self._changed(byte, self.outputs[byte])

    def set_drive_input(self, byte: int, bit: int, level: bool) -> None:
        """A level at an input of a drive: byte and bit within the drives' group."""
        at = self.drives_at + byte
        self.inputs[at] = self.inputs[at] & ~(1 << bit) | (level << bit)

    def set_output_byte(self, byte: int, value: int) -> None:
        if self.outputs[byte] != value:
            self.outputs[byte] = value
            self._changed(byte, value)

    def set_output_bit(self, number: int, on: bool) -> None:
        byte, bit = number >> 3, number & 7
        self.set_output_byte(byte, self.outputs[byte] & ~(1 << bit) | (on << bit))

    def clear_outputs(self) -> None:
        """All digital outputs off."""
        for first in (0, GROUP):
            for byte in range(first, first + DIGITAL):
                self.set_output_byte(byte, 0)

    def write_flag_byte(self, byte: int, value: int) -> None:
        """The host writes a flag byte; bits of the firmware keep their value."""
        kept = FIRMWARE_OWNS.get(byte, 0)
        self.flags[byte] = self.flags[byte] & kept | value & ~kept & 0xFF

    def set_register(self, number: int, value: int) -> None:
        """Register R00..19: a signed number in 32 bits."""
        self.data[4 * number : 4 * number + 4] = value.to_bytes(4, "little", signed=True)

    def set_data_word(self, byte: int, value: int) -> None:
        self.data[byte : byte + 2] = value.to_bytes(2, "little")

    @property
    def static(self) -> bytes:
        return bytes(self.data[:STATIC_BYTES])
