"""The bits of another processor: `python -m tests.native.emulated [TARGET]`, aarch64-linux-musl by default.

Moving machines with stepper drives, plain, damped and with errors, and with servo drives are advanced by the library
here and by a program of the same C, made by ziglang for the other processor and run by QEMU; every array of the loop is
compared. Exit code 3 without QEMU.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from isel_twin.machine import load_machine, with_overrides
from isel_twin.motion import line, trapezoid
from isel_twin.native import compiling
from isel_twin.plant.mujoco import MujocoPlant
from tests.lockstep import ADDRESSES

SOURCE = Path(__file__).with_suffix(".c")
MACHINES = {
    "steppers": ("4030", {}),
    "damped": ("4030", {"axes.all.stage.kind": "digital"}),
    "stages with errors": ("4030", {"axes.all.stage.step_accuracy": 3.0, "axes.all.stage.current_offset": 2.0}),
    "servos": ("4030-servo", {}),
}
STEPS, MOVE_NS = 4000, 1_000_000_000
START_MM = np.array([100.0, 100.0, 30.0])


def program(target: str, folder: Path) -> Path:
    """The program for a processor."""
    sources = compiling.sources()
    (folder / "exports.h").write_text(compiling.exports(sources), encoding="utf-8")
    made = folder / "emulated"
    flags = [flag for flag in compiling.FLAGS if flag not in ("-shared", "-fPIC")]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *flags, "-static", f"-I{folder}"]
    subprocess.run([*command, str(SOURCE), "-o", str(made), "-lm"], check=True)
    return made


def differing(name: str, command: list[str], folder: Path) -> list[str]:
    """The parts that differ after a move."""
    of, overrides = MACHINES[name]
    plant = MujocoPlant(with_overrides(load_machine(of), overrides), [], START_MM)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(100_000_000, np.empty(0, np.int64), np.empty((0, 4), np.int32))
    law = trapezoid(STEPS, 10_000, 300, 100_000)
    t_ns = 100_000_000 + law.times(0, STEPS)
    delta = line((STEPS, -STEPS // 2, STEPS // 3, 0)).deltas(0, STEPS).astype(np.int32)
    with (folder / "before").open("wb") as file:
        until = np.array([MOVE_NS])
        for array in (*plant.parts, plant.built.memory, t_ns, delta, until):
            file.write(np.int64(array.nbytes).tobytes() + array.tobytes())
    subprocess.run([*command, str(folder / "before"), str(folder / "after")], check=True)
    plant.advance(MOVE_NS, t_ns, delta)
    data, found, at = (folder / "after").read_bytes(), [], 0
    for part, array in zip(plant.parts._fields, plant.parts, strict=True):
        other = np.frombuffer(data, array.dtype, array.size, at).reshape(array.shape).copy()
        at += array.nbytes
        if part == "plant":
            other[[*ADDRESSES]] = array[[*ADDRESSES]]
        if other.tobytes() != array.tobytes():
            found.append(part)
    assert at == len(data)
    assert abs(plant.parts.commanded[0]) == STEPS
    return found


def main(target: str = "aarch64-linux-musl") -> int:
    machine = target.split("-", 1)[0]
    qemu = shutil.which(f"qemu-{machine}-static") or shutil.which(f"qemu-{machine}")
    if qemu is None:
        print(f"qemu-{machine} is not here (Debian: qemu-user-static)", file=sys.stderr)
        return 3
    wrong = False
    with tempfile.TemporaryDirectory() as name:
        made = program(target, Path(name))
        for kind in MACHINES:
            found = differing(kind, [qemu, str(made)], Path(name))
            print(f"{kind}: {'differ: ' + ', '.join(found) if found else 'every array is the same, to the bit'}")
            wrong |= bool(found)
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
