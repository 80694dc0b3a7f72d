"""STEP 5 text to a program and back, one instruction a line:

    OB 1                  a block begins
    ; comment
    LOOP: U M 6.0         a label
    SPB =LOOP             a jump to it, within the block
    L KT 050.1            constants: KH hexadecimal, KF -32768..32767, KM 16 bits, KY two bytes, KT n.base, KZ 0..999
    BE                    a block ends

Upper and lower case are the same, blanks do not matter. Every error names its line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from isel_twin.firmware.plc.codes import BLOCK_TYPES, ENDS, FORMS, Form, Instruction, encode
from isel_twin.firmware.plc.elements import MOST, bcd, from_bcd
from isel_twin.firmware.plc.image import ImageError, PlcBlock, PlcProgram
from isel_twin.firmware.plc.processor import instructions_by_word

_BLOCK_WORDS = {"OB": "organisation", "PB": "program", "FB": "function", "SB": "step"}
_LABEL = re.compile(r"([A-Z_][A-Z0-9_]*)\s*:(?!=)\s*(.*)", re.DOTALL)
_MNEMONICS = sorted({mnemonic for mnemonic, _ in FORMS}, key=len, reverse=True)
_AREAS = {m: sorted({a for n, a in FORMS if n == m}, key=len, reverse=True) for m in _MNEMONICS}


class AssemblyError(ValueError):
    """A line that cannot be assembled; `line` is its number from 1, the message the error and what is allowed."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(text)
        self.line = line


@dataclass
class _Open:
    """A block that is being read."""

    kind: str
    number: int
    line: int
    # line, instruction, and the label it jumps to
    items: list[tuple[int, Instruction, str]] = field(default_factory=list)
    labels: dict[str, int] = field(default_factory=dict)  # the word at which each stands
    words: int = 0


def assemble(text: str) -> PlcProgram:
    """The program of a text. Raises AssemblyError."""
    blocks: list[PlcBlock] = []
    block: _Open | None = None
    number = 0
    for number, line in enumerate(text.splitlines(), start=1):
        source = line.split(";", 1)[0].strip().upper()
        if not source:
            continue
        if block is None:
            block = _header(number, source)
            if any((b.kind, b.number) == (block.kind, block.number) for b in blocks):
                raise AssemblyError(number, f"{block.kind} {block.number} is there twice")
            continue
        while match := _LABEL.fullmatch(source):
            if match[1] in block.labels:
                raise AssemblyError(number, f"label {match[1]} is there twice in {block.kind} {block.number}")
            block.labels[match[1]] = block.words
            source = match[2].strip()
        if not source:
            continue
        instruction, label = _instruction(number, source)
        block.items.append((number, instruction, label))
        block.words += instruction.words
        if instruction.form.mnemonic == ENDS[0]:
            blocks.append(_closed(block))
            block = None
    if block is not None:
        raise AssemblyError(number, f"{block.kind} {block.number} of line {block.line} does not end; write BE")
    if not blocks:
        raise AssemblyError(max(number, 1), "no block; a program begins with a line such as OB 1")
    try:
        return PlcProgram.of(blocks)
    except ImageError as error:
        raise AssemblyError(number, str(error)) from None


def _header(line: int, source: str) -> _Open:
    match = re.fullmatch(r"([A-Z]+)\s*(\d{1,3})", source)
    if match is None or match[1] not in BLOCK_TYPES or int(match[2]) > 255:
        kinds = ", ".join(BLOCK_TYPES)
        raise AssemblyError(line, f"{source!r} begins no block; allowed: {kinds} and a number of 0 to 255")
    return _Open(match[1], int(match[2]), line)


def _closed(block: _Open) -> PlcBlock:
    code, word = b"", 0
    for line, instruction, label in block.items:
        if label:
            if label not in block.labels:
                known = f"; there are: {', '.join(sorted(block.labels))}" if block.labels else ""
                raise AssemblyError(line, f"no label {label} in {block.kind} {block.number}{known}")
            distance = block.labels[label] - word
            if not -128 <= distance <= 127:
                raise AssemblyError(line, f"{label} is {distance} words away; a jump reaches -128 to 127")
            instruction = Instruction(instruction.form, distance)
        code += encode(instruction)
        word += instruction.words
    return PlcBlock(block.kind, block.number, code)


def _instruction(line: int, source: str) -> tuple[Instruction, str]:
    compact = re.sub(r"\s+", "", source)
    best = ""
    for mnemonic in _MNEMONICS:
        if not compact.startswith(mnemonic):
            continue
        best = best or mnemonic
        rest = compact[len(mnemonic) :]
        if rest.startswith("=") and (mnemonic, "") in FORMS and FORMS[mnemonic, ""].operand == "jump":
            return Instruction(FORMS[mnemonic, ""]), rest[1:]
        for area in _AREAS[mnemonic]:
            form = FORMS[mnemonic, area]
            if rest.startswith(area) and form.operand != "jump" and _fits(form, rest[len(area) :]):
                return _with_operand(line, source, form, rest[len(area) :]), ""
    if not best:
        raise AssemblyError(line, f"{source!r} is no instruction")
    written = ", ".join(FORMS[best, area].written for area in _AREAS[best])
    raise AssemblyError(line, f"{source!r} is no instruction; allowed: {written}")


def _fits(form: Form, operand: str) -> bool:
    pattern = {"": "", "bit": r"\d+\.\d+", "number": r"-?\d+", "block": r"\d+", "constant": r"H?[-0-9A-F.,]+"}
    return re.fullmatch(pattern[form.operand], operand) is not None


def _with_operand(line: int, source: str, form: Form, operand: str) -> Instruction:
    match form.operand:
        case "":
            return Instruction(form)
        case "bit":
            number, bit = (int(part) for part in operand.split("."))
            if bit > 7:
                raise AssemblyError(line, f"{source!r}: bit {bit}; allowed: 0 to 7")
        case "constant":
            return Instruction(form, _constant(line, source, form.area, operand))
        case _:
            number, bit = int(operand), 0
    if not form.lowest <= number <= form.highest:
        raise AssemblyError(line, f"{source!r}: {number}; allowed: {form.lowest} to {form.highest}")
    return Instruction(form, number, bit)


_CONSTANTS = {
    "KH": (r"[0-9A-F]{1,4}", "1 to 4 hexadecimal digits"),
    "KF": (r"-?\d{1,5}", "-32768 to 32767"),
    "KM": (r"[01]{1,16}", "1 to 16 zeros and ones"),
    "KY": (r"\d{1,3},\d{1,3}", "two numbers of 0 to 255, such as 1,2"),
    "KT": (r"\d{1,3}\.[0-3]", f"0 to {MOST} and .0 to .3, such as 050.1 for five seconds"),
    "KZ": (r"\d{1,3}", f"0 to {MOST}"),
}


def _constant(line: int, source: str, area: str, operand: str) -> int:
    pattern, allowed = _CONSTANTS[area]
    if area in ("KT", "KZ") and re.fullmatch(r"H[0-9A-F]{4}", operand):  # hexadecimal digits that are not decimal
        return int(operand[1:], 16)
    if re.fullmatch(pattern, operand):
        match area:
            case "KH":
                return int(operand, 16)
            case "KM":
                return int(operand, 2)
            case "KZ":
                return bcd(int(operand))
            case "KT":
                number, base = operand.split(".")
                return int(base) << 12 | bcd(int(number))
            case "KF":
                if -0x8000 <= int(operand) <= 0x7FFF:
                    return int(operand) & 0xFFFF
            case _:
                high, low = (int(part) for part in operand.split(","))
                if max(high, low) <= 255:
                    return high << 8 | low
    raise AssemblyError(line, f"{source!r}: {operand!r}; allowed: {allowed}")


def disassemble(program: PlcProgram) -> str:
    """The text of a program: assembled again it gives the same bytes."""
    return "".join(f"{line}\n" for block in program.blocks for line in _listing(block))


def explain(program: PlcProgram) -> Sequence[tuple[str, str]]:
    """The lines of `disassemble`, each with a short explanation."""
    rows: list[tuple[str, str]] = []
    for block in program.blocks:
        head, *lines = _listing(block)
        said = [i.words_explained for i in instructions_by_word(block) if i is not None]
        rows.append((head, f"{_BLOCK_WORDS[block.kind]} block"))
        for line, text in zip(lines, said, strict=True):
            jump = re.search(r"=(L\d+)$", line)
            rows.append((line, re.sub(r"by -?\d+ words", f"to {jump[1]}", text) if jump else text))
    return rows


def _listing(block: PlcBlock) -> Iterator[str]:
    """The lines of a block; raises ImageError for words that are no instruction."""
    instructions = instructions_by_word(block)
    seconds = {word + 1 for word, i in enumerate(instructions) if i is not None and i.words == 2}
    targets = {word + i.number for word, i in enumerate(instructions) if i is not None and i.form.operand == "jump"}
    yield block.name
    for word, instruction in enumerate(instructions):
        if word in seconds:
            if word in targets:
                raise ImageError(f"{block.name}: a jump into the constant at word {word}")
            continue
        if instruction is None:
            code = block.code[2 * word : 2 * word + 2].hex(" ").upper()
            raise ImageError(f"{block.name}: {code} at word {word} is no instruction")
        if instruction.form.operand == "jump" and not 0 <= word + instruction.number < len(instructions):
            raise ImageError(f"{block.name}: a jump out of the block at word {word}")
        label = f"L{word}: " if word in targets else ""
        yield label + _written(instruction, word)


def _written(instruction: Instruction, word: int) -> str:
    form, number = instruction.form, instruction.number
    match form.operand:
        case "":
            return form.mnemonic
        case "bit":
            operand = f"{form.area} {number}.{instruction.bit}"
        case "jump":
            operand = f"=L{word + number}"
        case "constant":
            operand = f"{form.area} {_constant_text(form.area, number)}"
        case _:
            operand = f"{form.area} {number}".strip()
    return f"{form.mnemonic} {operand}"


def _constant_text(area: str, word: int) -> str:
    number = from_bcd(word)
    match area:
        case "KF":
            return str(word - 0x10000 if word & 0x8000 else word)
        case "KM":
            return f"{word:016b}"
        case "KY":
            return f"{word >> 8},{word & 0xFF}"
        case "KT" if number is not None and word >> 14 == 0:
            return f"{number:03d}.{word >> 12}"
        case "KZ" if number is not None and word >> 12 == 0:
            return f"{number:03d}"
    return f"{word:04X}" if area == "KH" else f"H{word:04X}"
