"""What the control keeps over a power cut: programs and parameters, as one image with a checksum."""

from __future__ import annotations

import json
import zlib
from typing import Final

from isel_twin.firmware.bwo900.contour import Contour
from isel_twin.firmware.bwo900.functions import FACTORY_FUNCTIONS
from isel_twin.firmware.bwo900.offset import Offset
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs import Program, Store

__all__ = ["filters", "image", "read"]

MAGIC: Final = b"BWO1"


def image(parameters: Parameters, store: Store) -> bytes:
    """The image of both."""
    content = {
        "q": [list(item) for item in parameters.items()],
        "status": [list(item) for item in parameters.statuses()],
        "programs": {name: list(program.blocks) for name, program in sorted(store.items())},
    }
    data = zlib.compress(json.dumps(content, separators=(",", ":")).encode(), 1)
    return MAGIC + zlib.crc32(data).to_bytes(4, "little") + data


def read(flash: bytes | None) -> tuple[Parameters, Store, bool]:
    """Parameters and programs of an image, and whether it could not be read; a new control has the factory's."""
    if flash is not None:
        try:
            data = flash[8:]
            if flash[:4] != MAGIC or int.from_bytes(flash[4:8], "little") != zlib.crc32(data):
                raise ValueError("checksum")
            content = json.loads(zlib.decompress(data))
            parameters = Parameters({int(q): float(value) for q, value in content["q"]})
            for q, status in content["status"]:
                parameters.set_status(int(q), int(status), "q")
            store = Store({name: Program.of(name, blocks) for name, blocks in content["programs"].items()})
            return parameters, store, False
        except (ValueError, KeyError, TypeError, zlib.error):
            pass
    parameters = Parameters()
    for number, value in FACTORY_FUNCTIONS.items():
        parameters.write(number, value)
    return parameters, Store(), flash is not None


def filters(parameters: Parameters) -> list[Contour | Offset]:
    """What blocks pass on their way from the interpreter to the path."""
    threshold = parameters.get(8_845) if parameters.loaded(8_845) else None
    return [Contour(), Offset(threshold)]
