"""What numba has compiled, called without numba: object code beside numba's own cache, linked by llvmlite.

Importing numba and preparing it takes 0.2 s of CPU time, a fifth of a short job, only to load code that is there
already. The object code of a function needs nothing of it:

    arguments -> kinds: dtype and dimensions of an array, int, float -> Entry: its address, called through ctypes

Only on Linux with x86-64, of functions that take arrays in one piece, int and float, return one number or nothing, and
use no memory of their own; all others, and all that is not found, are numba's. A call costs some microseconds more than
numba's own, so that who calls often changes over to it (compiling.py; decision plant/26). A call that ends in an error
is made once more by numba, which raises it: what it had changed is changed twice.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import pickle
import platform
import struct
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

from isel_twin.base.files import atomic_write, sealed, unsealed

Kinds = tuple[Any, ...]  # of the arguments: (dtype, dimensions, writeable), int or float

_NUMBERS = {int: ctypes.c_int64, float: ctypes.c_double}
RETURNED: dict[str, Any] = {
    "int64": ctypes.c_int64,
    "float64": ctypes.c_double,
    "bool": ctypes.c_bool,
    "none": ctypes.c_void_p,
}
_LIKE = {int: int, np.int64: int, float: float, np.float64: float}  # by numba's rules
_LEAST, _MOST = -(2**63), 2**63 - 1

_NOT_NEEDED = 4  # MADV_DONTNEED

# What the entry for Python calls, which nobody takes here; the code itself would for memory of its own, if it had any.
_NEVER_CALLED = {
    "NRT_Free",
    "NRT_MemInfo_call_dtor",
    "NRT_adapt_ndarray_from_python",
    "numba_adapt_ndarray",
    "numba_do_raise",
    "numba_runtime_build_excinfo_struct",
    "numba_unpickle",
}


class Code(NamedTuple):
    """Object code for one combination of kinds, as it is kept."""

    symbol: str
    returned: str
    missing: tuple[str, ...]  # symbols of other libraries
    code: bytes


def usable() -> bool:
    """Whether code is kept and loaded here: not where variables of the environment tell numba how to compile."""
    told = any(name.startswith("NUMBA_") and name != "NUMBA_CACHE_DIR" for name in os.environ)
    return sys.platform == "linux" and platform.machine() == "x86_64" and not told


def kinds_of(arguments: tuple[Any, ...]) -> Kinds | None:
    """The kinds of the arguments of a call; None if one of them is nothing for here."""
    kinds: list[Any] = []
    for value in arguments:
        if isinstance(value, np.ndarray):
            flags = value.flags
            if not (flags.c_contiguous and flags.aligned):
                return None
            kinds.append((value.dtype, value.ndim, flags.writeable))
        else:
            kind = _LIKE.get(type(value))
            if kind is None or (kind is int and not _LEAST <= value <= _MOST):
                return None
            kinds.append(kind)
    return tuple(kinds)


class Entry:
    """A linked function for arguments of these kinds. Its machine code lives as long as it does."""

    def __init__(self, code: Code, kinds: Kinds) -> None:
        self._linker = _linker()
        self._returned = RETURNED[code.returned]
        self._call = ctypes.CFUNCTYPE(ctypes.c_int32, *_words(kinds))(self._linker.link(code))

    def __call__(self, arguments: tuple[Any, ...]) -> tuple[bool, Any]:
        """Whether it has come to its end, and what it returns. Python's lock is free meanwhile."""
        words: list[Any] = []
        for value in arguments:
            if isinstance(value, np.ndarray):
                words += [None, None, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
            else:
                words.append(value)
        result, error = self._returned(), ctypes.c_void_p()
        status = self._call(ctypes.byref(result), ctypes.byref(error), *words)
        return status == 0, result.value


def fits(kinds: Kinds, numba_words: Iterable[str]) -> bool:
    """Whether a function of numba's takes these words, by LLVM's names, for arguments of these kinds."""
    named = {ctypes.c_void_p: "ptr", ctypes.c_int64: "i64", ctypes.c_double: "double"}
    return [named[word] for word in _words(kinds)] == ["ptr" if name.endswith("*") else name for name in numba_words]


def _words(kinds: Kinds) -> list[Any]:
    """Where the result and an error go, then the arguments. An array is two owners, number and size of its elements,
    address, shape and strides."""
    pointer, whole = ctypes.c_void_p, ctypes.c_int64
    words: list[Any] = [pointer, pointer]
    for kind in kinds:
        if kind in _NUMBERS:
            words.append(_NUMBERS[kind])
        else:
            words += [pointer, pointer, whole, whole, pointer, *[whole] * (2 * kind[1])]
    return words


# ---- kept ------------------------------------------------------------------------------------------------------------


class Kept:
    """What is kept of a function that contains code of other files, and fits this computer and their state."""

    def __init__(self, function: Callable[..., Any], files: tuple[str, ...]) -> None:
        kept = _kept(function, files) if usable() else {}
        self._entries = {kinds: Entry(code, kinds) for kinds, code in kept.items()}
        self._met: dict[Kinds, Entry] = {}  # the same with the dtypes of calls, found without comparing fields

    def __call__(self, arguments: tuple[Any, ...]) -> tuple[bool, Any]:
        """Whether it has been carried out, and what it returns."""
        kinds = kinds_of(arguments)
        if kinds is None:
            return False, None
        entry = self._met.get(kinds)
        if entry is None:
            entry = self._entries.get(kinds)
            if entry is None:
                return False, None
            self._met[kinds] = entry
        return entry(arguments)


def keep(function: Callable[..., Any], files: tuple[str, ...], kinds: Kinds, code: Code) -> None:
    """Keep code for these kinds. Raises OSError if there is no folder for it that can be written to."""
    place = _place(function)
    place.parent.mkdir(parents=True, exist_ok=True)
    content = _stamp(function, files), {**_kept(function, files), kinds: code}
    atomic_write(place, sealed(pickle.dumps(content)))


def missing(code: bytes) -> tuple[str, ...] | None:
    """Symbols of other libraries that object code calls (ELF); None if one of them is nowhere to be found."""
    sections = {section.name(): section.data() for section in llvm.ObjectFileRef.from_data(code).sections()}
    names, symbols = sections[b".strtab"], sections[b".symtab"]
    found = set()
    for name, _, _, section, _, _ in struct.iter_unpack("<IBBHQQ", symbols):
        if name and not section:
            found.add(names[name : names.index(b"\0", name)].decode())
    return tuple(sorted(found)) if all(map(_there, found)) else None


def _there(symbol: str) -> bool:
    return symbol in _NEVER_CALLED or (not symbol.startswith("NRT_") and hasattr(ctypes.CDLL(None), symbol))


def _kept(function: Callable[..., Any], files: tuple[str, ...]) -> dict[Kinds, Code]:
    with suppress(Exception):  # no such file, or damaged bytes, which raise anything
        stamp, kept = pickle.loads(unsealed(_place(function).read_bytes()))
        if stamp == _stamp(function, files):
            return {kinds: code for kinds, code in kept.items() if all(map(_there, code.missing))}
    return {}


def _place(function: Callable[..., Any]) -> Path:
    """In NUMBA_CACHE_DIR, beside the source, or in the user's cache: the first that there is to be."""
    source = Path(function.__code__.co_filename).absolute()
    beside = source.parent / "__pycache__"
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        folder = Path(named)
    elif os.access(beside if beside.exists() else source.parent, os.W_OK):
        folder = beside
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "isel-twin"
    whose = hashlib.sha256(str(source).encode()).hexdigest()[:12]
    return folder / f"{source.stem}.{function.__qualname__}-{function.__code__.co_firstlineno}.{whose}.o"


def _stamp(function: Callable[..., Any], files: tuple[str, ...]) -> str:
    return f"{_computer()} {digest((function.__code__.co_filename, *files))}"


@cache
def digest(files: tuple[str, ...]) -> str:
    """Of what is in them."""
    return hashlib.sha256(b"".join(Path(file).read_bytes() for file in files)).hexdigest()


@cache
def _computer() -> str:
    """All that compiled code depends on, beside its source."""
    features = llvm.get_host_cpu_features().flatten()
    return f"numba {metadata.version('numba')} llvm {llvm.llvm_version_info} {llvm.get_host_cpu_name()} {features}"


def give_back() -> None:
    """Let Linux have the memory of LLVM's code again, a quarter of a server's, most of which is read to link or compile
    once: what is needed after all is read anew from its file."""
    if sys.platform != "linux":
        return
    advise = ctypes.CDLL(None).madvise
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, rights, *_, file = line.split(maxsplit=5)
        if rights == "r-xp" and Path(file).name.startswith("libllvmlite"):  # never written to
            first, end = (int(address, 16) for address in span.split("-"))
            advise(ctypes.c_void_p(first), ctypes.c_size_t(end - first), _NOT_NEEDED)


class _Linker:
    """llvmlite's engine, and what it reads in place instead of copying it: the bytes of its object files.

    What must never be called aborts. That is known to this engine alone: numba may be imported at any time, and has
    true functions by these names.
    """

    def __init__(self) -> None:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
        declared = llvm.parse_assembly("\n".join(f"declare void @{symbol}()" for symbol in sorted(_NEVER_CALLED)))
        self._engine = llvm.create_mcjit_compiler(declared, machine)
        self._files: list[bytes] = []
        for function in declared.functions:
            self._engine.add_global_mapping(function, ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value)

    def link(self, code: Code) -> int:
        """Its address."""
        self._files.append(code.code)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code.code))
        self._engine.finalize_object()
        return int(self._engine.get_function_address(code.symbol))


_linker = cache(_Linker)
