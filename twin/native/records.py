"""Write records.h, structs and numbers that C shares with Python: `python -m isel_twin.native.records`."""

from __future__ import annotations

import importlib
from pathlib import Path

from isel_twin.native.library import POINTED, RECORDS, layout

MODULES = (  # these import all others
    "isel_twin.capture.table", "isel_twin.envs.tracking", "isel_twin.firmware.gmi99.planner",
    "isel_twin.motion.look_ahead", "isel_twin.motion.time_law", "isel_twin.plant.built", "isel_twin.plant.following",
)  # fmt: skip
# numbers that C has by the same name
NUMBERS = {
    "isel_twin.base.units": ("SECOND_NS",),
    "isel_twin.capture.table": ("IS_TIME", "NO_BIT", "SHORT_ROW", "TOO_LATE", "NO_COUNT"),
    "isel_twin.capture.vcd": ("ALL", "LOST", "FOUND", "NO_TIME", "EARLIER", "NO_VALUE", "NO_SIGNAL", "NO_END"),
    "isel_twin.capture.wave": ("LONGEST_NS",),
    "isel_twin.core.seen": ("SLOW_RAD_S",),
    "isel_twin.drives.dynamics": ("OPEN", "PHASE_A", "PHASE_B", "BOTH"),
    "isel_twin.drives.servo": ("LAG_FAULT", "VOLTAGE_FAULT"),
    "isel_twin.drives.servo_drive": ("I2T_BACK",),
    "isel_twin.drives.shaft": ("STEPPER", "SERVO"),
    "isel_twin.drives.stability": ("STATES",),
    "isel_twin.envs.tracking": ("DONE", "OUTSIDE", "STEPS_LOST", "IDLE", "PREVIEW_MM", "SIZE"),
    "isel_twin.firmware.gmi99.planner": ("STRAIGHT", "RIGHT_ANGLE_DEG"),
    "isel_twin.motion.look_ahead": ("FARTHEST", "FRACTIONS"),
    "isel_twin.plant.margin": ("SPEED_STEP_RAD_S", "SPEEDS"),
    "isel_twin.plant.memory": (
        "AXES", "SAMPLES", "FAR_M", "NEVER", "KEPT", "SAME", "APART", "FRESH", "PARTED_MM", "POSITION", "LAG", "TOUCH",
    ),
    "isel_twin.plant.touch": ("BOX", "RING", "PLANE", "NEWS"),
    "isel_twin.recordings.vcd": ("PULSE_NS", "SETUP_NS"),
}  # fmt: skip
WIDE = "AXIS_PARAMETERS", "AXIS_STATE", "AXIS"  # records that the law of drives has side by side (lanes.h)
HEADER = Path(__file__).parent / "records.h"
_TYPES = {"f8": "double", "i8": "int64_t", "i4": "int32_t"}


def text() -> str:
    """The text of records.h: for each record its struct, its layout for Python and what holds for it in C."""
    for module in MODULES:
        importlib.import_module(module)
    named = {
        name: getattr(importlib.import_module(module), name) for module, names in NUMBERS.items() for name in names
    }
    if len(named) < sum(len(names) for names in NUMBERS.values()):
        raise ValueError("NUMBERS: two have one name")
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
    HEADER.write_text(text(), "utf-8")
