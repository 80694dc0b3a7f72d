"""What the control keeps over a power cut: programs and parameters, as one image with a checksum."""

from __future__ import annotations

import json
import zlib
from typing import Final

from isel_twin.firmware.bwo900.contour import Contour
from isel_twin.firmware.bwo900.functions import FACTORY_FUNCTIONS
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.offset import Offset
from isel_twin.firmware.bwo900.overrides import FACTORY_OVERRIDES
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs import Program, Store

__all__ = ["filters", "image", "read"]

MAGIC: Final = b"BWO1"


def image(parameters: Parameters, store: Store) -> bytes:
    """The image of both: a head in JSON, and the texts of the programs behind it."""
    programs = [store[name] for name in sorted(store)]
    head = {
        "q": [list(item) for item in parameters.items()],
        "status": [list(item) for item in parameters.statuses()],
        "programs": [[program.name, len(program.text)] for program in programs],
    }
    packer = zlib.compressobj(1)
    data = packer.compress(json.dumps(head, separators=(",", ":")).encode() + b"\n")
    data += b"".join(packer.compress(program.text) for program in programs) + packer.flush()
    return MAGIC + zlib.crc32(data).to_bytes(4, "little") + data


def read(flash: bytes | None) -> tuple[Parameters, Store, bool]:
    """Parameters and programs of an image, and whether it could not be read; a new control has the factory's."""
    if flash is not None:
        try:
            return *_unpacked(flash), False
        except (ValueError, KeyError, TypeError, zlib.error, ProgramError):
            pass
    parameters = Parameters()
    for number, value in (FACTORY_FUNCTIONS | FACTORY_OVERRIDES).items():
        parameters.write(number, value)
    return parameters, Store(), flash is not None


def _unpacked(flash: bytes) -> tuple[Parameters, Store]:
    data = flash[8:]
    if flash[:4] != MAGIC or int.from_bytes(flash[4:8], "little") != zlib.crc32(data):
        raise ValueError("checksum")
    first, _, texts = zlib.decompress(data).partition(b"\n")
    head = json.loads(first)
    parameters = Parameters({int(q): float(value) for q, value in head["q"]})
    for q, status in head["status"]:
        parameters.set_status(int(q), int(status), "q")
    store, at = Store(), 0
    for name, size in head["programs"]:
        lines = texts[at : at + size].decode("latin-1").split("\n")[:-1]
        store[name] = Program.of(name, lines)
        at += size
    return parameters, store


def filters(parameters: Parameters) -> list[Contour | Offset]:
    """What blocks pass on their way from the interpreter to the path."""
    threshold = parameters.get(8_845) if parameters.loaded(8_845) else None
    return [Contour(), Offset(threshold)]
