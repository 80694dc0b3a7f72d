"""Writes an FMU. Needs the extra `fmu` (pythonfmu3), which brings the compiled wrapper; no compiler is needed."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Literal

from isel_twin.base.files import atomic_write

Interface = Literal["serial", "steps"]

# what the wrapper looks for: one class of pythonfmu3 in one file
_SCRIPT = '''"""A twin of isel-twin, which must be installed in the Python of the importing process."""

from pythonfmu3 import Fmi3Slave
from isel_twin.bridge.fmu.slaves import {base}


class {name}({base}, Fmi3Slave):
    """The model in isel-twin."""
'''
_MODELS = {"serial": ("SerialTwin", "IselTwinSerial"), "steps": ("StepsTwin", "IselTwinSteps")}


def build(path: Path, interface: Interface) -> None:
    """Write the FMU of an interface. Raises ImportError without pythonfmu3, OSError."""
    from pythonfmu3.builder import FmuBuilder

    base, name = _MODELS[interface]
    with tempfile.TemporaryDirectory(prefix="isel-twin-") as folder:
        script = Path(folder) / f"isel_twin_{interface}.py"
        atomic_write(script, _SCRIPT.format(base=base, name=name).encode())
        able = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUState", "canSerializeFMUState")
        made = FmuBuilder.build_FMU(script, folder, **dict.fromkeys(able, True))
        atomic_write(path, Path(made).read_bytes())
