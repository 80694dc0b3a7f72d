"""Compile the core: `python twin/native/compiling.py`, by the compiler of the system or by ziglang.

Stands alone: the build of a package runs it before anything is installed. core.c includes all other C. Generated here
is exports.h: the texts of all prototypes marked `API`, and a digest of the sources by which a checkout notices that its
library is stale.

No fused multiply-add and no other liberty of a compiler is allowed: the same bits on every machine.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).resolve().parent
TREE = HERE.parent.parent  # of a checkout or source archive
FLAGS = (
    "-std=gnu11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-fPIC", "-shared",
    "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror=vla",
)  # fmt: skip
X86_64 = ("-march=x86-64-v2", "-mno-fma")
SUFFIX = {"Windows": ".dll", "Darwin": ".dylib"}.get(platform.system(), ".so")
REMEDY = "build it: `python -m isel_twin.native.compiling`, or install isel-twin anew"
_PROTOTYPE = re.compile(r"^API ((?:int64_t|double|void) \w+\((?:[^(){;]|\([^()]*\))*\)) *\{", re.MULTILINE)


class BuildError(RuntimeError):
    """There is no compiler, or it refuses the source; the message says what to do."""


def sources() -> list[Path]:
    """All C files of a checkout; none in an installed package."""
    if not (HERE / "core.c").exists() or not (TREE / "pyproject.toml").exists():
        return []
    folders = TREE / "twin", TREE / "envs"
    return sorted(path for folder in folders for path in folder.rglob("*.[ch]") if path.name != "exports.h")


def digest(files: list[Path]) -> str:
    """A digest of these files, by which a library tells of which source it is."""
    found = hashlib.sha256()
    for path in files:
        found.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def exports(files: list[Path]) -> str:
    """The text of exports.h."""
    prototypes = [" ".join(match.split()) for path in files for match in _PROTOTYPE.findall(path.read_text("utf-8"))]
    lines = "".join(f'    "{prototype}\\n"\n' for prototype in prototypes)
    return f'TEXT core_prototypes =\n{lines};\nTEXT core_source = "core_source={digest(files)}";\n'


def compilers() -> list[list[str]]:
    """Commands of compilers, best first: CC, those of the system, ziglang."""
    if os.environ.get("CC"):
        return [os.environ["CC"].split()]
    found = [[path] for name in ("cc", "gcc", "clang") if (path := shutil.which(name))]
    if find_spec("ziglang") is not None:
        found.append([sys.executable, "-m", "ziglang", "cc"])
    return found


def build(target: Path | None = None, compiler: list[str] | None = None, extra: tuple[str, ...] = ()) -> Path:
    """Compile the library, by default beside this file. extra: further flags. Raises BuildError with one line."""
    files, target = sources(), target or HERE / f"core{SUFFIX}"
    if not files:
        raise BuildError(f"{HERE}: has no C sources; install isel-twin anew")
    commands = [compiler] if compiler else compilers()
    if not commands:
        raise BuildError("no C compiler is here; `pip install ziglang` brings one, or install gcc or clang")
    machine = X86_64 if platform.machine().lower() in ("x86_64", "amd64") else ()
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".core-") as folder:
        (Path(folder) / "exports.h").write_text(exports(files), "utf-8")
        made = Path(folder) / target.name
        for command in commands:
            zig = "ziglang" in command
            arch = [flag.replace("x86-64-v2", "x86_64_v2") if zig else flag for flag in machine]
            line = [*command, *FLAGS, *arch, *extra, f"-I{folder}", str(HERE / "core.c"), "-o", str(made), "-lm"]
            done = subprocess.run(line, capture_output=True, text=True)
            if done.returncode == 0:
                os.replace(made, target)
                return target
    raise BuildError(f"{' '.join(command)}: {done.stderr.strip()[-2000:]}")


def library() -> Path:
    """The library beside this file; in a checkout whose C has changed it is built anew. ISEL_TWIN_CORE names another
    one, as it is: one with sanitizers, for example. Raises BuildError."""
    if other := os.environ.get("ISEL_TWIN_CORE"):
        return Path(other)
    path, files = HERE / f"core{SUFFIX}", sources()
    if files and (not path.exists() or f"core_source={digest(files)}".encode() not in path.read_bytes()):
        return build(path)
    if not path.exists():
        raise BuildError(f"{path}: is missing; install isel-twin anew")
    return path


if __name__ == "__main__":
    try:
        print(build())
    except BuildError as error:
        sys.exit(f"error: {error}")
