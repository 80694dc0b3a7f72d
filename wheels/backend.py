"""The package's build backend: setuptools, and the compiled core for one platform put into the wheel.

    pip wheel .                                        for this machine, by its compiler
    pip wheel . -C target=aarch64-linux-gnu.2.17       for another one of compiling.TARGETS, by ziglang

ziglang is fetched only where it is needed: for another machine, or where no compiler works.
"""

from __future__ import annotations

import base64
import copy
import hashlib
import platform
import sysconfig
import tempfile
from pathlib import Path
from zipfile import ZipFile

import compiling
from compiling import TARGETS
from setuptools import build_meta
from setuptools.build_meta import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

COMPILER = "ziglang>=0.13,<0.18"
Settings = dict[str, str] | None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    here = not _target(config_settings) and compiling.usable()
    return [*build_meta.get_requires_for_build_wheel(config_settings), *([] if here else [COMPILER])]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    return get_requires_for_build_wheel(None)


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    target = _target(config_settings)
    pure = Path(wheel_directory, build_meta.build_wheel(wheel_directory, config_settings, metadata_directory))
    tag = TARGETS[target] if target else _own_tag()
    made = pure.with_name(pure.name.replace("-none-any.whl", f"-none-{tag}.whl"))
    with tempfile.TemporaryDirectory() as folder:
        library = compiling.build(Path(folder) / f"core{compiling.suffix(target)}", target=target)
        _add(library, pure, made, tag)
    pure.unlink()
    return made.name


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    compiling.build()
    return build_meta.build_editable(wheel_directory, config_settings, metadata_directory)


def _target(config_settings: Settings) -> str:
    target = (config_settings or {}).get("target", "")
    if target and target not in TARGETS:
        raise SystemExit(f"target={target}: is none of {', '.join(TARGETS)}")
    return target


def _own_tag() -> str:
    """The platform that a library compiled by the system's compiler is for."""
    if platform.system() == "Darwin":
        major, minor = (*platform.mac_ver()[0].split("."), "0")[:2]
        return f"macosx_{major}_{minor if major == '10' else 0}_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _add(library: Path, pure: Path, made: Path, tag: str) -> None:
    """Write a pure wheel anew with the library in it, and the tag of its platform."""
    with ZipFile(pure) as old, ZipFile(made, "w") as new:
        members = {info.filename: (info, old.read(info)) for info in old.infolist()}
        record = next(name for name in members if name.endswith(".dist-info/RECORD"))
        about = record.replace("RECORD", "WHEEL")
        info, text = members[about]
        text = text.replace(b"Root-Is-Purelib: true", b"Root-Is-Purelib: false")
        members[about] = info, text.replace(b"-none-any", f"-none-{tag}".encode())
        entry, last = copy.copy(info), members.pop(record)[0]
        entry.filename = f"isel_twin/native/{library.name}"
        members[entry.filename] = entry, library.read_bytes()
        lines = [f"{name},sha256={_digest(data)},{len(data)}\n" for name, (_, data) in members.items()]
        members[record] = last, "".join([*lines, f"{record},,\n"]).encode()
        for info, data in members.values():
            new.writestr(info, data)


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
