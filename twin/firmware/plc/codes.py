"""The instructions: text, code and a short explanation of each.

An instruction is one word of two bytes, B0 B1; a constant has a second word, high byte first. One table serves
assembler, disassembler, explanation and processor:

    FORM      U M 6.0  =  mnemonic "U", operand area "M", byte 6, bit 0   <-->   80h + bit, byte
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal

WORD_BYTES: Final = 2

# kinds of operands: none, byte.bit, one number of 0 to 255, a second word, a distance in words, a block's number
Operand = Literal["", "bit", "number", "constant", "jump", "block"]


@dataclass(frozen=True, slots=True)
class Form:
    """One way to write an instruction.

    area: the letters before the number, "M", "EB", "KH"; "" for none. base: B0, for bits that of bit 0; second: fixed
    B1, or an offset of the number there (80h: outputs). lowest, highest: of the number.
    """

    mnemonic: str
    area: str
    operand: Operand
    base: int
    words: str
    second: int = 0
    lowest: int = 0
    highest: int = 255

    @property
    def written(self) -> str:
        """The form for people: "U M byte.bit"."""
        tail = {"": "", "bit": " byte.bit", "number": " n", "constant": " value", "jump": " =LABEL", "block": " n"}
        return f"{self.mnemonic}{' ' if self.area else ''}{self.area}{tail[self.operand]}"


@dataclass(frozen=True, slots=True)
class Instruction:
    """A form with its operand: number (byte, number, distance, block, or the second word), and bit."""

    form: Form
    number: int = 0
    bit: int = 0

    @property
    def words(self) -> int:
        return 2 if self.form.operand == "constant" else 1

    @property
    def words_explained(self) -> str:
        at = f"{self.number}.{self.bit}" if self.form.operand == "bit" else str(self.number)
        return self.form.words.replace("#", at)


# the last byte of inputs, outputs and flags, the last data word
LAST_BYTE: Final[Mapping[str, int]] = {"E": 47, "A": 47, "M": 255, "D": 127}
LAST_ELEMENT: Final = 31  # the last timer, the last counter
# kinds of blocks and their codes in an image
BLOCK_TYPES: Final[Mapping[str, int]] = {"OB": 1, "PB": 2, "FB": 3, "SB": 4}

# mnemonic, B0 for flags, B0 for inputs and outputs, words
_BITS: Final = (
    ("U", 0x80, 0xC0, "and # is on"),
    ("O", 0x88, 0xC8, "or # is on"),
    ("S", 0x90, 0xD0, "if so: # on"),
    ("=", 0x98, 0xD8, "# becomes the result"),
    ("UN", 0xA0, 0xE0, "and # is off"),
    ("ON", 0xA8, 0xE8, "or # is off"),
    ("R", 0xB0, 0xF0, "if so: # off"),
)
_AREAS: Final[Mapping[str, str]] = {"E": "input", "A": "output", "M": "flag", "T": "timer", "Z": "counter"}

# B0 of SPA and SPB by kind of block
CALLS: Final[Mapping[str, tuple[int, int]]] = {
    "OB": (0x6D, 0x4D), "PB": (0x75, 0x55), "FB": (0x3D, 0x1D), "SB": (0x7D, 0x5D),
}  # fmt: skip

JUMPS: Final[Mapping[str, tuple[int, str]]] = {
    "SPA": (0x2D, "jump"),
    "SPB": (0xFA, "if so: jump"),
    "SPZ": (0x45, "if zero: jump"),
    "SPN": (0x35, "if not zero: jump"),
    "SPP": (0x15, "if more than zero: jump"),
    "SPM": (0x25, "if less than zero: jump"),
}
ENDS: Final = ("BE", "BEA")


def _forms() -> Iterator[Form]:
    for mnemonic, flags, images, words in _BITS:
        yield Form(mnemonic, "M", "bit", flags, words.replace("#", "flag #"))
        for area, second in (("E", 0x00), ("A", 0x80)):
            text = words.replace("#", f"{_AREAS[area]} #")
            yield Form(mnemonic, area, "bit", images, text, second, highest=LAST_BYTE[area])
    for area, codes in (("T", (0xF8, 0xF9, 0xFC, 0xFD)), ("Z", (0xB8, 0xB9, 0xBC, 0xBD))):
        for mnemonic, base in zip(("U", "O", "UN", "ON"), codes, strict=True):
            words = f"{'or' if mnemonic[0] == 'O' else 'and'} {_AREAS[area]} # is {'off' if 'N' in mnemonic else 'on'}"
            yield Form(mnemonic, area, "number", base, words, highest=LAST_ELEMENT)
    for mnemonic, base, words in (
        ("U(", 0xBA, "and what follows up to the bracket"),
        ("O(", 0xBB, "or what follows up to the bracket"),
        (")", 0xBF, "end of the bracket"),
        ("O", 0xFB, "or what follows"),
    ):
        yield Form(mnemonic, "", "", base, words)
    for mnemonic, area, base, words in (
        ("SI", "T", 0x34, "start timer # as a pulse"),
        ("SV", "T", 0x1C, "start timer # as an extended pulse"),
        ("SE", "T", 0x24, "start timer # as an on-delay"),
        ("SS", "T", 0x2C, "start timer # as a stored on-delay"),
        ("SA", "T", 0x14, "start timer # as an off-delay"),
        ("R", "T", 0x3C, "if so: reset timer #"),
        ("ZV", "Z", 0x6C, "count counter # up"),
        ("ZR", "Z", 0x54, "count counter # down"),
        ("S", "Z", 0x5C, "set counter #"),
        ("R", "Z", 0x7C, "if so: reset counter #"),
        ("L", "T", 0x02, "load what is left of timer #"),
        ("L", "Z", 0x42, "load counter #"),
    ):
        yield Form(mnemonic, area, "number", base, words, highest=LAST_ELEMENT)
    yield Form("L", "KB", "number", 0x28, "load #")
    for mnemonic, verb, images, image_words in (("L", "load", 0x4A, 0x52), ("T", "store into", 0x4B, 0x53)):
        off = mnemonic == "T"
        for area, second in (("E", 0x00), ("A", 0x80)):
            name, last = _AREAS[area], LAST_BYTE[area]
            yield Form(mnemonic, f"{area}B", "number", images, f"{verb} {name} byte #", second, highest=last)
            yield Form(mnemonic, f"{area}W", "number", image_words, f"{verb} {name} word #", second, highest=last - 1)
        yield Form(mnemonic, "MB", "number", 0x0A + off, f"{verb} flag byte #")
        yield Form(mnemonic, "MW", "number", 0x12 + off, f"{verb} flag word #", highest=LAST_BYTE["M"] - 1)
        yield Form(mnemonic, "DW", "number", 0x32 + off, f"{verb} data word #", highest=LAST_BYTE["D"])
        yield Form(mnemonic, "DL", "number", 0x22 + off, f"{verb} high byte of data word #", highest=LAST_BYTE["D"])
        yield Form(mnemonic, "DR", "number", 0x2A + off, f"{verb} low byte of data word #", highest=LAST_BYTE["D"])
    for area, second in (("KH", 0x40), ("KF", 0x04), ("KM", 0x80), ("KY", 0x20), ("KT", 0x02), ("KZ", 0x01)):
        yield Form("L", area, "constant", 0x30, "load #", second, highest=0xFFFF)
    for mnemonic, second, words in (
        ("!=F", 0x80, "equal?"),
        ("><F", 0x60, "not equal?"),
        (">F", 0x20, "accumulator 2 greater?"),
        (">=F", 0xA0, "accumulator 2 greater or equal?"),
        ("<F", 0x40, "accumulator 2 less?"),
        ("<=F", 0xC0, "accumulator 2 less or equal?"),
    ):
        yield Form(mnemonic, "", "", 0x21, words, second)
    for mnemonic, base, second, words in (
        ("+F", 0x79, 0, "add"),
        ("-F", 0x59, 0, "accumulator 2 less accumulator 1"),
        ("UW", 0x41, 0, "and, word by word"),
        ("OW", 0x49, 0, "or, word by word"),
        ("XOW", 0x51, 0, "exclusive or, word by word"),
        ("KEW", 0x01, 0, "one's complement"),
        ("KZW", 0x09, 0, "two's complement"),
        ("TAK", 0x70, 2, "exchange the accumulators"),
        ("STP", 0x70, 3, "stop the PLC"),
        ("BE", 0x65, 0, "end of the block"),
        ("BEA", 0x65, 1, "leave the block"),
        ("BEB", 0x05, 0, "if so: leave the block"),
        ("NOP0", 0x00, 0, "nothing"),
        ("NOP1", 0xFF, 0xFF, "nothing"),
    ):
        yield Form(mnemonic, "", "", base, words, second)
    yield Form("I", "", "number", 0x11, "low byte plus #")
    yield Form("D", "", "number", 0x19, "low byte less #")
    yield Form("SLW", "", "number", 0x61, "shift left by #", highest=15)
    yield Form("SRW", "", "number", 0x69, "shift right by #", highest=15)
    for mnemonic, (base, words) in JUMPS.items():
        yield Form(mnemonic, "", "jump", base, f"{words} by # words", lowest=-128, highest=127)
    for kind, (always, conditional) in CALLS.items():
        yield Form("SPA", kind, "block", always, f"call {kind} #")
        yield Form("SPB", kind, "block", conditional, f"if so: call {kind} #")
    yield Form("A", "DB", "block", 0x20, "data block #: there is one only")


# all forms by mnemonic and area. Jumps have none: `("SPA", "")`.
FORMS: Final[Mapping[tuple[str, str], Form]] = {(form.mnemonic, form.area): form for form in _forms()}


def encode(instruction: Instruction) -> bytes:
    """The machine code, 2 or 4 bytes. The operand is within the form's limits."""
    form, number = instruction.form, instruction.number
    match form.operand:
        case "bit":
            return bytes((form.base + instruction.bit, form.second + number))
        case "constant":
            return bytes((form.base, form.second, number >> 8, number & 0xFF))
        case "":
            return bytes((form.base, form.second))
    return bytes((form.base, (form.second + number) & 0xFF))


def decode(code: bytes, offset: int = 0) -> Instruction | None:
    """The instruction at an offset; None if there is none with that code, or its second word is missing."""
    if offset + WORD_BYTES > len(code):
        return None
    base, second = code[offset], code[offset + 1]
    for form in _BY_BASE.get(base, ()):
        match form.operand:
            case "":
                if second == form.second:
                    return Instruction(form)
            case "constant":
                if second == form.second and offset + 2 * WORD_BYTES <= len(code):
                    return Instruction(form, code[offset + 2] << 8 | code[offset + 3])
            case "jump":
                return Instruction(form, second - 256 if second > 127 else second)
            case _:
                number = second - form.second
                if form.lowest <= number <= form.highest:
                    return Instruction(form, number, base - form.base)
    return None


_BY_BASE: Final[dict[int, list[Form]]] = {}  # the forms that begin with a B0
for _form in FORMS.values():
    for _base in range(_form.base, _form.base + (8 if _form.operand == "bit" else 1)):
        _BY_BASE.setdefault(_base, []).append(_form)
