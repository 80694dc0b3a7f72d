"""The control's non-volatile memory: programs and parameters, as one image with a checksum.

    | BWO2 | checksum | program | program | ... | head | size of the head |
                        each compressed by itself       parameters, names and sizes, as JSON, compressed

Every key of the operator writes an image. Programs may be 100 MB and change only when a file comes, so their compressed
form and checksum are cached; a key costs the head and one copy of the rest.
"""

from __future__ import annotations

import json
import zlib
from typing import Any, Final

from isel_twin.base.parameters import parse_json
from isel_twin.firmware.bwo900.analysis.functions import FACTORY_FUNCTIONS
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram
from isel_twin.firmware.bwo900.realtime.overrides import FACTORY_OVERRIDES

MAGIC: Final = b"BWO2"
FIRST: Final = 8  # bytes before the programs
SIZE: Final = 4  # bytes of a checksum, and of the size of the head
MOST_TIMES: Final = 300  # longer than its compressed form is no text: equal lines are 230 times


class Memory:
    def __init__(self, parameters: Parameters, store: Store) -> None:
        self._parameters, self._store = parameters, store
        self._forget()

    def _forget(self) -> None:
        self._packed: dict[StoredProgram, bytes] = {}
        """Programs of the last image, compressed; a program is replaced, never changed."""
        self._checksum = zlib.crc32(b"")  # of all programs in order

    def image(self) -> bytes:
        programs = [self._store[name] for name in sorted(self._store)]
        if list(self._packed) != programs:
            self._packed = {p: self._packed.get(p) or zlib.compress(p.text, 1) for p in programs}
            self._checksum = zlib.crc32(b"")
            for part in self._packed.values():
                self._checksum = zlib.crc32(part, self._checksum)
        head = {
            "q": [list(item) for item in self._parameters.items()],
            "status": [list(item) for item in self._parameters.statuses()],
            "programs": [[program.name, len(part)] for program, part in self._packed.items()],
        }
        packed = zlib.compress(json.dumps(head, separators=(",", ":")).encode(), 1)
        end = packed + len(packed).to_bytes(SIZE, "little")
        checksum = zlib.crc32(end, self._checksum).to_bytes(SIZE, "little")
        return b"".join((MAGIC, checksum, *self._packed.values(), end))

    def __getstate__(self) -> dict[str, Any]:
        """Without the caches."""
        return {"_parameters": self._parameters, "_store": self._store}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._forget()


def read(flash: bytes | None) -> tuple[Parameters, Store, bool]:
    """Parameters and programs of an image, or those of a new control; True if the image could not be read."""
    if flash is not None:
        try:
            return *_unpacked(flash), False
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, zlib.error, ProgramError):
            pass
    parameters = Parameters()
    for number, value in {**FACTORY_FUNCTIONS, **FACTORY_OVERRIDES}.items():
        parameters.write(number, value)
    return parameters, Store(), flash is not None


def _unpacked(flash: bytes) -> tuple[Parameters, Store]:
    view = memoryview(flash)
    if flash[:4] != MAGIC or int.from_bytes(flash[4:FIRST], "little") != zlib.crc32(view[FIRST:]):
        raise ValueError("checksum")
    behind = len(flash) - SIZE
    head = parse_json(_inflated(view[behind - int.from_bytes(flash[behind:], "little") : behind]))
    parameters = Parameters({})
    for q, value in head["q"]:
        parameters.write(int(q), float(value), "q")
    for q, status in head["status"]:
        parameters.set_status(int(q), int(status), "q")
    store, at = Store(), FIRST
    for name, size in head["programs"]:
        store[name] = StoredProgram.of(name, _inflated(view[at : at + size]).decode("latin-1").split("\n")[:-1])
        at += size
    return parameters, store


def _inflated(packed: memoryview) -> bytes:
    """Raises ValueError for more than a program is, or less than all of it."""
    inflater = zlib.decompressobj()
    text = inflater.decompress(packed, max(MOST_TIMES * len(packed), 1))
    if not inflater.eof:
        raise ValueError("not compressed here")
    return text
