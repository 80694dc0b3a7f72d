"""Write records.h, structs and numbers that C shares with Python: `python -m isel_twin.native.records`."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from isel_twin.base.files import atomic_write
from isel_twin.native.library import POINTED, RECORDS, layout

ROOMS = {"isel_twin": Path(__file__).parents[1], "isel_twin.envs": Path(__file__).parents[2] / "envs"}
WIDE = "AXIS_PARAMETERS", "AXIS_STATE", "AXIS"  # records that the law of drives has side by side (lanes.h)
HEADER = Path(__file__).parent / "records.h"
_TYPES = {"f8": "double", "i8": "int64_t", "i4": "int32_t"}


def _modules() -> Iterator[ModuleType]:
    """All modules with records or numbers `IN_C`."""
    for package, folder in ROOMS.items():
        for path in sorted(folder.rglob("*.py")):
            source = path.read_text("utf-8")
            if path.parent != HEADER.parent and ("= record(" in source or "\nIN_C = " in source):
                yield importlib.import_module(".".join((package, *path.relative_to(folder).with_suffix("").parts)))


def text() -> str:
    """The text of records.h: for each record its struct, its layout for Python and what holds for it in C."""
    named: dict[str, Any] = {}
    for module in _modules():
        for name in getattr(module, "IN_C", ()):
            if name in named:
                raise ValueError(f"{module.__name__}: {name}: another module has a number of that name IN_C")
            named[name] = getattr(module, name)
    order = sorted(RECORDS, key=lambda name: (bool(POINTED[name]), name))  # whatever was imported first
    parts = [
        "/* Written by `python -m isel_twin.native.records` from the records and numbers in Python. */\n"
        "#pragma once\n#include <stddef.h>\n\n"
    ]
    for name, number in named.items():
        parts[0] += f"#define {name} {repr(number).translate({40: '{', 41: '}'})}\n"  # a tuple is a list in C
    for name in order:
        dtype, pointed, fields, asserts = RECORDS[name], POINTED[name], [], []
        for field, (kind, at, *_) in (dtype.fields or {}).items():
            base, shape = (kind.base, kind.shape) if kind.subdtype is not None else (kind, ())
            of = f"{pointed[field]} *" if field in pointed else _TYPES[base.str[1:]] + " "
            fields.append(f"    {of}{field}{''.join(f'[{n}]' for n in shape)};\n")
            asserts.append(f'_Static_assert(offsetof({name}, {field}) == {at}, "{field}");\n')
        parts.append(f"typedef struct {{\n{''.join(fields)}}} {name};\n{''.join(asserts)}")
        parts.append(f'_Static_assert(sizeof({name}) == {dtype.itemsize}, "{name}");\n')
        if name in WIDE:
            each = "".join(
                f" \\\n    FIELD_{_TYPES[kind.str[1:]]}({field})" for field, (kind, *_) in (dtype.fields or {}).items()
            )
            parts.append(f"#define {name}_FIELDS{each}\n")
        parts.append(f'TEXT layout_{name} = "{layout(dtype)}";\n')
    return "\n".join(parts)


if __name__ == "__main__":
    atomic_write(HEADER, text().encode())
