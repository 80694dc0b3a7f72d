"""Compile the core: `python twin/native/compiling.py`, by the compiler of the system or by ziglang.

Stands alone: the build of a package (wheels/backend.py) runs it before anything is installed. core.c includes all other
C. Generated here is exports.h: the texts of all prototypes marked `API`, and a digest of the sources, by which a
checkout notices that its library is stale.

No fused multiply-add and no other liberty of a compiler is allowed: the same bits on every machine.
"""

from __future__ import annotations

import argparse
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
FLAGS = (
    "-std=gnu11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-fPIC", "-shared",
    "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror=vla",
)  # fmt: skip
X86_64 = ("-march=x86-64-v2", "-mno-fma")
TARGETS = {  # other machines, as ziglang names them: the tag of a wheel
    "x86_64-linux-gnu.2.17": "manylinux_2_17_x86_64",
    "aarch64-linux-gnu.2.17": "manylinux_2_17_aarch64",
    "x86_64-macos.11.0": "macosx_11_0_x86_64",
    "aarch64-macos.11.0": "macosx_11_0_arm64",
    "x86_64-windows-gnu": "win_amd64",
}
REMEDY = "build it: `python -m isel_twin.native.compiling`, or install isel-twin anew"
CHOSEN = "ISEL_TWIN_CORE"  # variable with the path of another library
_PROTOTYPE = re.compile(r"^API ((?:int64_t|double|void) \w+\((?:[^(){;]|\([^()]*\))*\)) *\{", re.MULTILINE)
_CONSTANT = re.compile(r"(?<=, )[A-Z]+(?=[,)])")  # among the lengths of an array: C knows the number
_INCLUDE = re.compile(rb'^#include "([^"]+)"', re.MULTILINE)
_TRIED = "#include <math.h>\n#include <string.h>\ndouble core_tried(double x) { return sin(x); }\n"


class BuildError(RuntimeError):
    """There is no compiler, or it refuses the source; the message says what to do."""


def sources(source: Path | None = None) -> list[Path]:
    """A C file, by default core.c, and all that it includes; none in an installed package."""
    found: dict[Path, None] = {}
    ahead = [source or HERE / "core.c"]
    while ahead:
        path = ahead.pop()
        if path not in found and path.is_file():
            found[path] = None
            names = _INCLUDE.findall(path.read_bytes())
            ahead += [Path(os.path.normpath(path.parent / name.decode())) for name in names]
    return sorted(found)


def digest(files: list[Path]) -> str:
    """A digest of these files and of the flags, by which a library tells of which source it is."""
    found = hashlib.sha256(repr((FLAGS, X86_64)).encode())
    for path in files:
        found.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def exports(files: list[Path]) -> str:
    """The text of exports.h for a library of these files."""
    lines = ""
    for path in files:
        for match in _PROTOTYPE.findall(path.read_text("utf-8")):
            prototype = _CONSTANT.sub(r'" SPELLED(\g<0>) "', " ".join(match.split()))
            lines += f'    "{prototype}\\n"\n'
    return f'TEXT core_prototypes =\n{lines};\nTEXT core_source = "core_source={digest(files)}";\n'


def suffix(target: str = "") -> str:
    """Of the library's name on a platform, by default on this one."""
    system = target or platform.system().lower()
    return ".dll" if "windows" in system else ".dylib" if "macos" in system or "darwin" in system else ".so"


def compilers() -> list[list[str]]:
    """Commands of compilers, best first: CC, those of the system, ziglang."""
    if os.environ.get("CC"):
        return [os.environ["CC"].split()]
    found = [[path] for name in ("cc", "gcc", "clang") if (path := shutil.which(name))]
    if find_spec("ziglang") is not None:
        found.append([sys.executable, "-m", "ziglang", "cc"])
    return found


def usable() -> bool:
    """True if a compiler is named by CC, or one is found that makes a library by these flags."""
    with tempfile.TemporaryDirectory() as folder:
        tried = Path(folder) / "tried.c"
        tried.write_text(_TRIED, "utf-8")
        return bool(os.environ.get("CC")) or any(
            _run([*command, *_flags(command, ""), str(tried), "-o", str(tried.with_suffix(suffix())), "-lm"]) == ""
            for command in compilers()
        )


def build(path: Path | None = None, compiler: list[str] | None = None, extra: tuple[str, ...] = (), *,
          target: str = "", shown: bool = False, source: Path | None = None) -> Path:  # fmt: skip
    """Compile the library, by default beside its source. Raises BuildError with one line.

    extra: further flags; target: the machine it is for, as ziglang names it; shown: let the compiler say what it says;
    source: another C file than core.c.
    """
    files, source = sources(source), source or HERE / "core.c"
    path = path or source.with_suffix(suffix(target))
    if not files:
        raise BuildError(f"{HERE}: has no C sources; install isel-twin anew")
    if target:
        commands = [[sys.executable, "-m", "ziglang", "cc", "-target", target]]
    else:
        commands = [compiler] if compiler else compilers()
    if not commands:
        raise BuildError("no C compiler is here; `pip install ziglang` brings one, or install gcc or clang")
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".core-") as folder:
            (Path(folder) / "exports.h").write_text(exports(files), "utf-8")
            made = Path(folder) / path.name
            for command in commands:
                flags = [*_flags(command, target), *extra, f"-I{folder}"]
                why = _run([*command, *flags, str(source), "-o", str(made), "-lm"], shown)
                if not why:
                    os.replace(made, path)
                    return path
    except OSError as error:
        raise BuildError(f"{path}: cannot be written ({error.strerror}), and the C has changed or is new") from None
    more = "; CC names this compiler: unset it" if os.environ.get("CC") and not compiler else ""
    if not more and find_spec("ziglang") is None:
        more = "; `pip install ziglang` brings another compiler"
    raise BuildError(f"{why}; `python -m isel_twin.native.compiling` says more{more}")


def library(source: Path | None = None) -> Path:
    """The library beside its source; in a checkout whose C has changed it is built anew. ISEL_TWIN_CORE names another
    one for core.c, as it is: one with sanitizers, for example. Raises BuildError."""
    if source is None and (other := os.environ.get(CHOSEN)):
        return Path(other)
    path, files = (source or HERE / "core.c").with_suffix(suffix()), sources(source)
    if files and (not path.exists() or f"core_source={digest(files)}".encode() not in path.read_bytes()):
        return build(path, source=source)
    if not path.exists():
        raise BuildError(f"{path}: is missing; install isel-twin anew")
    return path


def _flags(command: list[str], target: str) -> list[str]:
    zig = any(Path(word).name in ("zig", "ziglang") for word in command)
    machine = target.split("-", 1)[0] or platform.machine().lower()
    x86_64 = X86_64 if machine in ("x86_64", "amd64") else ()
    flags = [*FLAGS, *(flag.replace("x86-64-v2", "x86_64_v2") if zig else flag for flag in x86_64)]
    return [*flags, "-s"] if zig else flags  # without the places of temporary files, which differ each time


def _run(line: list[str], shown: bool = False) -> str:
    """Run a compiler: nothing, or its first line that tells of an error."""
    try:
        told = None if shown else subprocess.PIPE
        done = subprocess.run(line, stdout=subprocess.DEVNULL, stderr=told, text=True, errors="replace")
    except OSError as error:
        return f"{line[0]}: {error.strerror}"
    if done.returncode == 0:
        return ""
    said = (done.stderr or f"exit code {done.returncode}").strip().splitlines()
    return f"{line[0]}: {next((text for text in said if 'error' in text), said[-1] if said else 'fails')}"


def main() -> None:
    parser = argparse.ArgumentParser(description="Compile the core.")
    parser.add_argument("--target", default="", help="another machine, as ziglang names it: aarch64-linux-gnu.2.17")
    parser.add_argument("-o", dest="path", type=Path, help="file that is written, by default this checkout's library")
    call = parser.parse_args()
    if call.target and call.path is None:
        parser.error("--target: needs -o FILE, as this checkout's library is for this machine")
    try:
        print(build(call.path, target=call.target, shown=True))
    except BuildError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
