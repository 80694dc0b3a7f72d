"""Write records.h, structs and numbers that C shares with Python: `python -m isel_twin.native.records`."""

from __future__ import annotations

import importlib
from pathlib import Path

from isel_twin.native.library import POINTED, RECORDS, layout

MODULES = (  # these import all others
    "isel_twin.firmware.gmi99.planner",
    "isel_twin.motion.look_ahead",
    "isel_twin.motion.time_law",
    "isel_twin.plant.following",
    "isel_twin.plant.memory",
    "isel_twin.envs.tracking",
    "isel_twin.envs.track_vector",
)
# numbers that C has by the same name
NUMBERS = {
    "isel_twin.base.units": ("SECOND_NS",),
    "isel_twin.firmware.gmi99.planner": ("STRAIGHT", "RIGHT_ANGLE_DEG"),
    "isel_twin.motion.look_ahead": ("FARTHEST", "FRACTIONS"),
    "isel_twin.plant.memory": ("AXES", "KEPT", "SAME"),
}
HEADER = Path(__file__).parent / "records.h"
_TYPES = {"f8": "double", "i8": "int64_t", "i4": "int32_t"}


def text() -> str:
    """The text of records.h: for each record its struct, its layout for Python and what holds for it in C."""
    for module in MODULES:
        importlib.import_module(module)
    named = {
        name: getattr(importlib.import_module(module), name) for module, names in NUMBERS.items() for name in names
    }
    order = [name for name in RECORDS if not POINTED[name]] + [name for name in RECORDS if POINTED[name]]
    parts = [
        "/* Written by `python -m isel_twin.native.records` from the records and numbers in Python. */\n"
        "#pragma once\n#include <stddef.h>\n"
    ]
    parts.append("".join(f"#define {name} {number!r}\n" for name, number in named.items()))
    for name in order:
        dtype, pointed, fields, asserts = RECORDS[name], POINTED[name], [], []
        for field, (kind, at, *_) in (dtype.fields or {}).items():
            base, shape = (kind.base, kind.shape) if kind.subdtype is not None else (kind, ())
            of = f"{pointed[field]} *" if field in pointed else _TYPES[base.str[1:]] + " "
            fields.append(f"    {of}{field}{''.join(f'[{n}]' for n in shape)};\n")
            asserts.append(f'_Static_assert(offsetof({name}, {field}) == {at}, "{field}");\n')
        parts.append(f"typedef struct {{\n{''.join(fields)}}} {name};\n{''.join(asserts)}")
        parts.append(f'_Static_assert(sizeof({name}) == {dtype.itemsize}, "{name}");\n')
        parts.append(f'TEXT layout_{name} = "{layout(dtype)}";\n')
    return "\n".join(parts)


if __name__ == "__main__":
    HEADER.write_text(text(), "utf-8")
